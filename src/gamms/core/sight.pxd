cimport cython

from gamms.core.agents cimport AgentColumns

ctypedef unsigned char u8
ctypedef long long i64

cdef extern from "math.h":
    cpdef double fabs(double x) noexcept nogil
    cpdef double atan2(double y, double x) noexcept nogil

cdef double LEAST, MOST, SCALE, MOST_CELLS, SLACK, TURN
cdef i64 FACTOR_X, FACTOR_Y, MANY, MOST_KEPT


cpdef double compute_scale(double radius) noexcept nogil
cdef bint is_within(double dx, double dy, double square) noexcept nogil
@cython.locals(off=double)
cdef bint is_ahead(double dx, double dy, double axis, double rim) noexcept nogil


@cython.final
cdef class SensorTable:
    cdef const i64[::1] begins
    cdef const double[::1] squares
    cdef const u8[::1] shows
    cdef i64 teams


@cython.locals(sensor=i64)
cdef bint is_shown(SensorTable sensors, i64 viewer, i64 team, double dx, double dy) except -1 nogil
@cython.locals(widest=double, sensor=i64)
cdef double find_widest_square(SensorTable sensors, i64 viewer) except? -1.0 nogil


@cython.final
cdef class AgentSearch:
    cdef SensorTable looks
    cdef i64 agents
    cdef const i64[::1] node, team
    cdef const u8[::1] alive
    cdef const double[::1] xy
    cdef i64[::1] order, ranks
    cdef double[::1] places

    @cython.locals(first=i64, row=i64, node=i64)
    cdef int load_node_positions(self, i64 game, i64 base) except -1 nogil
    @cython.locals(first=i64, number=i64)
    cdef int load_positions(self, i64 game, const double[::1] xy, i64 begin) except -1 nogil
    @cython.locals(first=i64, number=i64, agent=i64, x=double, place=i64)
    cdef int sort(self, i64 game) except -1 nogil


@cython.locals(
    widest=double, first=i64, here=i64, count=i64, side=i64, rank=i64, other=i64, dx=double, dy=double
)
cdef i64 see(AgentSearch s, i64 game, i64 viewer, i64[::1] seen) except -1 nogil
@cython.locals(gap=i64, place=i64, number=i64, before=i64)
cdef int sort_numbers(i64[::1] numbers, i64 count) except -1 nogil


@cython.final
cdef class AgentPositions:
    cdef readonly object at
    cdef readonly list names, nodes
    cdef readonly dict rows
    cdef readonly i64 count
    cdef readonly double[::1] x, y
    cdef readonly signed char[::1] is_seen

    @cython.locals(row=i64, count=i64, place=tuple)
    cpdef int fill(self, list names, list nodes) except -1
    @cython.locals(row=i64, moved=Py_ssize_t, node=object, place=tuple)
    cpdef Py_ssize_t follow(self, AgentColumns columns) except -1


@cython.final
cdef class RangeSearch:
    cdef readonly AgentPositions places
    cdef readonly tuple view
    cdef public bint is_built
    cdef bint is_endless
    cdef double radius, scale, square, size
    cdef i64 room, mask, kept
    cdef dict everyone, known
    cdef int[::1] first, after, before, cell_x, cell_y
    cdef i64[::1] found

    cpdef int build(self) except -1
    @cython.locals(x=double[::1], y=double[::1], greatest=double, row=i64, entry=i64)
    cdef int _enter_all(self) except -1 nogil
    cdef int _forget(self) except -1
    cpdef int move(self, i64 row) except -1
    @cython.locals(entry=i64, other=i64)
    cdef int _enter(self, i64 row) except -1 nogil
    @cython.locals(after=i64, before=i64)
    cdef int _leave(self, i64 row) except -1 nogil
    @cython.locals(place=double, cell=i64)
    cdef i64 _find_cell(self, double value) noexcept nogil
    cdef i64 _find_entry(self, i64 cell_x, i64 cell_y) noexcept nogil
    @cython.locals(
        count=i64, row=i64, xs=double[::1], ys=double[::1], middle_x=i64, middle_y=i64, cell_x=i64, cell_y=i64,
        dx=double, dy=double
    )
    cdef Py_ssize_t _find(self, double x, double y) except -1 nogil
    @cython.locals(names=list, nodes=list, data=dict, place=i64, row=i64, own_row=i64)
    cdef dict _make_named_results(self, i64 count, str own)
    cpdef dict find_by_name(self, double x, double y, str own)
    @cython.locals(count=i64, place=i64)
    cpdef list find_rows(self, double x, double y)
    @cython.locals(
        place=i64, row=i64, xs=double[::1], ys=double[::1], rows=list
    )
    cpdef list find_rows_ahead(self, double x, double y, double axis, double rim)
    @cython.locals(place=tuple, found=dict, data=dict, count=i64)
    cpdef dict find_around_node(self, object node, str own)


@cython.final
cdef class NodeViews:
    cdef readonly object known
    cdef readonly tuple view


cdef class AgentIndex:
    cdef public object phase, revised, revision, moment
    cdef public AgentPositions agents
    cdef public dict sights
    cdef public AgentColumns entered
    cdef public i64 epoch, version

    cpdef get_shared_look(self, double radius)
    @cython.locals(entered=AgentColumns, sight=RangeSearch)
    cpdef bint follow(self) except -1


cdef i64 as_cell(double place) noexcept nogil
