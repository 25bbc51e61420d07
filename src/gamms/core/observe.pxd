cimport cython

from gamms.core cimport strategies

ctypedef unsigned char u8
ctypedef int i32
ctypedef long long i64

cdef i64 OWN, OF_ACTION, OF_OTHER


@cython.final
cdef class Seen:
    cdef strategies.Looks looks
    cdef bint has_looks
    cdef i64 agents
    cdef const i64[::1] viewers, node, team, first, nodes
    cdef const u8[::1] alive, are_mates, mates


@cython.final
cdef class Observers:
    cdef i64 agents
    cdef const i64[::1] node, choice, turn
    cdef const i32[::1] offsets, targets
    cdef const u8[::1] is_asked
    cdef const double[::1] own
    cdef bint are_on_nodes
    cdef Seen seen


@cython.final
cdef class Vectors:
    cdef const double[::1] places
    cdef i64 actions, others, entries
    cdef float[::1] values
    cdef u8[::1] legal


@cython.final
cdef class Nearest:
    cdef i64 count
    cdef double[::1] far
    cdef i64[::1] nodes
    cdef u8[::1] mates


@cython.locals(i=i64, row=i64, at=i64, entry=i64, place=i64, action=i64)
cpdef int observe(Observers o, Vectors v, Nearest near, i64 game) except -1 nogil
@cython.locals(row=i64, own_x=double, own_y=double, at=i64, first=i64, count=i64, action=i64, node=i64, entry=i64, other=i64)
cdef int _write(Observers o, Vectors v, Nearest near, i64 game, i64 agent) except -1 nogil
@cython.locals(row=i64, pair=i64, at=i64, viewer=i64, other=i64, node=i64, is_mate=bint)
cdef int _look(Observers o, Vectors v, Nearest near, i64 game, i64 agent, double own_x, double own_y) except -1 nogil
@cython.locals(dx=double, dy=double, far=double, place=i64)
cdef int _take(Vectors v, Nearest near, i64 node, u8 is_mate, double own_x, double own_y) except -1 nogil
@cython.locals(game=i64)
cpdef int observe_games(Observers o, Vectors v, Nearest near, i64 begin, i64 end) except -1 nogil
cpdef int observe_aside(Observers o, Vectors v, Nearest near, i64 begin, i64 end) except -1
