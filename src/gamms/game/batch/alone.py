"""Strategies and rules that are written in arrays alone: in a game that is played alone they get one game as arrays."""

from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence
from copy import copy
from functools import WRAPPER_ASSIGNMENTS, partial, update_wrapper
from itertools import chain
from typing import Any, cast
from weakref import WeakKeyDictionary

import numpy as np

from gamms.arguments import as_context, as_function_of, as_numbers_of
from gamms.deciding import phase_of
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch.channels import Heard, Radio
from gamms.game.batch.columns import Roster, kept_in, put_locked
from gamms.game.batch.deeds import DeclaredDeeds
from gamms.game.batch.forms import F, StrategySpec, declare
from gamms.game.batch.given import as_flights, flown
from gamms.game.batch.initial_state import movement_of
from gamms.game.batch.last_turn import LastTurn
from gamms.game.batch.movement import AIMS, LIMITED, STOP, Movement, Places
from gamms.game.batch.one_by_one import Noted
from gamms.game.batch.sensing import SHOWING_NODES, note_sensors, note_sights, noted_sensors, rows_covered
from gamms.game.batch.state import STOPPED, Arrays, Emitted, GameArrays, NotTakenUp
from gamms.game.batch.turn import ArrayRule, ArrayTurn
from gamms.game.batch.view import ArrayStrategy, ArrayView
from gamms.game.deeds import checked_value
from gamms.game.moves import TurnMoves
from gamms.game.random_streams import ViewDraws
from gamms.game.settings import RuleSpec, declared
from gamms.game.snapshots import GameInternals
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray, locked_columns
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.text import shown
from gamms.typing import IAgent, IContext
from gamms.typing.context import HostContext
from gamms.typing.sensor_engine import ON_GROUND

_KEPT = "array strategies"  # the key of `state["memory"]` that has what views keep
_LAST = "array strategies, last turn"  # that of the turn in which it was asked last, where it looks at others
_OF_RULES = "array rules"  # the key of `ctx.game.data` that has what array rules keep
_READ = "array rules, events"  # that of how many events they have read
_worlds: WeakKeyDictionary[Any, tuple[Any, Movement, dict[Any, Any]]] = WeakKeyDictionary()


def array_strategy(
    form: ArrayStrategy | None = None, /, *, of: object = None, begins: object = None
) -> Callable[[IContext], Callable[[Any], None]]:
    """Decorator: make a strategy of a function from an `ArrayView` to actions, for batches and for games alone.

    The name stands for a function that makes the strategy, as `gamms.strategies.chase` does: `strategy=hunt(ctx)`, or
    `strategies={"red": hunt}` in a scenario. The actions are the same in both; a batch asks once a turn for all agents,
    a game that is played alone asks for each agent, in a view of one game and one agent.

    Args:
        form: returns the numbers of legal nodes, (games, agents), or what `view.towards` gives; of an agent that flies,
            which is asked alone, how far it flies, map units, (1, 1, 3).
        of: refused; there is no function beside the form.
        begins: refused, too.

    Raises:
        BadType: it cannot be called, or `of` or `begins` is given.
    """
    _refuse_second_form(of, begins, "array_strategy")
    function: ArrayStrategy = as_function_of(form, "An array strategy", "a view")
    name = getattr(function, "__name__", "array strategy")

    def make(ctx: IContext) -> Callable[[Any], None]:
        as_context(ctx, name)
        internals = cast("HostContext", ctx).game.internals

        def strategy(state: dict[str, Any]) -> None:
            view = _ViewOfOne(ctx, state, internals)
            view._lock()
            given, action = function(view), None
            if not view.flies:
                action = view._plain_action(int(view._checked(given, name, may_aim=True)[0, 0]))
            done = view._plain_deeds()
            state.get("outbox", []).extend(view._plain_outbox())
            if view.flies:
                flight = as_flights(given, f"{name}: what an agent that flies does", (1, 1))[0, 0].tolist()
                state["action"] = flown(flight, ctx.agent.agents[state["name"]].speed, done)
            else:
                state["action"] = {"node_id": action, "do": done} if done else action

        declare(strategy, StrategySpec(array_form=function, flies=True, begins=_remembered_alone, takes_up_all=True))
        return _documented(strategy, function)

    return _documented(make, function)


