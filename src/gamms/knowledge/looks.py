"""The reports of sensors: taken from agents that observe, and encoded as columns of ids, one event for each turn."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from math import hypot
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import GraphColumns, IntArray
from gamms.knowledge.fields import FieldFinder, FieldTable, SensorField
from gamms.plain import to_plain
from gamms.text import shown
from gamms.typing import AgentType, IAgent, IGraph
from gamms.typing.context import HostContext
from gamms.typing.sensor_engine import IN_AIR, ON_GROUND

Results = Mapping[str, tuple[Any, Any]]  # sensor -> (type, data), as in a state

# Forms of data: node ids; nodes and edges; agents and nodes; anything else; agents in 3D, and the nodes below; and, in
# encoded data only, agents as places in the list of all agents that the looks report, with their nodes.
_FORMS = range(6)
_IDS, _MAP, _AGENTS, _OTHER, _IN_SPACE, _LISTED = _FORMS
WITH_OTHER = (_OTHER, _IN_SPACE)
_OF_AGENTS_IN_SPACE = frozenset(kind.name for kind in IN_AIR)  # their data are (type, position) for each agent
# Types whose ids are node ids, and whose names are agent names; custom types may differ.
_OF_NODES = ("NEIGHBOR", "MAP", "RANGE", "ARC", "AERIAL", "OCCLUDED_MAP", "OCCLUDED_AERIAL")
_OF_AGENTS = frozenset(kind.name for kind in ON_GROUND | IN_AIR)
_SEEING = frozenset((*_OF_NODES, *_OF_AGENTS))
_INT = frozenset({int})
_UNSIGNED = 1 << 32
_INT64 = range(-(1 << 63), 1 << 63)
_NEAR = 1e-6  # map units: an agent seen this near a node is on it


Nearest = Callable[[Sequence[float]], int]


class Look(NamedTuple):
    """The data of one sensor of an agent.

    Attributes:
        sensor: its name.
        kind: the name of its SensorType.
        form: how the data are held.
        first: node ids, or agent numbers.
        second: edge ids, or the nodes of the agents.
        other: any other data.
        field: the nodes that it covers, if it reports only agents; None: not recorded.
    """

    sensor: str
    kind: str
    form: int
    first: list[int]
    second: list[int]
    other: Any
    field: SensorField | None = None


class Report(NamedTuple):
    """A look with the agents that its numbers stand for.

    Attributes:
        look: the look.
        names: number of an agent -> name.
        is_early: whether agents may have moved since.
    """

    look: Look
    names: Mapping[int, str]
    is_early: bool = False


Reports = Mapping[tuple[str, str], Report]
"""(agent, name of the sensor for it) -> report."""


def take_looks(
    results: Iterable[tuple[int, Results]], numbers: Mapping[str, int], nodes: Mapping[str, int]
) -> Iterator[tuple[int, list[Look]]]:
    """Yield the numbers of agents, and the looks of their sensors.

    Args:
        results: for each agent its number and its sensor data.
        numbers: agent -> number.
        nodes: agent -> its node, or the node below it.
    """
    for agent, each in results:
        of_sensors = [(name, str(getattr(kind, "name", kind)), data) for name, (kind, data) in each.items()]
        yield agent, [_make_look(*one, numbers, nodes) for one in of_sensors]


def take_observed_looks(
    ctx: HostContext,
    finder: FieldFinder,
    agents: Sequence[Any],
    states: Sequence[Mapping[str, Any]],
    numbers: Mapping[str, int],
    *,
    is_early: bool = False,
) -> list[tuple[int, list[Look]]]:
    """Return the numbers of agents, and the looks of their sensors in states from which they decide.

    Args:
        ctx: the context.
        finder: finds the fields of sensors.
        agents: the agents.
        states: the state of each of them.
        numbers: agent -> number.
        is_early: whether agents may have moved since.
    """
    columns = ctx.agent.block
    nodes = dict(zip(columns.names, columns.ids_of(columns.node), strict=True))
    results = [(numbers[agent.name], state["sensor"]) for agent, state in zip(agents, states, strict=True)]
    looks = list(take_looks(results, numbers, nodes))
    finder.note_places()
    for agent, state, (_, own) in zip(agents, states, looks, strict=True):
        carried = agent.sensors
        node = state.get("curr_pos") if is_early else None
        if is_early and not isinstance(node, int):  # it flew
            continue
        for i, look in enumerate(own):
            field = finder.find(carried.get(look.sensor), agent, node)
            if field is not None:
                own[i] = look._replace(field=field)
    return looks


def columns_of(observers: Iterable[tuple[int, list[Look]]], fields: FieldTable, turn: int) -> dict[str, Any]:
    """Return the data of an event.

    Args:
        observers: agent numbers and looks.
        fields: the fields that were written before.
        turn: number of turns before this one.
    """
    agents, counts, which, forms, sizes, ids, others, covered = [list[Any]() for _ in range(8)]
    sensors: dict[tuple[str, str], int] = {}
    looked = list(observers)
    seen = _find_seen(looked)
    place_of = {agent: place for place, agent in enumerate(seen)}
    for agent, own in looked:
        agents.append(agent)
        counts.append(len(own))
        for sensor, kind, form, first, second, other, field in own:
            which.append(sensors.setdefault((sensor, kind), len(sensors)))
            covered.append(field)
            if form == _AGENTS and list(map(seen.get, first)) == second:
                forms.append(_LISTED)
                sizes.append((len(first), 0))
                ids += map(place_of.__getitem__, first)
                continue
            forms.append(form)
            sizes.append((len(first), len(second)))
            ids += first
            ids += second
            if form in WITH_OTHER:
                others.append(other)
    return {
        "agents": _narrow(np.array(agents, np.int64)),
        "counts": _narrow(np.array(counts, np.int64)),
        "sensors": list(sensors),
        "which": _narrow(np.array(which, np.int64)),
        "forms": np.array(forms, np.uint8),
        "sizes": _narrow(np.array(sizes, np.int64).reshape(-1, 2)),
        "ids": _narrow(np.array(ids, np.int64)),
        "others": others,
        **(
            {
                "seen": _narrow(np.array(list(seen), np.int64)),
                "seen_at": _narrow(np.array(list(seen.values()), np.int64)),
            }
            if seen
            else {}
        ),
        **fields.write(covered, turn),
    }


def _find_seen(observers: Iterable[tuple[int, list[Look]]]) -> dict[int, int]:
    """Return the number of each agent that looks report at a node, ascending, and its node in the last look."""
    found: dict[int, int] = {}
    for _, own in observers:
        for look in own:
            if look.form == _AGENTS:
                found.update(zip(look.first, look.second, strict=True))
    return dict(sorted(found.items()))


def _narrow(numbers: "np.ndarray[Any, Any]") -> "np.ndarray[Any, Any]":
    """Return integers of as few bytes as all of them need, if none is negative."""
    if not numbers.size or numbers.min() < 0 or numbers.max() >= _UNSIGNED:
        return numbers
    return numbers.astype(np.min_scalar_type(int(numbers.max())))


class _LookColumns(NamedTuple):
    """The columns of looks, checked.

    Attributes:
        owners: (looks,) number of the agent that looked.
        which: (looks,) place of its sensor.
        forms: (looks,) how its data are held.
        ends: (2 * looks + 1,) where the ids of its first and of its second part begin, and where the last end.
        others: (looks + 1,) the number of items of `others` before each look.
    """

    owners: IntArray
    which: list[int]
    forms: IntArray
    ends: list[int]
    others: list[int]

    def slice_parts(self, row: int) -> tuple[slice, slice]:
        """Return where the first and the second part of the ids of a look are."""
        begin, middle, end = self.ends[2 * row : 2 * row + 3]
        return slice(begin, middle), slice(middle, end)


def _read_columns(data: Mapping[str, Any]) -> _LookColumns:
    """Check the columns of an event; see `decode_looks`."""
    agents, counts, which, forms, ids = (
        _convert_integers(data[name]) for name in ("agents", "counts", "which", "forms", "ids")
    )
    looks = len(which)
    sizes = _convert_integers(data["sizes"], 2)
    if len(forms) != looks or len(sizes) != looks or len(agents) != len(counts):
        raise ValueError("its columns have different lengths")
    if not _add_up(counts, looks) or not _add_up(sizes.reshape(-1), len(ids)):
        raise ValueError("its counts or sizes do not add up")
    sensors = data["sensors"]
    if type(sensors) is not list or not all(type(one) is tuple and [*map(type, one)] == [str, str] for one in sensors):
        raise TypeError("its sensors are not a list of pairs of a name and a kind")
    if looks and not 0 <= int(which.min()) <= int(which.max()) < len(sensors):
        raise ValueError("a look has a sensor that is not listed")
    if not np.isin(forms, _FORMS).all():
        raise ValueError("a look has an unknown form")
    first, second = sizes.T
    has_pairs = np.isin(forms, (_AGENTS, _IN_SPACE))
    if (second != np.where(has_pairs, first, 0))[forms != _MAP].any() or first[forms == _OTHER].any():
        raise ValueError("a look has ids that its form does not have")
    has_other = np.isin(forms, WITH_OTHER)
    if type(data["others"]) is not list or len(data["others"]) != np.count_nonzero(has_other):
        raise ValueError("its other data are not one item for each look that has some")
    ends = np.concatenate(([0], np.cumsum(sizes))).tolist()
    others = np.concatenate(([0], np.cumsum(has_other))).tolist()
    return _LookColumns(np.repeat(agents, counts), which.tolist(), forms, ends, others)


def decode_looks(
    data: Mapping[str, Any], agent: int | None = None, fields: FieldTable | None = None
) -> list[tuple[int, Look]]:
    """Decode looks, of all agents or of one: its number, and each of its looks.

    Args:
        data: the data of an event.
        agent: the number of the agent; None: all.
        fields: the fields that were read before; None: fields are left out.

    Raises:
        KeyError, ValueError, TypeError, IndexError: not a result of `columns_of`.
    """
    columns = _read_columns(data)
    owners = columns.owners
    covered = None if fields is None else fields.read(data, len(owners))
    rows = range(len(owners)) if agent is None else np.flatnonzero(owners == agent).tolist()
    ids = data["ids"].tolist()
    seen = _read_seen(data)
    found = []
    for row in rows:
        sensor, kind = data["sensors"][columns.which[row]]
        first, second = (ids[part] for part in columns.slice_parts(row))
        form = int(columns.forms[row])
        other = data["others"][columns.others[row]] if form in WITH_OTHER else None
        if form == _IN_SPACE and (type(other) is not list or len(other) != len(first)):
            raise ValueError("a look has other positions than agents")
        if form == _LISTED:
            form = _AGENTS
            if first and min(first) < 0:
                raise ValueError("it lists an agent at a negative place")
            pairs = [seen[place] for place in first]
            first = [number for number, _ in pairs]
            second = [node for _, node in pairs]
        field = None if covered is None else covered[row]
        found.append((int(owners[row]), Look(sensor, kind, form, first, second, other, field)))
    return found


def _read_seen(data: Mapping[str, Any]) -> list[tuple[int, int]]:
    """Return the number and the node of each listed agent."""
    if "seen" not in data:
        return []
    numbers, nodes = (_convert_integers(data[name]).tolist() for name in ("seen", "seen_at"))
    return list(zip(numbers, nodes, strict=True))


def _add_up(sizes: IntArray, total: int) -> bool:
    """Return whether sizes are not negative and have a sum, without an overflow for any numbers."""
    if not len(sizes):
        return total == 0
    return int(sizes.min()) >= 0 and int(sizes.max()) <= total and int(sizes.sum()) == total


def renumber_looks(
    data: Mapping[str, Any], number_of: Callable[[int], int], observer_of: Callable[[int], int] | None = None
) -> dict[str, Any]:
    """Return encoded looks with other numbers of agents.

    Args:
        data: result of `columns_of`.
        number_of: number of a seen agent -> new number of the same agent.
        observer_of: the same for the agents that looked; None: `number_of`.

    Raises:
        KeyError, ValueError, TypeError, IndexError: not a result of `columns_of`.
    """
    columns = _read_columns(data)
    ids = data["ids"].astype(np.int64)
    for row in np.flatnonzero(np.isin(columns.forms, (_AGENTS, _IN_SPACE))).tolist():
        part, _ = columns.slice_parts(row)
        ids[part] = [number_of(number) for number in ids[part].tolist()]
    found = {"agents": _map_numbers(data["agents"], observer_of or number_of), "ids": ids}
    if "seen" in data:
        found["seen"] = _map_numbers(data["seen"], number_of)
    wide = {key for key in found if data[key].dtype == np.int64}  # in older recordings
    return {**data, **{key: column if key in wide else _narrow(column) for key, column in found.items()}}


def _map_numbers(column: "np.ndarray[Any, Any]", number_of: Callable[[int], int]) -> "np.ndarray[Any, Any]":
    return np.array([number_of(number) for number in _convert_integers(column).tolist()], np.int64)


def restore_data(look: Look, graph: IGraph, names: Mapping[int, str]) -> Any:
    """Return the original data of a sensor.

    Args:
        look: the decoded look.
        graph: the graph of that time.
        names: number of an agent -> name.

    Raises:
        KeyError: a node, an edge or an agent does not exist.
    """
    if look.form == _IDS:
        return look.first
    if look.form == _MAP:
        nodes = {node: graph.get_node(node) for node in look.first}
        return {"nodes": nodes, "edges": [graph.get_edge(edge) for edge in look.second]}
    if look.form == _AGENTS:
        return {names[agent]: node for agent, node in zip(look.first, look.second, strict=True)}
    if look.form == _IN_SPACE:
        seen = zip(look.first, look.other, strict=True)
        return {names[agent]: (AgentType(kind), tuple(place)) for agent, (kind, place) in seen}
    if look.kind in _OF_AGENTS_IN_SPACE:
        return {name: (AgentType(kind), tuple(place)) for name, (kind, place) in look.other.items()}
    return look.other


_Moment = tuple[int, Any]
"""The number of turns of the game, and the agents with their places."""


class _Observation(NamedTuple):
    """The reports in the state from which an agent decides, the moment, and this state and the one before."""

    reports: Sequence[Report]
    moment: _Moment
    states: tuple[object, object]

    def is_last(self, state: Any) -> bool:
        """Return whether an agent with a state has not observed again."""
        return any(state is one for one in self.states) or state.get("turn") == self.moment[0]


class LiveReports:
    """The last reports of the sensors of a context, as its agents got them; no sensor is asked.

    The reports are noted when agents observe, as soon as there is a game. Others are taken from the states of agents:
    they count as early, and have no fields whose directions matter.

    Args:
        ctx: the context.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self._observed: dict[str, _Observation] = {}
        self._is_following = False
        self._follow()

    def _follow(self) -> None:
        game = self._ctx.current_game
        if game is not None and not self._is_following:
            self._is_following = True
            game.internals.after_observing.append(self.note)
            game.internals.after_reset.append(self._observed.clear)

    def note(self, agents: Sequence[Any], states: Sequence[Mapping[str, Any]]) -> None:
        """Note the reports in the states from which agents decide now."""
        moment = self._find_moment()
        reports = self._take(agents, states)
        for agent, state, own in zip(agents, states, reports, strict=True):
            self._observed[agent.name] = _Observation(own, moment, (state, agent.state))

    def read(self) -> Reports:
        """Return the last report of each sensor of living agents."""
        self._follow()
        now = self._find_moment()
        found = {}
        for agent in self._ctx.agent.create_iter():
            if agent.alive:
                for report in self._list_last(agent, now):
                    found[agent.name, report.look.sensor] = report
        return found

    def _list_last(self, agent: IAgent, now: _Moment) -> Sequence[Report]:
        """Return the last reports of the sensors of an agent."""
        state: Any = agent.state
        known = self._observed.get(agent.name)
        if known is not None and known.is_last(state):
            is_early = known.moment != now
            return [report._replace(is_early=is_early) for report in known.reports]
        if "sensor" not in state:  # it has not observed yet
            return []
        (reports,) = self._take([agent], [state], is_early=True)
        return reports

    def _take(
        self, agents: Sequence[Any], states: Sequence[Mapping[str, Any]], *, is_early: bool = False
    ) -> list[list[Report]]:
        """Return the reports in states, for each agent."""
        names = dict(enumerate(self._ctx.agent.block.names))
        numbers = {name: number for number, name in names.items()}
        finder = FieldFinder(self._ctx)
        looks = take_observed_looks(self._ctx, finder, agents, states, numbers, is_early=is_early)
        return [[Report(look, names, is_early) for look in own] for _, own in looks]

    def _find_moment(self) -> _Moment:
        game = self._ctx.current_game
        names, places = self._ctx.agent.positions.noted()
        return 0 if game is None else game.turn, (list(names), list(places))


