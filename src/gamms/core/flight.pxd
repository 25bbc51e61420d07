cimport cython

ctypedef unsigned char u8
ctypedef long long i64

cdef double NOWHERE


cdef class Flights:
    cdef i64 count
    cdef const i64[::1] agents
    cdef double[::1] position, previous, quat

    @cython.locals(low=i64, high=i64, middle=i64)
    cdef Py_ssize_t find(self, i64 agent) except -2 nogil
    @cython.locals(found=i64)
    cdef Py_ssize_t find_row(self, i64 agent, i64 game) except -2 nogil
    cpdef get_position(self, i64 agent, i64 game=*)
    cpdef get_previous_position(self, i64 agent, i64 game=*)
    cpdef get_rotation(self, i64 agent, i64 game=*)
    cpdef int fly(self, i64 agent, double x, double y, double z, i64 game=*) except -1
    cpdef int set_rotation(self, i64 agent, double w, double x, double y, double z, i64 game=*) except -1
    @cython.locals(source=i64, target=i64, i=i64)
    cpdef int copy_to(self, Flights flights, i64 agent, i64 game, i64 other, i64 in_game) except -1
    @cython.locals(row=Py_ssize_t)
    cdef Py_ssize_t find_flyer(self, i64 agent, i64 game) except -1
    @cython.locals(begin=i64, i=i64)
    cdef int fly_row(self, i64 row, double x, double y, double z) except -1 nogil
    @cython.locals(begin=i64)
    cdef int set_row_rotation(self, i64 row, double w, double x, double y, double z) except -1 nogil


@cython.final
cdef class TurnFlights(Flights):
    cdef double[::1] start, wanted, turned
    cdef u8[::1] has_flown
    cdef public list chosen

    @cython.locals(row=i64)
    cpdef get_wanted(self, i64 agent, i64 game)
    @cython.locals(row=i64)
    cpdef int hold(self, i64 agent, i64 game) except -1
    @cython.locals(row=i64, i=i64)
    cpdef int enter(self, i64 agent, i64 game, object start) except -1
    cdef int forget(self, i64 row) except -1 nogil
    @cython.locals(g=i64, i=i64, first=i64, row=i64)
    cpdef int set_out(self, const i64[::1] games, const u8[::1] moves) except -1
    @cython.locals(g=i64, i=i64)
    cpdef int cancel(self, const i64[::1] games, const u8[::1] are_put, i64 agents) except -1 nogil
    @cython.locals(g=i64, i=i64, row=i64, a=i64, number=Py_ssize_t, changed=int)
    cpdef Py_ssize_t move(self, const i64[::1] games, const u8[::1] moves, i64 agents, i64[::1] flown) except -1 nogil
    @cython.locals(n=i64, row=i64, a=i64)
    cpdef int put_back(self, const i64[::1] games, const i64[::1] agents) except -1 nogil


@cython.locals(a=i64)
cdef read_place(const double[::1] column, i64 row)
@cython.locals(a=i64)
cdef read_rotation(const double[::1] column, i64 row)
