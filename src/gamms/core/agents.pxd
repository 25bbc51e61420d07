cimport cython

from gamms.core cimport block as blocks

ctypedef long long i64
ctypedef unsigned long long u64
ctypedef unsigned char u8

cdef u64 MASK, SPREAD
cdef i64 FIRST_ROOM


@cython.final
cdef class MoveColumns:
    cdef i64[::1] starts, ends


@cython.locals(last=i64, slot=i64)
cdef i64 find_slot(const i64[::1] slots, const i64[::1] ids, i64 id) except -1 nogil


@cython.final
cdef class NodeNumbers:
    cdef readonly i64 count, room, dense
    cdef dict known
    cdef object lock
    cdef readonly i64[::1] ids
    cdef i64[::1] slots

    @cython.locals(ids=i64[::1], slots=i64[::1], number=Py_ssize_t)
    cpdef int make_room(self, i64 places) except -1
    @cython.locals(last=i64, slot=i64, number=i64)
    cpdef Py_ssize_t number(self, i64 id) except -1 nogil
    cdef Py_ssize_t add(self, i64 id) except -1 with gil
    @cython.locals(slot=i64)
    cdef Py_ssize_t enter(self, i64 id) except -1 nogil
    cpdef learn(self, object id)
    @cython.locals(row=Py_ssize_t)
    cpdef int write(self, const i64[::1] ids, i64[::1] numbers) except -1 nogil
    cpdef int write_moves(self, MoveColumns moves, MoveColumns numbers) except -1 nogil
    @cython.locals(row=Py_ssize_t)
    cpdef int write_ids(self, const i64[::1] numbers, i64[::1] ids) except -1 nogil


@cython.locals(dense=i64, places=i64, place=Py_ssize_t, found=NodeNumbers)
cpdef number_nodes(const i64[::1] ids)


cdef class AgentColumns:
    cdef public object alive, node, previous, share
    cdef public list teams
    cdef public set _changed, travellers
    cdef public object under_way
    cdef public bint is_closed, is_noting, _have_all_changed
    cdef public i64 version
    cdef public NodeNumbers numbers, _edge_numbers
    cdef object _journal
    cdef i64[::1] _goals, _nodes, _origins
    cdef const i64[::1] _edges, _motions, _sources, _targets
    cdef const double[::1] _shares
    cdef const u8[::1] _lives

    cpdef i64 get_node(self, Py_ssize_t row) except? -1
    cpdef i64 get_previous_node(self, Py_ssize_t row) except? -1
    cpdef get_ids(self, object numbers)
    cpdef get_edge_position(self, Py_ssize_t row)
    @cython.locals(share=double, edge=i64, ids=i64[::1])
    cpdef get_progress(self, Py_ssize_t row)
    @cython.locals(moved=i64, goals=i64[::1])
    cpdef int move_all(self, object rows, object ends) except -1
    @cython.locals(log=list, ids=list)
    cdef int _move(self, Py_ssize_t row, i64 node, i64 number) except -1
    cdef i64 _get_node(self, Py_ssize_t row) except? -1


@cython.final
cdef class MovingAgents:
    cdef AgentColumns columns
    cdef const i64[::1] rows
    cdef readonly bytearray takes_part, has_begun
    cdef readonly bytes lives
    cdef u8[::1] _takes_part, _has_begun
    cdef readonly bint are_all
    cdef int[::1] counts, blocked

    @cython.locals(columns=AgentColumns, i=Py_ssize_t, is_alive=u8, are_all=bint, are_new=bint, is_other=bint)
    cpdef bint take_lives(self) except -1
    cpdef let_take_part(self, bytes lives)
    @cython.locals(i=Py_ssize_t)
    cpdef int leave_out(self, i64[::1] starts, i64[::1] ends, bytes took_part) except -1
    @cython.locals(i=Py_ssize_t, found=list)
    cpdef select_present(self, object agents)
    @cython.locals(columns=AgentColumns, i=Py_ssize_t, found=list)
    cpdef list select_living(self, list agents)
    @cython.locals(columns=AgentColumns, i=Py_ssize_t, node=i64)
    cpdef int begin(self, MoveColumns moves) except -1
    @cython.locals(i=Py_ssize_t)
    cpdef int count(self, MoveColumns moves) except -1
    cpdef list list_counted(self)


cdef class AgentView:
    cdef public object _phase, _ctx, _near, strategy, _sensor_list, _shared
    cdef public AgentColumns _block
    cdef public Py_ssize_t _row
    cdef public tuple _carried
    cdef public list _last

    @cython.locals(block=AgentColumns, row=Py_ssize_t, node=i64, share=double, seen=list, sensed=dict, state=dict)
    cpdef get_state(self)
    @cython.locals(block=AgentColumns, numbers=NodeNumbers)
    cpdef set_state(self)
