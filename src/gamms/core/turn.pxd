cimport cython

from gamms.core cimport arrivals, block, conflicts, moves, observe, rules
from gamms.core.agents cimport AgentColumns, AgentView, MoveColumns, MovingAgents, NodeNumbers
from gamms.core.ask cimport ask_each
from gamms.core.conflicts cimport Contests, MoveRequests
from gamms.core.moves cimport OneEdgeMovers
from gamms.core.rules cimport Events, GameColumns, Rule

ctypedef unsigned char u8
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
    cdef const i64[::1] until, stop, map_of
    cdef i64 map
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


@cython.final
cdef class TurnsOfGames:
    cdef const i64[::1] turn
    cdef const u8[::1] going
    cdef i64 last, parts
    cdef i64[::1] until
    cdef u8[::1] over


@cython.locals(game=i64, until=i64)
cpdef int begin_turns(TurnsOfGames t, i64 most) except -1


@cython.final
cdef class LearnerStep:
    cdef TurnsOfGames turns
    cdef observe.LearnerTurn learners
    cdef i64[::1] given
    cdef const double[::1] score
    cdef i64 teams
    cdef observe.Observers observers
    cdef observe.VectorObservations output, last
    cdef observe.NearestAgents room
    cdef const i64[::1] first
    cdef i64[::1] first_node
    cdef readonly i64 num_ended, num_begun


@cython.locals(game=i64, player=Player, one=block.GameStarts)
cpdef int play_step(LearnerStep s, list players, list starts, bint waits, i64 begin, i64 end) except -1
@cython.locals(learner=i64, row=i64, agent=i64)
cdef int take_actions(LearnerStep s, observe.LearnerTurn t, observe.VisibleAgents seen, i64 game) except -1 nogil
@cython.locals(learner=i64, row=i64)
cdef i64 end_step(LearnerStep s, observe.LearnerTurn t, observe.VisibleAgents seen, i64 game) except -1 nogil
@cython.locals(why=u8, is_last=bint)
cdef int show_game(LearnerStep s, observe.LearnerTurn t, i64 game) except -1 nogil
@cython.locals(game=i64, can_begin=bint)
cdef int _begin_aside(
    LearnerStep s, block.GameStarts starts, i64 streets, const u8[::1] ended, i64 begin, i64 end
) except -1
cdef int _begin_again(
    LearnerStep s, observe.LearnerTurn t, block.GameStarts starts, i64 streets, i64 game
) except -1 nogil


@cython.final
cdef class Entry:
    cdef readonly str phase, time
    cdef readonly i64 part
    cdef readonly object play


@cython.final
cdef class TurnPlan:
    cdef public i64 epoch
    cdef readonly object order
    cdef readonly list entries


cdef class TurnDriver:
    cdef public object phase
    cdef public dict phases, spent
    cdef public TurnPlan plan_now
    cdef public i64 first, part

    cpdef bint run_before_moves(self) except -1
    cpdef int begin_moves(self, TurnPlan plan) except -1
    cpdef int end_moves(self) except -1
    cpdef int run_after_moves(self) except -1
    cpdef int end(self) except -1
    cpdef bint is_cut_short(self) except -1
    @cython.locals(plan=TurnPlan)
    cpdef int play_turn(self) except -1
    @cython.locals(entries=list, played=Py_ssize_t, last=Entry)
    cpdef int play_moves(self, TurnPlan plan) except -1
    @cython.locals(phase=object, entry=Entry, number=Py_ssize_t)
    cpdef Py_ssize_t play_entries(self, list entries, i64 epoch) except -1


cdef class ShippedDecisions:
    cdef public GameColumns games
    cdef public OneEdgeMovers movers
    cdef const i64[::1] rows, places, ids
    cdef readonly const u8[::1] decides
    cdef readonly bint remembers

    @cython.locals(games=GameColumns, i=i64, number=i64, place=i64, is_alive=bint)
    cpdef bint load_places(self, AgentColumns columns) except -1
    @cython.locals(games=GameColumns, i=i64)
    cpdef int decide(self, i64 turn, MoveColumns to) except -1


@cython.final
cdef class UnreadStates:
    cdef readonly ShippedDecisions shipped
    cdef readonly object order, part, blocked, team_memories
    cdef readonly bytes memory
    cdef readonly i64 turn


@cython.final
cdef class PartInCore:
    cdef readonly list individuals, sensors, numbers, looks
    cdef readonly MovingAgents moving
    cdef readonly i64 count, version
    cdef readonly bint has_starts, see_world_only, has_plans, is_paced, is_all_ground
    cdef readonly object ground


cdef class Answers:
    cdef public object state, slots, starts, ends, paths
    cdef public MoveColumns moves
    cdef public dict actions
    cdef public list awaited, written, failures

    cpdef int begin(self, object slots, object starts, object ends, MoveColumns moves) except -1
    cpdef int forget(self) except -1