def list_seen(look: Look) -> tuple[list[int], list[int]]:
    """Return the nodes of a look, and for each the number of the agent there; -1 if the node itself was seen."""
    if look.kind not in _SEEING:
        return [], []
    if look.form in (_AGENTS, _IN_SPACE):
        return look.second, look.first
    return (look.first, [-1] * len(look.first)) if look.form in (_IDS, _MAP) else ([], [])


def list_parts(look: Look) -> tuple[list[int], list[int], list[tuple[int, int]], Any]:
    """Return ids of nodes and of edges that a look saw, numbers of agents with their nodes, and what else it gave."""
    if look.form == _MAP:
        return look.first, look.second, [], None
    if look.form == _IDS:
        return (look.first, [], [], None) if look.kind in _OF_NODES else ([], [], [], look.first)
    return [], [], list(zip(look.first, look.second, strict=True)), look.other if look.form == _OTHER else None


class Sighting(NamedTuple):
    """The reported position of an agent.

    Attributes:
        node: its node, or the node below it.
        position: (x, y, z) of a flying agent.
    """

    node: int
    position: tuple[float, ...] | None


def make_nearest(columns: Callable[[], GraphColumns]) -> Nearest:
    """Return a function from a place (x, y) to the nearest node, on a map that may change."""

    def nearest(place: Sequence[float]) -> int:
        now = columns()
        return int(now.node_ids[((now.xy - np.asarray(place)) ** 2).sum(axis=1).argmin()])

    return nearest


