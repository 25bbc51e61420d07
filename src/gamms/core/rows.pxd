cimport cython

from gamms.core.agents cimport AgentColumns, MoveColumns
from gamms.core.draws cimport TurnCounter

ctypedef long long i64
ctypedef unsigned char u8


@cython.final
cdef class RowColumns:
    cdef const i64[::1] stop, turn, number_of, row_of
    cdef const u8[::1] placed
    cdef i64[::1] node, previous
    cdef u8[::1] alive


cdef class Call:
    cdef public bint is_moving
    cdef public i64 part


cdef class Row:
    cdef readonly i64 number
    cdef RowColumns _games
    cdef public Call _call
    cdef public object _phase, turns, values, seed, _state
    cdef public dict _own, _facts, facts_shown, read, undone
    cdef AgentColumns _columns
    cdef const i64[::1] _places
    cdef public list lasts, _kept
    cdef public object why, raised, journal, look
    cdef public i64 epoch
    cdef public bint shows_more, sees_world_only
    cdef object _count_map_changes
    cdef public object map_changes

    cpdef int take_columns(self, AgentColumns columns, const i64[::1] places) except -1
    @cython.locals(games=RowColumns, columns=AgentColumns, i=Py_ssize_t, at=i64, is_other=bint, are_placed=bint)
    cpdef int show(self) except -1
    @cython.locals(games=RowColumns, columns=AgentColumns, i=Py_ssize_t, at=i64)
    cpdef int take_nodes(self) except -1
    cpdef int show_facts(self, list known, Py_ssize_t at) except -1
    cpdef bint has_changed(self) except -1
    @cython.locals(i=Py_ssize_t, kept=list)
    cpdef bint has_asked(self) except -1
    @cython.locals(last=list)
    cpdef int forget_looks(self) except -1
    @cython.locals(order=object, table=TurnCounter, after=TurnCounter, begun=i64, has_drawn=bint, has_looked=bint)
    cpdef bint call(self, object function, tuple args) except -1
    cdef int _begin(self) except -1
    cdef int _end(self) except -1
    @cython.locals(wanted=i64[::1], is_common=bint)
    cpdef bint ask(self, object asker, Py_ssize_t first) except -1


@cython.locals(i=Py_ssize_t, slot=Py_ssize_t, moves=MoveColumns)
cdef int write_ends(object answers, list slots, i64[::1] ends, Py_ssize_t first) except -1
