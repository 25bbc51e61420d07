cimport cython

ctypedef unsigned char u8
ctypedef long long i64

cdef extern from "math.h":
    cpdef double fabs(double x) noexcept nogil

cdef double INFINITE, SLACK, LEAST, MOST, SHORT, ROUNDED
cdef i64 MORE_LEGS, ENDLESS, FORWARD, BACK, STOPPED


@cython.final
cdef class RoadEdges:
    cdef const i64[::1] ids, offsets, leaving, sources, targets
    cdef const u8[::1] removed
    cdef const double[::1] lengths, costs, seconds
    cdef const i64[::1] first_costs
    cdef double turn_seconds
    cdef i64 first, first_cost

    cpdef int use(self, i64 first) except -1 nogil
    cdef Py_ssize_t count(self, i64 node) except -1 nogil
    cdef double get_cost(self, i64 edge) except? -1.0 nogil
    cdef Py_ssize_t get_edge(self, i64 node, i64 number) except -1 nogil


@cython.final
cdef class ReachSearch:
    cdef i64[::1] nodes, listed, heap, places, rank, seen
    cdef double[::1] times, when
    cdef i64 found, search, size, count


@cython.final
cdef class LegalCache:
    cdef const i64[::1] kinds
    cdef i64[::1] counts, first, nodes
    cdef i64 used


@cython.final
cdef class TurnPaths:
    cdef i64 most
    cdef readonly i64[::1] node, edge, motion, left, legs, passed, edges, backs, nodes, route
    cdef readonly double[::1] share, now, speed, pace, begins, ends, since, until, times

    @cython.locals(legs=i64, nodes=i64, at=i64)
    cpdef int cut(self, i64 rows, i64 most, i64[::1] ints, double[::1] floats) except -1


@cython.final
cdef class GoalPaths:
    cdef RoadEdges roads, back
    cdef ReachSearch reach
    cdef u8[::1] direct
    cdef i64 most
    cdef i64[::1] goal, count, at, nodes
    cdef double[::1] far


cdef class LegalNodes:
    cdef ReachSearch reach

    cdef Py_ssize_t find(self, i64 node, i64 edge, double share, i64 motion, double speed, double now) except -1 nogil


cdef class LegalByMetres(LegalNodes):
    cdef RoadEdges roads
    cdef bint goes_on

    cdef Py_ssize_t find(self, i64 node, i64 edge, double share, i64 motion, double speed, double now) except -1 nogil


@cython.locals(found=i64, number=i64, edge=i64)
cpdef Py_ssize_t find_cheapest(RoadEdges roads, i64 source, i64 target) except -2 nogil
@cython.locals(nodes=i64)
cdef Py_ssize_t find_next_edge(RoadEdges roads, i64 node, i64 then) except -2 nogil
@cython.locals(node=i64, length=double, number=i64, other=i64)
cpdef Py_ssize_t find_reverse_edge(RoadEdges roads, i64 edge) except -2 nogil
@cython.locals(metres=double, pace=double, taken=double, least=double)
cpdef double compute_turns(RoadEdges roads, i64 edge, double share, double speed) except? -1.0 nogil
cpdef bint is_endless(RoadEdges roads, double speed) except -1 nogil
@cython.locals(node=i64, number=i64, found=bint)
cdef bint is_open(RoadEdges roads, i64 edge) except -1 nogil
cdef bint is_removed(RoadEdges roads, i64 edge) except -1 nogil
cpdef bint is_going(RoadEdges roads, i64 edge, i64 motion) except -1 nogil

