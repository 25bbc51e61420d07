cimport cython

from gamms.core cimport draws
from gamms.core.rules cimport Games

ctypedef unsigned char u8
ctypedef int i32
ctypedef long long i64
ctypedef unsigned long long u64

cdef u8 STAYS, WALKS, GOES, FOLLOWS, WANDERS, CHASES, FLEES
cdef i64 NOTHING, UNKNOWN
cdef double INFINITE


cpdef i64 next_stop(
    const i64[::1] stops, const i64[::1] following, i64 first, i64 count, i64 at, i64 node
) except? -2 nogil
cpdef i64 turns_left(bint is_there, i64 left, double far) noexcept nogil
@cython.locals(found=i64, number=i64, is_lower=bint)
cpdef i64 farthest(const double[::1] distances, const i64[::1] ids, i64 count) except? -2 nogil


@cython.final
cdef class WayTables:
    cdef i64 nodes
    cdef const i64[::1] tables
    cdef const double[::1] far
    cdef const i32[::1] actions
    cdef i64[::1] wanted
    cdef readonly i64 count
    cdef bint is_missing

    cpdef take(self, const i64[::1] tables, const double[::1] far, const i32[::1] actions)


@cython.final
cdef class Looks:
    cdef const i64[::1] begins
    cdef const double[::1] squares, places
    cdef const u8[::1] shows
    cdef i64 teams


@cython.final
cdef class Steps:
    cdef const i64[::1] begins, first, sizes, numbers, slots, nodes, following
    cdef const u8[::1] kinds


@cython.final
cdef class Strategies:
    cdef Games games
    cdef Steps steps
    cdef WayTables ways
    cdef Looks looks
    cdef const i32[::1] offsets, targets
    cdef const i64[::1] ids
    cdef const u64[::1] keys
    cdef double[::1] safety
    cdef i64[::1] legal
    cdef i64[::1] memory, noted
    cdef u8[::1] has_noted
    cdef i64 drawn


@cython.locals(node=i64, step=i64, kind=u8, action=i64)
cdef i64 act(Strategies p, i64 game, i64 agent) except? -2 nogil
@cython.locals(is_missing=bint, rows=i64, agents=i64, columns=i64, column=i64, agent=i64, place=i64)
cdef int remember(Strategies p, i64 game) except -1 nogil
@cython.locals(table=i64, place=i64)
cdef i64 _place(WayTables ways, i64 node, i64 target) except? -2 nogil
@cython.locals(place=i64)
cdef double _distance(WayTables ways, i64 node, i64 target) except? -1.0 nogil
@cython.locals(place=i64)
cdef i64 _towards(WayTables ways, i64 node, i64 target) except? -2 nogil
cdef i64 _drawn(Strategies p, i64 game, i64 agent, i64 bound) except? -2 nogil
@cython.locals(place=i64)
cdef i64 _known(Strategies p, i64 game, i64 agent, i64 column) except? -2 nogil
@cython.locals(place=i64)
cdef int _note(Strategies p, i64 agent, i64 column, i64 number) except -1 nogil
@cython.locals(first=i64, at=i64, least=double, far=double, number=i64)
cdef i64 _stop(Strategies p, i64 game, i64 agent, i64 step, i64 node) except? -2 nogil
@cython.locals(slot=i64, target=i64, left=i64, far=double)
cdef i64 _waypoint(Strategies p, i64 game, i64 agent, i64 step, i64 node) except? -2 nogil
@cython.locals(at=i64)
cdef bint _sees(Looks looks, Games games, i64 game, i64 agent, i64 other) except -1 nogil
@cython.locals(dx=double, dy=double, square=double, sensor=i64)
cdef bint shows(Looks looks, i64 agent, i64 team, i64 here, i64 there) except -1 nogil
@cython.locals(found=i64, least=double, at=i64, other=i64, far=double)
cdef i64 _nearest_enemy(Strategies p, i64 game, i64 agent, i64 node) except? -2 nogil
@cython.locals(at=i64, count=i64, is_seen=bint, action=i64, other=i64, far=double)
cdef i64 _farthest(Strategies p, i64 game, i64 agent, i64 node) except? -2 nogil
