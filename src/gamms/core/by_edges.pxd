cimport cython

from gamms.core cimport draws, moves, strategies, travel
from gamms.core.moves cimport OneEdgeMovers, LegalMoves
from gamms.core.rules cimport GameColumns, AgentPaths
from gamms.core.travel cimport ReachSearch, GoalPaths, LegalNodes

ctypedef unsigned char u8
ctypedef long long i64

cdef extern from "math.h":
    cpdef double floor(double x) noexcept nogil


cdef class LegalByEdges(LegalNodes):
    cdef LegalMoves streets
    cdef i64 first

    @cython.locals(place=i64, at=i64)
    cdef Py_ssize_t find(self, i64 node, i64 edge, double share, i64 motion, double speed, double now) except -1 nogil


cdef class EdgePaths(AgentPaths):
    cdef LegalByEdges legal
    cdef GoalPaths hops
    cdef i64 most
    cdef const double[::1] speeds
    cdef i64[::1] ahead, route
    cdef double[::1] covered
    cdef AgentPaths kept
    cdef bint keeps

    @cython.locals(agent=i64, row=i64)
    cdef int fill(self, GameColumns games, i64 game) except -1 nogil


cdef class EdgeMovers(OneEdgeMovers):
    cdef EdgePaths paths
    cdef i64[::1] ahead
    cdef double[::1] covered
    cdef GoalPaths long_ways
    cdef bint goes_far

    cdef int take_map(self, i64 first) except -1 nogil
    @cython.locals(i=i64, row=i64, part=i64)
    cdef int decide(self, GameColumns games, i64 game) except -1 nogil
    cdef bint goes(self, GameColumns games, i64 game, i64 i) except -1 nogil
    @cython.locals(row=i64)
    cdef int stay(self, GameColumns games, i64 game, i64 i) except -1 nogil
    @cython.locals(part=i64, i=i64)
    cdef int go_all(self, GameColumns games, i64 game) except -1 nogil
    @cython.locals(row=i64)
    cdef int keep(self, i64 game, i64 i) except -1 nogil
    @cython.locals(row=i64)
    cdef int recall(self, i64 game, i64 i) except -1 nogil


cpdef int begin(EdgePaths walks, i64 i, i64 node, i64 ahead, double covered) except -1 nogil
@cython.locals(found=bint, place=i64, at=i64)
cdef bint is_next(LegalByEdges legal, i64 node, i64 other) except -1 nogil
cpdef Py_ssize_t list_legal(EdgePaths walks, i64 i) except -1 nogil
cdef double whole_edges(double budget) except? -1.0 nogil
@cython.locals(number=i64, at=i64, here=i64, place=i64, other=i64)
cdef int list_within(LegalByEdges legal, i64 node, double hops) except -1 nogil
@cython.locals(node=i64, by_hops=bint, first=i64, ahead=i64, onward=double, count=i64)
cpdef bint go_towards(EdgePaths walks, i64 i, GoalPaths ways, i64 memory, i64 target) except -1 nogil
@cython.locals(budget=double, edges=i64, first=i64, place=i64, left=double)
cpdef int walk(EdgePaths walks, i64 i, i64 count) except -1 nogil

@cython.locals(number=i64)
cdef int copy_walk(AgentPaths steps, i64 row, AgentPaths others, i64 other, i64 most) except -1 nogil

@cython.locals(row=i64, node=i64, target=i64, count=i64)
cdef int choose(GameColumns games, EdgeMovers w, i64 game, i64 i) except -1 nogil
@cython.locals(row=i64)
cdef int go(GameColumns games, EdgeMovers w, i64 game, i64 i) except -1 nogil
@cython.locals(row=i64, by=u8, target=i64, count=i64)
cdef Py_ssize_t target_of(GameColumns games, EdgeMovers w, i64 game, i64 i) except -2 nogil
@cython.locals(first=i64, place=i64)
cdef int go_in_part(EdgePaths walks, i64 i, i64 part, i64 parts) except -1 nogil