def sightings(look: Look, nearest: Nearest) -> Iterator[tuple[int | str, Sighting]]:
    """Yield the agents in a look, by number or name, with their positions; false alarms are included by name.

    Args:
        look: the decoded look.
        nearest: function from a place (x, y) to the nearest node; without errors and delays, the node of an agent.
    """
    if look.kind not in _OF_AGENTS:
        return
    if look.form == _AGENTS:
        yield from ((agent, Sighting(node, None)) for agent, node in zip(look.first, look.second, strict=True))
        return
    if look.form == _IN_SPACE:
        seen: Iterable[tuple[int | str, Any]] = zip(look.first, look.other, strict=True)
    else:
        seen = look.other.items() if isinstance(look.other, dict) else ()
    for agent, place in seen:
        if isinstance(place, int):
            yield agent, Sighting(place, None)
        elif look.kind in _OF_AGENTS_IN_SPACE:
            kind, position = place
            yield agent, Sighting(nearest(position[:2]), tuple(position) if kind == AgentType.AERIAL.value else None)
        elif isinstance(place, dict) and isinstance(node := place.get("node_id"), int):
            yield agent, Sighting(node, None)


def find_nodes_below(
    data: Mapping[str, tuple[AgentType, tuple[float, ...]]], graph: IGraph, *, may_be_between: bool
) -> dict[str, int]:
    """Return the nodes of the agents on the ground that were seen from the air; agents between nodes are left out.

    The last node that an agent between nodes passed cannot be seen.

    Args:
        data: agent -> its type and position, without errors.
        graph: the map.
        may_be_between: whether agents may be between nodes.
    """
    found = dict[str, int]()
    for name, (kind, place) in data.items():
        if kind is not AgentType.AERIAL:
            node = graph.get_node(graph.nearest_node(place[0], place[1]))
            if not may_be_between or hypot(node.x - place[0], node.y - place[1]) <= _NEAR:
                found[name] = node.id
    return found


