cimport cython

from gamms.core cimport draws

ctypedef unsigned char u8
ctypedef int i32
ctypedef long long i64
ctypedef unsigned long long u64

cdef u64 NEVER, UNRANKED
cdef u8 GOES, STAYS, NEEDS_RANK
cdef int FORWARD, BOTH_WAYS

@cython.final
cdef class Contests:
    cdef i64 agents, nodes, places, least
    cdef bint allow_swaps, is_drawn
    cdef i32[::1] head, taken, start, end, after, number, queue, losers, members, place, free, first
    cdef u64[::1] value
    cdef u8[::1] stays

@cython.final
cdef class MoveRequests:
    cdef const i64[::1] starts, ends, offsets, limits
    cdef const u8[::1] counts
    cdef const u64[::1] ranks

@cython.locals(i=i64)
cpdef int begin(Contests c, MoveRequests requests, i64 at) except -1 nogil
@cython.locals(i=i64, low=i32, groups=i64, found=i32, g=i64)
cpdef i64 find_exchanges(Contests c) except -1 nogil
@cython.locals(start=i32, end=i32)
cdef bint is_between_nodes(Contests c, i64 i) noexcept nogil
@cython.locals(i=i64, j=i64, g=i32, groups=i32, low=i32, high=i32)
cdef i64 number_pairs(Contests c) except -1 nogil
@cython.locals(k=i64, i=i64)
cdef int list_members(Contests c, i64 found) except -1 nogil
@cython.locals(k=i64, m=i64, i=i64, way=i32)
cpdef int end_exchanges(Contests c, i64 found) except -1 nogil
@cython.locals(i=i64, p=i64, queued=i64)
cpdef i64 find_contests(Contests c, MoveRequests requests) except -1 nogil
@cython.locals(lost=i64, k=i64, m=i64, p=i64, i=i64, known=i64, queued=i64)
cpdef i64 find_more_contests(Contests c, MoveRequests requests, i64 found) except -1 nogil
@cython.locals(found=i64, members=i64, k=i64, p=i64, i=i64, coming=i64, node=i64, free=i64)
cdef i64 list_contests(Contests c, MoveRequests requests, i64 queued) except -1 nogil
@cython.locals(i=i64)
cpdef int clear(Contests c) except -1 nogil
@cython.locals(k=i64, m=i64, begin=i64, able=i64, i=i64)
cdef int decide(Contests c, MoveRequests requests, i64 found, i64 at, i64 turn) except -1 nogil
cdef bint is_ahead(Contests c, i64 i, i64 j) noexcept nogil
@cython.locals(k=i64, m=i64, i=i64)
cdef int put_best_first(Contests c, i64 begin, i64 end, i64 number) except -1 nogil
@cython.locals(child=i64, i=i32)
cdef int sift(Contests c, i64 begin, i64 number, i64 k) except -1 nogil
@cython.locals(at=i64, at_ranks=i64, found=i64, stopped=i64, i=i64)
cpdef i64 resolve(Contests c, MoveRequests requests, i64 game, i64 turn) except -1 nogil
@cython.locals(i=i64, found=Py_ssize_t)
cpdef Py_ssize_t find_losers(Contests c, i64[::1] out) except -1 nogil
