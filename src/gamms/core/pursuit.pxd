cimport cython

ctypedef long long i64

cdef i64 PURSUERS, EVADER, CAUGHT, ESCAPED


@cython.final
cdef class Moves:
    cdef const i64[::1] offsets, before, counts


@cython.final
cdef class Positions:
    cdef Moves pursuers, evader
    cdef int[::1] codes, queue, left


@cython.locals(nodes=i64, size=i64, count=i64, position=i64, first=i64, code=int, formation=i64, node=i64, arc=i64, before=i64)
cpdef i64 find_forced(Positions positions, i64 end) except -1
@cython.locals(nodes=i64, formation=i64, node=i64)
cdef int count_moves(Positions positions, i64 end) except -1 nogil
cdef bint is_forced(Positions positions, i64 position, i64 place, bint is_free) noexcept nogil
