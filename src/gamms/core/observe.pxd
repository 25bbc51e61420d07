cimport cython

from gamms.core cimport routes, sight, strategies

ctypedef unsigned char u8
ctypedef int i32
ctypedef long long i64

cdef i64 OWN, OF_ACTION, OF_OTHER, AROUND, ON_MAP


@cython.final
cdef class VisibleAgents:
    cdef sight.AgentSearch search
    cdef bint is_searched
    cdef i64 agents, nobody
    cdef const i64[::1] viewers, node, team, first, nodes
    cdef const u8[::1] alive, mates


@cython.final
cdef class Observers:
    cdef i64 agents
    cdef bint are_by_node
    cdef const i64[::1] games, rows, choice, first_node, first_road, mode_first, turn
    cdef const i32[::1] offsets, targets
    cdef const u8[::1] is_asked
    cdef VisibleAgents seen


@cython.final
cdef class VectorObservations:
    cdef const double[::1] places, own
    cdef bint are_on_nodes
    cdef readonly i64 actions, entries
    cdef i64 others
    cdef float[::1] values
    cdef u8[::1] legal
    cdef i64[::1] counts


@cython.locals(entry=i64, action=i64)
cdef int keep_rows(VectorObservations v, VectorObservations to, i64 first, i64 count) except -1 nogil


@cython.final
cdef class NearestAgents:
    cdef i64 count
    cdef i64[::1] agents, nodes, nearest
    cdef u8[::1] mates
    cdef double[::1] far
    cdef routes.NearbyDistances ways
    cdef public bint searches, lacks


@cython.final
cdef class NodeFeatures:
    cdef i64 most, hops
    cdef const i64[::1] near, far
    cdef const double[::1] places
    cdef float[::1] values


@cython.final
cdef class LearnerTurn:
    cdef i64 games, agents
    cdef bint may_return
    cdef i64[::1] counts, moves
    cdef u8[::1] alive, over, late, was_over, plays, terminated, truncated, may_begin, begun
    cdef double[::1] earned, rewards


@cython.locals(game=i64)
cpdef int begin_turns(LearnerTurn t) except -1
@cython.locals(row=i64)
cdef int begin_turn(LearnerTurn t, i64 game) except -1 nogil
@cython.locals(game=i64)
cpdef int write_masks(LearnerTurn t, u8[::1] legal) except -1
@cython.locals(actions=i64, row=i64, action=i64)
cdef int write_mask(LearnerTurn t, u8[::1] legal, i64 game) except -1 nogil
@cython.locals(first=i64, agent=i64)
cdef int observe_turn(
    LearnerTurn t, Observers o, VectorObservations v, NearestAgents found, i64 game
) except -1 nogil
@cython.locals(number=i64)
cpdef int observe_turns_aside(
    LearnerTurn t,
    Observers o,
    VectorObservations v,
    NearestAgents found,
    const i64[::1] games,
    i64 begin,
    i64 end,
) except -1
@cython.locals(found=i64, game=i64)
cpdef i64 end_turns(LearnerTurn t) except -1
@cython.locals(found=i64, row=i64, is_over=bint, is_late=bint, plays=bint, counts=bint, is_out=bint)
cdef i64 end_turn(LearnerTurn t, i64 game) except -1 nogil


@cython.locals(room=i64, seen=i64[::1], found=i64, place=i64, game=i64, viewer=i64, count=i64, number=i64)
cpdef i64 list_seen(
    sight.AgentSearch s,
    const i64[::1] games,
    const double[::1] own,
    const i64[::1] viewers,
    const u8[::1] is_asked,
    i64[::1] pairs,
) except -1
cdef i64 get_node(Observers o, i64 place, i64 agent) except -1 nogil
@cython.locals(i=i64, row=i64, entry=i64, count=i64, action=i64)
cpdef int observe(Observers o, VectorObservations v, NearestAgents found, i64 game) except -1 nogil
@cython.locals(choice=i64)
cdef i64 count_legal(Observers o, i64 game, i64 agent) except -1 nogil
@cython.locals(row=i64, base=i64, here=i64, choice=i64, own_x=double, own_y=double, at=i64, last=i64, first=i64, count=i64, num_legal=i64, action=i64, node=i64, entry=i64, place=i64, other=i64, roads=i64, is_timed=bint)
cdef i64 _write(Observers o, VectorObservations v, NearestAgents found, i64 game, i64 agent) except -1 nogil
cdef int begin_looks(Observers o, i64 game) except -1 nogil
@cython.locals(row=i64, base=i64, pair=i64, at=i64, viewer=i64, other=i64, place=i64)
cpdef int look(Observers o, NearestAgents found, i64 game, i64 agent) except -1 nogil
@cython.locals(far=double)
cdef double find_road(
    NearestAgents found, routes.NearbyDistances ways, i64 base, i64 node, i64 target
) except? -2.0 nogil
cdef bint is_nearer(NearestAgents found, double far, i64 other, i64 place) except -1 nogil
@cython.locals(count=i64, other=i64, dx=double, dy=double, far=double, place=i64)
cdef i64 _choose_nearest(VectorObservations v, NearestAgents found, double own_x, double own_y) except -1 nogil
@cython.locals(size=i64, i=i64, row=i64, node=i64, entry=i64, other=i64, at=i64)
cpdef int observe_nodes(Observers o, NodeFeatures n, NearestAgents found, i64 game) except -1 nogil
@cython.locals(choice=i64, k=i64, at=i64, place=i64, near=i64, entry=i64, first=i64, action=i64)
cdef int _write_around(Observers o, NodeFeatures n, i64 row, i64 node) except -1 nogil
@cython.locals(other=i64, k=i64, place=i64)
cdef int _count_around(NodeFeatures n, NearestAgents found, i64 row, i64 node) except -1 nogil
@cython.locals(other=i64, choice=i64, at=i64, first=i64, action=i64)
cdef int _write_map(Observers o, NodeFeatures n, i64 row, i64 node) except -1 nogil
@cython.locals(number=i64)
cpdef int observe_aside(Observers o, VectorObservations v, NearestAgents found, const i64[::1] places, i64 begin, i64 end) except -1
@cython.locals(game=i64)
cpdef int observe_nodes_aside(Observers o, NodeFeatures n, NearestAgents found, i64 begin, i64 end) except -1
