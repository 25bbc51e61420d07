cimport cython

ctypedef unsigned long long u64
ctypedef long long i64
ctypedef unsigned char u8

cdef u64 MASK, FACTOR
cdef i64 EMPTY, _DRAWN

@cython.locals(i=Py_ssize_t, size=Py_ssize_t, row=i64)
cpdef int gather(const i64[::1] column, const i64[::1] rows, i64[::1] out) except -1 nogil
@cython.locals(i=Py_ssize_t, size=Py_ssize_t, row=i64, end=i64, moved=i64)
cpdef i64 move_rows(i64[::1] node, i64[::1] previous, const i64[::1] rows, const i64[::1] ends) except -1 nogil
@cython.locals(found=Py_ssize_t, place=Py_ssize_t, i=Py_ssize_t)
cpdef Py_ssize_t stop_moves(
    const i64[::1] starts,
    i64[::1] ends,
    int[::1] counts,
    const i64[::1] losers,
    i64[::1] stopped,
    i64[::1] nodes,
) except -1 nogil


cdef class Block:
    cdef public dict columns, sizes
    cdef public Py_ssize_t games
    cdef public bytearray memory
    cdef dict _first, _room, _views
    cdef list _own
    cdef Py_ssize_t _stride

    @cython.locals(first=Py_ssize_t)
    cpdef get_row(self, str name, Py_ssize_t game=*)
    @cython.locals(block=Block, size=Py_ssize_t)
    cpdef copy_row(self, Py_ssize_t source, Py_ssize_t target, Block of=*)
    @cython.locals(copy=Block, size=Py_ssize_t)
    cpdef copy_game(self, Py_ssize_t game=*)
    cdef _begin_own(self, Py_ssize_t game)

cdef _cast_memory(bytearray memory, str code)

@cython.final
cdef class StartColumn:
    cdef u8[::1] target
    cdef const u8[::1] source
    cdef i64[::1] nodes
    cdef i64 size, step
    cdef StartColumn behind
    cdef bint has_nodes, is_last


@cython.final
cdef class GameStarts:
    cdef StartColumn first
    cdef const i64[::1] nodes, streets
    cdef i64[::1] next, now
    cdef i64 agents, ahead

    @cython.locals(place=i64)
    cpdef int begin(self, const i64[::1] games) except -1


@cython.locals(row=i64)
cdef int begin_game(GameStarts s, i64 game) except -1 nogil
@cython.locals(i=i64)
cdef int _copy_start(StartColumn c, const i64[::1] nodes, i64 agents, i64 game, i64 row) except -1 nogil
@cython.locals(i=i64)
cdef int _copy_bytes(u8[::1] target, i64 first, const u8[::1] source, i64 begin, i64 size) except -1 nogil

@cython.final
cdef class RecordTable:
    cdef readonly i64 words, count
    cdef u64[::1] records
    cdef i64[::1] slots

    @cython.locals(i=i64, number=i64)
    cpdef int take_memory(self, u64[::1] records, i64[::1] slots) except -1
    @cython.locals(row=i64, slot=i64, i=i64)
    cpdef int add(self, const u64[::1] rows, i64[::1] out) except -1 nogil

@cython.locals(begin=i64, i=i64, key=u64, last=i64, slot=i64)
cdef i64 find_slot(RecordTable t, const u64[::1] rows, i64 row) except -1 nogil
@cython.locals(first=i64, i=i64)
cdef bint is_equal(RecordTable t, i64 number, const u64[::1] rows, i64 begin) except -1 nogil
