cimport cython

from gamms.core cimport by_metres, draws, moves, travel
from gamms.core.by_metres cimport Roaming
from gamms.core.conflicts cimport resolve
from gamms.core.moves cimport Movers
from gamms.core.rules cimport Games, Steps
from gamms.core.travel cimport Reach, Ways

ctypedef unsigned char u8
ctypedef long long i64

cdef extern from "math.h":
    cpdef double floor(double x) noexcept nogil


@cython.final
cdef class Walkers:
    cdef Movers movers
    cdef Ways hops, ways
    cdef Reach reach
    cdef Roaming roaming
    cdef i64 most
    cdef const double[::1] speeds
    cdef i64[::1] nodes, lengths
    cdef double[::1] times


@cython.locals(i=i64, row=i64, ahead=i64, covered=double, target=i64)
cpdef int decide(Games games, Walkers w, i64 game) except -1 nogil
@cython.locals(ahead=i64)
cdef Py_ssize_t ahead_of(Games games, Walkers w, i64 row) except -2 nogil
@cython.locals(place=i64)
cdef bint is_next(Walkers w, i64 node, i64 other) except -1 nogil
@cython.locals(row=i64, by=u8, target=i64)
cdef Py_ssize_t target_of(Games games, Walkers w, i64 game, i64 i, i64 ahead, double covered) except -2 nogil
@cython.locals(place=i64)
cdef int list_legal(Walkers w, i64 i, i64 node, i64 ahead, double covered) except -1 nogil
cdef double whole_edges(double budget) except? -1.0 nogil
@cython.locals(number=i64, at=i64, place=i64, other=i64)
cdef int list_within(Walkers w, i64 node, double hops) except -1 nogil
@cython.locals(node=i64, by_hops=bint, first=i64, onward=double, budget=double, most=double, edges=i64, place=i64, left=double, onto=i64)
cdef int set_off(Games games, Walkers w, i64 row, i64 i, i64 target, i64 ahead, double covered) except -1 nogil
cdef Py_ssize_t following(Walkers w, i64 row, i64 node, i64 target, bint by_hops) except -1 nogil
@cython.locals(place=i64)
cdef int pass_node(Walkers w, i64 i, i64 node) except -1 nogil
@cython.locals(i=i64, row=i64, goes=bint)
cpdef int give_way(Games games, Walkers w, i64 game) except -1 nogil


cdef class Walks(Steps):
    cdef i64 most

    @cython.locals(agent=i64, row=i64)
    cdef int fill(self, Games games, i64 game) except -1 nogil
