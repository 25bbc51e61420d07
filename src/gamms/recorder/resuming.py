"""Continue a game from a turn of its recording, in a live context."""

from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from itertools import chain, product
from logging import CRITICAL, getLogger
from operator import itemgetter
from types import FunctionType
from typing import TYPE_CHECKING, Any

from gamms.arguments import as_function_of, as_ids, as_int, as_items, as_mapping
from gamms.deciding import get_phase
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir import events as kinds
from gamms.ir.events import COMPONENTS, LOGGED, change
from gamms.knowledge import looks as sensed
from gamms.plugins import Registry
from gamms.recorder import keyframes
from gamms.recorder.detached import DetachedState
from gamms.recorder.errors import UNFIT, RecordingError, report_damage
from gamms.recorder.replaying import Replayer
from gamms.text import as_code, reason, shown
from gamms.typing import SensorType
from gamms.typing.actions import is_factory
from gamms.typing.context import HostContext, contexts
from gamms.typing.game import find_strategy_name
from gamms.typing.recorder import OpCodes

if TYPE_CHECKING:
    from gamms.recorder.formats.reader import Reader

Strategies = Mapping[str, Any]  # agent or team -> its strategy
_Logged = tuple[int, int, Any]  # log, kind and data of an event

builders: Registry[Callable[[], HostContext]] = Registry("builder of games", "gamms.builders", "gamms.scenario")
"""Registered functions that rebuild the game of a recording; implemented by `gamms.scenario`, which is not imported
here."""

_SEED_BITS = 63
_FEW = 5  # agents that a warning names
_HISTORY = (kinds.SNAPSHOT, *LOGGED, kinds.GAME_FACTS, kinds.GAME_TURN, kinds.AGENT_CREATE)


def open_context(seed: int, vis_engine: object, *, is_quiet: bool) -> HostContext:
    """Return a new context; `vis_engine` None: without a window."""
    level = getLogger("gamms").level  # restored, because the program may have set it
    more = {} if vis_engine is None else {"vis_engine": vis_engine}
    made: Any = contexts["gamms"](seed=seed, **more, **({"logger_config": {"level": level}} if level else {}))
    if is_quiet:
        made.logger = getLogger("gamms.quiet")
        made.logger.setLevel(CRITICAL + 1)
    ctx: HostContext = made
    return ctx


def get_observation(ctx: HostContext, log: kinds.Log, before: DetachedState, turn: int, agent: str) -> dict[str, Any]:
    """Return the state that an agent's strategy received in a turn.

    Args:
        ctx: a context resumed at the turn before; it is changed.
        log: log of the turn.
        before: state before the turn.
        turn: number of the turn.
        agent: name of the agent.

    Raises:
        BadValue: the recording has no sensor data.
        UnknownName (KeyError): no living agent had this name.
        RecordingError: the recording is damaged.
    """
    replayer = Replayer(ctx)
    agents = replayer.state.agents
    agents.names = before.agents.get_names_by_number()
    agents.following = before.agents.following
    found = replayer.play_until_sensed(log, agent)
    if found is None:
        if any(kind == kinds.SENSED for kind, _ in kinds.list_events(log)):
            raise UnknownName("living agent", agent, before.agents.columns["names"])
        raise BadValue(
            f"This recording has no sensor data of turn {turn}: start it with ctx.record.start(…, sensed=True), "
            "which also works without sensors, and play by ctx.game."
        )
    try:
        state: dict[str, Any] = ctx.game.observation(agent)
    except UnknownName:
        raise
    except UNFIT as error:
        raise RecordingError(f"Agent {shown(agent)} cannot be asked in turn {turn}: {reason(error)}.") from error
    numbers = {name: number for number, name in agents.names.items()}
    with report_damage(f"The sensor data of turn {turn} are damaged", with_type=True):
        looks = sensed.decode_looks(found, numbers[agent], get_map=ctx.graph.columns)
        graph = ctx.graph.graph
        state["sensor"] = {
            look.sensor: (
                SensorType.__members__.get(look.kind, SensorType.CUSTOM),
                sensed.restore_data(look, graph, agents.names),
            )
            for _, look in looks
        }
    return state