def as_reported(look: Look, nearest: Nearest, names: Mapping[int, str]) -> Look:
    """Return a look reduced to the knowledge of its agent, without true positions and numbers."""
    if look.form == _IN_SPACE:
        return look._replace(second=[nearest(position[:2]) for _, position in look.other])
    if look.form == _AGENTS and look.kind not in _OF_AGENTS:
        places = {names[agent]: node for agent, node in zip(look.first, look.second, strict=True)}
        return look._replace(form=_OTHER, first=[], second=[], other=places)
    return look


def _convert_integers(column: object, *row: int) -> IntArray:
    """Return a column of integers, or of rows of integers of the given shape.

    Raises:
        TypeError: it is not such a column.
        OverflowError: an integer does not fit into int64.
    """
    if not isinstance(column, np.ndarray) or column.dtype.kind not in "iu" or column.ndim != 1 + len(row):
        raise TypeError(f"{shown(column)} is not a column of integers")
    if column.shape[1:] != row:
        raise TypeError(f"{shown(column)} is not a column of rows of {row[0]} integers")
    if column.size and int(column.max()) >= 1 << 63:
        raise OverflowError(f"{shown(column)} has an integer beyond int64")
    return column.astype(np.int64, copy=False)


def _make_look(sensor: str, kind: str, data: object, numbers: Mapping[str, int], nodes: Mapping[str, int]) -> Look:
    if type(data) is list and _are_ids(data):
        return Look(sensor, kind, _IDS, data, [], None)
    if type(data) is dict:
        if data.keys() == {"nodes", "edges"} and isinstance(data["nodes"], dict):
            edges: list[Any] = [getattr(edge, "id", None) for edge in data["edges"]]
            are_nodes = kind in _SEEING or all(getattr(node, "id", None) == key for key, node in data["nodes"].items())
            if are_nodes and _are_ids(data["nodes"]) and _are_ids(edges):
                return Look(sensor, kind, _MAP, list(data["nodes"]), edges, None)
        elif kind in _OF_AGENTS_IN_SPACE and data.keys() <= numbers.keys():
            below = [nodes[name] for name in data]
            return Look(sensor, kind, _IN_SPACE, [numbers[name] for name in data], below, to_plain(list(data.values())))
        elif data.keys() <= numbers.keys() and _are_ids(data.values()):
            return Look(sensor, kind, _AGENTS, [numbers[name] for name in data], list(data.values()), None)
    return Look(sensor, kind, _OTHER, [], [], to_plain(data))


def _are_ids(values: Collection[Any]) -> bool:
    # NOTE: inline for the many nodes that a sensor sees (benchmarks: spectators).
    return _INT.issuperset(map(type, values)) and (not values or (min(values) in _INT64 and max(values) in _INT64))