@cython.locals(left=double, is_paced=bint, end=i64, ahead=double, behind=double, may_turn=bint)
cpdef Py_ssize_t find_reachable(
    RoadEdges roads, ReachSearch reach, i64 node, i64 edge, double share, i64 motion, double speed, double now, bint goes_on
) except -1 nogil
@cython.locals(key=i64, count=i64, place=i64)
cpdef Py_ssize_t count_legal(RoadEdges roads, ReachSearch reach, LegalCache known, i64 agent, i64 node, double speed) except -1 nogil
@cython.locals(key=i64, is_known=bint)
cpdef Py_ssize_t get_legal_node(RoadEdges roads, ReachSearch reach, LegalCache known, i64 agent, i64 node, i64 number) except -1 nogil
cdef int list_node(ReachSearch reach, i64 node, double time) except -1 nogil
@cython.locals(number=i64)
cdef int list_near(RoadEdges roads, ReachSearch reach, i64 node) except -1 nogil
@cython.locals(endless=bint, latest=double, at=i64, number=i64, edge=i64, time=double, one=i64)
cdef int list_around(RoadEdges roads, ReachSearch reach, i64 node, double speed, double begun, double left) except -1 nogil
@cython.locals(number=i64)
cdef int forget_seen(ReachSearch reach) except -1 nogil
@cython.locals(number=i64, place=i64)
cdef int sort_seen(ReachSearch reach) except -1 nogil
cdef bint is_before(ReachSearch reach, i64 one, i64 other) except -1 nogil
@cython.locals(place=i64, above=i64)
cdef int reach_node(ReachSearch reach, i64 node, double time, i64 rank) except -1 nogil
@cython.locals(first=i64, node=i64, place=i64, below=i64)
cdef Py_ssize_t visit_first(ReachSearch reach) except -1 nogil

@cython.locals(edge=i64, latest=double, found=bint, at=i64, number=i64, cost=double)
cpdef bint is_only_way(RoadEdges roads, ReachSearch reach, i64 source, i64 target) except -1 nogil
@cython.locals(edge=i64)
cdef bint is_direct(GoalPaths ways, i64 source, i64 target) except -1 nogil
@cython.locals(at=i64, number=i64, edge=i64, cost=double, node=i64, place=i64)
cpdef Py_ssize_t find_way(GoalPaths ways, i64 row, i64 source, i64 goal) except -1 nogil
@cython.locals(found=i64, number=i64, edge=i64, other=i64)
cdef Py_ssize_t get_next_on_path(GoalPaths ways, i64 node) except -2 nogil
@cython.locals(place=i64, _=i64)
cdef Py_ssize_t find_place_on_path(GoalPaths ways, i64 row, i64 node, i64 goal) except -2 nogil
@cython.locals(place=i64)
cpdef double compute_distance(GoalPaths ways, i64 row, i64 node, i64 goal) except? -1.0 nogil
@cython.locals(place=i64)
cpdef Py_ssize_t find_next_node(GoalPaths ways, i64 row, i64 node, i64 goal) except -1 nogil
@cython.locals(place=i64, count=i64, first=i64, number=i64)
cpdef Py_ssize_t put_route(GoalPaths ways, TurnPaths trips, i64 row, i64 node, i64 goal, i64 begin) except -1 nogil

cdef Py_ssize_t end_towards(RoadEdges roads, i64 node, i64 edge, i64 target) except -1 nogil
@cython.locals(cost=double)
cpdef Py_ssize_t find_shorter_direction(RoadEdges roads, i64 edge, double share, double ahead, double behind) except -1 nogil

