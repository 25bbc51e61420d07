cimport cython

from gamms.core cimport draws, moves, rules, strategies, travel
from gamms.core.conflicts cimport resolve
from gamms.core.moves cimport Movers
from gamms.core.rules cimport Events, Games, Steps
from gamms.core.travel cimport LegalCache, Reach, Roads, Trips, Ways

ctypedef unsigned char u8
ctypedef long long i64

cdef i64 ENDLESS


@cython.final
cdef class Travelers:
    cdef Movers movers
    cdef Ways ways, near
    cdef Roads roads
    cdef Reach reach
    cdef LegalCache known
    cdef Trips trips
    cdef Events events
    cdef i64 slots, nodes
    cdef const double[::1] speeds
    cdef i64[::1] motion, starts, ends, drawn
    cdef i64 most_edges
    cdef Trips kept
    cdef bint keeps


@cython.locals(i=i64, row=i64)
cpdef int decide(Games games, Travelers t, i64 game) except -1 nogil
@cython.locals(row=i64)
cdef bint is_there(Games games, Travelers t, i64 game, i64 i) except -1 nogil
cdef int set_out(Games games, Travelers t, i64 row, i64 i) except -1 nogil
cdef int rest(Travelers t, i64 i) except -1 nogil
@cython.locals(row=i64, target=i64, can_go=bint, slot=i64, where=i64)
cdef int choose(Games games, Travelers t, i64 game, i64 i) except -1 nogil
@cython.locals(count=i64)
cdef int go_along(Travelers t, i64 row, i64 i) except -1 nogil
cdef int begin(Games games, Travelers t, i64 row, i64 i) except -1 nogil
cdef Py_ssize_t place_of(Travelers t, i64 i) except -2 nogil
@cython.locals(row=i64, by=u8, edge=i64, node=i64, share=double, now=double, count=i64, number=i64, legal=i64)
cdef Py_ssize_t target_of(Games games, Travelers t, i64 game, i64 i) except -2 nogil
cdef i64 drawn(Games games, Travelers t, i64 row, i64 i, i64 bound) except? -2 nogil
@cython.locals(edge=i64, node=i64)
cdef Py_ssize_t by_steps(Travelers t, i64 game, i64 i) except -2 nogil
cdef int stay(Games games, Travelers t, i64 row, i64 i) except -1 nogil
@cython.locals(i=i64, row=i64, leg=i64, goes=bint)
cpdef int give_way(Games games, Travelers t, i64 game) except -1 nogil
@cython.locals(i=i64)
cpdef int keep(Games games, Travelers t, i64 game) except -1 nogil
@cython.locals(i=i64)
cpdef int recall(Games games, Travelers t, i64 game) except -1 nogil
@cython.locals(i=i64, row=i64, share=double, has_left_edge=bint, is_put=bint)
cpdef int settle(Games games, Travelers t, i64 game) except -1 nogil
@cython.locals(i=i64, row=i64, part=i64)
cpdef int move(Games games, Travelers t, i64 game) except -1 nogil
cdef int go(Games games, Travelers t, i64 row, i64 i) except -1 nogil


cdef class MetrePaths(Steps):
    cdef Trips trips
    cdef Roads roads
    cdef const i64[::1] edge_streets, edge_flags
    cdef i64[::1] sources, targets, streets, flags
    cdef double[::1] metres
    cdef Trips kept
    cdef bint keeps

    @cython.locals(agent=i64, row=i64, first=i64, leg=i64, edge=i64)
    cdef int fill(self, Games games, i64 game) except -1 nogil
