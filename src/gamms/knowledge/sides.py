"""Sights, witnessed events and messages of the agents of a side in a turn, and the parts of recordings that it knows.

A side is a team, or an agent without a team. Each column of agents, field of a game and field of an event declares its
audience or role in `ir`; the functions here apply these declarations. What has no declaration is left out.
"""

from collections import ChainMap
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from itertools import chain
from math import inf
from typing import Any, NamedTuple, cast

import numpy as np

from gamms.errors import BadValue, UnknownName
from gamms.ir.events import DECISIONS, EVENTS, GAME_EVENT, MOVES, EventKind, Role
from gamms.ir.graph import IntArray
from gamms.ir.messages import ARRIVALS
from gamms.ir.obstacles import BoolArray
from gamms.ir.schema import AGENT_COLUMNS, Audience
from gamms.ir.sensor_results import Coverage
from gamms.knowledge.fields import find_coverage, find_edge_rows, find_node_rows
from gamms.knowledge.looks import (
    Nearest,
    Report,
    Results,
    Sighting,
    as_reported,
    find_nodes_below,
    list_parts,
    list_sightings,
    make_nearest,
)
from gamms.plain import Plain
from gamms.text import as_text, shown
from gamms.typing import IAgent, IGraph, IGraphEngine, ISensor
from gamms.typing.sensor_engine import IN_AIR, ON_GROUND

HIDDEN = ""  # in place of the name of an agent that is not in view


class Side(NamedTuple):
    """A team, or an agent without a team: a team with the name of such an agent is another side.

    Attributes:
        team: the team; None: the side is an agent.
        agent: the name of an agent without a team; None: the side is a team.
    """

    team: Any
    agent: str | None

    @property
    def text(self) -> str:
        """The team as text, or the name of the agent; several sides of a game may have the same text."""
        return as_text(self.team) if self.agent is None else self.agent

    @property
    def kind(self) -> str:
        """The word that tells the side from others with the same text."""
        if self.agent is not None:
            return "agent"
        return "team" if isinstance(self.team, str) else type(self.team).__name__


def find_side(name: str, team: object) -> Side:
    """Return the side of an agent: its team, or the agent itself if it has no team."""
    return Side(team, name if team is None else None)


def find_side_of(agent: IAgent) -> Side:
    """Return the side of an agent, also of one of another class that has no teams."""
    return find_side(agent.name, getattr(agent, "team", None))


def label_sides(sides: Iterable[Side], known: Container[str] = ()) -> dict[Side, str]:
    """Return a text for each side that no other side has, in the order of the sides.

    This is the text of the side. If several have the same text, it is that of the team that is a text, and the others
    get a word before it: "agent red", "int 1".

    Args:
        sides: the sides; they may be repeated.
        known: texts of sides that were assigned before, perhaps among more sides.
    """
    distinct = dict.fromkeys(sides)
    found: dict[Side, str] = {}
    taken: set[str] = set()
    for side in sorted(distinct, key=lambda one: (one.agent is not None, one.kind != "team")):
        text = side.text
        while text in taken or (side.kind != "team" and f"{side.kind} {text}" in known):
            text = f"{side.kind} {text}"
        taken.add(text)
        found[side] = text
    return {side: found[side] for side in distinct}


def list_assigned_labels(header: Mapping[str, Any]) -> list[str]:
    """Return the texts of sides that the header of a recording has assigned, as `known` of `label_sides`.

    In a cut, agents without a team that are not its own are not named, so these have no text that is named.
    """
    sides = [side for side in header.get("sides") or () if isinstance(side, str)]
    if "audience" not in header:
        return sides
    agents = header.get("agents") or ()
    own = [header["audience"], *agents, *(f"agent {name}" for name in agents)]
    return [*sides, *(f"agent {side}" for side in sides if side not in own)]


