"""Observations of agents about others, as one short text per agent and turn in their memories.

An entry of a memory is `("belief", turn, observer)` -> JSON: `found` (agent -> node; in games by metres a list of the
node, the time of the turn, and for an agent on an edge the end of the edge, its id and the distance of the agent from
the node), `looks` (where agents that were not found were not noticed) and `closed` (edges that were open until then).
Ascending node ids are written as differences. Only `note` changes an entry later, so that a recording gets each entry
once. In the memory of a team, all observations of a turn are joined, once all members know them, to one entry of the
observer "": a JSON object from observers to their entries. This keeps the memory of a large team small, which each
member copies in each turn.

Reports about earlier turns are in separate entries, because the team may already have joined that turn: `("belief
reports", turn, observer)` -> JSON, a list of (agent, node, turn when it was there, whether a rule put it there).
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, lru_cache
from hashlib import blake2b
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from gamms.arguments import as_context, as_count, as_mapping
from gamms.belief.ground import Arc, BeliefMap, get_belief_map
from gamms.context import Context
from gamms.deciding import get_phase
from gamms.errors import BadType, BadValue, MissingKey
from gamms.ir.agents import are_mates
from gamms.ir.graph import FloatArray, IntArray, as_node_id
from gamms.ir.sensor_results import Coverage
from gamms.knowledge.sides import list_certain
from gamms.text import shown
from gamms.typing import AgentType, IAgent
from gamms.typing.game import AerialState, NodeId, State
from gamms.typing.on_edges import PassedNode

Memory = dict[Any, Any]
Key = tuple[str, int, str]

EdgeIds = tuple[int, int, int]  # ids of the source node, the target node, and the edge

ENTRY = "belief"  # first part of a key
_REPORTS = "belief reports"  # first part of a key of reports about earlier turns
_ALL = ""  # the observer of joined observations of a team; no agent has this name
_MAP = "belief map"  # key of the digest of the map that was seen last
_EVENTS = "belief events"  # key of the number of events of the game that were read
HORIZON = 50  # default minimum number of turns for which looks are remembered
_ALMOST = 0.999999  # the highest probability below 1 that is written

_MOST_TEXTS = 1 << 16  # observations whose texts are read once: those of a batch of several hundred games
_grounds: WeakKeyDictionary[Context, dict[str, BeliefMap]] = WeakKeyDictionary()  # the last maps, by digest
_MOST_MAPS = 4


class ObservedNodes(NamedTuple):
    """Nodes on which agents would have been noticed, with a detection probability."""

    node_ids: IntArray | None  # (nodes,) ascending; None: all nodes
    detection: float | FloatArray  # for all nodes, or (nodes,)
    not_shown: frozenset[str]  # names of agents about which it has no information
    is_convex: bool = False  # whether it also covers straight edges between these nodes


class ExactPosition(NamedTuple):
    """The exact position of an agent, in a game by metres."""

    time: float  # time within the turn, from 0 to 1
    edge: EdgeIds | None = None  # None: on its node
    offset_m: float = 0.0


_ON_NODE = ExactPosition(0.0)


class Observation(NamedTuple):
    """The observations of one agent in one turn."""

    found: Mapping[str, int]  # agent -> its node, or the last node that it passed
    looks: tuple[ObservedNodes, ...]
    closed: tuple[Arc, ...] | None  # edges that were open until this turn; None: unknown
    places: Mapping[str, ExactPosition]  # agent -> exact position, if known


class Report(NamedTuple):
    """A report about the position of an agent in an earlier turn."""

    name: str
    node: int
    turn: int
    is_put: bool  # relocated by a rule, so that earlier observations no longer hold


class Sighting(NamedTuple):
    """A sighting of an agent: the node, the turn and the observer; in games by metres also the edge."""

    node: int  # its node, or the last node that it passed
    turn: int
    by: str
    edge: EdgeIds | None = None  # ids of the source node, the target node, and the edge
    offset_m: float = 0.0  # distance from the source of the edge


class TurnObservations:
    """The observations of some agents in one turn.

    Args:
        turn: number of the turn.
        texts: observer -> entry.

    Attributes:
        texts: the entries, sorted by observer.
        digest: a hash of the texts.
    """

    def __init__(self, turn: int, texts: Mapping[str, str]) -> None:
        self._turn = turn
        self.texts = dict(sorted(texts.items()))
        self.digest = blake2b("\n".join(map("\n".join, self.texts.items())).encode(), digest_size=16).digest()

    @cached_property
    def observations(self) -> list[Observation]:
        """The observations, sorted by observer."""
        return [_read(self._turn, by, text) for by, text in self.texts.items()]

    @cached_property
    def found(self) -> dict[str, Sighting]:
        """Agent -> its sighting; the first observer counts."""
        found: dict[str, Sighting] = {}
        for by, seen in zip(self.texts, self.observations, strict=True):
            for name, node in seen.found.items():
                place = seen.places.get(name, _ON_NODE)
                found.setdefault(name, Sighting(node, self._turn, by, place.edge, place.offset_m))
        return found

    @cached_property
    def joined(self) -> str:
        """All observations together, as one entry."""
        entries = ",".join(f"{json.dumps(by)}:{text}" for by, text in self.texts.items())
        return f"{{{entries}}}"

    @cached_property
    def closed(self) -> tuple[Arc, ...]:
        """Edges that were open until this turn."""
        if not any('"closed"' in text for text in self.texts.values()):  # NOTE: saves reading all entries
            return ()
        return tuple(arc for one in self.observations for arc in one.closed or ())


def join_turns(*memories: Mapping[Any, Any]) -> dict[int, TurnObservations]:
    """Return the observations of each turn, merged from several memories."""
    joined: dict[int, set[str]] = {}
    alone: dict[int, dict[str, str]] = {}
    reports: dict[int, list[tuple[str, Report]]] = {}
    for memory in memories:
        for key, text in as_mapping(memory, "A memory").items():
            if type(key) is not tuple or len(key) != 3:
                continue
            kind, turn, by = key
            if kind not in (ENTRY, _REPORTS):
                continue
            if type(turn) is not int or type(by) is not str or type(text) is not str:
                raise _make_type_error(turn, by, text)
            if kind == _REPORTS:
                for report in _parse_reports(turn, by, text):
                    reports.setdefault(report.turn, []).append((by, report))
            elif by == _ALL:
                joined.setdefault(turn, set()).add(text)
            else:
                known = alone.setdefault(turn, {})
                known[by] = max(text, known.get(by, ""))
    found = {
        turn: _join_turn(turn, tuple(sorted(joined.get(turn, ()))), tuple(alone.get(turn, {}).items()))
        for turn in {*joined, *alone}
    }
    for turn, reported in reports.items():
        found[turn] = _add_reports(turn, found[turn].texts if turn in found else {}, reported)
    return dict(sorted(found.items()))


def _add_reports(turn: int, texts: Mapping[str, str], reports: Iterable[tuple[str, Report]]) -> TurnObservations:
    """Return a turn with later reports about it."""
    entries = {by: json.loads(text) for by, text in texts.items()}
    found: dict[str, dict[str, Any]] = {by: entry.pop("found", {}) for by, entry in entries.items()}
    for by, report in sorted(reports):
        if report.is_put:
            for places in found.values():
                places.pop(report.name, None)
        found.setdefault(by, {}).setdefault(report.name, report.node)
    return TurnObservations(
        turn,
        {by: _as_text({"found": dict(sorted(places.items())), **entries.get(by, {})}) for by, places in found.items()},
    )


@lru_cache(maxsize=_MOST_TEXTS)  # NOTE: saves joining the same hundred turns in each turn
def _join_turn(turn: int, joined: tuple[str, ...], alone: tuple[tuple[str, str], ...]) -> TurnObservations:
    """Return a turn from its joined and its separate entries."""
    parts = [_parse_entries(turn, text) for text in joined]
    parts.append({by: text for by, text in alone if not any(by in one for one in parts)})
    texts: dict[str, str] = {}
    for part in parts:
        for by, text in part.items():
            texts[by] = max(text, texts.get(by, ""))
    return _parse_turn(turn, tuple(sorted(texts.items())))


@lru_cache(maxsize=_MOST_TEXTS)
def _parse_turn(turn: int, texts: tuple[tuple[str, str], ...]) -> TurnObservations:
    return TurnObservations(turn, dict(texts))  # NOTE: the same object for all teammates


@lru_cache(maxsize=_MOST_TEXTS)
def _parse_entries(turn: int, text: str) -> Mapping[str, str]:
    """Return the entries in a joined text, by observer."""
    try:
        return {by: _as_text(entry) for by, entry in json.loads(text).items()}
    except (AttributeError, ValueError, RecursionError) as error:
        raise _make_type_error(turn, _ALL, text) from error


def merge(*memories: Mapping[Any, Any]) -> dict[Key, str]:
    """Return the observations in several memories, sorted by turn and observer.

    Merging observations merges the beliefs of teammates: the result follows from Bayes' rule with all observations, in
    any order, and an observation in several memories counts once.
    """
    return {(ENTRY, turn, by): text for turn, seen in join_turns(*memories).items() for by, text in seen.texts.items()}


def find_last_sightings(turns: Mapping[int, TurnObservations]) -> dict[str, Sighting]:
    """Return the last sighting of each agent; of several observers in one turn, the first by name counts."""
    last: dict[str, Sighting] = {}
    for turn in sorted(turns):
        last |= turns[turn].found
    return dict(sorted(last.items()))


# -- writing observations -------------------------------------------------------------------------------------------


def note_senses(ctx: Context, state: State | AerialState, *, share: bool, horizon: int) -> None:
    """Write to memory the agents of other teams that an agent's sensors show in this turn."""
    agent = as_context(ctx, "observe").agent.get_agent(get_required(state, "name"))
    on_edge = None if state.get("edge") is None else state.get("xy")
    found: dict[str, Any] = dict(_find_respawned_agents(ctx, state, share=share))
    looks = []
    agents = ctx.agent.agents
    graph = ctx.graph.graph
    for report in list_certain(agent, state["sensor"], on_edge, graph, may_be_between=is_by_metres(ctx)):
        places = report.places.items()
        found |= {one: _as_found(ctx, state, node) for one, node in places if _is_other(ctx, state, one)}
        # without agents that were deleted since a late look
        unclear = sorted(one for one in report.unclear if one in agents and _is_other(ctx, state, one))
        looks.append(_write_look(ctx, report.coverage, unclear))
    if state.get("time", 0.0):  # beliefs are about the beginning of the turn, when agents were elsewhere
        looks = []
    _note(ctx, state, {"found": dict(sorted(found.items())), "looks": [look for look in looks if look]}, share=share)
    shared = state.get("team_memory", {})
    for memory in (get_required(state, "memory"), shared):
        _prune(memory, _find_first_kept_turn(state["turn"], as_count(horizon, "horizon")))
    _join(shared, state["turn"])


