cimport cython

from gamms.core cimport arrivals, moves, rules

ctypedef long long i64


@cython.final
cdef class PastPlaces:
    cdef i64 turns
    cdef i64[::1] node, edge, motion
    cdef double[::1] share
    cdef const i64[::1] motions

    @cython.locals(first=i64, i=i64)
    cdef int note(self, rules.GameColumns games) except -1 nogil


@cython.final
cdef class Player:
    cdef rules.GameColumns games
    cdef moves.OneEdgeMovers movers
    cdef arrivals.Arrivals arrivals
    cdef rules.Rule first
    cdef bint has_rules, at_arrivals
    cdef const i64[::1] until, stop
    cdef PastPlaces past


cdef i64 DECIDE, SETTLE, MOVE

cdef int decide(Player p, i64 game) except -1 nogil
cdef int move(Player p, i64 game) except -1 nogil
cdef int play_phase(Player p, i64 phase, i64 game) except -1 nogil
@cython.locals(game=i64, parts=i64)
cpdef int play(Player p, i64 begin, i64 end) except -1 nogil
@cython.locals(game=i64, parts=i64)
cpdef int play_phases(Player p, i64 phase, i64 begin, i64 end) except -1 nogil
cpdef int play_phases_aside(Player p, i64 phase, i64 begin, i64 end) except -1
cpdef int play_aside(Player p, i64 begin, i64 end) except -1