def find_named_side(given: object, sides: Iterable[Side]) -> Side:
    """Return the side that a user names: by a team, by its text, or by the name of an agent without a team.

    Args:
        given: the team, the text or the name; "team red" and "agent red" name only a team, or only an agent.
        sides: the sides of the game.

    Raises:
        UnknownName (KeyError): no side has this name.
        BadValue: several sides have this name.
    """
    labels = label_sides(sides)
    found = [side for side in labels if side.agent is None and _is_same_team(side.team, given)]
    if isinstance(given, str):
        found = found or [side for side in labels if side.agent is None and side.text == given]
        found += [side for side in labels if side.agent == given]
        for name in (labels.get, _write_with_kind, _write_with_genus):
            found = found or [side for side in labels if name(side) == given]
    if not found:
        raise UnknownName("team", given, labels.values())
    if len(found) > 1:
        ways = " or ".join(shown(_write_with_genus(side)) for side in found)
        raise BadValue(f"Several sides of this game have the name {shown(given)}. Write {ways} in its place.")
    return found[0]


def _write_with_kind(side: Side) -> str:
    return f"{side.kind} {side.text}"


def _write_with_genus(side: Side) -> str:
    return f"{'team' if side.agent is None else 'agent'} {side.text}"


def _is_same_team(team: object, given: object) -> bool:
    """Return whether a caller gives this team; True, 1.0 and 1 are three teams."""
    is_of_kind = type(given) is type(team) or not any(isinstance(one, bool | float) for one in (given, team))
    return is_of_kind and bool(team == given)


def list_sides(
    header: Mapping[str, Any], first: Mapping[str, Any], is_own: Callable[[str, Any], bool] = lambda _name, _team: True
) -> list[str | None]:
    """Return the sides of a game in the order of their color assignment, which is the same in all cuts.

    A side is its text as by `label_sides`; None for an unknown agent without a team.

    Args:
        header: header of the whole recording.
        first: first keyframe of the game.
        is_own: function of the name and the team of an agent: whether it is known.
    """
    scenario = header.get("scenario")
    teams = scenario.get("teams") if isinstance(scenario, Mapping) else None
    sides = [
        *map(find_side, first["names"], first["teams"]),
        *(Side(team, None) for team in teams or () if isinstance(team, str)),  # some may come later
    ]
    labels = label_sides(sides, list_assigned_labels(header))
    return [label if side.agent is None or is_own(side.agent, None) else None for side, label in labels.items()]


# -- seen -----------------------------------------------------------------------------------------------------------


class AgentPlaces(NamedTuple):
    """Where agents are, and on which side; one item for each agent."""

    names: Sequence[str]
    sides: Sequence[Side]
    rows: IntArray  # (agents,) of their nodes, or the nodes below them; -1: unknown
    is_alive: BoolArray  # (agents,)
    is_standing: BoolArray  # (agents,) on its node: neither on an edge nor in the air


class SideLook(NamedTuple):
    """The report of one sensor, as far as it counts for a side.

    Attributes:
        agent: the name of the agent that carries the sensor.
        nodes: rows of the reported nodes.
        field: rows of the nodes that the sensor covers, if it reports only agents.
        reports_all: whether it reports every agent that stands in its field.
        agents: the names of the agents that it reports where they are.
    """

    agent: str
    nodes: IntArray
    field: IntArray
    reports_all: bool
    agents: Collection[str]


class SeenParts(NamedTuple):
    """The content of a report on a map.

    Attributes:
        nodes: rows of the reported nodes.
        edges: rows of the reported edges.
        agents: the reported agents: name and node row; -1: its actual node was reported.
        other: any other report; None: there is none.
    """

    nodes: IntArray
    edges: IntArray
    agents: Sequence[tuple[str, int]]
    other: Any


def find_seen(report: Report, sensor: ISensor | None, now: Mapping[str, int], map_now: IGraphEngine) -> SeenParts:
    """Return the content of a report, without unknown nodes, edges and agents.

    Args:
        report: the report.
        sensor: its sensor; None: unknown.
        now: agent -> the row of its actual node, or of the node below it.
        map_now: the map.
    """
    look = report.look
    names = report.names
    if has_errors(sensor):
        look = as_reported(look, make_nearest(map_now.columns), names)
    nodes, edges, agents, other = list_parts(look)
    node_rows = find_node_rows(map_now, nodes)
    edge_rows = find_edge_rows(map_now, edges)
    at = find_node_rows(map_now, [node for _, node in agents]).tolist()
    pairs = [(names[number], row) for (number, _), row in zip(agents, at, strict=True) if number in names]
    is_rough = has_errors(sensor) and look.other is not None  # positions in space, which are not those of the agents
    seen = [(name, -1 if now[name] == row and not is_rough else row) for name, row in pairs if name in now]
    return SeenParts(node_rows[node_rows >= 0], edge_rows[edge_rows >= 0], seen, other)