def array_rule(
    form: ArrayRule | None = None, /, *, of: object = None, begins: object = None
) -> Callable[[IContext], None]:
    """Decorator: make a rule of a function of an `ArrayTurn`, for batches and for games alone.

    The name stands for the rule then: `ctx.game.add(storm)`, or `rules: [{rule: my_module:storm}]` in a scenario. It
    does the same in both; in a game that is played alone it gets a turn of one game.

    Args:
        form: does in many games at once what the rule does in one.
        of: refused; there is no function beside the form.
        begins: refused, too.

    Raises:
        BadType: it cannot be called, or `of` or `begins` is given.
    """
    _refuse_second_form(of, begins, "array_rule")
    function: ArrayRule = as_function_of(form, "An array rule", "a turn")
    name = getattr(function, "__name__", "array rule")

    def rule(ctx: IContext) -> None:
        as_context(ctx, name)
        turn = _TurnOfOne(cast("HostContext", ctx))
        turn._lock()
        function(turn)

    spec = RuleSpec(array_form=function, begin_arrays=_kept_alone, is_array_function=True)
    return declared(_documented(rule, function), spec)


def _refuse_second_form(of: object, begins: object, decorator: str) -> None:
    if of is not None or begins is not None:
        raise BadType(
            f"{decorator} takes neither of= nor begins=: pass the array function itself, {decorator}(function). It "
            "plays one game as it plays a batch, and needs no other function beside it."
        )


def _kept_alone(ctx: HostContext, state: GameArrays) -> dict[Hashable, Arrays]:
    """Return what array rules keep in the game of a context, and let them go on with the events that they have read."""
    for reader, number in ctx.game.data.get(_READ, {}).items():
        state.events.read(reader, number)
    return dict(ctx.game.data.get(_OF_RULES, {})) if state.roster.is_first.all() else {}


def _remembered_alone(ctx: HostContext, state: GameArrays) -> dict[Hashable, Arrays]:
    """Return what array strategies keep in the memories of agents."""
    memories = [ctx.game.memories.get(name, {}) for name in state.roster.names]
    several = {number: kept for number, memory in enumerate(memories) if (kept := memory.get(_KEPT))}
    if several and not state.roster.is_first.all():
        raise NotTakenUp("rows of agents that may come are not in what array strategies keep")
    found: dict[Hashable, Arrays] = {}
    for key in dict.fromkeys(chain.from_iterable(several.values())):
        kept = {number: one[key] for number, one in several.items() if key in one}
        names = dict.fromkeys(chain.from_iterable(kept.values()))
        found[key] = {name: _joined(key, {number: one[name] for number, one in kept.items()}) for name in names}
    return found


