"""From a turn of a recording on: a live context in which the game stands as it stood then."""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from itertools import product
from logging import CRITICAL, getLogger
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from gamms.arguments import as_function_of, as_ids, as_int, as_items, as_mapping
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir import events as kinds
from gamms.ir.events import COMPONENTS, LOGGED, change
from gamms.plugins import Registry
from gamms.recorder import keyframes, sensed
from gamms.recorder.detached import DetachedState
from gamms.recorder.errors import UNFIT, RecordingError, refusing
from gamms.recorder.replaying import Replayer
from gamms.text import as_code, reason, shown
from gamms.typing import SensorType
from gamms.typing.actions import makes_strategies
from gamms.typing.context import HostContext, contexts
from gamms.typing.recorder import OpCodes

if TYPE_CHECKING:
    from gamms.recorder.formats.reader import Reader

Strategies = Mapping[str, Any]  # agent or team -> its strategy
_Logged = tuple[int, int, Any]  # the log, the kind and the data of an event

builders: Registry[Callable[[], HostContext]] = Registry("builder of games", "gamms.builders", "gamms.scenario")
"""What makes a function that builds the game of a recording again: `gamms.scenario`, which is not imported here."""

_SEED_BITS = 63
_HISTORY = (kinds.SNAPSHOT, *LOGGED, kinds.GAME_FACTS, kinds.GAME_TURN)


def opened_context(seed: int, vis_engine: object, *, is_quiet: bool) -> HostContext:
    """Return a fresh context; `vis_engine` None: without a window."""
    level = getLogger("gamms").level  # which stays what the program has made it
    more = {} if vis_engine is None else {"vis_engine": vis_engine}
    made: Any = contexts["gamms"](seed=seed, **more, **({"logger_config": {"level": level}} if level else {}))
    if is_quiet:
        made.logger = getLogger("gamms.quiet")
        made.logger.setLevel(CRITICAL + 1)
    ctx: HostContext = made
    return ctx


def observation(ctx: HostContext, log: kinds.Log, before: DetachedState, turn: int, agent: str) -> dict[str, Any]:
    """Return the state that an agent's strategy got in a turn.

    Args:
        ctx: a context in which the game was resumed from the turn before; it is changed.
        log: of the turn.
        before: the state before it.
        turn: its number.
        agent: its name.

    Raises:
        BadValue: what was sensed is not in the recording.
        UnknownName (KeyError): there was no such living agent.
        RecordingError: what is in the recording is damaged.
    """
    replayer = Replayer(ctx)
    agents = replayer.state.agents
    agents.names, agents.following = before.agents.names_by_number(), before.agents.following
    found = replayer.play_until_sensed(log, agent)
    if found is None:
        if any(kind == kinds.SENSED for kind, _ in kinds.events_of(log)):
            raise UnknownName("living agent", agent, before.agents.columns["names"])
        raise BadValue(
            f"What was sensed in turn {turn} is not in this recording: start it with ctx.record.start(…, sensed=True), "
            "and play by ctx.game."
        )
    try:
        state: dict[str, Any] = ctx.game.observation(agent)
    except UnknownName:
        raise
    except UNFIT as error:
        raise RecordingError(f"Agent {shown(agent)} cannot be asked in turn {turn}: {reason(error)}.") from error
    numbers = {name: number for number, name in agents.names.items()}
    with refusing(f"What was sensed in turn {turn} is damaged", with_type=True):
        looks = sensed.looks_of(found, numbers[agent])
        graph = ctx.graph.graph
        state["sensor"] = {
            look.sensor: (
                SensorType.__members__.get(look.kind, SensorType.CUSTOM),
                sensed.data_of(look, graph, agents.names),
            )
            for _, look in looks
        }
    return state


@contextmanager
def all_or_nothing(ctx: HostContext) -> Iterator[None]:
    """Restore the game of a context if what changes it raises."""
    before, draw_start = ctx.game.snapshot(), ctx.game.internals.draw_start
    try:
        yield
    except BaseException:
        ctx.game.restore(before)
        ctx.game.internals.draw_start = draw_start
        raise


