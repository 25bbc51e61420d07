"""What the core plays in one game: the decisions of shipped strategies, and whole turns of games of shipped parts.

In each turn the core decides for the agents whose strategies it has: `ShippedAgents`, which `ShippedFinder` makes. All
other phases are those of the turn engine, and the states of these agents are made when one is read; see
`core.turn.GameTurn.decide_in_core`.

A run has to call Python in every turn if a strategy, a rule, a sensor or a listener of the program takes part in it.
If none does, the core plays the turns: `GameInCore`. The last turn of each agent leaves something that can be read: its
state, the data of its sensors, and `ctx.game.moves`. For agents that are eliminated before the end of the run, the turn
engine plays that turn at once. For the others it plays the moves of the last turn again when something of this is read,
or before anything changes; see `DecidePhase.leave_unread`.
"""

from collections.abc import Callable, Collection, Iterator
from time import perf_counter
from typing import Any

import numpy as np

from gamms import kernels
from gamms.core import rules
from gamms.core.copies import refill_each
from gamms.core.turn import ShippedDecisions
from gamms.errors import BadValue, UnknownName
from gamms.game.block.columns import AgentTable, PlayedGame, find_decider, get_sensors, list_agents, make_roster
from gamms.game.block.in_core import CoreColumns, CoreGames, find_core_forms, list_called_rules
from gamms.game.block.initial_state import InitialState, make_movement
from gamms.game.block.sensing import list_sensors_called_each_turn
from gamms.game.block.state import GameArrays, is_exact_float
from gamms.game.block.strategy_steps import begin_steps, can_read, list_memories
from gamms.game.conflicts import find_unranked, flatten
from gamms.game.order import TurnOrder
from gamms.game.plan import find_first_called
from gamms.game.settings import NamedRule, as_called, refuse_unused
from gamms.game.slots import COUNTED, Slots
from gamms.game.strategy_specs import Same, get_strategy_spec
from gamms.ir.agents import show_lives, show_positions, show_progress
from gamms.ir.game_state import BlockedAgents, GameState, describe_conflict
from gamms.ir.graph import IntArray, split_mode
from gamms.ir.obstacles import BoolArray
from gamms.progress import delay_interrupts

_GAME = np.zeros(1, np.int64)  # the number of the only game
_ELIMINATED = rules.KINDS.index("eliminated")
_MOMENT_S = 0.1  # that the core plays at once, so that Ctrl-C is noticed
_SHORTEST_S = 1e-6  # that a clock can measure
_FIRST_TURNS = 64  # that it plays at once, until their time is known
PATIENCE = 1.0  # before columns are made, asking agents has cost so many times as much as making them
_ASKS_A_GAME = 200  # to make columns takes as long as to ask so many agents,
_ASKS_AN_AGENT = 7  # and so many for each agent,
_NODES_AN_ASK = 20  # and one for so many nodes of the map
_ASKS_A_SLOT = 20  # to make the slot and the state of an agent takes as long as to ask so many
_NEVER = 1 << 62  # a turn that no game reaches
FEWEST_TURNS = 20  # of a run: to read the game into columns takes as long as the turn engine takes for these
_FIRST_READING = 20  # turns that it takes longer at first
_NODES_A_TURN = 50  # to read so many nodes of the map, at first, takes as long as the turn engine takes for a turn


def find_game_in_core(game: PlayedGame, last: int | None, known: "GameInCore | None") -> "GameInCore | None":
    """Return a game as a game of the core; None: Python takes part in its turns, or they are few.

    Args:
        game: the game, which has begun.
        last: the last turn of the run; None: only rules end the game.
        known: the earlier result for this game, which is reused if it still fits; None: there is none.
    """
    more = 0 if known is not None else _FIRST_READING + len(game.ctx.graph.graph) // _NODES_A_TURN
    visual = game.ctx.visual_engine
    past = visual.quiet_turns() if hasattr(visual, "quiet_turns") else None
    are_few = last is not None and last - game.turn < FEWEST_TURNS + more
    if are_few or past is None or game.ctx.agent.block.is_noting or not _may_be_in_core(game):
        if known is not None:
            known.make_last_turn()
        return None
    refuse_unused(game.internals.parts.settings)
    game.internals.parts.turns.note_departed()
    roster = make_roster(game)
    key = _make_key(game, roster, past)
    is_known = known is not None and known.key == key
    game.internals.parts.turns.forget_states()
    if known is not None:
        known.make_last_turn(is_replaced=is_known)
    try:
        if known is not None and is_known:
            known.read()
            return known
        return GameInCore(game, roster, key, past) if _is_in_core(game, roster) else None
    except (BadValue, UnknownName):  # an agent began, or was before, on a node that has been removed
        return None