def note(
    ctx: Context, state: State | AerialState, name: str, node: NodeId, *, turn: int | None = None, share: bool = True
) -> None:
    """Record that an agent is or was on a node, as reported by a custom sensor, a message or a rule.

    Args:
        ctx: the context.
        state: state of the agent that records it, in its strategy.
        name: name of the reported agent.
        node: its node.
        turn: when it was there, as a `state["turn"]`, for example the `turn` of a message; None: now.
        share: whether to write it to `state["team_memory"]`, too.

    Raises:
        UnknownName (KeyError): the agent or the node does not exist.
        BadValue: the turn is in the future.
    """
    graph = as_context(ctx, "note").graph.graph
    where = as_node_id(node, f"node of agent {shown(name)}", graph)
    now = get_required(state, "turn")
    graph.get_node(where)
    agent = ctx.agent.get_agent(name)
    then = now if turn is None else as_count(turn, "turn of note", 0)
    if then > now:
        raise BadValue(f"Agent {agent.name!r} cannot have been on node {where} in turn {then}: this is turn {now}.")
    if then == now:
        _note(ctx, state, {"found": {agent.name: where}, "looks": []}, share=share)
        return
    _report(state, Report(agent.name, where, then, is_put=False), share=share)


def _note(ctx: Context, state: State | AerialState, new: dict[str, Any], *, share: bool) -> None:
    memory = get_required(state, "memory")
    turn = get_required(state, "turn")
    key = (ENTRY, turn, get_required(state, "name"))
    known = json.loads(memory.get(key, "{}"))
    found = dict(sorted({**known.get("found", {}), **new["found"]}.items()))
    looks = new["looks"] or known.get("looks", [])
    entry = {"found": found, "looks": looks, "closed": known.get("closed", []) or _list_closed_edges(ctx, memory)}
    text = _as_text({name: part for name, part in entry.items() if part not in ({}, [])})
    _write(state, key, text, share=share)