def resume(ctx: HostContext, reader: "Reader", turn: int, then: DetachedState, *, is_fresh: bool) -> None:
    """Set a context to the state of a recording after so many turns.

    Args:
        ctx: the context; its graph is what it was then.
        reader: the recording.
        turn: how many turns.
        then: the state after these.
        is_fresh: whether nothing was done with the context yet.

    Raises:
        RecordingError: it does not fit the context.
    """
    strategies = {name: agent.strategy for name, agent in ctx.agent.agents.items()}
    facts = dict(ctx.game.facts)
    ctx.game.internals.draw_start = None
    ctx.game.internals.state.begin_from_here()
    replayer, past = Replayer(ctx), Past(reader)
    with refusing(f"This game cannot go on from turn {turn}"):
        known = history(reader, past, turn)
        known["facts"] = facts | known["facts"]  # for those which a recording cannot hold
        if is_fresh:
            ctx.game.configure(known["settings"])
        snapshot = then.keyframe(turn) | known
        if ctx.seed != seed_at(reader, turn):
            snapshot["chance"] = None
        delete_others(ctx, snapshot["names"])
        replayer.state.sensor_ids = sensor_ids(reader, past, turn)
        replayer.state.restore(snapshot)
    for name, agent in ctx.agent.agents.items():
        agent.decide_by(strategies.get(name))
    looks = [data for *_, data in past.events(turn, (kinds.VISUALS,))]
    drawings = reader.header.get("drawings", [])
    drawings = [*drawings, *(data for *_, data in past.events(turn, (kinds.VISUAL_COMMANDS,)))]
    replayer.show(looks[-1] if looks else reader.header.get("visuals"), drawings)
    for _, kind, data in past.events(turn, tuple(COMPONENTS)):
        ctx.record.components.apply(OpCodes(kind).name, data, lenient=True)
    drawing = getattr(ctx.visual, "drawing", None)  # a visual engine of the caller's may have none
    if drawing is not None:
        drawing.turns.forget(events=len(ctx.game.events))
        drawing.events.go_to_turn()


def strategies_of(then: DetachedState, given: Strategies) -> dict[str, Any]:
    """Return the strategies of agents by their names, from those of agents and teams.

    Raises:
        BadType: a strategy is not a function.
        UnknownName (KeyError): there is no such agent or team.
        RecordingError: a team is none.
    """
    columns = then.agents.columns
    with refusing("The teams of this recording are damaged"):
        teams = {*columns["teams"]}
    team_of = dict(zip(columns["names"], columns["teams"], strict=True))
    for name, strategy in given.items():
        if name not in team_of and name not in teams:
            raise UnknownName("team or agent", name, [*sorted(map(str, teams)), *team_of])
        if strategy is not None and not makes_strategies(strategy):
            as_function_of(strategy, "A strategy", "the state")
    found = {name: given.get(name, given.get(team)) for name, team in team_of.items()}
    return {name: strategy for name, strategy in found.items() if strategy is not None}


def seed_at(reader: "Reader", turn: int) -> Any:
    """Return the seed of the game after so many turns: that of the recording, unless it was reset to another one."""
    later = [data["seed"] for *_, data in Past(reader).events(turn, (kinds.SNAPSHOT,)) if "seed" in data]
    return [reader.header.get("seed"), *later][-1]


def branches(
    resume: Callable[..., HostContext],
    build: Callable[[], HostContext],
    strategies: Mapping[str, Any],
    seeds: Iterable[int] | None,
    max_turns: int | None,
) -> Iterator[dict[str, Any]]:
    """Yield a row for each seed of each combination of strategies; see `Recording.branch`."""
    if not callable(build):
        raise BadType(f"build must be a function that makes a context, such as scenario.build, not {shown(build)}.")
    strategies = as_mapping(strategies, "strategies")
    chosen: list[int | None] = [None] if seeds is None else [*as_ids(seeds, "seeds")]
    for names, combination in _combinations(strategies):
        with resume(combination, chosen[0], ctx=build()) as ctx:
            for seed in chosen:
                ctx.game.reset(seed)
                yield {**names, "seed": ctx.seed, **_played(ctx, max_turns)}


