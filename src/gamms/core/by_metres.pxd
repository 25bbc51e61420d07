cimport cython

from gamms.core cimport contacts, draws, moves, rules, strategies, travel
from gamms.core.contacts cimport Legs
from gamms.core.moves cimport TripMovers, TripPaths
from gamms.core.rules cimport Events, GameColumns
from gamms.core.travel cimport LegalCache, ReachSearch, RoadEdges, TurnPaths, GoalPaths

ctypedef unsigned char u8
ctypedef long long i64


cdef class MetreMovers(TripMovers):
    cdef GoalPaths ways, near
    cdef RoadEdges roads
    cdef ReachSearch reach
    cdef LegalCache known
    cdef Events events
    cdef i64 slots, nodes
    cdef const double[::1] speeds
    cdef i64[::1] motion, start_places, end_places, drawn
    cdef i64 most_edges

    @cython.locals(i=i64, row=i64)
    cdef int decide(self, GameColumns games, i64 game) except -1 nogil
    @cython.locals(was_on_edge=bint)
    cdef bint is_put(self, GameColumns games, i64 game, i64 i) except -1 nogil
    cdef bint is_moving(self, GameColumns games, i64 game, i64 i) except -1 nogil
    cdef i64 find_goal(self, i64 row) except -1 nogil
    @cython.locals(row=i64, own=i64)
    cdef int stay(self, GameColumns games, i64 game, i64 i) except -1 nogil
    @cython.locals(row=i64)
    cdef int stand(self, GameColumns games, i64 game, i64 i) except -1 nogil
    @cython.locals(part=i64, i=i64)
    cdef int go_all(self, GameColumns games, i64 game) except -1 nogil


@cython.locals(row=i64, edge=i64)
cdef bint is_there(GameColumns games, MetreMovers t, i64 game, i64 i) except -1 nogil
@cython.locals(own=i64)
cdef int set_out(GameColumns games, MetreMovers t, i64 row, i64 i) except -1 nogil
@cython.locals(edge=i64)
cdef Py_ssize_t find_edge(GameColumns games, MetreMovers t, i64 row) except -2 nogil
@cython.locals(row=i64, own=i64)
cdef int go(GameColumns games, MetreMovers t, i64 game, i64 i) except -1 nogil
cdef int stop_on_edge(MetreMovers t, i64 own) except -1 nogil
@cython.locals(row=i64, own=i64, target=i64, can_go=bint, slot=i64, where=i64)
cdef int choose(GameColumns games, MetreMovers t, i64 game, i64 i) except -1 nogil
@cython.locals(count=i64)
cdef int go_along(MetreMovers t, i64 row, i64 own) except -1 nogil
@cython.locals(edge=i64, on=i64, legs=i64, now=double)
cdef int go_over(MetreMovers t, i64 row, i64 own) except -1 nogil
@cython.locals(edge=i64, share=double)
cdef int begin(GameColumns games, MetreMovers t, i64 row, i64 i) except -1 nogil
cdef Py_ssize_t find_place(MetreMovers t, i64 own) except -2 nogil
@cython.locals(row=i64, own=i64, by=u8, edge=i64, node=i64, share=double, now=double, count=i64, number=i64, legal=i64)
cdef Py_ssize_t find_target(GameColumns games, MetreMovers t, i64 game, i64 i) except -2 nogil
cdef i64 choose_number(GameColumns games, MetreMovers t, i64 row, u8 by, i64 count) except? -2 nogil
cdef i64 draw_below(GameColumns games, MetreMovers t, i64 row, i64 bound) except? -2 nogil
@cython.locals(row=i64, edge=i64, node=i64)
cdef Py_ssize_t choose_by_steps(MetreMovers t, i64 game, i64 i) except -2 nogil


cdef class MetrePaths(TripPaths):
    cdef RoadEdges roads
    cdef const i64[::1] edge_ids
    cdef Legs legs

    @cython.locals(agent=i64, first=i64, leg=i64)
    cdef int fill(self, GameColumns games, i64 game) except -1 nogil