def _report(state: State | AerialState, report: Report, *, share: bool) -> None:
    key = (_REPORTS, get_required(state, "turn"), get_required(state, "name"))
    known = json.loads(get_required(state, "memory").get(key, "[]"))
    if list(report) not in known:
        _write(state, key, _as_text([*known, report]), share=share)


def _write(state: State | AerialState, key: Key, text: str, *, share: bool) -> None:
    state["memory"][key] = text
    if share and "team_memory" in state and state.get("team") is not None:
        state["team_memory"][key] = text


def get_required(state: State | AerialState, key: str) -> Any:
    """Return the value of a key of the state.

    Raises:
        MissingKey (KeyError): the key is missing.
    """
    if key not in as_mapping(state, "state"):
        raise MissingKey(
            f"A belief needs state[{key!r}]. ctx.game sets it; in your own loop, set name, team, turn and "
            "memory, a dict that you store for the agent."
        )
    return state[key]  # type: ignore[call-overload] # one of those above


def _is_other(ctx: Context, state: State | AerialState, name: str) -> bool:
    """Return whether an agent is on the ground and on another team than the observer."""
    other = ctx.agent.get_agent(name)
    team = get_required(state, "team")
    is_mate = name == state["name"] or are_mates(team, getattr(other, "team", None))
    return not is_mate and other.type is not AgentType.AERIAL


