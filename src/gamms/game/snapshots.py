"""Operations on whole games: snapshots, forks, and the interface `ctx.game.internals` for engines and clients."""

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from copy import copy, deepcopy
from functools import partial
from types import CellType, FunctionType, MethodType
from typing import Any, NamedTuple

from gamms.arguments import DescribedFunction, as_mapping, find_annotations
from gamms.core.copies import ONLY_PLAIN, NotPlain, copy_deep, copy_values
from gamms.deciding import ContextPart, DecidePhase, add_copies, copy_part, refuse_while_deciding
from gamms.errors import BadValue, ContextTerminated, GammsError
from gamms.game.conflicts import Conflicts
from gamms.game.facts import PrivateForks, get_facts
from gamms.game.lasting import copy_doing, drop_deed, put_doing
from gamms.game.movement.moves import TurnMoves
from gamms.game.result import Collectors, warn_of_idle, warn_of_stuck_agents
from gamms.game.settings import NamedRule, Plan, RuleSet, RuleTable, Settings
from gamms.game.turn import Observer, TurnEngine
from gamms.ir.agents import Position
from gamms.ir.game_state import COPY_OF, FIELDS, KEPT, SAVED, GameState, is_of_reader
from gamms.ir.schema import Memo
from gamms.knowledge.sides import select_by_name, select_heard, select_own
from gamms.progress import delay_interrupts
from gamms.readonly import NotPickled
from gamms.text import shown
from gamms.typing.agent_engine import AgentType, IAgent
from gamms.typing.context import HostContext, IContext

_SCALARS = frozenset({str, bytes, int, float, bool, complex, type(None)})
_PARTIAL = frozenset({partial, DescribedFunction})
_FUNCTIONS = frozenset({FunctionType, MethodType, *_PARTIAL})
_UNKNOWN = object()


class SnapshotError(GammsError, RuntimeError):
    """A snapshot cannot be taken or restored now."""


class Snapshot(NotPickled):
    """A game at a moment: the result of `ctx.game.snapshot()`, for `ctx.game.restore`.

    Attributes:
        turn: the number of turns played.
        seed: the seed of the context.
    """

    __slots__ = ("_of", "_parts", "_values", "seed", "turn")
    _not_pickled = (
        "A snapshot cannot be pickled, because it refers to the agents and the graph of its context. To continue a "
        "game in another process, record it and use Recording.resume."
    )

    def __init__(self, turn: int, seed: int, of: GameState, values: list[Any], parts: dict[str, Any]) -> None:
        self.turn = turn
        self.seed = seed
        self._of = of
        self._values = values
        self._parts = parts

    def __repr__(self) -> str:
        return f"Snapshot(turn={self.turn}, seed={self.seed})"

    def place_of(self, agent: IAgent) -> int | Position:
        """Return the place of an agent: a node id, or (x, y, z)."""
        place: int | Position = self._parts["agents"].find_place(agent)
        return place

    def places_of(self, agents: Mapping[str, IAgent]) -> dict[str, int | Position]:
        """Return name -> place, for some agents."""
        places: dict[str, int | Position] = self._parts["agents"].find_places(agents)
        return places

    @property
    def agents(self) -> Any:
        """The agents, as `ctx.agent.storage.snapshot()` returned them. Any: the class of the agent engine."""
        return self._parts["agents"]

    @property
    def sensors(self) -> Any:
        """The sensors, as `ctx.sensor.storage.snapshot()` returned them. Any: the class of the sensor engine."""
        return self._parts["sensors"]

    @property
    def data(self) -> dict[str, Any]:
        """The data of rules; read-only."""
        return self.get("data") or {}

    def get(self, name: str) -> Any:
        """Return the value of a field of the game; None if it is an empty dict."""
        return self._values[SAVED.index(name)]

    def part(self, name: str) -> Any:
        """Return a part of the game: "settings", "rules", "collectors" or "logs", as the game keeps them."""
        return self._parts[name]

    def __deepcopy__(self, memo: dict[int, Any]) -> "Snapshot":
        """Copy the snapshot together with its context."""
        moves = self.get("moves")
        agents = deepcopy(self._parts["agent_engine"], memo)
        if moves is not None and id(moves) not in memo:  # they hold views of arrays
            memo[id(moves)] = moves.copy_for_agents(agents, partial(_find_twin, memo))
        of, values, parts = deepcopy((self._of, self._values, self._parts), memo)
        parts["prepared"] = -1  # strategies are prepared once in each context
        return Snapshot(self.turn, self.seed, of, values, parts)