def as_side_look(
    agent: str, sensor: ISensor | None, seen: SeenParts, field: IntArray, *, is_early: bool = False
) -> SideLook:
    """Return the part of a report that a side sees; of sensors with errors, only the true part.

    An early report tells which nodes were seen, but not which agents are on them now.
    """
    if is_early:
        return SideLook(agent, seen.nodes[:0], np.concatenate([seen.nodes, field]), reports_all=False, agents=())
    found = [name for name, row in seen.agents if row < 0 or not has_errors(sensor)]
    return SideLook(agent, seen.nodes, field, is_reporting_all(sensor), found)


def has_errors(sensor: ISensor | None) -> bool:
    """Return whether a sensor may report agents where they are not."""
    return bool(getattr(sensor, "has_errors", False))


def is_reporting_all(sensor: ISensor | None) -> bool:
    """Return whether a sensor reports every agent that stands in its field, where it is and at once."""
    return bool(getattr(sensor, "reports_all", False))


class SideKnowledge(NamedTuple):
    """The nodes that a side sees, as ascending rows, and the visible agents of other sides, by name."""

    nodes: IntArray
    agents: Sequence[str]


def find_known(
    sides: Iterable[Side], looks: Iterable[SideLook], places: AgentPlaces, nodes: int
) -> dict[Side, SideKnowledge]:
    """Return what sides see: side -> its knowledge.

    A side sees the nodes of its living agents, and those that their sensors report or cover. It sees the agents that
    are reported where they are, and those that stand on its nodes. In the field of a sensor that misses agents, reports
    them late or elsewhere, or leaves teams out, only its reports count.

    Args:
        sides: the sides.
        looks: the reports of all sensors.
        places: the agents.
        nodes: the number of nodes of the map.
    """
    living = {name: row for row, name in enumerate(places.names) if places.is_alive[row]}
    clear = {side: np.zeros(nodes + 1, bool) for side in sides}  # the last item is for unknown nodes, row -1
    shaded = {side: np.zeros(nodes + 1, bool) for side in clear}
    reported: dict[Side, dict[str, None]] = {side: {} for side in clear}
    for row in living.values():
        if places.sides[row] in clear:
            clear[places.sides[row]][places.rows[row]] = True
    for look in looks:
        side = places.sides[living[look.agent]] if look.agent in living else None
        if side is None or side not in clear:
            continue
        clear[side][look.nodes] = True
        (clear if look.reports_all else shaded)[side][look.field] = True
        reported[side].update(dict.fromkeys(look.agents))
    side_of = dict(zip(places.names, places.sides, strict=True))
    known = {}
    for side, mask in clear.items():
        mask[-1] = False
        standing = np.flatnonzero(places.is_standing & mask[places.rows]).tolist()
        found = reported[side] | dict.fromkeys(places.names[row] for row in standing)
        others = [name for name in found if side_of.get(name) != side]
        known[side] = SideKnowledge(np.flatnonzero((mask | shaded[side])[:-1]), others)
    return known


def find_sighted(reports: Iterable[Report], others: Container[str], nearest: Nearest) -> dict[str, Sighting]:
    """Return which other agents sensors report, false alarms included, each with its position in the last report.

    Args:
        reports: the reports of the sensors of a side.
        others: the names of the agents of other sides.
        nearest: function from a place (x, y) to the nearest node.
    """
    found = {}
    for look, names, _ in reports:
        for agent, sighting in list_sightings(look, nearest):
            name = names.get(agent) if isinstance(agent, int) else agent
            if name is not None and name in others:
                found[name] = sighting
    return found


