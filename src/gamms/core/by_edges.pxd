cimport cython

from gamms.core cimport draws, moves, rules, strategies, travel
from gamms.core.moves cimport LegalMoves, TripMovers
from gamms.core.rules cimport GameColumns
from gamms.core.travel cimport ReachSearch, GoalPaths, LegalNodes, TurnPaths

ctypedef unsigned char u8
ctypedef long long i64

cdef extern from "math.h":
    cpdef double floor(double x) noexcept nogil


cdef class LegalByEdges(LegalNodes):
    cdef LegalMoves streets
    cdef i64 first

    @cython.locals(place=i64, at=i64)
    cdef Py_ssize_t find(self, i64 node, i64 edge, double share, i64 motion, double speed, double now) except -1 nogil


cdef class TrafficStates:
    cdef const i64[::1] nodes, edges, sources, offsets, after, kept, first_of_game, begin_of_agent
    cdef i64[::1] driven, driving
    cdef i64 begin, first


cdef class LegalWithTurns(LegalNodes):
    cdef TrafficStates states

    cdef Py_ssize_t find(self, i64 node, i64 edge, double share, i64 motion, double speed, double now) except -1 nogil


cdef class EdgePaths:
    cdef TurnPaths trips
    cdef LegalByEdges legal
    cdef GoalPaths hops


cdef class EdgeMovers(TripMovers):
    cdef EdgePaths paths
    cdef GoalPaths long_ways
    cdef LegalWithTurns with_turns
    cdef bint goes_far, obey_turns
    cdef const double[::1] speeds

    @cython.locals(i=i64, row=i64, part=i64)
    cdef int decide(self, GameColumns games, i64 game) except -1 nogil
    cdef bint is_moving(self, GameColumns games, i64 game, i64 i) except -1 nogil
    @cython.locals(row=i64)
    cdef int stay(self, GameColumns games, i64 game, i64 i) except -1 nogil
    @cython.locals(part=i64, i=i64)
    cdef int go_all(self, GameColumns games, i64 game) except -1 nogil


@cython.locals(at=i64)
cpdef int begin(EdgePaths walks, i64 row, i64 node, i64 ahead, double covered, double speed) except -1 nogil
@cython.locals(found=bint, place=i64, at=i64)
cdef bint is_next(LegalByEdges legal, i64 node, i64 other) except -1 nogil
@cython.locals(node=i64, ahead=i64)
cpdef Py_ssize_t list_legal(EdgePaths walks, i64 row) except -1 nogil
cdef double count_whole_edges(double budget) except? -1.0 nogil
@cython.locals(number=i64, at=i64, here=i64, place=i64, other=i64)
cdef int list_within(LegalByEdges legal, i64 node, double hops) except -1 nogil
@cython.locals(node=i64, by_hops=bint, first=i64, ahead=i64, onward=double, count=i64)
cpdef bint go_towards(EdgePaths walks, i64 row, GoalPaths ways, i64 memory, i64 target) except -1 nogil
@cython.locals(budget=double, speed=double, edges=i64, first=i64, place=i64, left=double)
cpdef int walk(TurnPaths trips, i64 row, i64 count) except -1 nogil

@cython.locals(state=i64, kept=i64)
cdef Py_ssize_t find_state(TrafficStates s, i64 row, i64 node, i64 previous) except -1 nogil
@cython.locals(at=i64, row=i64)
cpdef int find_places(
    TrafficStates s, const i64[::1] games, const i64[::1] agents, const i64[::1] node, const i64[::1] previous,
    i64[::1] places
) except -1
cdef int use_states(TrafficStates s, i64 game, i64 agent) except -1 nogil
@cython.locals(at=i64, place=i64, after=i64)
cdef Py_ssize_t find_next(TrafficStates s, i64 state, i64 node, i64 edge) except -2 nogil
@cython.locals(at=i64, place=i64)
cdef Py_ssize_t list_with_turns(TrafficStates s, ReachSearch reach, i64 state) except -1 nogil

cdef int use_edges(EdgeMovers w, i64 first) except -1 nogil
cdef int stand(GameColumns games, EdgeMovers w, i64 row, i64 i) except -1 nogil
@cython.locals(row=i64, own=i64, node=i64, target=i64, count=i64)
cdef int choose(GameColumns games, EdgeMovers w, i64 game, i64 i) except -1 nogil
@cython.locals(row=i64, own=i64, node=i64, state=i64, after=i64)
cdef int choose_with_turns(GameColumns games, EdgeMovers w, LegalWithTurns legal, i64 game, i64 i) except -1 nogil
@cython.locals(row=i64, by=u8, count=i64, number=i64)
cdef Py_ssize_t find_chosen_state(
    GameColumns games, EdgeMovers w, LegalWithTurns legal, i64 game, i64 i, i64 state
) except -2 nogil
@cython.locals(row=i64, own=i64, obeys=bint)
cdef int go(GameColumns games, EdgeMovers w, i64 game, i64 i) except -1 nogil
@cython.locals(row=i64, by=u8, target=i64, count=i64)
cdef Py_ssize_t find_target(GameColumns games, EdgeMovers w, i64 game, i64 i) except -2 nogil
