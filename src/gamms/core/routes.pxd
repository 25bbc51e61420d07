cimport cython

from gamms.core cimport travel

ctypedef long long i64

cdef double INFINITE, SLACK, LEAST


@cython.final
cdef class Arcs:
    cdef const i64[::1] offsets, ends, ids
    cdef const double[::1] weights
    cdef i64 first


@cython.final
cdef class Paths:
    cdef travel.ReachSearch reach
    cdef i64[::1] last, before, path
    cdef readonly i64 count


cpdef double widened(double far) except? -1.0 nogil
@cython.locals(left=i64, visited=i64, latest=double, number=i64, node=i64, arc=i64)
cpdef i64 find(
    Arcs arcs, Paths paths, const i64[::1] roots, const i64[::1] goals, i64 most, double within, bint is_nearest
) except -2 nogil
@cython.locals(left=i64, number=i64)
cdef i64 list_goals(travel.ReachSearch reach, const i64[::1] goals) except -1 nogil
@cython.locals(end=i64, place=i64, far=double, rank=i64, before=i64, is_better=bint)
cdef int go_along(Arcs arcs, Paths paths, i64 start, i64 arc, double within) except -1 nogil
@cython.locals(count=i64)
cpdef i64 trace(Paths paths, i64 node) except -1 nogil
