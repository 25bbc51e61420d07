cimport cython

from gamms.core cimport draws, travel
from gamms.core.agents cimport NodeNumbers
from gamms.core.travel cimport RoadEdges, TurnPaths

ctypedef unsigned long long u64
ctypedef long long i64

cdef extern from "math.h":
    cpdef double sqrt(double x) noexcept nogil
    cpdef double fabs(double x) noexcept nogil

cdef double INFINITE, SLACK
cdef int ON_NODES, BY_PATHS, ON_WAYS, NEAR_PLACES, ON_LINES, OURS, THEIRS, BY_RANK, BY_PAIR, BY_PLACE
cdef i64 BACKWARDS, TURNS, UNKNOWN, ON_NODE, LEAVES, MOST_NEAR


@cython.final
cdef class Tracks:
    cdef public i64 agents
    cdef i64 most
    cdef i64[::1] nodes, lengths
    cdef const i64[::1] sides
    cdef double[::1] times
    cdef bint at_end


@cython.final
cdef class Legs:
    cdef i64 most
    cdef i64[::1] counts, sources, targets, edges, streets, flags
    cdef double[::1] begins, ends, since, until, lengths


@cython.locals(is_back=bint)
cdef int describe_leg(
    Legs legs, i64 place, RoadEdges roads, const i64[::1] edge_ids, i64 edge, i64 back
) except -1 nogil


@cython.final
cdef class NearNodes:
    cdef const i64[::1] arcs, heads
    cdef const double[::1] costs
    cdef double limit
    cdef travel.ReachSearch search
    cdef i64[::1] offsets, counts, ends
    cdef double[::1] far
    cdef i64 used, first

    @cython.locals(places=i64)
    cpdef int take(self, const i64[::1] arcs, const i64[::1] heads, const double[::1] costs) except -1
    cpdef int make_room(self, i64 room) except -1 with gil
    cdef int begin(self) except -1 nogil
    @cython.locals(place=i64)
    cpdef int forget(self) except -1 nogil
    @cython.locals(place=i64, at=i64, arc=i64, far=double, number=i64, end=i64)
    cdef Py_ssize_t learn(self, i64 node) except -1 nogil
    cdef Py_ssize_t find_end(self, i64 node) except -1 nogil
    @cython.locals(first=i64, beyond=i64, last=i64, middle=i64)
    cdef double get_distance(self, i64 start, i64 end) except -1.0 nogil


@cython.final
cdef class NodePositions:
    cdef const i64[::1] numbers
    cdef const double[::1] xyz


@cython.locals(place=Py_ssize_t)
cpdef int put_paths(
    TurnPaths trips, const i64[::1] rows, RoadEdges roads, const i64[::1] edge_ids, NodeNumbers numbers,
    NodeNumbers streets, Tracks tracks, Legs legs, const i64[::1] agents,
) except -1 nogil
@cython.locals(number=i64, at=i64, place=i64)
cdef int put_path(
    TurnPaths trips, i64 row, RoadEdges roads, const i64[::1] edge_ids, NodeNumbers numbers, NodeNumbers streets,
    Tracks tracks, Legs legs, i64 agent,
) except -1 nogil


@cython.final
cdef class MotionIntervals:
    cdef readonly i64[::1] agents, nodes, order
    cdef readonly double[::1] since, until
    cdef i64[::1] legs, keys, next, first
    cdef double[::1] begins, ends
    cdef readonly i64 count

    cpdef int make_room(self, i64 room) except -1 with gil
    @cython.locals(piece=i64)
    cdef Py_ssize_t put(self, i64 agent, i64 node, i64 leg, double since, double until) except -1 nogil
    cdef int enter(self, i64 entry, i64 key) except -1 nogil
    @cython.locals(entry=i64)
    cdef int forget(self, i64 entries) except -1 nogil


@cython.final
cdef class Polylines:
    cdef const i64[::1] firsts, lasts
    cdef const double[::1] xs, ys, lengths, shares, wholes
    cdef double x, y

    @cython.locals(left=double, last=i64, point=i64, length=double)
    cdef int find(self, i64 edge, double share) except -1 nogil


