cimport cython

from gamms.core cimport draws, routes, rules, sight, travel
from gamms.core.rules cimport GameColumns

ctypedef unsigned char u8
ctypedef int i32
ctypedef long long i64
ctypedef unsigned long long u64

cdef u8 STAYS, WALKS, GOES, FOLLOWS, WANDERS, CHASES, FLEES, MIXES, SKIPS, PICKS
cdef i64 NOTHING
cdef double INFINITE


cpdef i64 find_next_stop(
    const i64[::1] stops, const i64[::1] following, i64 first, i64 count, i64 at, i64 node
) except? -2 nogil
cpdef i64 count_turns_left(bint is_there, i64 left, double far) noexcept nogil
cpdef bint is_nearer(double far, i64 number, double least, i64 found) noexcept nogil
@cython.locals(found=i64, number=i64)
cpdef i64 find_farthest(const double[::1] distances, const i64[::1] ids, i64 count) except? -2 nogil
cpdef bint is_drawn(double fraction, double chance) noexcept nogil
cpdef bint are_mates(i64 own, i64 other, i64 nobody) noexcept nogil
@cython.locals(pair=i64)
cpdef int mark_mates(
    const i64[::1] teams, i64 nobody, const i64[::1] agents, const i64[::1] others, u8[::1] found
) except -1 nogil


@cython.final
cdef class StrategySteps:
    cdef const i64[::1] begins, first, sizes, numbers, slots, nodes, following
    cdef const double[::1] chances
    cdef const u8[::1] kinds


@cython.final
cdef class Strategies:
    cdef GameColumns games
    cdef StrategySteps steps
    cdef routes.PathTables ways
    cdef sight.AgentSearch search
    cdef const double[::1] shares
    cdef bint has_lookers
    cdef travel.GoalPaths long_ways
    cdef const u64[::1] keys
    cdef const u8[::1] anywhere
    cdef const i32[::1] near_offsets, near_targets
    cdef i64[::1] memory, legal, legal_ids, seen
    cdef double[::1] safety
    cdef i64 count, ahead, drawn
    cdef bint goes_far, has_roads

    cpdef go_far(self, travel.GoalPaths ways)
    cpdef int take_moves(self, const i32[::1] offsets, const i32[::1] targets) except -1 nogil


cdef int begin(Strategies p, i64 game) except -1 nogil
@cython.locals(number=i64)
cdef int take_legal(Strategies p, const i64[::1] nodes, i64 count) except -1 nogil
@cython.locals(node=i64, step=i64, kind=u8, target=i64)
cdef i64 act(Strategies p, i64 game, i64 agent) except? -2 nogil
cdef double _find_distance(Strategies p, i64 game, i64 agent, i64 node, i64 target) except? -1.0 nogil
@cython.locals(has_path=bint)
cdef i64 _step_towards(Strategies p, i64 game, i64 agent, i64 node, i64 target) except? -2 nogil
cdef i64 _draw_number(Strategies p, i64 game, i64 agent, i64 bound) except? -2 nogil
@cython.locals(key=u64)
cdef double _draw_fraction(Strategies p, i64 game, i64 agent) except? -1.0 nogil
cdef i64 _find_index(Strategies p, i64 game, i64 agent, i64 column) except? -2 nogil
@cython.locals(first=i64, place=i64, at=i64)
cdef i64 _stop(Strategies p, i64 game, i64 agent, i64 step, i64 node) except? -2 nogil
@cython.locals(first=i64, found=i64, least=double, number=i64, far=double)
cdef i64 _find_nearest_stop(Strategies p, i64 step, i64 node) except -1 nogil
@cython.locals(place=i64, place_of_left=i64, target=i64, left=i64, far=double)
cdef i64 _choose_waypoint(Strategies p, i64 game, i64 agent, i64 step, i64 node) except? -2 nogil
@cython.locals(first=i64, target=i64, is_near=bint, count=i64, left=i64, number=i64)
cdef i64 _draw_waypoint(Strategies p, i64 game, i64 agent, i64 step, i64 node) except? -2 nogil
@cython.locals(place=i64, at=i64, number=i64, edge=i64)
cdef int _list_reachable(Strategies p, i64 node) except -1 nogil
@cython.locals(count=i64, enemies=i64, place=i64)
cdef i64 _find_enemies(Strategies p, i64 game, i64 agent) except -1 nogil
@cython.locals(found=i64, least=double, at=i64, other=i64, far=double, place=i64)
cdef i64 _find_nearest_enemy(Strategies p, i64 game, i64 agent, i64 node) except? -2 nogil
@cython.locals(at=i64, count=i64, number=i64, place=i64, far=double)
cdef i64 _find_farthest(Strategies p, i64 game, i64 agent) except? -2 nogil
