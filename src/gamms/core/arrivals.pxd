cimport cython

from gamms.core cimport by_metres, moves, rules, travel
from gamms.core.by_metres cimport MetreMovers
from gamms.core.conflicts cimport resolve
from gamms.core.rules cimport GameColumns
from gamms.core.travel cimport TurnPaths

ctypedef unsigned char u8
ctypedef long long i64

cdef double NOT_BEGUN
cdef u8 DECIDES, GOES_ON
cdef i64 ARRIVE, CHOOSE, GO_ON




@cython.final
cdef class Queue:
    cdef readonly i64 agents
    cdef double[::1] times
    cdef i64[::1] heap
    cdef i64[::1] sizes

    cdef bint is_before(self, i64 first, i64 one, i64 other) except -1 nogil
    @cython.locals(first=i64, place=i64)
    cpdef int push(self, i64 game, i64 agent, double time) except -1 nogil
    @cython.locals(first=i64, found=i64, size=i64, agent=i64, place=i64, child=i64)
    cpdef Py_ssize_t pop(self, i64 game) except -1 nogil
    cpdef Py_ssize_t count_agents(self, i64 game) except -1 nogil
    @cython.locals(first=i64)
    cpdef double find_first_time(self, i64 game) except? -1.0 nogil


@cython.final
cdef class Arrivals:
    cdef MetreMovers travelers
    cdef Queue queue
    cdef i64 most
    cdef bint has_end
    cdef double[::1] now
    cdef u8[::1] comes, late
    cdef i64[::1] asked, loses, legs, passed, nodes, here, counts
    cdef TurnPaths last, chosen
    cdef bint keeps_last, has_chosen

    @cython.locals(first=i64)
    cdef int process_arrival(self, i64 game, i64 agent, i64 why) except -1 nogil
    @cython.locals(first=i64, number=i64)
    cdef int leave(self, i64 game) except -1 nogil


cpdef int play(GameColumns games, Arrivals a, i64 game) except -1 nogil
@cython.locals(is_over=bint, row=i64)
cdef int play_phase(GameColumns games, Arrivals a, MetreMovers t, i64 phase, i64 game) except -1 nogil
@cython.locals(now=double, i=i64, row=i64, own=i64, leg=i64, source=double, target=double, share=double)
cdef int show(GameColumns games, Arrivals a, MetreMovers t, i64 game) except -1 nogil
@cython.locals(i=i64, row=i64)
cdef int put_back(GameColumns games, MetreMovers t, i64 game) except -1 nogil
@cython.locals(i=i64, row=i64)
cdef int set_out(GameColumns games, Arrivals a, MetreMovers t, i64 game) except -1 nogil
@cython.locals(row=i64, own=i64, edge=i64)
cdef int begin(GameColumns games, Arrivals a, MetreMovers t, i64 game, i64 i) except -1 nogil
@cython.locals(number=i64, i=i64, row=i64)
cdef int choose(GameColumns games, Arrivals a, MetreMovers t, i64 game) except -1 nogil
@cython.locals(own=i64)
cdef int decide(GameColumns games, Arrivals a, MetreMovers t, i64 game, i64 i) except -1 nogil
@cython.locals(leg=i64)
cdef Py_ssize_t find_place_after(MetreMovers t, i64 row, i64 own, i64 legs) except -2 nogil
@cython.locals(has_losers=bint, loses=bint, number=i64, i=i64, row=i64)
cdef int give_way(GameColumns games, Arrivals a, MetreMovers t, i64 game) except -1 nogil
@cython.locals(own=i64, until=double)
cdef int depart(Arrivals a, MetreMovers t, i64 game, i64 i) except -1 nogil
@cython.locals(number=i64, i=i64, row=i64, own=i64)
cdef int go_on(GameColumns games, Arrivals a, MetreMovers t, i64 game) except -1 nogil
@cython.locals(now=double, i=i64, row=i64, own=i64)
cdef int arrive(GameColumns games, Arrivals a, MetreMovers t, i64 game) except -1 nogil
cdef int return_agent(Arrivals a, MetreMovers t, i64 row, i64 own) except -1 nogil
cdef int hold(GameColumns games, MetreMovers t, i64 row, i64 own) except -1 nogil