@cython.final
cdef class PathSegments:
    cdef Polylines edges
    cdef public const double[::1] places, flights
    cdef readonly i64 parts
    cdef i64 room
    cdef i64[::1] offsets
    cdef double[::1] since, until, begins, ends

    cpdef int make_room(self, i64 room) except -1 with gil
    @cython.locals(piece=i64, agent=i64, is_flying=bint)
    cdef int fill(self, Tracks tracks, Legs legs, MotionIntervals pieces) except -1 nogil
    @cython.locals(part=i64, axis=int)
    cdef int _put_flight(self, i64 agent, double since) except -1 nogil
    @cython.locals(part=i64)
    cdef int _put_stay(self, i64 node, double since, double until) except -1 nogil
    @cython.locals(first=i64, beyond=i64, leg=i64)
    cdef int _put_legs(self, Legs legs, i64 agent, bint at_end) except -1 nogil
    @cython.locals(pace=double, part=i64, first=i64, last=i64, number=i64, point=i64, share=double, time=double)
    cdef int _put_line(self, i64 edge, double begin, double end, double since, double until) except -1 nogil
    @cython.locals(part=i64)
    cdef Py_ssize_t _put(self, double since, double until) except -1 nogil
    cdef int _begin(self, i64 part, double x, double y) except -1 nogil
    cdef int _end(self, i64 part, double x, double y) except -1 nogil
    @cython.locals(begin=double, share=double)
    cdef double compute_coordinate(self, i64 part, int axis, double time) except? -1.0 nogil


