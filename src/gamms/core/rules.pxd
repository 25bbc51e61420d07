cimport cython

from gamms.core cimport contacts, draws
from gamms.core.agents cimport MoveColumns, NodeNumbers
from gamms.core.contacts cimport Contacts, Legs, MotionIntervals, Tracks

ctypedef unsigned char u8
ctypedef unsigned long long u64
ctypedef long long i64

cdef i64 TAG, RESPAWNED, ELIMINATED, TAKE, DROP, CAPTURE, REACH, ARRIVE, END, CALL, ILLEGAL, WAITS, LATE_DEED
cdef i64 NOTHING, RESPAWN, ELIMINATE, FUNCTION, GONE, NOBODY, LEADER, ITS_TEAM
cdef u8 BY_EVENT, BY_TIME



@cython.final
cdef class GameColumns:
    cdef public i64 agents
    cdef i64 teams
    cdef Py_ssize_t rows
    cdef public const i64[::1] order
    cdef bint applies_effects
    cdef i64[::1] node, previous, stops, start, turn
    cdef const i64[::1] home, team, first_node, mode_first
    cdef u8[::1] alive, placed, over
    cdef const u8[::1] plays
    cdef double[::1] score
    cdef i64[::1] edge
    cdef double[::1] share
    cdef i64 nobody

    cdef Py_ssize_t get_row(self, i64 game, i64 agent) noexcept nogil
    cpdef int bind(self, i64[::1] node, i64[::1] previous, u8[::1] alive) except -1


cdef i64 find_first_place(GameColumns games, i64 game, i64 agent) except -1 nogil


@cython.final
cdef class Events:
    cdef readonly i64 room
    cdef public i64 count
    cdef i64 rule
    cdef readonly i64[::1] games, turns, rules, kinds, agents, others, nodes
    cdef readonly double[::1] times

    cpdef int make_room(self, i64 room) except -1 with gil
    @cython.locals(row=i64)
    cdef int put(self, i64 game, i64 turn, i64 rule, i64 kind, i64 agent, i64 other, i64 node) except -1 nogil
    @cython.locals(row=Py_ssize_t)
    cpdef list take_all(self)


@cython.locals(row=i64, node=i64)
cpdef int respawn(GameColumns games, Events events, i64 game, i64 agent) except -1 nogil
@cython.locals(row=i64)
cpdef int eliminate(GameColumns games, Events events, i64 game, i64 agent) except -1 nogil
cpdef int end_game(GameColumns games, Events events, i64 game, i64 rule, i64 winner) except -1 nogil
@cython.locals(first=Py_ssize_t, best=i64, teams=i64, is_alone=bint, team=Py_ssize_t)
cdef i64 find_leader(GameColumns games, i64 game) except? -1 nogil


@cython.locals(agent=i64, row=i64, slot=i64)
cpdef int take_moves(
    GameColumns games, MoveColumns moves, NodeNumbers numbers, const i64[::1] slots, bytes took_part
) except -1


cdef class AgentPaths:
    cdef bint are_one_edge
    cdef i64[::1] nodes, lengths
    cdef double[::1] times

    @cython.locals(agent=i64, row=i64, node=i64)
    cdef int fill(self, GameColumns games, i64 game) except -1 nogil


cdef class GivenPaths(AgentPaths):
    cdef int fill(self, GameColumns games, i64 game) except -1 nogil


cpdef int fill_steps(AgentPaths steps, GameColumns games, i64 game) except -1 nogil

@cython.locals(agent=i64)
cpdef int fill_sides(GameColumns games, i64 game, const i64[::1] plays, i64[::1] sides) except -1 nogil


@cython.locals(found=i64, last=i64, piece=i64, agent=i64)
cdef Py_ssize_t find_arrivals(Tracks tracks, Legs legs, MotionIntervals pieces, const i64[::1] members, const i64[::1] owners, i64 team) except -1 nogil