def _joined(key: Hashable, arrays: Mapping[int, np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
    """Return what agents keep, each in arrays of its own, as one: what is of one of them from its own.

    Args:
        key: under which they keep it.
        arrays: of the agents, by their numbers: (1, all agents, …), or anything.
    """
    own = np.array([*arrays])
    joined = arrays[own[0]].copy()
    has_rows = joined.ndim > 1 and joined.shape[1] > own[-1]
    for number, array in arrays.items():
        if has_rows and array.shape == joined.shape:
            joined[:, number] = array[:, number]
    for array in arrays.values():
        others = np.array(array)
        if has_rows and array.shape == joined.shape:
            others[:, own] = joined[:, own]
        if not np.array_equal(others, joined, equal_nan=joined.dtype.kind == "f"):
            raise NotTakenUp(f"agents keep different arrays under {shown(key)}")
    return joined


def _documented(function: F, form: Callable[..., object]) -> F:
    """Give a function the name and the docstring of a form, which takes something else."""
    made: Any = update_wrapper(function, form, [one for one in WRAPPER_ASSIGNMENTS if "annot" not in one])
    del made.__wrapped__
    return function


class _DrawsOfOne(ViewDraws):
    """The draws of `state["draw"]`, as those of a view."""

    def __init__(self, draw: Any) -> None:
        self._draw = draw
        super().__init__(np.zeros((1, 1), np.uint64), np.zeros(1, np.int64))

    def bits_of(self, counted: BoolArray | int) -> BitArray:
        """Return 64 random bits, if they count."""
        return np.array([[self._draw.bits() if np.any(counted) else 0]], np.uint64)


class _ViewOfOne(ArrayView):
    """What the state of one agent holds, as a view of one game with one agent."""

    _may_aim = True

    def __init__(self, ctx: IContext, state: dict[str, Any], internals: GameInternals) -> None:
        roster, host = Roster.of(ctx.agent.agents.values()), cast("HostContext", ctx)
        shared, movement = _world(host)[1], _movement_in(host, roster)
        streets = movement.streets
        number, flies = roster.names.index(state["name"]), "quat" in state
        here = roster.agents[number].current_node_id if flies else state["curr_pos"]
        node = streets.rows(here)
        if flies:
            movement = in_air = Noted(movement)
            in_air.leaves_nodes = True
            in_air.begin((1, len(roster.names)))
        game = GameArrays(roster, movement, [_seed_of(host)], np.full((1, len(roster.names)), node))
        if len(movement.now):
            movement.now[0] = state.get("time", 0.0)
        if not flies and state.get("edge", ()) is not None:  # an agent that decides on a node has left its edge
            _put_on_edges(host, movement, roster, [number])
        game.turn[0], game.facts, game.shared = state["turn"], state["facts"], shared
        game.blocked[0, number] = "in conflict" in (state.get("blocked") or "")
        game.kept = state["memory"].setdefault(_KEPT, {})
        game.noted = {number: noted_sensors(roster.agents[number])}
        game.noted_nodes = {number: [name for name, (kind, _) in state["sensor"].items() if kind in SHOWING_NODES]}
        game.look = self._look
        super().__init__(game, np.zeros(1, np.int64), np.array([number]))
        self.draw = _DrawsOfOne(state["draw"])
        self._host, self._internals, self._memory = host, internals, state["memory"]
        self._sensed, self._inbox, self._deeds, self._outboxes = state["sensor"], state.get("inbox", ()), [], []
        self._nodes: Sequence[int] = () if flies else state["legal"]
        if host.game.channels:
            game.radio = Radio(host.game.channels, roster, roster.part_of(None), 1)
            self._channels = host.game.channels
        check = partial(checked_value, ctx=host)
        game.deeds = DeclaredDeeds(state.get("deeds", {}), check, roster, streets)
        if flies:
            in_air.note(0, number, streets.rows(state["legal"] or (here,)), state.get("time", 0.0))
            shape = len(roster.names)
            places = Places(np.full((1, shape, 3), -1), np.zeros((1, shape)), np.zeros((1, shape, 2)))
            game.places, game.heights = places, np.zeros((1, shape))
            *places.xy[0, number], game.heights[0, number] = state["curr_pos"]

    def _plain_action(self, number: int) -> int | list[int] | None:
        """Return the action of the agent, as `state["action"]` has it."""
        if number < STOP:
            return self._nodes[number]
        if number == STOP:
            return None
        ids: list[int] = self.streets.ids(np.array([self.node[0, 0], number % AIMS])).tolist()
        here, target = ids
        nodes = number // AIMS - LIMITED  # how many of the way; less than 0: all
        if nodes < 0 and (target in self._nodes or len(self._movement.edge)):
            return target
        path: list[int] = self._host.graph.graph.shortest_path(here, target)[1:]
        action: list[int] | int = (path if nodes < 0 else path[:nodes]) or here
        return action

    def of(self, agents: IntArray) -> ArrayView:
        """Return the view of other agents in the game, as a batch has it: what their sensors show is looked for."""
        own, here, memory = self._state, self.roster.agents, self._memory
        agents = as_numbers_of(agents, "agents", len(here), "agents").reshape(-1)
        if self.flies:
            raise BadValue("A strategy of an agent that flies knows this agent alone: view.of is not for it.")
        turn, name = int(self.turn[0]), self.roster.names[self.agents[0]]
        if own.kept and memory.get(_LAST, turn - 1) not in (turn - 1, turn):
            raise BadValue(
                f"Agent {shown(name)} was not asked since turn {memory[_LAST]}, and what it keeps of others is old: "
                "play this strategy in a batch, where it is asked in all turns."
            )
        memory[_LAST] = turn
        version = self._host.agent.structure_version
        if own.shared.get("of", (None,))[0] != version:
            own.shared["of"] = version, {}
        movement = copy(self._movement)  # the view of the agent alone keeps its own
        game = _game_of(self._host, self.roster, movement, own.shared["of"][1])
        movement.now = self._movement.now
        _put_on_edges(self._host, movement, self.roster, agents.tolist())
        blocked = self._internals.state.blocked
        game.blocked[0] = ["in conflict" in (blocked.get(name) or "") for name in self.roster.names]
        game.facts, game.kept, game.radio = own.facts, own.kept, own.radio
        note_sensors(game, agents.tolist(), with_nodes=True)
        note_sights(game, self._host, self._internals.parts.turns.looks, 0)
        return ArrayView(game, self.games, agents)

    def _plain_outbox(self) -> list[dict[str, Any]]:
        """Return what the agent sends, as `state["outbox"]` has it."""
        sent = [box for box in self._outboxes or () if box.to]
        return [{"channel": box.channel, "to": box.to[0], "body": box.bodies[0]} for box in sent]

    def heard(self, channel: str) -> Heard:
        """Return what is in `state["inbox"]`."""
        if self._state.radio is None or channel not in self._state.radio.channels:
            raise UnknownName("channel", channel, () if self._state.radio is None else self._state.radio.channels)
        inbox = [message for message in self._inbox if message["channel"] == channel]
        none = np.zeros(len(inbox), np.int64)
        senders = np.array([self.roster.names.index(message["sender"]) for message in inbox], np.int64)
        turns = np.array([message["turn"] for message in inbox], np.int64)
        overheard = np.array([message["overheard"] for message in inbox], np.bool_)
        return Heard(none, none, senders, [message["body"] for message in inbox], turns, overheard)

    def _plain_deeds(self) -> dict[str, dict[str, Any]]:
        """Return what the agent does besides moving, as `state["action"]` has it."""
        known, done = self._state.deeds, [one for one in self._deeds or () if len(one.at)]
        return {one.kind: {key: known.plain(one, key)[0] for key in one.values} for one in done}

    def _look(self, games: IntArray) -> None:  # noqa: ARG002 - there is one
        """Note what `state["sensor"]` shows."""

        def shown_to(agent: IAgent, names: Sequence[str]) -> dict[str, Any]:  # noqa: ARG001 - the one that is asked
            return {name: self._sensed[name][1] for name in names}

        note_sights(self._state, self._host, shown_to, 0)

    def _plain_looks(self) -> None:
        """Return nothing: `state["sensor"]` says what is seen."""

    def covered(self) -> BoolArray:
        """Return on which nodes the sensors of the agent would show agents with some probability, (1, 1, nodes)."""
        name, found = self.roster.names[self.agents[0]], np.zeros((1, 1, self.streets.num_nodes), np.bool_)
        sensors = self.roster.agents[self.agents[0]].sensors
        for sensor in [sensors[key] for key, (kind, _) in self._sensed.items() if kind in ON_GROUND]:
            found[0, 0, rows_covered(self._state, sensor, int(self.streets.ids(self.node[0, 0])), name)] = True
        return found


class _TurnOfOne(ArrayTurn):
    """The turn of a game that is played alone, as a turn of one game: what rules do with it is done there at once."""

    def __init__(self, ctx: HostContext) -> None:
        game, roster = ctx.game, Roster.of(ctx.agent.agents.values())
        movement = _movement_in(ctx, roster)
        state = _game_of(ctx, roster, movement, _world(ctx)[1])
        _put_on_edges(ctx, movement, roster, range(len(roster.names)))
        check = partial(checked_value, ctx=ctx)
        state.deeds = DeclaredDeeds(game.deeds, check, roster, movement.streets)
        super().__init__(state, np.zeros(1, np.int64))
        self._ctx, self._game, self._is_moving = ctx, game, game.is_moving
        self._number = {name: number for number, name in enumerate(roster.names)}
        block = ctx.agent.block
        state.placed[0] = [block.row_of(name) in block.placed for name in roster.names]
        self.took_part = np.zeros(self.node.shape, np.bool_)
        self._has_flown = np.zeros(self.node.shape, np.bool_)
        moves: TurnMoves | None = game.internals.state.moves
        if moves is not None:
            self.starts, self.ends, self.took_part, self.paths = LastTurn.of(moves, roster, movement, self.node)
            for number in np.flatnonzero(roster.flies & self.took_part[0]).tolist():
                self._has_flown[0, number] = moves.was_put(moves.order.index_of[roster.names[number]])
        done = [(0, self._number[one.agent], i, one.kind, one.values) for i, one in enumerate(game.performed())]
        self._deeds += state.deeds.from_plain(done, self.starts)

    def close_roads(self, at: IntArray, edges: Sequence[int]) -> None:
        """Close roads, ids of edges."""
        if len(self._as_at(at)) and len(edges):
            self._ctx.graph.close_roads(tuple(edges))

    def open_roads(self, at: IntArray, edges: Sequence[int]) -> None:
        """Open roads, which were closed."""
        if len(self._as_at(at)) and len(edges):
            self._ctx.graph.open_roads(tuple(edges))

    @property
    def is_playing(self) -> BoolArray:
        """Which agents are in the game, or were when the turn began, (1, agents)."""
        now = self._game.turn + self._is_moving
        out = {one["agent"] for one in self._game.events if one["kind"] == "eliminated" and one["turn"] == now}
        return super().is_playing | np.array([name in out for name in self.roster.names], np.bool_)

    @property
    def is_there_by_move(self) -> BoolArray:
        """Which agents are where their moves have led them, rather than put there since: (1, agents)."""
        return super().is_there_by_move & ~self._has_flown

    def _note(self, kind: str, at: IntArray, fields: Mapping[str, list[Any]]) -> None:
        for i in range(len(at)):
            self._game.emit(kind, **{name: values[i] for name, values in fields.items()})

    def new_events(self, reader: Hashable) -> list[Emitted]:
        """Return the events since the last call for a reader, at first all so far."""
        read, events = self._game.data.setdefault(_READ, {}), self._game.events
        found = [Emitted.of(0, entry) for entry in events[read.get(reader, 0) :]]
        read[reader] = len(events)
        return found

    def _add_score(self, key: Hashable, at: IntArray, points: float | FloatArray) -> None:
        for number in [points] * len(at) if isinstance(points, int) else np.broadcast_to(points, len(at)).tolist():
            self._game.scores[key] += number

    def _add_scores(self, at: IntArray, teams: IntArray, points: float | FloatArray) -> None:
        for number, point in zip(teams.tolist(), np.broadcast_to(points, len(at)).tolist(), strict=True):
            self._game.scores[self.roster.teams[number]] += point

    def scores(self, key: Hashable) -> FloatArray:
        """Return the score of a key, (1,); 0 where there is none."""
        return np.array([self._game.scores.get(key, 0)], np.float64)

    def _end(self, _: int, how: dict[str, Any]) -> None:
        self._game.end(**how)

    def eliminate(self, at: IntArray, agents: IntArray) -> None:
        """Take agents out of the game, those that are in it, each with an event."""
        for number in self._pairs(at, agents)[1].tolist():
            self._game.eliminate(self.roster.names[number])
            put_locked(self.alive, (0, number), values=False)

    def respawn(self, at: IntArray, agents: IntArray) -> None:
        """Put agents, dead or alive, where they began, each with an event."""
        for number in self._pairs(at, agents)[1].tolist():
            self._game.respawn(self.roster.names[number])
            put_locked(self.node, (0, number), self.streets.rows(self.roster.agents[number].current_node_id))
            put_locked(self.alive, (0, number), values=True)
            self._state.placed[0, number] = True

    def in_air(self) -> tuple[IntArray, FloatArray]:
        """Return the numbers of the agents that fly, ascending, and where they are, (1, these, 3)."""
        agents = np.flatnonzero(self.roster.flies)
        places: list[Any] = [self.roster.agents[number] for number in agents.tolist()]
        return agents, np.array([[one.position for one in places]], np.float64).reshape(1, -1, 3)

    def start_of(self, agents: IntArray) -> IntArray:
        """Return where agents began, (1, agents)."""
        agents = as_numbers_of(agents, "agents", len(self.roster.names), "agents").reshape(-1)
        starts = [self._game.start_node(self.roster.names[number]) for number in agents.tolist()]
        nearest = self._ctx.graph.graph.nearest_node  # of those that fly the nodes below them
        return self.streets.rows([[one if isinstance(one, int) else nearest(*one[:2]) for one in starts]])

    def stops(self, at: IntArray, agents: IntArray) -> IntArray:
        """Return how often agents were tagged, put back or eliminated so far."""
        at, agents = self._pairs(at, agents)
        counts = Counter(one.get(STOPPED[one["kind"]]) for one in self._game.events if one["kind"] in STOPPED)
        return np.array([counts[self.roster.names[number]] for number in agents[at == 0].tolist()], np.int64)

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return what a rule remembers of the game, at first what `make(1)` gives."""
        self._state.kept = self._game.data.setdefault(_OF_RULES, {})
        return super().keep(key, make)


def _seed_of(ctx: HostContext) -> int:
    """Return the seed of a context, also while a strategy runs, whose view does not show it."""
    with phase_of(ctx).suspended(changes_world=False):
        return ctx.seed


def _game_of(ctx: HostContext, roster: Roster, movement: Movement, shared: dict[Any, Any]) -> GameArrays:
    """Return the game of a context as arrays of one game: where its agents are, who is alive, and what is published."""
    agents = roster.agents
    nodes = movement.streets.rows([[one.current_node_id for one in agents]])
    state = GameArrays(roster, movement, [_seed_of(ctx)], nodes)
    state.alive[0], state.turn[0] = [one.alive for one in agents], ctx.game.turn
    state.facts, state.shared = ctx.game.facts, shared
    return state


def _movement_in(ctx: HostContext, roster: Roster) -> Movement:
    """Return how the agents of a context go, which is made once for each revision of the graph."""
    game, (plain, shared) = ctx.game, _world(ctx)
    key = "movement", game.legal, game.speed_unit, game.turn_seconds, tuple(one.speed for one in roster.agents)
    is_plain = game.legal == "edges" and game.speed_unit == "edges" and {*key[-1]} == {None}
    return plain if is_plain else kept_in(shared, key, lambda: movement_of(game, roster))


def _put_on_edges(ctx: HostContext, movement: Movement, roster: Roster, agents: Sequence[int]) -> None:
    """Let agents be on the edges of which they have covered a part."""
    with phase_of(ctx).suspended(changes_world=False):
        block = ctx.agent.block
    for number in agents:
        place = block.progress[block.row_of(roster.names[number])]
        if place is not None:
            movement.put_on(np.zeros(1, np.int64), number, place)


def _world(ctx: HostContext) -> tuple[Movement, dict[Any, Any]]:
    """Return the streets of a context, and what was worked out of them; made once for each revision of the graph."""
    revision = ctx.graph.graph.revision
    known = _worlds.get(ctx)
    if known is None or revision is None or known[0] != revision:
        known = _worlds[ctx] = revision, Movement(Streets(locked_columns(ctx.graph.columns()), ctx.graph.routes)), {}
    return known[1], known[2]