def calls_functions(game: PlayedGame) -> bool:
    """Return whether functions of the program take part in the turns of a game."""
    may_be_quiet = hasattr(game.ctx.visual_engine, "quiet_turns") and _may_be_in_core(game)
    return not may_be_quiet or find_first_called(game, make_roster(game)) is not None


def _may_be_in_core(game: PlayedGame) -> bool:
    """Return False if a quick look shows that Python takes part in the turns of a game."""
    settings = game.settings()
    plans = settings["plans"]
    parts = game.internals.parts
    strategies = {id(one): one for one in game.ctx.agent.storage.list_strategies() if one is not None}
    deciders = [*strategies.values(), *(plan.function for plan in plans.values())]
    are_called = parts.collectors.by_name or game.internals.after_observing or parts.rules.now.act_before_moves
    return (
        all(get_strategy_spec(one).is_in_core for one in deciders)
        and all(one.spec.core_form is not None and not one.spec.is_array_function for one in game.rules)
        and not (are_called or settings["channels"] or settings["deeds"] or settings["time_budget"])
        and not game.ctx.agent.block.flyers
        and not any(mode is not None and split_mode(mode)[1] for mode in game.ctx.agent.block.modes)
        and settings["decide"] == "turn"  # all living agents decide in the last turn
        and all(type(score) in (int, float) and is_exact_float(score) for score in game.scores.values())
        and game.internals.state.parts_played is None
    )


def _is_in_core(game: PlayedGame, roster: AgentTable) -> bool:
    """Return whether the core can play whole turns of a game; see `_may_be_in_core`."""
    settings = game.settings()
    left_out = roster.find_unlisted(settings["order"])
    left_out |= find_unranked(settings["conflicts"], roster.names, roster.list_teams())
    return (
        find_first_called(game, roster) is None
        and all(one.spec.core_form is not None for one in list_called_rules(game, roster))
        and not left_out.any()
    )


def _make_key(game: PlayedGame, roster: AgentTable, past: Any) -> tuple[Any, ...]:
    """Return a key that is equal as long as the columns of a game, and its rules in the core, stay the same."""
    agents = roster.agents
    block = game.ctx.agent.block
    own = {one.spec.key for one in game.rules}
    facts = {name: Same(value) for name, value in game.facts.items() if name not in own}
    return (
        *(roster.names, roster.teams, roster.team_of.tolist(), list(block.names), block.speed.tobytes()),
        *([getattr(agent, "strategy", None) for agent in agents], game.rules, facts),
        *(past, game.ctx.graph.graph, game.ctx.graph.storage.count_changes()),
        [Same(value) for value in game.settings().values()],
        [tuple(get_sensors(agent).items()) for agent in agents],
        game.internals.parts.turns.phase.sensor_changes,
    )