def find_known_flags(data: Mapping[Any, Any], is_in_view: Callable[[str], bool]) -> dict[Any, dict[str, Any]]:
    """Return the flags in the data of rules as a side knows them: their homes, and by which agent each is carried.

    All sides know the homes, and which flags are not there. The name of a carrier that is not in view is "".

    Args:
        data: the data of the rules of a game, by key.
        is_in_view: whether an agent is of the side, or seen by it.
    """
    found = {}
    for key, kept in data.items():
        if isinstance(kept, Mapping) and all(isinstance(kept.get(part), Mapping) for part in ("bases", "carriers")):
            carriers = {
                team: name if name is None or is_in_view(name) else HIDDEN for team, name in kept["carriers"].items()
            }
            found[key] = {"bases": dict(kept["bases"]), "carriers": carriers}
    return found


# -- certain --------------------------------------------------------------------------------------------------------


class CertainReport(NamedTuple):
    """The part of a sensor's report that an agent knows for certain, about agents on the ground at the present time.

    Attributes:
        places: agent -> its node, or a `PassedNode` on an edge.
        coverage: the nodes on which the sensor would have shown other agents.
        unclear: names of agents that may be on covered nodes although they are not in `places`.
    """

    places: Mapping[str, int]
    coverage: Coverage
    unclear: set[str]


_NO_COVERAGE = Coverage(np.zeros(0, np.int64), np.zeros(0), ())


def list_certain(
    agent: IAgent,
    sensed: Results,
    on_edge: tuple[float, float] | None,
    graph: IGraph,
    *,
    may_be_between: bool,
) -> Iterator[CertainReport]:
    """Yield what each sensor that shows agents has told an agent in its present look.

    Reports of sensors that err or report late give no certain places. Sensors that do not tell their coverage exclude
    no places.

    Args:
        agent: the agent.
        sensed: the reports of its sensors, as in its state.
        on_edge: the position of the agent between nodes; None: it is at a node, or in the air.
        graph: the map.
        may_be_between: whether agents may be between nodes.
    """
    for name, (kind, data) in sensed.items():
        if kind not in ON_GROUND | IN_AIR:
            continue
        sensor = agent.sensors.get(name)
        coverage = None if sensor is None else find_coverage(sensor, agent, on_edge)
        if coverage is None:
            coverage = _NO_COVERAGE
        places: Mapping[str, int] = {}
        if coverage.is_exact:
            places = data if kind in ON_GROUND else find_nodes_below(data, graph, may_be_between=may_be_between)
        yield CertainReport(places, coverage, {*coverage.not_shown, *(data.keys() - places.keys())})


# -- witnessed ------------------------------------------------------------------------------------------------------

_TURNS = 10  # for which views are remembered


class KnownAgents(NamedTuple):
    """The agents that a side knows at a moment.

    Attributes:
        own: name -> team, of the agents of the side.
        seen: the names of the agents of other sides that it sees.
        names: the names of all agents of the game so far.
        by_number: number of an agent in events -> its name, for all present agents.
    """

    own: Mapping[str, Any]
    seen: Container[str]
    names: Container[str]
    by_number: Mapping[int, str]

    def is_in_view(self, name: str) -> bool:
        """Return whether an agent is of the side, or seen by it."""
        return name in self.own or name in self.seen


def is_witnessed(kind: int, data: Mapping[str, Any], agents: KnownAgents) -> bool:
    """Return whether a side knows of an event: it names no agents, or one that is in view.

    The decisions of an agent are known to its side only.

    Args:
        kind: the kind of the event.
        data: its data.
        agents: the agents that the side knows.
    """
    if data.get("kind") in DECISIONS and "agent" in data:
        return data["agent"] in agents.own
    actors = [data[key] for key, field in EVENTS[kind].fields.items() if field.role is Role.AGENT]
    named = actors or [text for text in _list_texts(data) if text in agents.names]
    return not named or any(map(agents.is_in_view, named))