@contextmanager
def restore_on_error(ctx: HostContext) -> Iterator[None]:
    """Restore the game of a context if an error occurs in the block."""
    before = ctx.game.snapshot()
    draw_start = ctx.game.internals.draw_start
    try:
        yield
    except BaseException:
        ctx.game.restore(before)
        ctx.game.internals.draw_start = draw_start
        raise


def resume(ctx: HostContext, reader: "Reader", turn: int, then: DetachedState, *, is_fresh: bool) -> None:
    """Set a context to the state of a recording after a number of turns.

    Args:
        ctx: the context, with the graph of that time.
        reader: reader of the recording.
        turn: number of turns.
        then: state after these turns.
        is_fresh: whether the context is unused.

    Raises:
        RecordingError: it does not fit the context.
    """
    strategies = {name: agent.strategy for name, agent in ctx.agent.agents.items()}
    facts = dict(ctx.game.facts)
    ctx.game.internals.draw_start = None
    ctx.game.internals.state.begin_from_here()
    get_phase(ctx).drop_plans()
    replayer = Replayer(ctx)
    past = EventHistory(reader)
    with report_damage(f"This game cannot go on from turn {turn}"):
        known = read_history(reader, past, turn)
        known["facts"] = facts | known["facts"]  # keep facts that a recording cannot contain
        if is_fresh:
            ctx.game.configure(known["settings"])
        snapshot = then.make_keyframe(turn) | known
        if ctx.seed != find_seed(reader, turn):
            snapshot["chance"] = None
        delete_others(ctx, snapshot["names"])
        ctx.game.internals.parts.turns.note_departed()  # here, where the game has not begun, so they are not of it
        replayer.state.sensor_ids = find_sensor_ids(reader, past, turn)
        replayer.state.restore(snapshot)
        ctx.game.internals.state.departed = find_departed(reader, past, turn)
    for name, agent in ctx.agent.agents.items():
        agent.decide_by(strategies.get(name))
    looks = [data for *_, data in past.list_events(turn, (kinds.VISUALS,))]
    drawings = reader.header.get("drawings", [])
    drawings = [*drawings, *(data for *_, data in past.list_events(turn, (kinds.VISUAL_COMMANDS,)))]
    replayer.show(looks[-1] if looks else reader.header.get("visuals"), drawings)
    for _, kind, data in past.list_events(turn, tuple(COMPONENTS)):
        ctx.record.components.apply(OpCodes(kind).name, data, lenient=True)
    drawing = getattr(ctx.visual, "drawing", None)  # a custom visual engine may have none
    if drawing is not None:
        drawing.turns.jump()


def find_strategies(then: DetachedState, given: Strategies) -> dict[str, Any]:
    """Return the strategies of agents by name, from strategies by agent or team.

    Raises:
        BadType: a strategy is not a function.
        UnknownName (KeyError): the agent or team does not exist.
        RecordingError: the teams are invalid.
    """
    columns = then.agents.columns
    with report_damage("The teams of this recording are damaged"):
        teams = {*columns["teams"]}
    team_of = dict(zip(columns["names"], columns["teams"], strict=True))
    for name, strategy in given.items():
        if name not in team_of and name not in teams:
            raise UnknownName("team or agent", name, [*sorted(map(str, teams)), *team_of])
        if strategy is not None and not is_factory(strategy):
            as_function_of(strategy, "A strategy", "the state")
    found = {name: given.get(name, given.get(team)) for name, team in team_of.items()}
    return {name: strategy for name, strategy in found.items() if strategy is not None}