class ShippedAgents(ShippedDecisions):
    """The decisions of those agents of one game that have shipped strategies.

    Args:
        game: the game; it has begun.
        slots: the slots of all agents, dead or alive.
        roster: the same agents.
        decides: (agents,) whether the core decides for each.
    """

    def __init__(self, game: PlayedGame, slots: Slots, roster: AgentTable, decides: BoolArray) -> None:
        self._game = game
        self._slots = slots
        self._versions = _list_versions(game)
        self._inactive: frozenset[int] | None = None
        self._names = {name for name, is_own in zip(roster.names, decides.tolist(), strict=True) if is_own}
        movement = make_movement(game, roster)
        state = GameArrays(roster, movement, [game.ctx.seed], np.zeros((1, len(roster.names)), np.int64))
        if game.settings()["team_memory"]:
            state.share_memories()
        self._state = state
        block = CoreColumns([state], np.zeros(1, np.int64))
        block.until[:] = 1
        self._core = CoreGames(game, state, block, is_apart=False, decides=True).begin()
        self._core.prepare(None, 1)
        plans = game.settings()["plans"]
        deciders = [find_decider(agent, plans) for agent in roster.agents if agent.name in self._names]
        steps = [step for one in deciders for step in get_strategy_spec(one).core_steps or () if step.key]
        self._steps = list({step.key: step for step in steps}.values())
        self._before = self._core.memory  # before the last turn
        columns = movement.streets.columns
        numbers = game.ctx.agent.block.numbers
        numbers.write(columns.node_ids.data, np.empty(len(columns.node_ids), np.int64).data)  # number them all
        places = kernels.find_rows(columns.node_ids, np.asarray(numbers.ids)[: numbers.count], columns.node_order)
        super().__init__(
            *self._core.deciders,
            flatten(decides, np.uint8),
            slots.selection.buffer,
            flatten(places, np.int64),
            flatten(columns.node_ids, np.int64),
            remembers=bool(self._steps),
        )

    def is_of(self, game: PlayedGame, slots: Slots) -> bool:
        """Return whether the agents of a game, their strategies and the map are the same as when this was made."""
        return slots is self._slots and self._versions == _list_versions(game)

    def begin_memories(self, inactive: Collection[int]) -> None:
        """Make the memories of the living agents that have none yet; `inactive` are the rows of the dead."""
        if inactive == self._inactive:
            return
        rows = self._slots.selection.rows
        was_out = self._inactive
        self._inactive = frozenset(inactive)
        memory_of = self._game.internals.state.get_memory
        for name, row in zip(self._slots.names, rows, strict=True):
            if row not in inactive and (was_out is None or row in was_out):
                memory_of(name)

    def take_memories(self, *, are_known: bool) -> bool:
        """Prepare the memories for a turn; return False if one has a form that strategies do not write."""
        if not (are_known or self._read_memories()):
            return False
        self._before = self._core.memory.copy()
        return True

    def _read_memories(self) -> bool:
        game = self._game
        find = game.ctx.graph.graph.get_node
        known = [memory for name, memory in game.internals.state.memories.items() if name in self._names]
        if not all(can_read(self._steps, memory, find) for memory in known):
            return False
        for key, columns in begin_steps(self._steps, game.ctx, self._state).items():
            for name, values in columns.items():
                self._state.kept[key][name][...] = values
        self._core.prepare(None, 1)
        return True

    def show_memories(self, *, of_start: bool) -> None:
        """Show the present memories of agents in the game, or those before the last turn."""
        memory = self._core.memory
        now = memory.copy()
        if of_start:
            memory[...] = self._before
        self._core.finish()
        memory[...] = now
        memory_of = self._game.internals.state.get_memory
        for name, key, value in list_memories(self._state, self._steps):
            if name in self._names:
                memory_of(name)[key] = value


def _list_versions(game: PlayedGame) -> tuple[Any, ...]:
    """Return the versions of sensors, seed and map, on which the decisions of shipped strategies depend."""
    turns = game.internals.parts.turns
    return turns.phase.sensor_changes, turns.seed_changes, game.ctx.graph.graph.revision