@cython.final
cdef class Tags:
    cdef i64[::1] taken
    cdef readonly i64 count, number, room
    cdef i64 run
    cdef i64[::1] on_edges, by, a, b, a_nodes, b_nodes, ways, order, spare
    cdef double[::1] times, distances
    cdef u64[::1] draws
    cdef readonly i64[::1] taggings, taggers, others, nodes
    cdef readonly double[::1] moments

    cpdef int make_room(self, i64 room) except -1 with gil
    cdef int begin(self) except -1 nogil
    @cython.locals(is_anywhere=bint, place=i64, contact=i64, a=i64, b=i64, ways=i64, row=i64)
    cdef int add(self, Contacts found, i64 tagging, bint mutual, Territory ground, const i64[::1] team) except -1 nogil
    @cython.locals(one=i64, other=i64, place=i64)
    cdef int _merge(self) except -1 nogil
    cdef bint _is_before(self, i64 one, i64 other) except -1 nogil
    @cython.locals(number=i64, place=i64, row=i64, a=i64, b=i64)
    cdef Py_ssize_t match(self) except -1 nogil
    cdef int _make(self, i64 tag, i64 row, i64 tagger, i64 other, i64 node) except -1 nogil


@cython.final
cdef class Territory:
    cdef const i64[::1] owners, holders
    cdef i64 agents
    cdef bint is_empty

    @cython.locals(owner=i64)
    cdef bint is_own(self, i64 node, i64 agent, i64 team) except -1 nogil


@cython.final
cdef class Tagging:
    cdef public Contacts contacts
    cdef Tagging behind
    cdef int search
    cdef i64 then
    cdef double limit, points
    cdef bint mutual, is_last, ends
    cdef const i64[::1] plays
    cdef public Territory ground
    cdef i64[::1] sides

    cpdef Py_ssize_t find(self, GameColumns games, i64 game) except -1 nogil
    cdef bint may_meet(self, GameColumns games, i64 game) except -1 nogil
    @cython.locals(found=bint, count=i64, agent=i64, row=i64, place=i64)
    cdef bint _share_ends(self, GameColumns games, i64 game, MotionIntervals pieces) except -1 nogil
    cdef int collect(self, Tags tags, GameColumns games, i64 game, i64 number) except -1 nogil
    cdef int score(self, i64 number, GameColumns games, i64 game, i64 tagger) except -1 nogil
    cdef bint follow_up(self, i64 number, GameColumns games, Events events, i64 game, i64 other) except? True nogil
    cdef bint is_ending(self, i64 number) except? True nogil


@cython.final
cdef class Flags:
    cdef i64 flags, goal, involved
    cdef double points
    cdef const i64[::1] team, base, home, takes
    cdef const i64[::1] members
    cdef public Territory ground
    cdef const u64[::1] names, purposes
    cdef i64[::1] carriers, stops, captures
    cdef double[::1] taken

    @cython.locals(flag=i64, agent=i64, row=i64, number=i64)
    cdef int drop(self, GameColumns games, Events events, i64 game, i64 rule) except -1 nogil
    @cython.locals(flag=i64)
    cdef int note_stops(self, GameColumns games, i64 game) except -1 nogil
    @cython.locals(flag=i64, carrier=i64, agent=i64, node=i64)
    cdef bint concern(self, GameColumns games, i64 game) except -1 nogil
    @cython.locals(team=i64)
    cdef bint _may_be_home(self, GameColumns games, i64 game, i64 agent) except -1 nogil
    cdef bint _may_take(self, i64 agent, i64 flag) except -1 nogil
    @cython.locals(flag=i64, now=double)
    cdef int pass_turn(self, GameColumns games, Events events, i64 game, i64 rule, Tracks tracks, Legs legs, MotionIntervals pieces) except -1 nogil
    @cython.locals(piece=i64, flag=i64, agent=i64)
    cdef int _find_involved(self, i64 game, MotionIntervals pieces) except -1 nogil
    @cython.locals(soonest=double, place=i64, since=double)
    cdef double _find_next_moment(self, MotionIntervals pieces, double now) except? -1.0 nogil
    @cython.locals(row=i64, agent=i64, place=i64, piece=i64, team=i64)
    cdef int _capture(self, GameColumns games, Events events, i64 game, i64 rule, MotionIntervals pieces, i64 flag, double now) except -1 nogil
    @cython.locals(agent=i64, found=bint, team=i64)
    cdef bint _is_home(self, GameColumns games, i64 game, i64 carrier, i64 node) except -1 nogil
    @cython.locals(row=i64, taker=i64, least=u64, bits=u64, first=u64, place=i64, piece=i64, agent=i64)
    cdef int _take(self, GameColumns games, Events events, i64 game, i64 rule, MotionIntervals pieces, i64 flag, double now) except -1 nogil
    @cython.locals(flag=i64, found=bint)
    cdef bint _is_carrying(self, i64 game, i64 agent) except -1 nogil
    @cython.locals(winner=i64, full=i64, team=i64)
    cdef bint _end(self, GameColumns games, Events events, i64 game, i64 rule) except -1 nogil