def complete_strategies(ctx: HostContext, then: DetachedState, own: Collection[str]) -> None:
    """Give agents that came during a recording the strategies that they had, or log a warning that names them.

    A plain function is known by its name from another agent; others, such as those that a factory makes, are not.

    Args:
        ctx: the resumed context, whose other agents have their strategies.
        then: the recorded state.
        own: names of agents that were in the context before, or at the start: they have what the caller gives them.
    """
    agents = ctx.agent.agents
    functions = {
        find_strategy_name(one.strategy): one.strategy
        for one in agents.values()
        if isinstance(one.strategy, FunctionType) and one.strategy.__closure__ is None
    }
    deciding = {one.team for one in agents.values() if one.strategy is not None}
    left_idle = {agents[name].team for name in own if name in agents} - deciding
    columns = then.agents.columns
    missing = []
    for name, recorded in zip(columns["names"], columns["strategies"], strict=True):
        agent = agents[name]
        is_decided = agent.strategy is not None or agent.team in ctx.game.plans
        if name in own or is_decided or not isinstance(recorded, str):
            continue
        if recorded in functions:
            agent.register_strategy(functions[recorded])
        elif agent.team not in left_idle:
            missing.append(name)
    if missing:
        few = ", ".join(map(shown, missing[:_FEW]))
        more = f" and {len(missing) - _FEW} more" if len(missing) > _FEW else ""
        ctx.logger.warning(
            f"resume: no strategy decides for agents that came during the recording, {few}{more}: they stay where they "
            f"are. Give them, resume(…, strategies={{{shown(missing[0])}: …}}), by agent or team."
        )


def find_seed(reader: "Reader", turn: int) -> Any:
    """Return the seed of the game after a number of turns: that of the recording, or of a later reset."""
    later = [data["seed"] for *_, data in EventHistory(reader).list_events(turn, (kinds.SNAPSHOT,)) if "seed" in data]
    return [reader.header.get("seed"), *later][-1]


def play_branches(
    resume: Callable[..., HostContext],
    build: Callable[[], HostContext],
    strategies: Mapping[str, Any],
    seeds: Iterable[int] | None,
    max_turns: int | None,
) -> Iterator[dict[str, Any]]:
    """Yield a row for each seed and combination of strategies; see `Recording.branch`."""
    if not callable(build):
        raise BadType(f"build must be a function that makes a context, such as scenario.build, not {shown(build)}.")
    strategies = as_mapping(strategies, "strategies")
    chosen: list[int | None] = [None] if seeds is None else [*as_ids(seeds, "seeds")]
    for names, combination in _list_combinations(strategies):
        with resume(combination, chosen[0], ctx=build()) as ctx:
            for seed in chosen:
                ctx.game.reset(seed)
                yield {**names, "seed": ctx.seed, **_play_to_end(ctx, max_turns)}


def _list_combinations(given: Mapping[str, Any]) -> Iterator[tuple[dict[str, str | None], dict[str, Any]]]:
    """Yield all combinations of strategies by team or agent, with their names; None means that none is given.

    Raises:
        BadType: strategies are neither a list nor a dict.
    """
    named: list[list[tuple[str | None, Any]]] = []
    for of, some in given.items():
        if isinstance(some, Mapping):
            named.append(list(some.items()))
        else:
            listed = as_items(some, f"strategies[{shown(of)}]", "strategies")
            named.append([(None if one is None else as_code(one), one) for one in listed])
    for chosen in product(*named):
        names = {f"strategies.{of}": name for of, (name, _) in zip(given, chosen, strict=True)}
        yield names, {of: one for of, (_, one) in zip(given, chosen, strict=True) if one is not None}


def _play_to_end(ctx: HostContext, max_turns: int | None) -> dict[str, Any]:
    """Play a game to its end; return the row of its result, or its error."""
    try:
        row: dict[str, Any] = ctx.game.run(max_turns).row()
    except Exception as error:  # noqa: BLE001 - which code of users may raise; the other games go on
        return {"error": f"{type(error).__name__}: {reason(error)}"}
    return {**row, "error": None}


def as_seed(given: object, recorded: object) -> int:
    """Return the seed given by a caller, or the seed of the recording.

    Raises:
        RecordingError: the recording has none.
    """
    if given is not None:
        return as_int(given, "seed")
    if type(recorded) is not int or recorded.bit_length() > _SEED_BITS:
        raise RecordingError(f"The seed of this recording is {shown(recorded)}, not a number: give resume(…, seed=…).")
    return recorded