class ShippedFinder:
    """Finds the decisions of the agents of a game in the core, as `ShippedAgents`.

    Args:
        game: the game.
    """

    def __init__(self, game: PlayedGame) -> None:
        self._game = game
        self._known: ShippedAgents | None = None
        self._slots: Slots | None = None  # of the last call
        self._versions: tuple[Any, ...] = ()
        self._asked = 0  # how often agents had been asked when this was new

    def find(self, order: TurnOrder) -> tuple[ShippedAgents | None, int]:
        """Return the decisions; None: Python has to decide for all agents, or to make them does not pay yet.

        Args:
            order: the agents.

        Returns:
            Also the turn in which to call this again, unless the agents or the settings change before.
        """
        game = self._game
        slots = order.slots
        if self._known is not None and self._known.is_of(game, slots):
            self._known.begin_memories(order.block.inactive)
            return self._known, 0
        self._known = None
        wait = self._count_turns_to_wait(order)
        if wait > 0:
            return None, game.turn + wait
        if not _may_decide(game, order):
            return None, _NEVER
        roster = AgentTable.of(list_agents(game))
        decides = _find_agents_in_core(game, roster)
        if not decides.any():
            return None, _NEVER
        try:
            self._known = ShippedAgents(game, slots, roster, decides)
        except (BadValue, UnknownName):  # a strategy names a node that has been removed
            return None, _NEVER
        self._known.begin_memories(order.block.inactive)
        return self._known, 0

    def _count_turns_to_wait(self, order: TurnOrder) -> int:
        """Return the number of turns after which asking agents has cost as much as making the columns.

        Costs are counted in agents that are asked. The slots that are not made yet count as saved.
        """
        game = self._game
        slots = order.slots
        versions = _list_versions(game)
        turns = game.internals.parts.turns
        asked = turns.asked
        if slots is not self._slots or versions != self._versions:
            # with another seed, the turns that the core has decided before pay for the new columns
            self._asked = asked - turns.unread_turns if slots is self._slots else asked
            turns.unread_turns = 0
            self._slots = slots
            self._versions = versions
        agents = len(order.slots)
        cost = _ASKS_A_GAME + _ASKS_AN_AGENT * agents + len(game.ctx.graph.graph) // _NODES_AN_ASK
        saved = max(agents - 1, 1)  # in each turn
        spent = (asked - self._asked) * saved + (0 if slots.has_made else _ASKS_A_SLOT * agents)
        return -(-int(PATIENCE * cost - spent) // saved)


def _may_decide(game: PlayedGame, order: TurnOrder) -> bool:
    """Return False if a quick look shows that Python has to decide for all agents."""
    slots = order.slots
    if order.has_parts or order.has_channels or order.has_deeds or order.block.has_teams or not slots.are_plain:
        return False
    if game.ctx.graph.graph.revision is None:
        return False
    settings = game.settings()
    strategies = {id(one): one for one in game.ctx.agent.storage.list_strategies() if one is not None}
    deciders = [*strategies.values(), *(plan.function for plan in settings["plans"].values())]
    return settings["time_budget"] is None and any(get_strategy_spec(one).is_in_core for one in deciders)


def _find_agents_in_core(game: PlayedGame, roster: AgentTable) -> BoolArray:
    """Return for which agents the core decides, (agents,); for all, none or some."""
    plans = game.settings()["plans"]
    deciders = [find_decider(agent, plans) for agent in roster.agents]
    kinds = {id(one): one for one in deciders}
    in_core = {key: one is None or get_strategy_spec(one).is_in_core for key, one in kinds.items()}
    forms = find_core_forms(game, roster)
    each = zip(forms, deciders, roster.agents, strict=True)
    are_known = [
        form is not None and in_core[id(one)] and not list_sensors_called_each_turn(agent) for form, one, agent in each
    ]
    found = np.array(are_known, np.bool_)
    if not found.all():
        _leave_out_sharers(found, roster)
    has_decider = np.array([one is not None for one in deciders], np.bool_)
    return found if (found & has_decider).any() else np.zeros_like(found)


def _leave_out_sharers(found: BoolArray, roster: AgentTable) -> None:
    """Leave out agents that share a sensor with one that is asked: the sensor shows the last look of all."""
    sensors = [{id(sensor) for sensor in get_sensors(agent).values()} for agent in roster.agents]
    new = np.flatnonzero(~found).tolist()
    while new:
        seen = {sensor for i in new for sensor in sensors[i]}
        new = [i for i in np.flatnonzero(found).tolist() if not seen.isdisjoint(sensors[i])]
        found[new] = False


class LastTurns:
    """The turns that the core has played last, and the state of the game in the context before them.

    Args:
        undo: undoes them in the columns.
        turn: the turn that the context shows before them.
        values: the state of the game in the context.
        are_some_out: whether agents were eliminated in the last of them.

    Attributes:
        undo, turn, are_some_out: see the arguments.
    """

    def __init__(self, undo: Callable[[], None], turn: int, values: GameState, *, are_some_out: bool) -> None:
        self.undo = undo
        self.turn = turn
        self.are_some_out = are_some_out
        self._blocked = BlockedAgents(values.blocked)
        self._num_errors = len(values.errors)

    def show(self, values: GameState, turn: int) -> dict[str, Any]:
        """Show what the moves after a turn depend on, as before these turns; return the fields as they were."""
        before = {
            "turn": turn,
            "over": None,
            "blocked": self._blocked,
            "errors": values.errors[: self._num_errors],
            "timings": dict(values.timings),
        }
        now = {name: getattr(values, name) for name in before}
        for name, value in before.items():
            setattr(values, name, value)
        return now


class GameInCore:
    """A game of shipped parts in the core: its columns, and how they are read from the context and shown in it.

    Args:
        game: the game; it has begun.
        roster: its agents.
        key: the result of `_make_key` for the game.
        past: the turns that the visual engine remembers. Any: the class is of that package.

    Attributes:
        key: see above.
    """

    def __init__(self, game: PlayedGame, roster: AgentTable, key: tuple[Any, ...], past: Any) -> None:
        self.key = key
        self._past = past
        self._game = game
        self._roster = roster
        movement = make_movement(game, roster)
        begin = movement.streets.rows(np.array([roster.list_start_nodes(game)]))
        state = GameArrays(roster, movement, [game.ctx.seed], begin)
        settings = game.settings()
        if settings["team_memory"]:
            state.share_memories()
        self._state = state
        self._on_edges = movement.make_progress if movement.by_metres else None
        self._columns = CoreColumns([state], np.zeros(1, np.int64))
        state.facts.update(game.facts)
        for rule in list_called_rules(game, roster):
            if rule.spec.prepare_arrays is not None:
                rule.spec.prepare_arrays(state)
        deciders = [find_decider(agent, settings["plans"]) for agent in roster.agents]
        self._decides = np.array([one is not None for one in deciders], np.bool_)
        self._steps = [step for one in deciders for step in get_strategy_spec(one).core_steps or () if step.key]
        self._read(begin)
        self._core = CoreGames(game, state, self._columns, is_apart=False, past_turns=past.room + 1).begin()
        block = game.ctx.agent.block
        number = {name: i for i, name in enumerate(roster.names)}
        self._by_row = np.array([number[name] for name in block.names], np.int64)  # the number of the agent of each row
        self._seconds = np.inf  # that the last turns took, each
        self._last_turns: LastTurns | None = None

    def _read(self, begin: IntArray) -> None:
        """Copy the state of the game to the columns; `begin` are the start nodes of agents, (1, agents)."""
        game = self._game
        state = self._state
        game.internals.parts.turns.update_counts()
        state.reset([game.ctx.seed], begin)
        InitialState(game, state, self._columns).put_values(state, _GAME)
        for key, kept in state.kept.items():
            for name, values in state.first.get(key, {}).items():
                kept[name][...] = values
        for number in np.flatnonzero(state.alive[0] & self._decides).tolist():
            game.internals.state.get_memory(self._roster.names[number])
        self._shown = game.turn  # the last turn that the context shows

    def read(self) -> None:
        """Copy the state of the game to the columns, which are older."""
        self._read(self._state.streets.rows(np.array([self._roster.list_start_nodes(self._game)])))

    def play_ahead(self, last: int | None, after_turns: Callable[[int], None]) -> Iterator[bool]:
        """Play turns until the end; yield True if the turn engine has to play the next one, False when all are played.

        The context shows the game at these moments, and after an interruption.

        Args:
            last: the last turn; None: only rules end the game.
            after_turns: called with the number of turns played, several times a second.
        """
        try:
            yield from self._step_turns(last, after_turns)
        except KeyboardInterrupt:
            self._show()
            raise

    def _step_turns(self, last: int | None, after_turns: Callable[[int], None]) -> Iterator[bool]:
        state = self._state
        turns = self._game.internals.parts.turns
        is_going = True
        are_some_out = False
        while is_going:
            turn = int(state.turn[0])
            most = _FIRST_TURNS if self._seconds == np.inf else max(1, int(_MOMENT_S / self._seconds))
            undo = state.checkpoint(self._core.moves)
            began = perf_counter()
            self._play_to(turn + most if last is None else min(turn + most, last))
            played = int(state.turn[0])
            self._seconds = max(perf_counter() - began, _SHORTEST_S) / max(played - turn, 1)
            is_going = bool(state.is_going[0]) and played != last
            left = self._list_last_turns(turn)
            if not is_going and left[-1:] == [played]:
                are_some_out = True
                left.pop()
            if left:
                undo()
            for number in left:
                self._play_to(number - 1)
                self._show()
                turns.makes_states = True
                try:
                    yield True
                finally:
                    turns.makes_states = False
                self._play_to(number)
                self._shown = number
            self._play_to(played)
            after_turns(played)
        last_turns = LastTurns(undo, self._shown, self._game.internals.state, are_some_out=are_some_out)
        self._show()
        self._last_turns = last_turns
        yield False

    @property
    def read_turn(self) -> Callable[[], None] | None:
        """A function that makes the end of the last turn, which the turn engine has not played; None: it is made."""
        return None if self._last_turns is None else self.make_last_turn

    def forget_last_turn(self) -> None:
        """Do not play the last turn again."""
        self._last_turns = None

    def make_last_turn(self, *, is_replaced: bool = False) -> None:
        """Play the moves of the last turn again with the turn engine, unless it has played them.

        Args:
            is_replaced: whether all living agents will have other last turns; then this one is only made for agents
                that were eliminated in it.
        """
        before = self._last_turns
        self._last_turns = None
        if before is None or (is_replaced and not before.are_some_out):
            return
        values = self._game.internals.state
        turns = self._game.internals.parts.turns
        turn = values.turn
        memories = {name: dict(memory) for name, memory in values.memories.items()}
        with delay_interrupts():
            before.undo()
            self._play_to(before.turn)
            self._play_to(turn - 1)
            now = before.show(values, turn - 1)
            self._show_agents()
            self._show_memories(values)
            self._show_blocked(values, self._state.errors.list_entries(0)[len(values.errors) :])
            self._shown = turn - 1
            try:
                turns.is_playing = True
                turns.repeat_moves()
            finally:
                turns.is_playing = False
                for name, value in now.items():
                    setattr(values, name, value)
                self._play_to(turn)
                self._show_agents()
                refill_each(values.memories, memories)
                self._show_counts(values)
                turns.show_blocked()
                self._shown = turn

    def _play_to(self, turn: int) -> None:
        """Play until this turn has ended."""
        if turn <= self._state.turn[0]:
            return
        core = self._core
        columns = self._columns
        with delay_interrupts():
            columns.until[:] = turn * core.num_parts
            core.prepare(None, 1)
            columns.give()
            core.play_part(0, 0, 1, None)
            core.finish()
            columns.take_in()

    def _list_last_turns(self, turn: int) -> list[int]:
        """Return the turns after `turn`, ascending, in which agents took part last that were eliminated in them."""
        now = int(self._state.turn[0])
        takes_part = self._columns.takes_part[0]
        last = {
            number for agent, number in self._find_eliminated_agents().items() if number == now or not takes_part[agent]
        }
        return sorted(number for number in last if number > turn)

    def _find_eliminated_agents(self) -> dict[int, int]:
        """Return agent -> the last turn in which it was eliminated, of the turns played last."""
        noted = self._columns.noted
        if noted is None:
            return {}
        those = noted.select(noted.kinds == _ELIMINATED)
        return dict(zip(those.agents.tolist(), those.turns.tolist(), strict=True))

    # -- showing ------------------------------------------------------------------------------------------------------

    def _show(self) -> None:
        """Show the present state in the context."""
        turn = int(self._state.turn[0])
        if turn == self._shown:
            return
        began = perf_counter()
        values = self._game.internals.state
        with delay_interrupts():
            block = self._game.ctx.agent.block
            before = np.array([block.get_ids(block.node), block.get_ids(block.previous)], np.int64)
            self._show_agents()
            self._show_values(values)
            self._show_past(before, turn)
            values.turn = turn
            self._shown = turn
        values.timings["apply"] += perf_counter() - began

    def _show_agents(self) -> None:
        """Show where the agents are, and which are alive."""
        state = self._state
        block = self._game.ctx.agent.block
        rows = self._by_row
        ids = state.streets.get_ids
        show_positions(block, ids(state.node[0, rows]), ids(state.previous[0, rows]))
        alive = state.alive[0, rows].tobytes()
        if alive != bytes(block.alive):
            show_lives(block, alive)
        block.placed = set(np.flatnonzero(state.placed[0, rows]).tolist())
        if state.movement.depends_on_speeds:
            on_edges = state.movement.find_edge_positions(0, state.node[0])
            show_progress(block, {row: on_edges[i] for row, i in enumerate(rows.tolist()) if i in on_edges})

    def _show_values(self, values: GameState) -> None:
        """Show scores, events, errors, counts, reasons of stops, memories, and what rules keep."""
        state = self._state
        for team, points in state.scores.get_scores(0).items():
            known = values.scores.get(team)
            if known != points or type(known) is not type(points):
                values.scores[team] = points
        events = state.events.list_entries(0)[len(values.events) :]
        values.events += events
        errors = state.errors.list_entries(0)[len(values.errors) :]
        values.errors += errors
        if state.over[0] is not None:
            values.over = dict(state.over[0])
        self._show_counts(values)
        self._show_blocked(values, errors)
        self._show_memories(values)
        for rule in as_called(self._game.rules):
            if rule.spec.show_arrays is not None:
                rule.spec.show_arrays(self._game.ctx, state, events, self._count_later_events(rule))

    def _show_memories(self, values: GameState) -> None:
        """Show what strategies remember."""
        for name, key, value in list_memories(self._state, self._steps):
            values.get_memory(name)[key] = value

    def _show_counts(self, values: GameState) -> None:
        columns = [self._state.counts[kind][0].tolist() for kind in COUNTED]
        for name, *numbers in zip(self._roster.names, *columns, strict=True):
            if name in values.counts or any(numbers):
                values.counts.setdefault(name, {}).update(zip(COUNTED, numbers, strict=True))
        self._game.internals.parts.turns.restart_counts()

    def _show_blocked(self, values: GameState, errors: list[dict[str, Any]]) -> None:
        """Show why the last actions of agents were not executed; `errors` are new."""
        state = self._state
        blocked = values.blocked
        last = self._find_eliminated_agents()
        last |= dict.fromkeys(np.flatnonzero(self._columns.takes_part[0]).tolist(), int(state.turn[0]))
        names = self._roster.names
        for agent in last:
            blocked.pop(names[agent], None)
        turn_of = {names[agent]: turn for agent, turn in last.items()}
        for error in errors:
            if error["turn"] + 1 == turn_of.get(error["agent"]):
                blocked.add(error["agent"], error["message"])
        for agent in np.flatnonzero(state.blocked[0]).tolist():
            if agent in last:
                blocked.add(names[agent], describe_conflict(self._core.get_wanted_place(0, agent)))
        self._game.internals.parts.turns.show_blocked()

    def _show_past(self, before: IntArray, turn: int) -> None:
        """Let the visual engine remember the turns since the last call.

        Args:
            before: (2, agents) the nodes of agents when these turns began, and their previous nodes.
            turn: the last of these turns.
        """
        past = self._core.past
        turns = len(past.node)
        first = max(self._shown + 1, turn + 1 - turns)
        rows = np.arange(first, turn + 1) % turns
        nodes = np.ascontiguousarray(self._state.streets.get_ids(past.node[rows][:, self._by_row]))
        places: list[Any] = [of_turn.data for of_turn in nodes]
        if self._on_edges is not None:
            places = nodes.tolist()
            row_of = {number: row for row, number in enumerate(self._by_row.tolist())}
            for row, of_turn in zip(rows.tolist(), places, strict=True):
                on_edges = self._on_edges(past.edge[row], past.share[row], past.motion[row])
                for number in on_edges.keys() & row_of.keys():
                    of_turn[row_of[number]] = on_edges[number]
        is_all = first == self._shown + 1
        here, previous = before
        begin = np.where(nodes[0] == here, previous, here).data if is_all else places.pop(0)
        self._past.end_turns(begin, places, turn, goes_on=is_all)

    def _count_later_events(self, rule: NamedRule) -> int:
        """Return the number of events of the last turn from rules that are played after a rule."""
        noted = self._columns.noted
        if noted is None:
            return 0
        is_late = noted.rules >= self._core.numbers[rule.name]
        return int(np.count_nonzero(is_late & (noted.turns == self._state.turn[0])))
