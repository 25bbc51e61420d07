cimport cython

from gamms.core cimport by_metres, moves, rules, travel
from gamms.core.by_metres cimport MetreMovers
from gamms.core.conflicts cimport resolve
from gamms.core.rules cimport GameColumns

ctypedef long long i64

cdef double SHORT


cpdef double short_of(double end) except? -1.0 nogil


@cython.final
cdef class Queue:
    cdef double[::1] times
    cdef i64[::1] heap
    cdef readonly i64 size

    cdef bint is_before(self, i64 one, i64 other) except -1 nogil
    @cython.locals(place=i64)
    cpdef int push(self, i64 agent, double time) except -1 nogil
    @cython.locals(first=i64, agent=i64, place=i64, child=i64)
    cpdef Py_ssize_t pop(self) except -1 nogil
    cpdef double first_time(self) except? -1.0 nogil


@cython.final
cdef class Arrivals:
    cdef MetreMovers travelers
    cdef Queue queue
    cdef i64 most
    cdef i64[::1] here, asked, loses, legs, passed, nodes


@cython.locals(now=double, count=i64)
cpdef int play(GameColumns games, Arrivals a, i64 game) except -1 nogil
@cython.locals(i=i64, row=i64)
cdef int put_back(GameColumns games, MetreMovers t, i64 game) except -1 nogil
@cython.locals(i=i64, row=i64)
cdef int set_out(GameColumns games, Arrivals a, MetreMovers t, i64 game) except -1 nogil
@cython.locals(row=i64, edge=i64)
cdef int begin(GameColumns games, MetreMovers t, i64 game, i64 i) except -1 nogil
@cython.locals(leg=i64)
cdef Py_ssize_t place_after(MetreMovers t, i64 row, i64 i, i64 legs) except -2 nogil
@cython.locals(has_losers=bint, i=i64, row=i64)
cdef int give_way(GameColumns games, Arrivals a, MetreMovers t, i64 game) except -1 nogil
@cython.locals(until=double)
cdef int depart(Arrivals a, MetreMovers t, i64 i) except -1 nogil
@cython.locals(number=i64, i=i64, row=i64)
cdef int arrive(GameColumns games, Arrivals a, MetreMovers t, i64 game, double now, i64 count) except -1 nogil
cdef int come_back(Arrivals a, MetreMovers t, i64 i) except -1 nogil
@cython.locals(leg=i64, edge=i64)
cdef int hold(GameColumns games, MetreMovers t, i64 game, i64 i) except -1 nogil
