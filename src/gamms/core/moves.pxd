cimport cython

from gamms.core cimport draws
from gamms.core.conflicts cimport Contests, resolve
from gamms.core.rules cimport Games

ctypedef unsigned char u8
ctypedef int i32
ctypedef long long i64
ctypedef unsigned long long u64

cdef u8 STAYS, WALKS, IS_GIVEN


@cython.final
cdef class Streets:
    cdef const i32[::1] offsets, targets


@cython.final
cdef class Priority:
    cdef Contests contests
    cdef const i64[::1] places, limits
    cdef const u64[::1] ranks
    cdef bint are_drawn


@cython.final
cdef class Movers:
    cdef Streets streets
    cdef const u8[::1] decides_by
    cdef const u64[::1] keys
    cdef const i64[::1] given
    cdef Priority priority
    cdef bint has_conflicts
    cdef i64[::1] ends, counts, moves, blocks
    cdef u8[::1] takes_part, blocked


@cython.locals(at=i64, walkers=i64, i=i64, row=i64, node=i64, action=i64)
cpdef int decide(Games games, Movers m, i64 game) except -1 nogil
@cython.locals(at=i64, lost=i64, i=i64, row=i64)
cpdef int give_way(Games games, Movers m, i64 game) except -1 nogil
@cython.locals(at=i64, at_ranks=i64, turn=i64)
cdef i64 losers(Priority p, Games games, Movers m, i64 game) except -1 nogil
@cython.locals(at=i64, row=i64)
cpdef int move(Games games, Movers m, i64 game) except -1 nogil