cdef class Rule:
    cdef GameColumns games
    cdef Events events
    cdef i64 number
    cdef public Rule behind
    cdef public bint is_last

    cdef int happen(self, i64 game) except -1 nogil
    cdef int happen_all(self, i64 game) except -1 nogil


cpdef int play(Rule rule, i64 game) except -1 nogil
@cython.locals(place=Py_ssize_t)
cpdef int play_games(Rule rule, const i64[::1] games) except -1 nogil


cdef class TagRule(Rule):
    cdef Tagging first
    cdef Tags tags
    cdef AgentPaths steps
    cdef u64[::1] purpose
    cdef i64[::1] turn
    cdef const u64[::1] purposes

    @cython.locals(number=i64, tag=i64, tagger=i64, other=i64, by=i64)
    cdef int happen(self, i64 game) except -1 nogil
    @cython.locals(rule=i64, winner=i64, tag=i64, by=i64, team=i64)
    cdef int _end(self, i64 game) except -1 nogil


@cython.final
cdef class Visitors:
    cdef AgentPaths steps
    cdef Tracks tracks
    cdef Legs legs
    cdef MotionIntervals pieces
    cdef const i64[::1] ground
    cdef i64[::1] sides

    cdef int follow(self, GameColumns games, i64 game) except -1 nogil


cdef class FlagRule(Rule):
    cdef Flags flags
    cdef Visitors visitors

    cdef int happen(self, i64 game) except -1 nogil


cdef class RespawnRule(Rule):
    cdef const i64[::1] plays
    cdef i64[::1] out, times
    cdef i64 wait, most

    @cython.locals(first=i64, agent=i64, place=i64, row=i64)
    cdef int happen(self, i64 game) except -1 nogil


cdef class TimeLimitRule(Rule):
    cdef i64 last, winner

    cdef int happen(self, i64 game) except -1 nogil


cdef class NoneLeftRule(Rule):
    cdef i64 team, winner
    cdef const i64[::1] members

    @cython.locals(agent=i64, row=i64, has_come=bint)
    cdef int happen(self, i64 game) except -1 nogil


cdef class LastTeamRule(Rule):
    @cython.locals(left=i64, agent=i64, team=i64)
    cdef int happen(self, i64 game) except -1 nogil


cdef class ReachRule(Rule):
    cdef Visitors visitors
    cdef MotionIntervals pieces
    cdef const i64[::1] starters, order
    cdef i64[::1] goals
    cdef i64 winner
    cdef double points

    cdef int happen(self, i64 game) except -1 nogil
    @cython.locals(place=Py_ssize_t, home=i64)
    cdef int _mark_starts(self, i64 game, i64 mark) except -1 nogil
    @cython.locals(earliest=double, piece=i64, since=double, is_first=bint, teams=i64, winner=i64, place=Py_ssize_t, team=i64, last=i64, agent=i64, node=i64)
    cdef int _reach(self, i64 game) except -1 nogil
    cdef bint _is_goal(self, i64 piece, i64 team) except -1 nogil


cdef class ArriveRule(Rule):
    cdef Visitors visitors
    cdef MotionIntervals pieces
    cdef i64 team
    cdef const i64[::1] starters
    cdef i64[::1] owners
    cdef double points

    @cython.locals(found=i64, place=i64, piece=i64, agent=i64)
    cdef int happen(self, i64 game) except -1 nogil
    @cython.locals(agent=Py_ssize_t, home=i64)
    cdef int _mark_starts(self, i64 game, i64 mark) except -1 nogil
