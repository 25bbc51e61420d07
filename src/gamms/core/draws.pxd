cimport cython

ctypedef unsigned long long u64
ctypedef long long i64

cdef u64 MASK, GAMMA, FACTOR_1, FACTOR_2, SIP_0, SIP_1, SIP_2, SIP_3, EIGHT_BYTES, MOST, LOW
cdef u64 PHILOX_0, PHILOX_1, WEYL_0, WEYL_1
cdef int WORDS

cpdef u64 mix(u64 bits) noexcept nogil
cpdef u64 rotate_left(u64 bits, int places) noexcept nogil
@cython.locals(v0=u64, v1=u64, v2=u64, v3=u64, number=int)
cpdef u64 compute_siphash(u64 key_0, u64 key_1, u64 word) noexcept nogil
cpdef u64 compute_first_key(u64 purpose, u64 name) noexcept nogil
cpdef u64 compute_turn_key(u64 first, i64 turn) noexcept nogil
cpdef u64 compute_bits(u64 key, i64 k) noexcept nogil
cpdef u64 convert_to_integer(u64 bits, u64 n) noexcept nogil
cpdef u64 draw_integer(u64 first, i64 turn, i64 k, u64 n) noexcept nogil
cpdef double convert_to_fraction(u64 bits) noexcept nogil
@cython.locals(i=Py_ssize_t)
cpdef int fill_first_keys(const u64[::1] purposes, const u64[::1] names, u64[::1] out) except -1 nogil
@cython.locals(i=Py_ssize_t)
cpdef int fill_turn_keys(const u64[::1] first, const i64[::1] turns, u64[::1] out) except -1 nogil
@cython.locals(i=Py_ssize_t)
cpdef int fill_bits(const u64[::1] keys, const i64[::1] counts, u64[::1] out) except -1 nogil


@cython.locals(middle=u64, crossed=u64)
cdef u64 compute_upper_product(u64 a, u64 b) noexcept nogil
@cython.locals(a=u64, b=u64, c=u64, d=u64, a_next=u64, lower_0=u64, lower_1=u64, _=int)
cdef int put_words(u64 key_0, u64 key_1, u64[::1] out, i64 begin) except -1 nogil
cdef int put_halves(u64 word, u64[::1] out, i64 begin) except -1 nogil
@cython.locals(place=i64)
cdef u64 draw_from_words(const u64[::1] words, i64 begin, u64 n) noexcept nogil
@cython.locals(i=Py_ssize_t)
cpdef int fill_words(const u64[::1] keys, u64[::1] out) except -1 nogil
@cython.locals(i=Py_ssize_t)
cpdef int fill_below_of_words(const u64[::1] words, const i64[::1] n, i64[::1] out) except -1 nogil
@cython.locals(agents=i64, row=i64, i=i64, number=i64)
cpdef int place_agents(const u64[::1] keys, const i64[::1] rows, u64[::1] words, i64[::1] taken, i64[::1] out) except -1 nogil
@cython.locals(low=i64, high=i64, middle=i64, place=i64)
cdef i64 take_free(i64[::1] taken, i64 count, i64 number) except -1 nogil


@cython.final
cdef class RandomChoices:
    cdef const u64[::1] keys
    cdef const i64[::1] counts
    cdef i64[::1] chosen


@cython.locals(place=i64, row=i64)
cdef int choose(RandomChoices choices, i64 at, const i64[::1] agents, i64 begin, i64 end, i64 turn) except -1 nogil


cdef class TurnCounter:
    cdef readonly object clock
    cdef public object before_draws
    cdef readonly object seed
    cdef readonly i64 turn, begun, seeds

    cpdef int rekey(self, object seed) except -1
    @cython.locals(turn=i64)
    cdef i64 _catch_up(self) except? -1


cdef class TurnStream:
    cdef TurnCounter _turns
    cdef i64 _begun, _count, _seeds
    cdef u64 _key, _first

    @cython.locals(turns=TurnCounter, begun=i64)
    cdef int _seek(self) except -1
    cdef u64 _draw_next(self) except? 1
    @cython.locals(bound=u64)
    cpdef object below(self, object n)
    @cython.locals(count=Py_ssize_t, place=Py_ssize_t)
    cpdef object choice(self, object options)