def delete_others(ctx: HostContext, names: list[str]) -> None:
    """Delete agents that did not exist, and agents whose order differs, which are created again."""
    agents = ctx.agent.agents
    for name in [name for name in agents if name not in set(names)]:
        ctx.agent.delete_agent(name)
    now = list(agents)
    first = next((i for i, name in enumerate(now) if name != names[i]), len(now))
    for name in now[first:]:
        ctx.agent.delete_agent(name)


def find_departed(reader: "Reader", past: "EventHistory", turn: int) -> dict[str, tuple[Any, int]]:
    """Return the agents that were deleted until a turn; see `GameState.departed`.

    In the knowledge of a team, agents are deleted that it does not see any more: then there are none.
    """
    found = reader.keyframe(0)
    if found is None or "audience" in reader.header or not past.list_events(turn, (kinds.AGENT_DELETE,)):
        return {}
    state = DetachedState(deepcopy(found[1]), found[0])
    state.advance(reader, found[0], turn)
    return state.agents.departed


def find_sensor_ids(reader: "Reader", past: "EventHistory", turn: int) -> set[str]:
    """Return the ids of all sensors that existed at the end of any turn until then."""
    begin = reader.keyframe(0)
    said = [data for *_, data in past.list_events(turn, (kinds.SENSORS, kinds.SNAPSHOT))]
    said += [] if begin is None else [begin[1]]
    sensors = chain.from_iterable(keyframes.list_sensors(data.get("sensor_kinds", ())) for data in said)
    return {sensor["id"] for sensor in sensors}


class EventHistory:
    """Events of some kinds up to a turn; each is read only once."""

    def __init__(self, reader: "Reader") -> None:
        self._reader = reader
        self._known: dict[tuple[int, ...], tuple[int, list[_Logged]]] = {}  # kinds -> (last turn read, events)

    def list_events(self, turn: int, which: tuple[int, ...]) -> list[_Logged]:
        """Return the events of these kinds in the first turns, with their logs and kinds."""
        until, known = self._known.get(which, (0, []))
        if turn > until:
            known += [(log, kind, data) for log, _, kind, data in self._reader.events(until, turn, which)]
            self._known[which] = turn, known
        return known[: bisect_left(known, turn, key=itemgetter(0))]


def read_history(reader: "Reader", past: EventHistory, turn: int) -> dict[str, Any]:
    """Return the events and facts until then, and the starts of agents."""
    found = reader.keyframe(0)
    begin = {} if found is None else found[1]
    starts = _read_starts(begin)
    known = _read_history(begin)
    for _, kind, data in past.list_events(turn, _HISTORY):
        if kind == kinds.SNAPSHOT:
            known = _read_history(deepcopy(data))  # copied, because `change` extends its lists
        elif kind in LOGGED:
            known[LOGGED[kind]].append(data)
        elif kind == kinds.GAME_FACTS:
            change(known["facts"], data)
        elif kind == kinds.AGENT_CREATE:
            position = data.get("state", {}).get("position")  # none in the knowledge of a team
            starts[data["name"]] = data["kwargs"]["start_node_id"] if position is None else tuple(position)
        if kind in (kinds.SNAPSHOT, kinds.GAME_TURN):
            starts |= data.get("starts", {})
    return {**known, "starts": starts}


def _read_history(snapshot: Mapping[str, Any]) -> dict[str, Any]:
    found = {"facts": dict(snapshot.get("facts", {})), "settings": snapshot.get("settings", {})}
    return {log: list(snapshot.get(log, ())) for log in LOGGED.values()} | found


def _read_starts(begin: Mapping[str, Any]) -> dict[str, Any]:
    """Return the starts of agents from the first keyframe of a recording."""
    if "starts" in begin:
        return dict(begin["starts"])
    places = zip(begin["kind"].tolist(), begin["node"].tolist(), begin["position"].tolist(), strict=True)
    at = (tuple(position) if flies else node for flies, node, position in places)
    return dict(zip(begin["names"], at, strict=True))