class GameStart(NamedTuple):
    """The start of a game, before its first turn."""

    snapshot: Snapshot
    rng: Any  # the state of the context's own stream
    first_seed: tuple[int, Any]  # the seed and that state of the first start in this context

    def get_rng_state(self, seed: int) -> Any:
        """Return the state of the context's own stream at the start with a seed; None: a new stream."""
        return dict([self.first_seed, (self.snapshot.seed, self.rng)]).get(seed)


class SnapshotTaker(NamedTuple):
    """The parts of a game that a snapshot contains."""

    ctx: HostContext
    state: GameState
    settings: Settings
    rules: RuleSet
    collectors: Collectors
    turns: TurnEngine

    def refuse_in_turn(self, action: str) -> None:
        """Raise an error while a turn is being played, and after the context has ended."""
        if self.ctx.is_terminated():
            raise ContextTerminated("ctx.game")
        if self.turns.is_playing:
            raise SnapshotError(f"A snapshot cannot be {action} in the middle of a turn: do it between two turns.")

    def take(
        self,
        copy_state: Callable[[GameState], list[Any]] = GameState.copy_values,
        copy_attributes: Callable[[dict[str, Any]], dict[str, Any]] = copy_values,
        *,
        has_counts: bool = True,
    ) -> Snapshot:
        """Return a snapshot.

        Args:
            copy_state: copies the values of the game.
            copy_attributes: copies the attributes of an agent.
            has_counts: whether the counts of the agents are brought up to date; see `Slots.keep_counts`.
        """
        ctx = self.ctx
        state = self.state
        if has_counts:
            self.turns.update_counts()
        else:
            self.turns.note_departed()
        parts = {
            "turns": self.turns.snapshot(),
            "agents": ctx.agent.storage.snapshot(copy_attributes),
            "agent_engine": ctx.agent,
            "world": ctx.graph.storage.snapshot(),
            "sensors": ctx.sensor.storage.snapshot(),
            "settings": self.settings.settings_now(),
            "rules": self.rules.now,
            "collectors": self.collectors.snapshot(),
            "logs": state.get_marks(),
            "is_seeded": ctx.is_seeded,
            "rng": ctx.rng_state(),
            "prepared": self.turns.prepared,
        }
        return Snapshot(state.turn, ctx.seed, state, copy_state(state), parts)

    def is_own(self, snapshot: Snapshot) -> bool:
        """Return whether a snapshot belongs to this game."""
        return snapshot._of is self.state

    def restore(self, snapshot: Snapshot, *, forget: bool = False, keeps_written: bool = False) -> None:
        """Restore everything except random streams.

        Args:
            snapshot: the snapshot.
            forget: whether sensors drop their last data.
            keeps_written: whether what functions have written stays: attributes of agents, and `WRITTEN` fields.
        """
        ctx = self.ctx
        state = self.state
        parts = snapshot._parts
        ctx.graph.storage.restore(parts["world"])
        ctx.sensor.storage.restore_keywords(parts["sensors"])
        ctx.agent.storage.restore(parts["agents"], keeps_attributes=keeps_written)
        ctx.sensor.storage.restore(parts["sensors"], forget=forget)
        settings = self.settings.settings_now()
        if settings is not parts["settings"] and settings != parts["settings"]:
            self.settings.configure(parts["settings"])
        if self.rules.now is not parts["rules"]:
            self.rules.put(parts["rules"])
        self.collectors.restore(parts["collectors"])
        were_blocked = bool(state.blocked)
        if keeps_written:
            state.take_back(snapshot._values)
        else:
            state.restore(snapshot._values)
        state.go_to(parts["logs"])
        self.turns.restore(parts["turns"], shows_blocked=were_blocked or bool(state.blocked))
        if self.turns.prepared != parts["prepared"]:
            self.turns.prepared = parts["prepared"]
            self.turns.phase.drop_plans()

    def restore_streams(self, snapshot: Snapshot) -> None:
        """Restore the seed and the random streams; call it before `restore`."""
        ctx = self.ctx
        parts = snapshot._parts
        ctx.reseed(snapshot.seed, parts["rng"])
        ctx.is_seeded = parts["is_seeded"]

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that takes a turn back, but for what functions have written; see `restore`."""
        leave_unread = _keep_unread(self.turns)
        with self.turns.phase.suspend(changes_world=False):
            snapshot = self.take(GameState.turn_copies, dict, has_counts=False)
        doing = copy_doing(self.state.data)
        kept = dict.get(self.state.data, KEPT, {})
        readers = {key: copy_deep(kept[key]) for key in filter(is_of_reader, kept)}
        adding = [order.slots.keep_counts() for order in self.turns.orders]
        undoing = [checkpoint() for checkpoint in self.ctx.game.internals.checkpoints]

        def take_back() -> None:
            if self.ctx.is_terminated():
                return
            with delay_interrupts():
                self.restore_streams(snapshot)
                self.restore(snapshot, keeps_written=True)
                put_doing(self.state.data, doing)
                now = dict.get(self.state.data, KEPT, {})
                for key in [*filter(is_of_reader, now)]:
                    del now[key]
                now |= copy_deep(readers)
                leave_unread()
                for add_counts in adding:
                    add_counts()
                for undo in undoing:
                    undo()

        return take_back


def _keep_unread(turns: TurnEngine) -> Callable[[], None]:
    """Return a function after which the states of the last turn are made when they are read, if this is so now.

    Other ends of turns are made now, and states of agents for which the core remembers.
    """
    phase = turns.phase
    phase.read_moves()
    unread = turns.unread
    if unread is None or unread.shipped.remembers or phase.read_turn is not turns.reader:
        phase.read_last_turn()
        unread = None

    def leave() -> None:
        turns.unread = unread
        turns.are_memories_in_core = False
        phase.leave_unread(None if unread is None else turns.reader)

    return leave


# -- forks ------------------------------------------------------------------------------------------------------


class ForkSource:
    """A game at a moment, of which a fork is made: at once, or when the fork is first read.

    Args:
        parts: the parts of the game.
        only_plain: whether the fork may be made later. Then all values are copied now, and what functions hold is
            noted; otherwise they are the values of the game.
        names: the agents whose last states the fork has; None: all.

    Attributes:
        snapshot: the game.
        agents: its agents.
        held: id of a function -> the contents of its cells; and of each list and dict that it holds -> the items.

    Raises:
        NotPlain: `only_plain`, and the game has other objects than plain values, functions and parts of the context.
    """

    def __init__(self, parts: SnapshotTaker, *, only_plain: bool, names: Collection[str] | None = None) -> None:
        self._state = parts.state
        self._game = parts.ctx.game
        self.snapshot = (
            parts.take(GameState.copy_plain_values, _list_plain_values)
            if only_plain
            else parts.take(GameState.list_values, dict)
        )
        self.agents = self.snapshot.agents
        each = zip(self.agents.roster.agents, self.agents.states, strict=True)
        self.agents.states = [state.copy() if names is None or one.name in names else {} for one, state in each]
        self._team_memories = [state.get("team_memory") for state in self.agents.states]
        self._settings: dict[str, Any] = self.snapshot.part("settings")
        self.held: dict[int, Any] = {}
        if only_plain:
            copies = {id(one): copy_deep(one, ONLY_PLAIN) for one in self._team_memories}
            self._team_memories = [copies[id(one)] for one in self._team_memories]
            self._note_functions(parts.ctx.sensor.sensors.values())
        self._context = parts.ctx.capture(self.agents, only_plain=only_plain)
        internals = self._game.internals
        self._scenario = internals.scenario
        self._digests = internals.digests
        self._map_number = internals.map_number
        self._map_spec = internals.map_spec

    @property
    def starts(self) -> dict[str, int | Position]:
        """Agent -> its start; see `GameInternals.starts`."""
        began: dict[str, int | Position] = self.snapshot.get("began") or {}
        start: GameStart | None = self.snapshot.get("start")
        if start is None:
            return dict(began)
        if not self.snapshot.get("has_begun"):
            places: dict[str, int | Position] = self.agents.places
            return places | began
        stored = {name: one for name, one in self.agents.roster.stored.items() if name not in began}
        return start.snapshot.places_of(stored) | began

    def renew_map(self) -> None:
        """Take the map of the game again, for one more fork of a game that has not changed."""
        self._context.renew_map()

    def make_fork(
        self,
        seed: int,
        fork: object = None,
        functions: Sequence[tuple[object, object]] = (),
        shared: Sequence[object] = (),
    ) -> tuple[Any, Memo]:
        """Make a complete fork; call it once after each `renew_map`.

        Args:
            seed: its seed.
            fork: what functions get in place of the game; None: the new game.
            functions: pairs of a function of the game, and another whose counterpart the fork has in its place.
            shared: objects of the game that the fork has, too; see `list_shareable`.

        Returns:
            The context (Any: its class imports this one), and a memo of `copy.deepcopy`: id of an object -> its copy.
        """
        ctx, memo = self.make_context(seed)
        ahead: GameInternals = ctx.game.internals
        ahead.scenario = self._scenario
        memo[id(self._game)] = fork or ctx.game
        memo |= {id(one): one for one in shared}
        memo |= {id(function): get_counterpart(other, memo) for function, other in functions}
        self.copy_game(ahead.parts, memo)
        return ctx, memo

    def make_context(self, seed: int) -> tuple[Any, Memo]:
        """Make a fork with a new game, for `copy_game` or `copy_known`; see `make_fork`."""
        memo = ForkMemo()
        memo.held = self.held
        ctx = self._context.make_fork(seed, memo)
        ahead: GameInternals = ctx.game.internals
        memo |= {id(self._game): ctx.game, id(self._state): ahead.state}
        ahead.digests = self._digests
        ahead.map_number = self._map_number
        ahead.map_spec = self._map_spec
        return ctx, memo

    def copy_game(self, target: SnapshotTaker, memo: Memo) -> None:
        """Copy the whole game into the game of a context from `make`."""
        storage = target.ctx.agent.storage
        strategies = {id(one): get_counterpart(one, memo) for one in self.agents.strategies}
        for agent in storage.list_created():
            strategy = strategies[id(agent.strategy)]
            if strategy is not agent.strategy:
                agent.decide_by(strategy)
        storage.renew_strategies(lambda strategy: strategies[id(strategy)])
        state = target.state
        state.copy_logs(self.snapshot.part("logs"))
        for name, copy_of in COPY_OF.items():
            value = self.snapshot.get(name)
            if value is not None and not FIELDS[name].is_own:
                state.put(name, copy_of(value, memo))
        plans = self._settings["plans"].items()
        self.copy_means(
            target, memo, plans={team: Plan(get_counterpart(one.function, memo), one.arrays) for team, one in plans}
        )
        target.collectors.take_copies(self.snapshot.part("collectors"), lambda fn: get_counterpart(fn, memo))
        self._renew_states(target)
        moves: TurnMoves | None = self.snapshot.get("moves")
        if moves is not None:
            state.moves = moves.copy_for_agents(target.ctx.agent, partial(_find_twin, memo))
        state.began = self.starts

    def copy_means(self, target: SnapshotTaker, memo: Memo, **others: object) -> None:
        """Copy the functions of sensors, the rules and the settings; `others` replaces some settings."""
        for sensor in target.ctx.sensor.sensors.values():
            if getattr(sensor, "function", None) is not None:
                sensor.function = get_counterpart(sensor.function, memo)
        defaults = target.settings.settings()
        settings = {**self._settings, **others}
        given = {name: get_counterpart(value, memo) for name, value in settings.items() if value is not defaults[name]}
        target.settings.configure(given)
        known: RuleTable = self.snapshot.part("rules")
        rules = copy_rules(known.rules, memo)
        are_same = all(new.rule is one.rule for new, one in zip(rules, known.rules, strict=True))
        target.rules.replace(known if are_same and not known.list_changed() else RuleTable(tuple(rules)))

    def _renew_states(self, target: SnapshotTaker) -> None:
        """Insert what agents of the fork know into their last states, and their streams when one is read."""
        states = []
        for agent, team_memory in zip(target.ctx.agent.storage.list_created(), self._team_memories, strict=True):
            state = target.ctx.agent.storage.get_turn_access(agent).last[0]
            if "memory" in state:
                renew_state(target, agent, state, team_memory)
                states.append((agent, state))
        if states:
            target.turns.phase.leave_unread(partial(renew_streams, target, states))

    def _note_functions(self, sensors: Iterable[Any]) -> None:
        """Note what the functions of the game hold, those of its sensors, too; see `get_counterpart`."""
        settings = self._settings
        conflicts = settings["conflicts"]
        if type(conflicts) is Conflicts and not conflicts.has_state:
            self._settings = {**settings, "conflicts": copy(conflicts)}
            conflicts = None
        functions = [*self.agents.strategies, *(plan.function for plan in settings["plans"].values())]
        functions += [function for sensor in sensors if (function := getattr(sensor, "function", None)) is not None]
        functions += [one.rule for one in self.snapshot.part("rules").rules]
        functions += [one.fn for one, _ in self.snapshot.part("collectors").values()]
        for function in (*functions, conflicts, settings["default_action"]):
            if type(function) not in (_FUNCTIONS | _SCALARS):
                raise NotPlain  # an object, which is copied
            _note_held(function, self.held)


class ForkMemo(dict[int, Any]):
    """The memo of a fork: id of an object -> its copy.

    Attributes:
        held: what functions held when the fork was taken; see `ForkSource`.
    """

    held: dict[int, Any]


def _list_plain_values(attributes: dict[str, Any]) -> dict[str, Any]:
    made: dict[str, Any] = copy_values(attributes, ONLY_PLAIN)
    return made


def _note_held(value: Any, held: dict[int, Any]) -> None:
    """Note the present content of each cell, list and dict that a function holds; see `_rebind_value`.

    Raises:
        NotPlain: it holds an object that has to be copied at once.
    """
    kind = type(value)
    if kind in _SCALARS or id(value) in held:
        return
    parts: Iterable[Any] = ()
    if kind is FunctionType:
        parts = held[id(value)] = [_get_content(cell) for cell in value.__closure__ or ()]
    elif kind is MethodType:
        if not _is_replaced(value.__self__):
            raise NotPlain
    elif kind in _PARTIAL:
        parts = value.func, value.args, value.keywords
    elif kind is dict:
        parts = held[id(value)] = [] if _is_of_scalars(value) else [*value.items()]
    elif kind is list or kind is tuple:
        parts = held[id(value)] = [*value]
    elif isinstance(value, ContextPart) and not _is_replaced(value):
        raise NotPlain
    for part in parts:
        _note_held(part, held)


def _is_replaced(value: object) -> bool:
    """Return whether a value is a context, or a part that has a counterpart in each fork."""
    return isinstance(value, IContext) or getattr(type(value), "__deepcopy__", None) is ContextPart.__deepcopy__


def _find_twin(memo: Memo, agent: Any) -> Any:
    """Return the copy of an agent; a deleted agent is copied now."""
    return memo.get(id(agent)) or copy_part(agent, memo)


def copy_rules(rules: Iterable[NamedRule], memo: Memo) -> list[NamedRule]:
    """Return the counterparts of rules in a fork; see `get_counterpart`."""
    return [one._replace(rule=get_counterpart(one.rule, memo)) for one in rules]


def renew_state(target: SnapshotTaker, agent: IAgent, state: dict[str, Any], team_memory: object) -> None:
    """Insert what an agent of a game knows into a copy of its last state in another game."""
    state["memory"] = target.state.get_memory(agent.name)
    if "team_memory" in state:
        state["team_memory"] = copy_deep(team_memory)
    state["facts"] = get_facts(agent.name, agent.team, target.state, target.ctx.game.facts)
    state["fork"] = PrivateForks(target.ctx)


def renew_streams(target: SnapshotTaker, states: list[tuple[IAgent, dict[str, Any]]]) -> None:
    """Insert the random streams of the fork into the last states of agents."""
    order = target.turns.get_order()
    for agent, state in states:
        i = order.index_of.get(agent.name) if agent.alive else None
        slot = None if i is None else order.slots[i]
        for key, value in (("draw", slot and slot.draws), ("rng", slot and slot.rng)):
            if value is None:
                state.pop(key, None)
            else:
                state[key] = value


def get_counterpart(value: object, memo: Memo) -> Any:
    """Return the counterpart of a strategy, rule or setting in a fork.

    A function that closes over the context, an agent or another part of the game is rebound to the parts of the fork;
    other objects that it holds are shared. Objects are copied; objects that cannot be copied are shared.
    """
    if type(value) in _SCALARS:
        return value
    if isinstance(value, (FunctionType, MethodType, partial)):
        return _rebind_value(value, memo)
    if id(value) in memo:
        return memo[id(value)]
    trial = dict(memo)
    try:
        made = deepcopy(value, trial)
    except Exception:  # noqa: BLE001 - whatever a caller's object raises when it is copied
        return value
    add_copies(memo, trial)
    return made


def list_shareable(values: Iterable[object], memo: Memo) -> list[object]:
    """Return the objects that forks may share instead of copies, because they hold no part of a context.

    Args:
        values: functions and settings: objects, or functions that may hold methods of objects.
        memo: what `ForkSource.make_context` returns for a fork.
    """
    found: dict[int, object] = {}
    for value in values:
        _collect_copied(value, found, set())
    return [one for one in found.values() if not _holds_parts(one, memo)]


def _collect_copied(
    value: object, found: dict[int, object], seen: set[tuple[int, bool]], *, is_held: bool = False
) -> None:
    """Add the objects that `get_counterpart` copies for a function or a setting to others, by `id`.

    Args:
        value: the function or setting, or what a function holds.
        found: gets the objects.
        seen: the `id` of what was looked through before, and whether it was held.
        is_held: whether a function holds the value: then it is shared, unless it is a function, too.
    """
    kind: Any = type(value)
    one: Any = value
    if kind in _SCALARS or (id(value), is_held) in seen:
        return
    seen.add((id(value), is_held))
    if kind is MethodType:
        _collect_copied(one.__self__, found, seen)
    elif kind is FunctionType:
        for cell in one.__closure__ or ():
            _collect_copied(_get_content(cell), found, seen, is_held=True)
    elif kind in _PARTIAL:
        for part in (one.func, *one.args, *one.keywords.values()):
            _collect_copied(part, found, seen, is_held=True)
    elif not is_held:
        found[id(value)] = value
    elif kind in (list, tuple, dict):
        for part in one.values() if kind is dict else one:
            _collect_copied(part, found, seen, is_held=True)


def _holds_parts(value: object, memo: Memo) -> bool:
    """Return whether a copy of an object in a fork holds parts of the fork."""
    watched = _WatchedMemo(memo)
    try:
        deepcopy(value, watched)
    except Exception:  # noqa: BLE001 - whatever a caller's object raises when it is copied
        return False  # it is shared in any case
    return watched.is_read


class _WatchedMemo(dict[int, Any]):
    """A memo of `copy.deepcopy` that notices when a copy is taken that it has from the beginning."""

    def __init__(self, memo: Memo) -> None:
        super().__init__(memo)
        self._first = frozenset(memo)
        self.is_read = False

    def get(self, key: int, default: object = None) -> Any:
        """Return the copy of an object by its `id`."""
        self.is_read = self.is_read or key in self._first
        return super().get(key, default)


def _rebind_value(value: object, memo: Memo) -> Any:
    known = memo.get(id(value), _UNKNOWN)
    if known is not _UNKNOWN:
        return known
    rebind = _REBOUND.get(type(value), deepcopy if isinstance(value, ContextPart) else None)
    return value if rebind is None else rebind(value, memo)


def _rebind_function(function: FunctionType, memo: Memo) -> FunctionType:
    memo[id(function)] = function  # it may close over itself
    cells = function.__closure__ or ()
    held = _find_past_content(function, memo)
    contents = [_get_content(cell) for cell in cells] if held is None else held
    made = tuple([_rebind_cell(*one, memo) for one in zip(cells, contents, strict=True)])
    if all(new is cell for new, cell in zip(made, cells, strict=True)):
        return function
    twin = FunctionType(function.__code__, function.__globals__, function.__name__, function.__defaults__, made)
    twin.__kwdefaults__ = function.__kwdefaults__
    twin.__annotations__ = find_annotations(function)
    twin.__module__ = function.__module__
    twin.__qualname__ = function.__qualname__
    twin.__doc__ = function.__doc__
    twin.__dict__.update(function.__dict__)
    memo[id(function)] = twin
    return twin


def _find_past_content(holder: object, memo: Memo) -> Any:
    """Return what a function, list or dict held when a fork was taken; None: that is not noted."""
    return memo.held.get(id(holder)) if isinstance(memo, ForkMemo) else None


def _get_content(cell: CellType) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # nothing was assigned yet
        return _UNKNOWN


def _rebind_cell(cell: CellType, content: Any, memo: Memo) -> CellType:
    made = _rebind_value(content, memo)
    return cell if made is content else CellType(made)


def _rebind_method(method: MethodType, memo: Memo) -> Any:
    instance = get_counterpart(method.__self__, memo)
    return method if instance is method.__self__ else MethodType(method.__func__, instance)


def _rebind_partial(function: "partial[Any]", memo: Memo) -> Any:
    parts = function.func, function.args, function.keywords
    func, args, keywords = made = [_rebind_value(one, memo) for one in parts]
    if all(new is one for new, one in zip(made, parts, strict=True)):
        return function
    twin = type(function)(func, *args, **keywords)
    memo[id(function)] = twin
    twin.__dict__.update(function.__dict__)
    return twin


def _rebind_items(values: list[Any] | tuple[Any, ...], memo: Memo) -> Any:
    held = _find_past_content(values, memo)
    known = values if held is None else held
    items = [_rebind_value(one, memo) for one in known]
    return values if all(new is one for new, one in zip(items, known, strict=True)) else type(values)(items)


def _rebind_values(values: dict[Any, Any], memo: Memo) -> dict[Any, Any]:
    held = _find_past_content(values, memo)
    if held is None and _is_of_scalars(values):
        return values
    known = values if held is None else dict(held)
    items = {key: _rebind_value(one, memo) for key, one in known.items()}
    return values if all(items[key] is one for key, one in known.items()) else items


def _is_of_scalars(values: dict[Any, Any]) -> bool:
    """Return whether all values of a dict are scalars, for example those of a territory of many nodes."""
    return all(type(one) in _SCALARS for one in values.values())


_REBOUND: dict[type, Callable[[Any, Memo], Any]] = {
    FunctionType: _rebind_function,
    MethodType: _rebind_method,
    partial: _rebind_partial,
    DescribedFunction: _rebind_partial,
    tuple: _rebind_items,
    list: _rebind_items,
    dict: _rebind_values,
}


class GameInternals(ContextPart):
    """The parts of a game for the recorder, scenarios and the context; not for strategies.

    Args:
        parts: the parts of the game.
        phase: the phase of the context.

    Attributes:
        state: the state of the game.
        draw_start: called by `reset` with another seed, to draw the random parts of the start; None: there are none.
        after_reset: called after each reset, in order.
        after_observing: called in every turn with the agents and their states before any agent decides, in order; see
            `turn.Observer`.
        checkpoints: called before a turn that may be taken back; each returns a function that takes it back elsewhere.
        scenario: the scenario of the game as plain values, for the recorder; None: a program built the game.
        digests: returns the SHA-256 of each part of the scenario, for strategies that fit one map; None: no scenario.
        map_number, map_spec: the number of the map among those of a batch, 0 if there is one; and its entry in `maps`,
            or under the key `map` of the scenario; None: a program built the game.
        kept: caches of rules, by name; copies and snapshots do not contain them.
        named_idle: the teams, agents and modes that warnings have named.
        left_as: the number of the game in the batch from which it was made under way; None: it knows its start.
        shown_as: the number of the game in the batch that plays it, and shows it here; None: it is played here.
        asks_all: whether all agents are asked in a batch, because a function has drawn or looked for them.
        calls_rules: whether all rules are called as functions in a batch, because a function has changed what the core
            had of them.
        unchecked_arrays: keys of the arrays of array functions that came from a recording; see `GameArrays.unchecked`.
    """

    _called = "ctx.game.internals"

    def __init__(self, parts: SnapshotTaker, phase: DecidePhase) -> None:
        self._parts = parts
        self._phase = phase
        phase.created = self.note_starts
        self.state: GameState = parts.state
        self.draw_start: Callable[[], None] | None = None
        self.after_reset: list[Callable[[], None]] = []
        self.after_observing: list[Observer] = parts.turns.observers
        self.checkpoints: list[Callable[[], Callable[[], None]]] = []
        self.scenario: dict[str, Any] | None = None
        self.digests: Callable[[], dict[str, str]] | None = None
        self.map_number = 0
        self.map_spec: Any = None
        self.kept: dict[str, Any] = {}
        self.named_idle = set[Hashable]()
        self.calls_rules = False
        self.asks_all = False
        self.left_as: int | None = None
        self.shown_as: int | None = None
        self.unchecked_arrays = set[Hashable]()

    def take_calls(self, other: "GameInternals | None") -> None:
        """Let a batch call the functions that it calls in another game; None: those of a game at its start."""
        self.calls_rules = other is not None and other.calls_rules
        self.asks_all = other is not None and other.asks_all

    def refuse_misfits(self) -> None:
        """Check the starts of agents and the arrays of array functions, which came from a recording.

        Raises:
            BadValue: the game cannot go on from one; the message names it.
        """
        kept = as_mapping(self.state.data.get(KEPT, {}), "The arrays of array functions")
        for key, arrays in kept.items():
            for name, one in as_mapping(arrays, f"What {shown(key)} keeps").items():
                if getattr(one, "shape", ())[:1] != (1,):
                    raise BadValue(f"{shown(name)} of {shown(key)} must be an array of one game, not {shown(one)}.")
        self.unchecked_arrays = {*kept}
        for name, agent in self._parts.ctx.agent.agents.items():
            start = self.state.began.get(name)
            if start is not None and (type(start) is int) != (agent.type is not AgentType.AERIAL):
                raise BadValue(
                    f"The start of agent {shown(name)} must be a node, or (x, y, z) if it flies, not {start}."
                )

    def warn_of_idle_teams(self) -> None:
        """Log a warning that lists the teams for which nothing decides; a team is named once."""
        ctx = self._parts.ctx
        teams = ctx.agent.block.teams
        strategies = ctx.agent.storage.list_strategies()
        decided = {team for team, strategy in zip(teams, strategies, strict=True) if strategy is not None}
        warn_of_idle(teams, decided.union(ctx.game.plans), self.named_idle, ctx.logger.warning)

    def warn_of_stuck_agents(
        self, seeds_at: Mapping[str, Mapping[int, int]] | None = None, *, has_learners: bool = False
    ) -> None:
        """Log a warning that names agents which decide but cannot move, once; see there."""
        warn_of_stuck_agents(self._parts.ctx, self.named_idle, seeds_at, has_learners=has_learners)

    @property
    def parts(self) -> SnapshotTaker:
        """The parts of the game that snapshots contain."""
        return self._parts

    @property
    def starts(self) -> dict[str, int | Position]:
        """Agent -> its start (a node id or (x, y, z)), once the game has begun."""
        began = self.state.began
        if self.state.start is None:
            return dict(began)
        agents = self._parts.ctx.agent.agents
        if self.state.has_begun:
            snapshot: Snapshot = self.state.start.snapshot
            return snapshot.places_of(agents) | began
        return {name: self.find_start(agent) for name, agent in agents.items()} | began

    def note_starts(self, starts: Iterable[tuple[str, int | Position]]) -> None:
        """Store the starts of agents, by their names, that are created while a game is played."""
        if self.state.has_begun:
            came = dict(starts)
            self.state.began.update(came)
            for name in came:
                drop_deed(self._parts.ctx, name)

    def find_start(self, agent: IAgent) -> int | Position:
        """Return the start of an agent: a node id, or (x, y, z)."""
        state = self.state
        start = self.state.start
        place: int | Position
        if agent.name in state.began:
            place = state.began[agent.name]
        elif state.has_begun and start is not None:
            place = start.snapshot.place_of(agent)
        else:
            place = getattr(agent, "position", agent.current_node_id)
        return place

    @refuse_while_deciding
    def restart_streams(self) -> None:
        """Restart the agents' random streams with the current seed of the context."""
        self._parts.turns.restart_streams()

    @refuse_while_deciding
    def fork(self, seed: int) -> tuple[Any, Memo]:
        """Return a context with a copy of this game, with all random streams based on a seed.

        Returns:
            The context (Any: its class imports this one), and a memo of `copy.deepcopy`: id of an object -> its copy.

        Raises:
            SnapshotError: a turn is being played.
            ContextTerminated: the context has ended.
        """
        self._parts.refuse_in_turn("taken")
        return ForkSource(self._parts, only_plain=False).make_fork(seed)

    @refuse_while_deciding
    def capture(self) -> ForkSource | None:
        """Return the present game, of which a fork can be made later; None: it has objects that are copied at once."""
        self._parts.refuse_in_turn("taken")
        try:
            return ForkSource(self._parts, only_plain=True)
        except NotPlain:
            return None

    def copy_streams(self, target: "GameInternals") -> None:
        """Copy the random streams to a copy of the game, so that it draws the same numbers."""
        target.parts.turns.restore(self._parts.turns.snapshot())

    @refuse_while_deciding
    def restore_rules(self, rules: Sequence[NamedRule]) -> None:
        """Replace all rules, without calling `prepare`."""
        self._parts.rules.put(RuleTable(tuple(rules)))

    @property
    def is_time_up(self) -> bool:
        """Whether the limit of turns of `run` or of the settings was reached."""
        turn = self.state.turn
        last = self.state.last_turn
        most = self._parts.settings.max_turns
        is_past = most is not None and turn > most and (last is None or turn > last)
        return turn in (last, most) or is_past

    @refuse_while_deciding
    def close(self) -> None:
        """Close the event loop and, if the context ends in the middle of a turn before the last one, end the game."""
        turns = self._parts.turns
        state = self.state
        turns.close()
        self.draw_start = None  # it refers to the builder of the game
        if turns.is_playing and state.over is None and not self.is_time_up:
            state.over = {"reason": "closed", "winner": None, "truncated": True}