def _combinations(given: Mapping[str, Any]) -> Iterator[tuple[dict[str, str | None], dict[str, Any]]]:
    """Yield all combinations of strategies by team or agent, with their names in a table; None stands for none given.

    Raises:
        BadType: strategies are neither listed nor named.
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


def _played(ctx: HostContext, max_turns: int | None) -> dict[str, Any]:
    """Play a game to its end; return the row of its result, or what it has raised."""
    try:
        row: dict[str, Any] = ctx.game.run(max_turns).row()
    except Exception as error:  # noqa: BLE001 - which code of users may raise; the other games go on
        return {"error": f"{type(error).__name__}: {reason(error)}"}
    return {**row, "error": None}


def as_seed(given: object, recorded: object) -> int:
    """Return the seed that a caller gave, or that of the recording.

    Raises:
        RecordingError: the recording has none.
    """
    if given is not None:
        return as_int(given, "seed")
    if type(recorded) is not int or recorded.bit_length() > _SEED_BITS:
        raise RecordingError(f"The seed of this recording is {shown(recorded)}, which is none: give resume(…, seed=…).")
    return recorded


def delete_others(ctx: HostContext, names: list[str]) -> None:
    """Delete agents who were not there, and those who came in another order, to be made again."""
    agents = ctx.agent.agents
    for name in [name for name in agents if name not in set(names)]:
        ctx.agent.delete_agent(name)
    now = list(agents)
    first = next((i for i, name in enumerate(now) if name != names[i]), len(now))
    for name in now[first:]:
        ctx.agent.delete_agent(name)


def sensor_ids(reader: "Reader", past: "Past", turn: int) -> set[str]:
    """Return the ids of all sensors that there were until then, at least at the end of a turn."""
    begin = reader.keyframe(0)
    said = [data for *_, data in past.events(turn, (kinds.SENSORS, kinds.SNAPSHOT))]
    said += [] if begin is None else [begin[1]]
    return {sensor["id"] for data in said for sensor in keyframes.sensors_in(data.get("sensor_kinds", ()))}


class Past:
    """Events of some kinds up to a turn; each is read once, whichever turns are asked for."""

    def __init__(self, reader: "Reader") -> None:
        self._reader = reader
        self._known: dict[tuple[int, ...], tuple[int, list[_Logged]]] = {}  # kinds -> until which turn, and the events

    def events(self, turn: int, which: tuple[int, ...]) -> list[_Logged]:
        """Return the events of these kinds in the first turns, each with its log and kind."""
        until, known = self._known.get(which, (0, []))
        if turn > until:
            known += [(log, kind, data) for log, _, kind, data in self._reader.events(until, turn, which)]
            self._known[which] = turn, known
        return known[: bisect_left(known, turn, key=itemgetter(0))]


def history(reader: "Reader", past: Past, turn: int) -> dict[str, Any]:
    """Return what was emitted and published until then, and where agents began."""
    found = reader.keyframe(0)
    begin = {} if found is None else found[1]
    starts = _starts_of(begin)
    known = _history_in(begin)
    for _, kind, data in past.events(turn, _HISTORY):
        if kind == kinds.SNAPSHOT:
            known = _history_in(deepcopy(data))  # whose lists `change` makes longer
        elif kind in LOGGED:
            known[LOGGED[kind]].append(data)
        elif kind == kinds.GAME_FACTS:
            change(known["facts"], data)
        if kind in (kinds.SNAPSHOT, kinds.GAME_TURN):
            starts |= data.get("starts", {})
    return {**known, "starts": starts}


def _history_in(snapshot: Mapping[str, Any]) -> dict[str, Any]:
    found = {"facts": dict(snapshot.get("facts", {})), "settings": snapshot.get("settings", {})}
    return {log: list(snapshot.get(log, ())) for log in LOGGED.values()} | found


def _starts_of(begin: Mapping[str, Any]) -> dict[str, Any]:
    """Return where agents began, by the first keyframe of a recording."""
    if "starts" in begin:
        return dict(begin["starts"])
    places = zip(begin["kind"].tolist(), begin["node"].tolist(), begin["position"].tolist(), strict=True)
    at = (tuple(position) if flies else node for flies, node, position in places)
    return dict(zip(begin["names"], at, strict=True))