@cython.final
cdef class Contacts:
    cdef Tracks tracks
    cdef Legs legs
    cdef readonly MotionIntervals pieces
    cdef NearNodes reach
    cdef NodePositions places
    cdef PathSegments lines
    cdef const u64[::1] names, purpose
    cdef const i64[::1] turn
    cdef readonly i64[::1] a, b, a_nodes, b_nodes, on_edges, order
    cdef readonly double[::1] times, distances
    cdef readonly u64[::1] draws
    cdef bint crossing, by_metres, is_exact
    cdef readonly i64 room, count, kept
    cdef double limit

    cpdef int make_room(self, i64 contacts) except -1 with gil
    cpdef Py_ssize_t find(self, int search, double limit) except -1 nogil
    cdef int _search(self, int search) except -1 nogil
    @cython.locals(contact=i64, pair=u64, key=u64)
    cdef int _finish(self) except -1 nogil
    @cython.locals(kept=i64, previous=i64, place=i64, contact=i64, has_been_near=bint, before=double)
    cdef int _drop_repeated(self) except -1 nogil
    @cython.locals(contact=i64)
    cdef int _meet(
        self, double time, double distance, i64 on_edge, i64 a, i64 b, i64 a_node, i64 b_node
    ) except -1 nogil
    @cython.locals(found=bint, agent=i64, place=i64, most=i64)
    cdef bint _share_nodes(
        self, const i64[::1] nodes, const i64[::1] lengths, i64[::1] first
    ) except -1 nogil
    @cython.locals(soonest=double, agent=i64, first=i64, last=i64, place=i64, until=double, leg=i64, piece=i64)
    cdef int _put_steps(self) except -1 nogil
    @cython.locals(agent=i64, leg=i64, last=i64, one=i64, piece=i64)
    cdef int _put_legs(self, bint are_known) except -1 nogil
    cdef bint _is_of(self, i64 piece, int side) except -1 nogil
    @cython.locals(first=i64, last=i64)
    cdef Py_ssize_t _find_node(self, i64 agent, double time) except -1 nogil
    @cython.locals(slack=double, piece=i64, node=i64, other=i64, time=double)
    cdef int _find_on_nodes(self) except -1 nogil
    @cython.locals(agent=i64, first=i64, place=i64, piece=i64, source=i64, other=i64, a=i64, b=i64, time=double)
    cdef int _pass_by(self) except -1 nogil
    @cython.locals(piece=i64, other=i64, time=double, a=i64, b=i64)
    cdef int _find_on_streets(self) except -1 nogil
    @cython.locals(since=double, until=double, gap=double, later=double)
    cdef double _find_first_touch(self, i64 piece, i64 other) except? -1.0 nogil
    @cython.locals(begin=double, share=double, span=double)
    cdef double _find_place_on_street(self, i64 piece, double time) except? -1.0 nogil
    @cython.locals(side=int, piece=i64, node=i64, begin=i64, entry=i64, other=i64, back=double, distance=double)
    cdef int _find_near(self) except -1 nogil
    @cython.locals(time=double, a_node=i64, b_node=i64)
    cdef int _add_near(self, i64 piece, i64 other, double distance) except -1 nogil
    @cython.locals(theirs=i64, width=double, farthest=double, piece=i64, rim=double, first=i64, last=i64, middle=i64)
    cdef int _sweep(self) except -1 nogil
    @cython.locals(agent=i64, part=i64, piece=i64)
    cdef int _put_lines(self) except -1 nogil
    @cython.locals(agent=i64, place=i64, piece=i64)
    cdef int _set_step_positions(self) except -1 nogil
    @cython.locals(a=i64, b=i64, x=double, y=double, z=double, far=double)
    cdef int _step_near(self, i64 piece, i64 other) except -1 nogil
    @cython.locals(
        part=i64, their=i64, since=double, until=double, limit=double, x=double, y=double, z=double, far=double,
        dx=double, dy=double, dz=double, square=double, mixed=double, inside=double, share=double
    )
    cdef int _approach(self, i64 piece, i64 other) except -1 nogil
    @cython.locals(a=i64, b=i64, a_node=i64, b_node=i64)
    cdef int _meet_on_way(self, double time, double distance, i64 piece, i64 other) except -1 nogil
    @cython.locals(side=int, piece=i64, end=int, node=i64, other=i64)
    cdef int _find_within(self) except -1 nogil
    @cython.locals(leg=i64)
    cdef Py_ssize_t _find_door(self, i64 piece, int end, bint is_entry) except? -1 nogil
    @cython.locals(leg=i64, begin=double, end=double)
    cdef double _measure_distance(self, i64 piece, bint is_source, double time) except? -1.0 nogil
    @cython.locals(since=double, until=double)
    cdef double _interpolate(self, i64 piece, double begin, double end, double time) except? -1.0 nogil
    @cython.locals(
        first=i64, row=i64, entry=i64, other=i64, since=double, until=double, is_source=bint, begin=double, last=double
    )
    cdef int _go_from(self, i64 piece, int end, i64 node, int side) except -1 nogil
    @cython.locals(since=double, until=double, length=double, first=double, last=double, passing=double)
    cdef int _follow_street(self, i64 piece, i64 other, int side) except -1 nogil
    @cython.locals(begin=double, end=double)
    cdef double _interpolate_street_share(self, i64 piece, double time) except? -1.0 nogil
    @cython.locals(time=double)
    cdef int _add_within(
        self, i64 piece, i64 other, double since, double until, double begin, double end, int side
    ) except -1 nogil
    @cython.locals(found=int)
    cdef bint _is_before(self, i64 one, i64 other, int by) except -1 nogil
    @cython.locals(count=i64, root=i64, end=i64, least=i64)
    cdef int _sort(self, i64[::1] order, i64 first, i64 last, int by) except -1 nogil
    @cython.locals(item=i64, child=i64)
    cdef int _sink(self, i64[::1] order, i64 first, i64 root, i64 count, int by) except -1 nogil


@cython.locals(agent=i64, first=i64, last=i64, leg=i64, beyond=i64, one=i64, node=i64, until=double, place=i64)
cpdef int put_visits(Tracks tracks, Legs legs, MotionIntervals pieces) except -1 nogil
@cython.locals(first=i64, leg=i64)
cdef bint is_there(Tracks tracks, Legs legs, i64 agent) except -1 nogil
cdef int compare_numbers(double one, double other) noexcept nogil