class PastViews:
    """Which agents sides saw in the last turns, to tell which of them know of an event."""

    def __init__(self) -> None:
        self._seen: dict[int, dict[Side, frozenset[str]]] = {}  # turn -> side -> names of agents
        self._members: tuple[Mapping[str, Side], dict[Side, dict[str, Any]]] = ({}, {})

    def note(self, turn: int, side: Side, names: Iterable[str], *, is_early: bool = False) -> None:
        """Note the agents of other sides that a side sees when a turn begins.

        Args:
            turn: the number of the turn.
            side: the side.
            names: the names of the agents.
            is_early: whether this was read after the turn; then it does not replace what is known.
        """
        seen = self._seen.setdefault(turn, {})
        if not is_early or side not in seen:
            seen[side] = frozenset(names)
        for other in [one for one in self._seen if not turn - _TURNS < one <= turn + 1]:  # later: before a reset
            del self._seen[other]

    def find_witnesses(self, event: Mapping[str, Any], side_of: Mapping[str, Side]) -> set[Side]:
        """Return the sides that know of an event of the game.

        Args:
            event: an entry of the log of events.
            side_of: agent -> its side; another mapping when sides change.
        """
        if self._members[0] is not side_of:  # NOTE: not for each event (benchmarks: films)
            members: dict[Side, dict[str, Any]] = {}
            for name, side in side_of.items():
                members.setdefault(side, {})[name] = side.team
            self._members = side_of, members
        deleted: dict[str, Any] = {event[key]: None for key in ("agent", "other") if isinstance(event.get(key), str)}
        names = ChainMap(deleted, cast("dict[str, Any]", side_of))
        seen = self._seen.get(event["turn"], {})
        return {
            side
            for side, own in self._members[1].items()
            if is_witnessed(GAME_EVENT, event, KnownAgents(own, seen.get(side, frozenset()), names, {}))
        }


def select_own(entries: Iterable[Mapping[str, Any]], names: Container[str]) -> Iterator[dict[str, Any]]:
    """Yield copies of the entries of a log of deeds or errors that are about agents of a side."""
    return (dict(entry) for entry in entries if entry.get("agent") in names)


def _list_texts(value: object) -> Iterator[str]:
    """Yield all texts in a plain value, including lists and dicts."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        yield from _list_texts([*value.keys(), *value.values()])
    elif isinstance(value, (list, tuple, set, frozenset)):
        for one in value:
            yield from _list_texts(one)


# -- heard ----------------------------------------------------------------------------------------------------------


def select_heard(entries: Iterable[Mapping[str, Any]], names: Container[str], turn: float) -> Iterator[dict[str, Any]]:
    """Yield the messages that agents have sent or heard, without what became of them elsewhere or in later turns.

    Args:
        entries: the log of messages; see `ir.messages`.
        names: the names of the agents.
        turn: the last turn of which they know.
    """
    for entry in entries:
        heard = find_receivers(entry, names, turn)
        if entry["sender"] in names or any(heard.values()):
            yield {**entry, **heard, "lost": [], "jammed": []}


def find_receivers(entry: Mapping[str, Any], names: Container[str], turn: float) -> dict[str, dict[str, int]]:
    """Return which of the agents have heard or overheard a message until a turn, each with its turn of arrival."""
    return {key: {name: at for name, at in entry[key].items() if name in names and at <= turn} for key in ARRIVALS}


def split_heard(entry: Mapping[str, Any], names: Container[str]) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the turns in which agents learn of a message, each with what they know of it then.

    Senders know their message at once; others when it arrives. The turns are numbers of turns after it was sent.

    Args:
        entry: an entry of the log of messages; see `ir.messages`.
        names: the names of the agents.
    """
    known = {**entry, "lost": [], "jammed": []}
    heard = find_receivers(entry, names, inf)
    if entry["sender"] in names:
        yield 0, known | heard
        return
    for turn in sorted(set(chain.from_iterable(each.values() for each in heard.values()))):
        now = {key: {name: at for name, at in each.items() if at == turn} for key, each in heard.items()}
        yield max(turn - entry["turn"], 0), known | now


# -- parts of recordings ----------------------------------------------------------------------------------------------


