cimport cython

from gamms.core cimport travel

ctypedef unsigned char u8
ctypedef long long i64

cdef double INFINITE, SLACK, LEAST, NOT_KNOWN


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
    Arcs arcs, Paths paths, const i64[::1] roots, const i64[::1] goals, i64 most, double within, double least, bint is_nearest
) except -2 nogil
@cython.locals(left=i64, number=i64)
cdef i64 list_goals(travel.ReachSearch reach, const i64[::1] goals) except -1 nogil
@cython.locals(end=i64, place=i64, far=double, rank=i64, before=i64, is_better=bint)
cdef int go_along(Arcs arcs, Paths paths, i64 start, i64 arc, double within) except -1 nogil
@cython.locals(count=i64)
cpdef i64 trace(Paths paths, i64 node) except -1 nogil


@cython.final
cdef class PathTables:
    cdef const i64[::1] ids
    cdef Arcs arcs
    cdef Paths paths
    cdef i64[::1] tables, targets, root, goal
    cdef int[::1] following
    cdef double[::1] far, radius
    cdef readonly i64 count

    @cython.locals(nodes=i64, table=i64, place=i64)
    cpdef take(
        self,
        const i64[::1] offsets,
        const i64[::1] tails,
        const double[::1] costs,
        double[::1] far,
        int[::1] following,
        const i64[::1] moved,
    )

    @cython.locals(place=i64)
    cdef Py_ssize_t place(self, i64 node, i64 target) except -1 nogil
    @cython.locals(table=i64, first=i64, node=i64)
    cdef int begin(self, i64 place) except -1 nogil
    @cython.locals(table=i64, first=i64, least=double, is_whole=bint, number=i64, at=i64, place=i64)
    cdef int find(self, i64 target, i64 node) except -1 nogil
    cdef int fill(self, i64 target) except -1 nogil
    cdef double distance(self, i64 node, i64 target) except? -1.0 nogil


@cython.locals(place=i64, number=i64)
cpdef int find_distances(
    PathTables ways, const i64[::1] order, const i64[::1] nodes, const i64[::1] targets, double[::1] found
) except -1 nogil
@cython.locals(place=i64, number=i64, first=i64, count=i64, node=i64)
cpdef int find_actions(
    PathTables ways,
    const i64[::1] offsets,
    const i64[::1] legal,
    const i64[::1] order,
    const i64[::1] nodes,
    const i64[::1] targets,
    const u8[::1] allowed,
    i64[::1] found,
) except -1 nogil
@cython.locals(last=i64, length=i64, edges=i64, steps=i64)
cdef i64 node_towards(
    PathTables ways, const i64[::1] legal, i64 first, i64 count, i64 node, i64 target, const u8[::1] allowed
) except? -2 nogil
@cython.locals(steps=i64)
cpdef i64 count_steps(const i64[::1] path, i64 length, const i64[::1] legal, i64 first, i64 count) except -1 nogil
@cython.locals(number=i64)
cdef i64 number_of(const i64[::1] legal, i64 first, i64 count, i64 node) except? -2 nogil
