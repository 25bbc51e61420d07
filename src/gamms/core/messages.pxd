cimport cython

from gamms.core cimport draws

ctypedef unsigned char u8
ctypedef unsigned long long u64
ctypedef long long i64

cdef extern from "math.h":
    cpdef double sqrt(double x) noexcept nogil

cdef int IS_HEARD, IS_OVERHEARD, IS_LOST, IS_JAMMED, MAY_USE, MAY_OVERHEAR, MAY_RELAY, IS_MEANT, CAN_HEAR, IN_REACH
cdef i64 NO_ROW, AWAITED, ADMITS, IS_FOR_OTHERS, IS_FOR_SENDER, IS_UNKNOWN


@cython.final
cdef class Channel:
    cdef i64 agents, delay
    cdef double range_m
    cdef bint needs_rows, is_relayed
    cdef const u8[::1] roles
    cdef const i64[::1] jammers
    cdef const double[::1] distances, chances, places, radii


@cython.final
cdef class ChannelNetwork:
    cdef const double[::1] xyz
    cdef const u8[::1] alive, reach
    cdef const u64[::1] names, purposes
    cdef const i64[::1] turns
    cdef i64[::1] slots, awaited, waves, now, next
    cdef u8[::1] jammed, states


@cython.final
cdef class Messages:
    cdef const i64[::1] games, senders, groups, first, members, numbers
    cdef i64[::1] arrivals
    cdef u8[::1] is_known, outcomes


@cython.locals(x=double, y=double, z=double)
cdef double compute_distance(const double[::1] places, i64 k, const double[::1] others, i64 other) noexcept nogil
@cython.locals(k=Py_ssize_t, slope=double)
cpdef double compute_loss_chance(Channel channel, double far) noexcept nogil
@cython.locals(base=i64, i=i64, k=Py_ssize_t, jammer=i64, far=double)
cdef int jam(Channel channel, ChannelNetwork network, i64 game) except -1 nogil
cdef bint is_in_range(Channel channel, ChannelNetwork network, i64 row, i64 other) noexcept nogil
@cython.locals(k=i64, row=i64, base=i64, i=i64)
cpdef int find_in_range(Channel channel, ChannelNetwork network, i64 count, u8[::1] reach) except -1 nogil
@cython.locals(base=i64, name=u64, first=u64, bits=u64)
cdef bint is_lost(Channel channel, ChannelNetwork network, Messages sent, i64 m, i64 by, i64 to) noexcept nogil
@cython.locals(base=i64, i=i64, k=i64)
cdef int prepare(Channel channel, ChannelNetwork network, Messages sent, i64 m) except -1 nogil
@cython.locals(base=i64, found=i64, k=i64, by=i64, at=i64, i=i64, reaches=bint, can_hear=bint)
cdef i64 transmit(Channel channel, ChannelNetwork network, Messages sent, i64 m, i64 wave, i64 transmitters) except -1 nogil
@cython.locals(base=i64, transmitters=i64, wave=i64, is_waiting=bint, k=i64, row=i64)
cdef i64 spread(Channel channel, ChannelNetwork network, Messages sent, i64 m, i64 awaited) except -1 nogil
@cython.locals(at=i64, i=i64, state=int, outcome=int)
cdef int note(Channel channel, ChannelNetwork network, Messages sent, i64 m) except -1 nogil
@cython.locals(m=Py_ssize_t, base=i64, verdict=i64, found=i64, k=i64)
cpdef int admit(
    const i64[::1] games, const i64[::1] senders, const i64[::1] groups, const i64[::1] first, const i64[::1] members,
    const u8[::1] uses, const u8[::1] there, const i64[::1] sizes, i64[::1] left, i64[::1] verdicts
) except -1 nogil
@cython.locals(m=Py_ssize_t, i=Py_ssize_t)
cpdef int count_messages(const i64[::1] games, const i64[::1] senders, i64[::1] counts, i64[::1] numbers) except -1 nogil
@cython.locals(game=i64, m=Py_ssize_t, awaited=i64)
cpdef i64 spread_all(Channel channel, ChannelNetwork network, Messages sent) except -1 nogil