cdef class TurnMovesInCore:
    cdef public object order, starts, ends, paths, slots, by_names
    cdef public bytes took_part
    cdef public dict actions
    cdef public MoveColumns columns
    cdef public i64 applied

    cpdef bint are_steps(self, AgentColumns block) except -1


cdef class NodeConflicts


cdef class GameTurn(TurnDriver):
    cdef public object _ctx, state, make_moves, near, asked_part, travel, order_now, whole
    cdef public object moves_of, checked, rules, collectors, groups
    cdef public NodeConflicts conflicting
    cdef public list observers
    cdef public Answers answers
    cdef public i64 asked, seed_changes
    cdef public bint is_deciding, is_moving, makes_states, are_memories_in_core
    cdef public ShippedDecisions shipped
    cdef public i64 look_again, ask_until, asks_for, unread_turns, shipped_epoch, shipped_seeds
    cdef public object revised, reader, shipped_revision
    cdef public UnreadStates unread
    cdef list _named
    cdef tuple _named_of

    @cython.locals(shipped=ShippedDecisions, to=MoveColumns, is_known=bint, is_unread=bint)
    cpdef bint decide_in_core(self, object order, object part) except -1
    @cython.locals(asked=PartInCore)
    cdef MoveColumns _ask_none(self, object order, object part)
    @cython.locals(to=MoveColumns, both=object)
    cdef MoveColumns _begin_answers(self, object order, PartInCore asked)
    @cython.locals(unread=UnreadStates)
    cdef MoveColumns _ask_rest(self, object order, object rest)
    @cython.locals(moving=MovingAgents)
    cpdef list list_living(self)
    @cython.locals(key=tuple, found=list, columns=AgentColumns, agent=AgentView)
    cdef list _select_living(self, object block, object agents)
    cpdef int play_decisions(self, i64 number) except -1
    @cython.locals(answers=Answers)
    cpdef ask(self, object order, object part, object observers, object paths=*)
    @cython.locals(answers=Answers, asked=PartInCore, alike=list)
    cpdef decide(self, object order, object part, object observers=*, object paths=*)
    @cython.locals(moves=TurnMovesInCore, moving=PartInCore, agents=MovingAgents, block=AgentColumns)
    cpdef int move(self, i64 number) except -1
    @cython.locals(moves=TurnMovesInCore, agents=NodeConflicts)
    cpdef int give_way(self, i64 number) except -1


cdef class NodeConflicts:
    cdef public NodeNumbers numbers
    cdef public MoveColumns rows
    cdef public Contests contests
    cdef public MoveRequests requests
    cdef i64[::1] found
    cdef public bytearray takes_part
    cdef public bytes took_part
    cdef public i64 room
    cdef public object order, conflicts, allow_swaps

    @cython.locals(is_same=bint)
    cpdef bint let_all_go(self, TurnMovesInCore moves, i64 turn) except -1
    cpdef bint write(self, MoveColumns moves) except -1
    cpdef i64 resolve(self, i64 turn) except -1


cdef class RuleOfGame:
    cdef public Events events
    cdef public list in_each_turn
    cdef public object rule

    @cython.locals(rule=Rule)
    cpdef list play(self, object ctx)


cdef class MovesForRules


cdef class RuleMoves:
    cdef public GameColumns games
    cdef public NodeNumbers numbers
    cdef public object rules, order
    cdef public MovesForRules game
    cdef public i64 seeds
    cdef public const i64[::1] slots

    @cython.locals(taken=MoveColumns)
    cpdef int take_steps(self, TurnMovesInCore moves, AgentColumns columns) except -1
    @cython.locals(game=MovesForRules)
    cpdef bint has_room(self) except -1
    @cython.locals(found=RuleOfGame, kept=dict)
    cpdef get_rule(self, object ctx, object form, object key)


cdef class MovesForRules:
    cdef public object phase, state, revised, revision
    cdef public GameTurn turns
    cdef public AgentColumns block
    cdef public object bound
    cdef public RuleMoves now, steps, tracks
    cdef public NodeNumbers numbers, edge_numbers
    cdef public object pieces
    cdef public i64 epoch, keys
    cdef public i64[::1] turn_number
    cdef object _moves
    cdef i64 _version, _turn

    cpdef bint is_of_map(self) except -1
    cpdef int begin(self, object ctx) except -1
    @cython.locals(now=RuleMoves, number=i64, seeds=i64, is_known=bint)
    cpdef get_turn_moves(self, object ctx)
    @cython.locals(moves=TurnMovesInCore)
    cpdef RuleMoves follow_moves(self, object ctx, object moves)
    cpdef RuleMoves get_any_moves(self, object ctx)


@cython.final
cdef class GamePlayer:
    cdef object ctx, find_game, form, key, play
    cdef bint follows
    cdef MovesForRules game