cpdef int begin(
    TurnPaths trips, i64 row, i64 node, i64 edge, double share, i64 motion, double now, double speed, i64 left
) except -1 nogil
@cython.locals(place=i64)
cdef int put_new_leg(
    TurnPaths trips, i64 row, i64 edge, i64 back, double begin, double end, double until
) except -1 nogil
cdef int stand_still(TurnPaths trips, i64 row) except -1 nogil
cdef int add_leg(RoadEdges roads, TurnPaths trips, i64 row, i64 edge, double begin, double end, double until) except -1 nogil
@cython.locals(share=double)
cdef double compute_turns_to_end(RoadEdges roads, TurnPaths trips, i64 row, i64 edge, i64 motion) except? -1.0 nogil
@cython.locals(first=double, last=double, part=double, stop=double)
cdef double stop_before_end(TurnPaths trips, i64 row, i64 motion, double takes) except? -1.0 nogil
@cython.locals(first=double, takes=double, until=double, stop=double, node=i64, place=i64)
cdef bint cover(RoadEdges roads, TurnPaths trips, i64 row, i64 edge, i64 motion) except -1 nogil
cpdef int stand(RoadEdges roads, TurnPaths trips, i64 row) except -1 nogil
cpdef bint is_on_edge_at_start(TurnPaths trips, i64 row) except -1 nogil
@cython.locals(first=i64)
cpdef bint is_moving(TurnPaths trips, i64 row) except -1 nogil
@cython.locals(first=i64)
cpdef int stay(TurnPaths trips, i64 row) except -1 nogil
@cython.locals(leg=i64, edge=i64)
cpdef int stop_short(RoadEdges roads, TurnPaths trips, i64 row) except -1 nogil
@cython.locals(first=i64, node=i64, stands=bint, leg=i64, place=i64, last=i64)
cpdef int go_in_part(TurnPaths trips, i64 row, i64 part, i64 parts) except -1 nogil
@cython.locals(share=double)
cpdef double compute_share(double begin, double end, double since, double until, double time) except? -1.0 nogil
cpdef Py_ssize_t get_motion(double begin, double end) except -1 nogil
cdef int put_leg(TurnPaths trips, i64 leg, i64 other, double share, double since, double until) except -1 nogil
cdef int copy_leg(TurnPaths trips, i64 leg, TurnPaths others, i64 other) except -1 nogil
cdef class PathsBySlot:
    cdef public list maps
    cdef public TurnPaths core
    cdef object make_progress, motions

    @cython.locals(found=i64, i=Py_ssize_t)
    cpdef i64 count_most_legs(self) except -1
    @cython.locals(found=i64, i=Py_ssize_t)
    cpdef i64 count_most_nodes(self) except -1
    cpdef int take(self, i64 i, TurnPaths paths, i64 row, i64 room, object roads) except -1
    @cython.locals(paths=TurnPaths)
    cpdef get_progress(self, i64 i)
    @cython.locals(paths=TurnPaths, leg=i64, begin=double, end=double, share=double)
    cpdef get_position_at(self, i64 i, double time)


cpdef int copy_trip(TurnPaths trips, i64 row, TurnPaths others, i64 other) except -1 nogil
@cython.locals(number=i64, place=i64)
cpdef int add_trip(TurnPaths trips, i64 row, TurnPaths others, i64 other, i64 first) except -1 nogil
@cython.locals(at=i64, number=i64)
cpdef Py_ssize_t find_missing_edge(RoadEdges roads, TurnPaths trips, i64 node, i64 count) except -2 nogil
@cython.locals(speed=double)
cdef bint is_using_whole_turn(RoadEdges roads, TurnPaths trips, i64 row) except -1 nogil
@cython.locals(at=i64, left=i64, metres=double, edge=i64, number=i64)
cdef int set_pace(RoadEdges roads, TurnPaths trips, i64 row, i64 motion, i64 count) except -1 nogil
@cython.locals(number=i64, node=i64)
cpdef bint go(RoadEdges roads, TurnPaths trips, i64 row, i64 motion, i64 count) except -1 nogil
@cython.locals(node=i64, edge=i64, motion=i64, needs_whole=bint, count=i64, before=i64, goes_on=bint)
cpdef bint go_towards(RoadEdges roads, TurnPaths trips, GoalPaths ways, i64 memory, i64 row, i64 target) except -1 nogil
@cython.locals(node=i64, edge=i64, motion=i64, ahead=double, behind=double)
cdef Py_ssize_t find_motion(
    RoadEdges roads, TurnPaths trips, GoalPaths ways, i64 memory, i64 row, i64 target
) except -1 nogil

@cython.locals(number=i64)
cpdef int find_reverse_edges(RoadEdges roads, const i64[::1] edges, i64[::1] found) except -1 nogil
@cython.locals(used=i64, number=i64, count=i64, place=i64)
cpdef Py_ssize_t find_each(
    LegalNodes legal, i64 first, const i64[::1] node, const i64[::1] edge, const double[::1] share,
    const i64[::1] motion, const double[::1] speed, const double[::1] now, i64[::1] found, i64[::1] counts
) except -1 nogil