_PUBLIC_ENTRIES = ("format", "package", "created", "world", "world_sha256")
_PUBLIC_ARTISTS = (
    "graph",
    "obstacles",
    "flags",
    "territory",
    "tags",
    "goals",
    "held",
    "discovered",
    "resources",
    "cooldowns",
    "doing",
)
_OF_AGENTS = (Role.AGENT, Role.NUMBER, Role.EACH, Role.BY_AGENT, Role.BY_TEAM)
_OF_VISUALS = ("artists", "is_declared", "team_colors")
_KNOWN_COLUMNS = {
    part.name
    for column in AGENT_COLUMNS
    for part in (column.parts or (column,))
    if column.find_audience() is not Audience.HOST
}


def select_public_entries(header: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of the header of a recording that everybody knows; others may name agents of other sides."""
    return {key: header[key] for key in _PUBLIC_ENTRIES if key in header}


def select_visuals(
    visuals: Mapping[str, Any], agents: Container[str], sensors: Container[str], unknown: Container[str]
) -> dict[str, Any]:
    """Return the artists and colors that a side knows.

    Artists with custom drawers or shapes are left out, because they see everything.

    Args:
        visuals: the artists and colors in the header of the whole recording.
        agents: the names of the agents that the side has seen so far, and of its own.
        sensors: the ids of its sensors.
        unknown: the names of agents of which it may not know the colors.
    """
    names = {"agent": agents, "sensor": sensors}
    artists = [
        one
        for one in visuals["artists"]
        if one["kind"] in _PUBLIC_ARTISTS or one["keywords"].get("name") in names.get(one["kind"], ())
    ]
    known = {key: visuals[key] for key in _OF_VISUALS if key in visuals} | {"artists": artists}
    if "team_colors" in known:
        known["team_colors"] = {side: one for side, one in known["team_colors"].items() if side not in unknown}
    return known


def select_columns(columns: Mapping[str, Any], rows: Sequence[int]) -> dict[str, Any]:
    """Return the columns of the agents of a side, with empty values in columns that only the host knows.

    Args:
        columns: the columns of all agents, as in a keyframe.
        rows: the rows of the agents of the side.
    """
    selected: dict[str, Any] = {}
    for name, values in columns.items():
        own = values[rows] if isinstance(values, np.ndarray) else [values[row] for row in rows]
        if name not in _KNOWN_COLUMNS:
            own = np.zeros_like(own) if isinstance(own, np.ndarray) else [None] * len(rows)
        selected[name] = own
    return selected


def select_history(history: Mapping[str, Any], agents: KnownAgents, turn: int) -> dict[str, Any]:
    """Return copies of the known parts of a keyframe beside its columns and the fields of the game.

    Args:
        history: the keyframe.
        agents: the agents that the side knows.
        turn: the last turn of which it knows.
    """
    given = {"events": [], **history}
    return {key: select(given[key], agents, turn) for key, select in _HISTORY.items() if key in given}


def _copy_public(value: Plain, _agents: KnownAgents, _turn: int) -> Any:
    return deepcopy(value)


def _select_events(events: Sequence[Mapping[str, Any]], agents: KnownAgents, _: int) -> list[Mapping[str, Any]]:
    return [deepcopy(event) for event in events if is_witnessed(GAME_EVENT, event, agents)]


def _select_settings(given: Mapping[str, Any], agents: KnownAgents, _: int) -> dict[str, Any]:
    """Return the settings of a game without declarations of deeds, which are known when they are done.

    Channels that only other sides use are left out; of the others, those who overhear, relay or jam among other sides.
    """
    own = [*agents.own, *agents.own.values()]
    settings = {key: deepcopy(value) for key, value in given.items() if key != "deeds"}
    for name, channel in [*settings.get("channels", {}).items()]:
        listed = [key for key in ("eavesdroppers", "relay") if isinstance(channel.get(key), list | tuple)]
        members = {key: [one for one in channel[key] if one in own] for key in listed}
        channel.update(members)
        if "jammers" in channel:
            channel["jammers"] = [
                one for one in channel["jammers"] if one.get("agent", one.get("team")) in [None, *own]
            ]
        if not (any(members.values()) or any(team in own for team in channel.get("teams", own))):
            del settings["channels"][name]
    return settings


_HISTORY: dict[str, Callable[[Any, KnownAgents, int], Any]] = {
    "pace": _copy_public,
    "components": _copy_public,
    "events": _select_events,
    "settings": _select_settings,
    "facts": _copy_public,
    "deeds": lambda deeds, agents, _: list(select_own(deeds, agents.own)),
    "messages": lambda messages, agents, turn: list(select_heard(messages, agents.own, turn)),
    "starts": lambda starts, agents, _: select_by_name(starts, agents.own),
}
"""Part of a keyframe beside its columns -> function that returns the part that a side knows; others are left out."""


def select_by_name(values: Mapping[str, Any], names: Container[str]) -> dict[str, Any]:
    """Return the values of some agents, by name."""
    return {name: value for name, value in values.items() if name in names}


def select_event(kind: int, data: Plain, agents: KnownAgents) -> Any:
    """Return the part of the data of an event that a side knows when it happens; None if it knows nothing.

    Messages are known in the turns of `split_heard`; here they are left out. An event for all may name one agent: it is
    known while the side sees this agent, see `names_only`.

    Args:
        kind: the kind of the event.
        data: its data; moves are a flat list of numbers and nodes.
        agents: the agents that the side knows.

    Raises:
        KeyError, TypeError, ValueError, IndexError: the data do not fit the kind.
    """
    known = EVENTS.get(kind)
    if known is None or known.audience in (Audience.HOST, Audience.HEARD):
        return None
    if known.audience is Audience.WITNESSED:
        return data if is_witnessed(kind, data, agents) else None
    if kind == MOVES:
        pairs = zip(map(int, data[::2]), map(int, data[1::2]), strict=True)
        own = [pair for pair in pairs if agents.by_number.get(pair[0]) in agents.own]
        return list(chain.from_iterable(own)) or None
    if known.is_tuple:  # (number, …)
        return data if agents.by_number.get(data[0]) in agents.own else None
    return _select_fields(known, data, agents)


def names_only(kind: int, data: Plain, is_shown: Callable[[str], bool]) -> bool:
    """Return whether an event names no agent in a field of its own that is not shown to a side.

    Witnessed events and messages may: who witnesses or hears them knows of the agents in them.

    Args:
        kind: the kind of the event.
        data: its data.
        is_shown: whether an agent exists for the side at this moment.
    """
    known = EVENTS[kind]
    if known.is_tuple or known.audience in (Audience.WITNESSED, Audience.HEARD):
        return True
    keys = [key for key, field in known.fields.items() if field.role is Role.AGENT and isinstance(data.get(key), str)]
    return all(is_shown(data[key]) for key in keys)


def _select_fields(known: EventKind, data: Mapping[str, Any], agents: KnownAgents) -> dict[str, Any] | None:
    """Return the fields of an event that a side knows; fields that its kind does not declare are left out."""
    rows = _find_own_rows(known, data, agents)
    is_told = known.audience is Audience.ALL
    found = {}
    for key, value in data.items():
        field = known.fields.get(key)
        if field is None:
            continue
        items = value
        if field.role is Role.AGENT and isinstance(value, str):
            is_told = is_told or value in agents.own
        elif field.role in _OF_AGENTS:
            items = _select_items(field.role, value, rows, agents)
            is_told = is_told or len(items) > 0
            if field.is_optional and not len(items):
                continue
        found[key] = items
    return found if is_told else None


def _find_own_rows(known: EventKind, data: Mapping[str, Any], agents: KnownAgents) -> list[int]:
    """Return the rows of the agents of a side in the columns of an event."""
    names: list[str] = []
    for key, field in known.fields.items():
        if field.role is Role.NUMBER:
            names = [agents.by_number[number] for number in np.asarray(data[key]).tolist()]
        elif field.role is Role.AGENT and isinstance(data.get(key), list):
            names = data[key]
    return [row for row, name in enumerate(names) if name in agents.own]


def _select_items(role: Role, value: Plain, rows: list[int], agents: KnownAgents) -> Any:
    """Return the part of the value of a field that is about the agents of a side."""
    if role is Role.BY_AGENT:
        return select_by_name(value, agents.own)
    if role is Role.BY_TEAM:
        teams = set(agents.own.values())
        return [pair for pair in value if pair[0] in teams]
    return value[rows] if isinstance(value, np.ndarray) else [value[row] for row in rows]
