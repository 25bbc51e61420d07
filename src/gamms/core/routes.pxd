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


cpdef double widen_distance(double far) except? -1.0 nogil
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
    cdef Py_ssize_t find_index(self, i64 node, i64 target) except -1 nogil
    @cython.locals(table=i64, first=i64, node=i64)
    cdef int begin(self, i64 place) except -1 nogil
    @cython.locals(table=i64, first=i64, least=double, is_whole=bint, number=i64, at=i64, place=i64)
    cdef int find(self, i64 target, i64 node) except -1 nogil
    cdef int fill(self, i64 target) except -1 nogil
    cdef double get_distance(self, i64 node, i64 target) except? -1.0 nogil


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
cdef i64 find_next_node(
    PathTables ways, const i64[::1] legal, i64 first, i64 count, i64 node, i64 target, const u8[::1] allowed
) except? -2 nogil
@cython.locals(steps=i64)
cpdef i64 count_steps(const i64[::1] path, i64 length, const i64[::1] legal, i64 first, i64 count) except -1 nogil
@cython.locals(number=i64)
cdef i64 find_number(const i64[::1] legal, i64 first, i64 count, i64 node) except? -2 nogil


@cython.final
cdef class NodesByX:
    cdef const i64[::1] order
    cdef const double[::1] xy
    cdef i64[::1] found

    @cython.locals(here=i64, count=i64, side=i64, other=i64, node=i64, dx=double, dy=double)
    cdef Py_ssize_t find(self, i64 rank, i64 begin, i64 end, double square) except -1 nogil


@cython.final
cdef class NearbyDistances:
    cdef Arcs arcs
    cdef Paths paths
    cdef i64[::1] root, goal, first, counts
    cdef int[::1] nodes
    cdef float[::1] far
    cdef double[::1] radius
    cdef i64 used
    cdef double farthest

    @cython.locals(places=i64)
    cpdef take(self, const i64[::1] ids, const i64[::1] offsets, const i64[::1] tails, const double[::1] costs)
    @cython.locals(low=i64, end=i64, high=i64, middle=i64)
    cdef double look_up(self, i64 place, i64 node) except? -2.0 nogil
    @cython.locals(least=double, radius=double)
    cdef int search(self, i64 base, i64 target, i64 node) except -1 nogil
    @cython.locals(other=i64, count=i64, number=i64, at=i64)
    cdef int keep(self, i64 place, i64 node, double radius) except -1 nogil
    @cython.locals(room=i64, rank=i64)
    cpdef int find_all(self, NodesByX near, i64 begin, i64 end, double square) except -1
    @cython.locals(number=i64)
    cdef int find_around(self, NodesByX near, i64 target, i64 count) except -1 nogil


@cython.locals(gap=i64, place=i64, number=int, before=i64)
cdef int sort_part(int[::1] numbers, i64 first, i64 count) except -1 nogil
