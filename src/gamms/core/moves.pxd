cimport cython

from gamms.core cimport draws, routes, strategies, travel
from gamms.core.conflicts cimport Contests, MoveRequests, resolve
from gamms.core.rules cimport GameColumns, AgentPaths
from gamms.core.travel cimport TurnPaths

ctypedef unsigned char u8
ctypedef int i32
ctypedef long long i64

cdef u8 STAYS, WALKS, IS_GIVEN, STEPS, KINDS
cdef i64 NONE, HALT


@cython.final
cdef class LegalMoves:
    cdef const i32[::1] offsets, targets
    cdef i64 nodes
    cdef readonly bint are_all_legal


@cython.final
cdef class ChosenRoutes:
    cdef i64 room
    cdef const i64[::1] nodes, counts, motions

    @cython.locals(number=i64)
    cdef Py_ssize_t take(self, i64 row, i64[::1] route) except -2 nogil


cdef class OneEdgeMovers:
    cdef LegalMoves streets
    cdef const u8[::1] decides_by
    cdef draws.RandomChoices walks
    cdef const i64[::1] given, edges
    cdef ChosenRoutes routes
    cdef strategies.Strategies by_steps
    cdef Contests contests
    cdef MoveRequests requests
    cdef bint has_conflicts
    cdef i64[::1] by_kind, kind_ends
    cdef i64[::1] ends, went, counts, moves, blocks, wanted
    cdef u8[::1] takes_part, blocked, held
    cdef const i64[::1] part_of
    cdef i64[::1] part
    cdef i64 parts

    cpdef take(self, LegalMoves streets)
    @cython.locals(count=i64, kind=int, i=i64)
    cpdef sort_kinds(self)
    cdef int take_game(self, GameColumns games, i64 game) except -1 nogil
    cdef int decide(self, GameColumns games, i64 game) except -1 nogil
    @cython.locals(i=i64, row=i64, is_put=bint)
    cdef int settle(self, GameColumns games, i64 game) except -1 nogil
    @cython.locals(i=i64, part=i64, is_loser=bint)
    cdef int give_way(self, GameColumns games, i64 game) except -1 nogil
    cdef int move(self, GameColumns games, i64 game) except -1 nogil
    @cython.locals(at=i64, i=i64, part=i64)
    cdef int go_all(self, GameColumns games, i64 game) except -1 nogil
    cdef bint is_put(self, GameColumns games, i64 game, i64 i) except -1 nogil
    @cython.locals(row=i64)
    cdef bint is_moving(self, GameColumns games, i64 game, i64 i) except -1 nogil
    cdef i64 find_goal(self, i64 row) except -1 nogil
    @cython.locals(row=i64)
    cdef int stay(self, GameColumns games, i64 game, i64 i) except -1 nogil
    @cython.locals(row=i64)
    cdef int stand(self, GameColumns games, i64 game, i64 i) except -1 nogil


cdef class TripMovers(OneEdgeMovers):
    cdef TurnPaths trips
    cdef bint has_all
    cdef i64 first

    cdef int take_game(self, GameColumns games, i64 game) except -1 nogil


@cython.locals(at=i64, first=i64, part=i64, i=i64, row=i64)
cdef int begin_part(GameColumns games, OneEdgeMovers m, i64 game) except -1 nogil
cdef bint is_deciding(OneEdgeMovers m, i64 row, i64 i, i64 part) except -1 nogil
@cython.locals(at=i64, part=i64, place=i64, i=i64)
cdef int stay_all(GameColumns games, OneEdgeMovers m, i64 game) except -1 nogil
@cython.locals(begin=i64, end=i64)
cdef int walk_at_random(GameColumns games, OneEdgeMovers m, i64 game) except -1 nogil
@cython.locals(at=i64, first=i64, part=i64, place=i64, i=i64, row=i64, number=i64)
cdef int take_numbers(GameColumns games, OneEdgeMovers m, i64 game, int kind, const i64[::1] numbers) except -1 nogil
@cython.locals(at=i64, part=i64, place=i64, i=i64)
cdef int follow_steps(GameColumns games, OneEdgeMovers m, i64 game) except -1 nogil


cdef i64 count_legal(LegalMoves s, i64 place) except? -2 nogil
cdef i64 as_legal(i64 number, i64 count) except? -2 nogil
cdef i64 get_legal_node(LegalMoves s, i64 first, i64 node, i64 number) except? -2 nogil
cdef int set_out(GameColumns games, OneEdgeMovers m, i64 row) except -1 nogil
@cython.locals(node=i64)
cdef Py_ssize_t choose_node_by_steps(GameColumns games, OneEdgeMovers m, i64 game, i64 i) except -1 nogil
@cython.locals(node=i64, first=i64, number=i64)
cdef i64 act(strategies.Strategies p, LegalMoves s, i64 game, i64 i) except? -2 nogil
@cython.locals(row=i64, at=i64, place=i64, node=i64)
cpdef int ask(
    strategies.Strategies p, LegalMoves s, const i64[::1] games, const i64[::1] agents, const u8[::1] asked,
    i64[::1] drawn, i64[::1] found
) except -1 nogil
cdef int block_agent(OneEdgeMovers m, i64 row, i64 wanted) except -1 nogil
@cython.locals(row=i64)
cdef bint is_put(GameColumns games, OneEdgeMovers m, i64 game, i64 i) except -1 nogil
cdef bint is_stopped(GameColumns games, OneEdgeMovers m, i64 row, i64 i) except -1 nogil
@cython.locals(part=i64)
cdef int put(GameColumns games, OneEdgeMovers m, i64 row) except -1 nogil
cdef int leave_or_join(GameColumns games, OneEdgeMovers m, i64 row) except -1 nogil
cdef int go(GameColumns games, OneEdgeMovers m, i64 row) except -1 nogil
cdef int end_part(GameColumns games, OneEdgeMovers m, i64 game) except -1 nogil


cdef class PartPaths(AgentPaths):
    cdef OneEdgeMovers movers

    @cython.locals(agent=i64, row=i64, place=i64, part=i64, is_put=bint)
    cdef int fill(self, GameColumns games, i64 game) except -1 nogil


cdef class TripPaths(AgentPaths):
    cdef TripMovers movers
    cdef TurnPaths trips

    cdef int fill(self, GameColumns games, i64 game) except -1 nogil


@cython.locals(agent=i64, row=i64)
cdef int copy_paths(GameColumns games, TripPaths p, i64 game) except -1 nogil