def is_by_metres(ctx: Context) -> bool:
    """Return whether agents may be anywhere on an edge."""
    return ctx.current_game is not None and ctx.game.speed_unit != "edges"


def _as_found(ctx: Context, state: State | AerialState, node: int) -> int | list[float]:
    """Return the written form of the position of an agent."""
    if not is_by_metres(ctx):
        return int(node)
    place = [*node.edge[1:], node.offset_m] if isinstance(node, PassedNode) else []
    # If teams move one after another, others may not have moved yet in this turn.
    return [int(node), 0.0 if ctx.game.order else state.get("time", 0.0), *place]


def _read_found(value: int | list[Any]) -> tuple[int, ExactPosition | None]:
    """Return the node, and the exact position if it is known."""
    if isinstance(value, int):
        return value, None
    node, time, *place = value
    if not place:
        return int(node), ExactPosition(float(time))
    target, edge, offset = place
    return int(node), ExactPosition(float(time), (int(node), int(target), int(edge)), float(offset))


def _find_respawned_agents(ctx: Context, state: State | AerialState, *, share: bool) -> dict[str, int]:
    """Return where `ctx.game.respawn` has put agents since the last observation, which all strategies can read.

    If the agent may have moved since, it becomes a report about an earlier turn.
    """
    found: dict[str, int] = {}
    if ctx.current_game is None:
        return found
    with get_phase(ctx).suspend(changes_world=False):  # NOTE: saves a copy of all events of the game, 3 us for each
        events = ctx.game.events
    memory = get_required(state, "memory")
    turn = state["turn"]
    known = set[str]()
    for event in reversed(events[memory.get(_EVENTS, 0) :]):
        name = event.get("agent")
        if event["kind"] != "respawned" or name in known or name not in ctx.agent.agents:
            continue
        known.add(name)
        if _is_other(ctx, state, name):
            # A rule for deeds may have moved it in this turn, before the turn of the observer's team.
            then = min(event["turn"], turn) - _may_have_moved(ctx, state, name)
            if then == turn:
                found[name] = event["node"]
            elif then >= 0:  # otherwise it can be anywhere
                _report(state, Report(name, event["node"], then, is_put=True), share=share)
    if len(events) != memory.get(_EVENTS, 0):
        memory[_EVENTS] = len(events)
    return found


