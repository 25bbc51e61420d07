cimport cython

from gamms.core cimport block as blocks

ctypedef long long i64


cdef class AgentColumns:
    cdef public object node, previous
    cdef public list progress, teams
    cdef public set _changed, travellers
    cdef public object under_way
    cdef public bint is_closed, is_noting, _have_all_changed
    cdef public i64 version
    cdef object _journal
    cdef i64[::1] _nodes, _origins

    cpdef i64 move_rows(self, const i64[::1] rows, const i64[::1] ends) except -1
    cpdef on_edge(self, Py_ssize_t row)
    @cython.locals(moved=i64)
    cpdef int move_all(self, object rows, object ends) except -1
    @cython.locals(log=list, ids=list)
    cdef int _move(self, Py_ssize_t row, i64 node) except -1
    cdef i64 _node_of(self, Py_ssize_t row) except? -1


@cython.final
cdef class PointedColumns:
    cdef AgentColumns columns
    cdef const i64[::1] node, previous

    @cython.locals(columns=AgentColumns, i=Py_ssize_t, size=Py_ssize_t, first=Py_ssize_t)
    cpdef int point(self, Py_ssize_t game) except -1


@cython.final
cdef class MoveColumns:
    cdef i64[::1] starts, ends


@cython.final
cdef class MovingAgents:
    cdef AgentColumns columns
    cdef const i64[::1] rows
    cdef int[::1] counts, blocked

    @cython.locals(columns=AgentColumns, i=Py_ssize_t, node=i64)
    cpdef int begin(self, MoveColumns moves) except -1
    @cython.locals(i=Py_ssize_t)
    cpdef int count(self, MoveColumns moves) except -1
    cpdef list counted(self)


cdef class AgentView:
    cdef public object _phase, _ctx, _near, strategy, _sensor_list, _shared
    cdef public AgentColumns _block
    cdef public Py_ssize_t _row
    cdef public tuple _carried
    cdef public list _last

    @cython.locals(block=AgentColumns, row=Py_ssize_t, node=i64, seen=list, sensed=dict, state=dict)
    cpdef get_state(self)
    @cython.locals(block=AgentColumns)
    cpdef set_state(self)