_IN_ALL_GAMES: dict[str, Any] = {
    "plans": {},
    "time_budget": None,
    "deadline_s": None,
}  # settings


def copy_known(
    known: ForkSource, source: SnapshotTaker, target: SnapshotTaker, memo: Memo, names: frozenset[str]
) -> None:
    """Copy the knowledge of some agents into the game of a new context.

    Args:
        known: the game as it is now.
        source: the parts of the game.
        target: the parts of the new game; its map, agents and sensors are already copies.
        memo: id of an object -> its copy, for the context, its engines, agents and sensors.
        names: the names of the agents.
    """
    start = source.state.start.snapshot
    target.ctx.agent.storage.hide(start.agents, names)
    target.ctx.sensor.storage.hide(start.sensors, names)
    known.copy_means(target, memo, **_IN_ALL_GAMES)
    teams = frozenset(one.team for name, one in source.ctx.agent.agents.items() if name in names)
    state = target.state
    state.data.update(copy_deep(start.data, memo))
    state.copy_logs(known.snapshot.part("logs"))
    state.put_known(source.state, names, teams)
    state.messages = list(select_heard(source.state.messages, names, source.state.turn + 1))
    for log in ("errors", "deeds"):
        setattr(state, log, list(select_own(getattr(source.state, log), names)))
    state.began = select_by_name(known.starts, names)
    for rule in target.rules.rules:
        prepare = rule.spec.prepare
        if prepare is not None and rule.spec.disclose is None:  # it may draw random state that no agent knows
            prepare(target.ctx)
    state.put_known(source.state, names, teams)
    for name in filter(names.__contains__, source.state.memories):
        state.get_memory(name)  # also of agents that remember nothing
    for rule in source.rules.rules:
        disclose = rule.spec.disclose
        if disclose is not None:
            _put_in(state.data, copy_deep(disclose(source.state.data, names), memo))
    state.stream_version += 1
    target.turns.phase.drop_plans()


def _put_in(values: dict[Any, Any], known: Mapping[Any, Any]) -> None:
    """Merge values into others, recursively for dicts."""
    for key, value in known.items():
        if isinstance(value, dict) and isinstance(values.get(key), dict):
            _put_in(values[key], value)
        else:
            values[key] = value