def _may_have_moved(ctx: Context, state: State | AerialState, name: str) -> bool:
    """Return whether an agent may have moved between a respawn of the last turn and this observation."""
    part_of = {team: part for part, teams in enumerate(ctx.game.order or ()) for team in teams}
    is_earlier = part_of.get(getattr(ctx.agent.get_agent(name), "team", None), 0) < part_of.get(state["team"], 0)
    # A rule for deeds may have put it where it already was, and then it has moved on; no event names the rule.
    return is_earlier or any(rule.phase == "deeds" for rule in ctx.game.rules)


def _write_look(ctx: Context, covered: Coverage, not_shown: list[str]) -> list[Any]:
    """Return the written form of a look; [] if nothing follows from it."""
    node_ids = covered.node_ids
    detection = covered.detection
    order = np.argsort(node_ids)
    order = order[detection[order] > 0.0]
    if not len(order):
        return []
    ids = node_ids[order]
    chances = detection[order]
    chances = np.where(chances < 1.0, np.minimum(np.round(chances, 6), _ALMOST), 1.0)
    is_even = bool((chances == chances[0]).all())
    is_everywhere = len(ids) == len(ctx.graph.columns().node_ids)
    steps = None if is_everywhere and is_even else np.diff(ids, prepend=0).tolist()
    look = [steps, float(chances[0]) if is_even else chances.tolist()]
    if covered.is_convex and is_by_metres(ctx):
        return [*look, not_shown, 1]
    return [*look, *([not_shown] if not_shown else [])]


@lru_cache(maxsize=_MOST_TEXTS)
def _read(turn: int, by: str, text: str) -> Observation:
    try:
        entry = json.loads(text)
        looks = tuple(_read_look(*look) for look in entry.get("looks", ()))
        closed = entry.get("closed", ())
        arcs = None if closed is None else tuple((int(s), int(t), float(length)) for s, t, length in closed)
        found = {name: _read_found(value) for name, value in entry.get("found", {}).items()}
        places = {name: place for name, (_, place) in found.items() if place is not None}
        return Observation({name: node for name, (node, _) in found.items()}, looks, arcs, places)
    except (AttributeError, KeyError, TypeError, ValueError, ArithmeticError, RecursionError) as error:
        raise _make_type_error(turn, by, text) from error


@lru_cache(maxsize=_MOST_TEXTS)
def _parse_reports(turn: int, by: str, text: str) -> list[Report]:
    try:
        return [Report(str(name), int(node), int(then), bool(put)) for name, node, then, put in json.loads(text)]
    except (TypeError, ValueError, ArithmeticError, RecursionError) as error:
        raise _make_type_error(turn, by, text) from error


def _make_type_error(turn: object, by: object, text: object) -> BadType:
    return BadType(
        f"The memory has {shown(text)} as the observation of {shown(by or 'a team')} in turn {shown(turn)}. "
        f"Keys that begin with {ENTRY!r} belong to gamms.belief; do not write to them."
    )


def _as_text(entry: Mapping[str, Any] | Sequence[Any]) -> str:
    return json.dumps(entry, separators=(",", ":"))


def _read_look(
    steps: list[int] | None, detection: float | list[float], not_shown: Iterable[str] = (), is_convex: int = 0
) -> ObservedNodes:
    ids = None if steps is None else np.cumsum(np.array(steps, np.int64))
    chances = np.array(detection) if isinstance(detection, list) else float(detection)
    return ObservedNodes(ids, chances, frozenset(not_shown), bool(is_convex))


# -- updates of memories
# ----------------------------------------------------------------------------------------------


def _list_closed_edges(ctx: Context, memory: Memory) -> list[list[float]] | None:
    """Return the edges removed since the last observation of the agent; None if that map is no longer known."""
    ground = get_belief_map(ctx.graph.columns())
    known = _grounds.setdefault(ctx, {})
    known[ground.digest] = ground
    while len(known) > _MOST_MAPS:
        del known[next(iter(known))]
    before = memory.get(_MAP, ground.digest)
    memory[_MAP] = ground.digest
    if before == ground.digest:
        return []
    return [list(arc) for arc in sorted(known[before].list_arcs() - ground.list_arcs())] if before in known else None


def _list_keys(memory: Mapping[Any, Any]) -> list[Key]:
    """Return the keys of observations and reports."""
    return [key for key in memory if type(key) is tuple and len(key) == 3 and key[0] in (ENTRY, _REPORTS)]


def _find_first_kept_turn(turn: int, horizon: int) -> int:
    """Return the turn before which looks are forgotten, the same for all agents of a team; it changes rarely.

    Each change means that all results from the first look on are computed again.
    """
    return turn - turn % horizon - horizon


def _prune(memory: Memory, before: int) -> None:
    """Forget looks of earlier turns; last sightings stay."""
    old = [key for key in _list_keys(memory) if key[1] < before]
    if not any(key[0] == _REPORTS or '"looks"' in str(memory[key]) for key in old):
        return
    turns = join_turns(memory)
    last = find_last_sightings(turns)
    oldest = min((one.turn for one in last.values()), default=max(turns))
    for then in (one for one in turns if one < before):
        memory.pop((ENTRY, then, _ALL), None)
        for by, seen in zip(turns[then].texts, turns[then].observations, strict=True):
            written = json.loads(turns[then].texts[by]).get("found", {})
            found = {name: written[name] for name, node in seen.found.items() if last[name][:3] == (node, then, by)}
            closed = {"closed": seen.closed} if seen.closed != () and oldest < then else {}
            memory.pop((ENTRY, then, by), None)
            if found or closed:
                memory[ENTRY, then, by] = _as_text(({"found": found} if found else {}) | closed)
    for key in [key for key in _list_keys(memory) if key[0] == _REPORTS]:
        kept = [report for report in _parse_reports(key[1], key[2], memory.pop(key)) if report.turn >= before]
        if kept:
            memory[key] = _as_text(kept)


def _join(memory: Memory, turn: int) -> None:
    """Join the observations of turns that all members know; all members do the same and get the same result."""
    keys = [key for key in _list_keys(memory) if key[0] == ENTRY]
    then_of = sorted({then for _, then, by in keys if by != _ALL and then < turn - 1})
    turns = join_turns({key: memory[key] for key in keys if key[1] in then_of}) if then_of else {}
    for then, seen in turns.items():
        for by in seen.texts:
            memory.pop((ENTRY, then, by), None)
        memory[ENTRY, then, _ALL] = seen.joined


def get_ground_agent(ctx: Context, name: str) -> IAgent:
    """Return an agent on the ground by name.

    Raises:
        UnknownName (KeyError): the agent does not exist.
        BadType: the agent flies.
    """
    agent = ctx.agent.get_agent(name)
    if agent.type is AgentType.AERIAL:
        raise BadType(f"Beliefs are about agents that move along edges, but {name!r} flies.")
    return agent
