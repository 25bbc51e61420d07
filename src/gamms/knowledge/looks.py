"""The reports of sensors: taken from agents that observe, and encoded as columns of ids, one event for each turn."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from math import hypot, isfinite
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core.sight import compute_scale
from gamms.deciding import UNKNOWN_LOOK, get_phase, refuse_unknown_look
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensor_results import AgentLook
from gamms.knowledge.fields import FieldFinder, FieldTable, SensorField
from gamms.plain import to_plain
from gamms.text import shown
from gamms.typing import AgentType, IAgent, IGraph, ISensor
from gamms.typing.context import HostContext
from gamms.typing.sensor_engine import IN_AIR, ON_GROUND, find_owner

Results = Mapping[str, tuple[Any, Any]]  # sensor -> (type, data), as in a state

# Forms of data: node ids; nodes and edges; agents and nodes; anything else; agents in 3D, and the nodes below; and, in
# encoded data only, agents as places in the list of all agents that the looks report, with their nodes; and all agents
# of this list in a disc around the agent that looks.
_FORMS = range(7)
_IDS, _MAP, _AGENTS, _OTHER, _IN_SPACE, _LISTED, _IN_DISC = _FORMS
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
_NO_AGENTS = np.zeros(0, np.int64)
MOST_IN_DISCS = 1 << 24  # looks of this form times listed agents, of one turn: as many may be reported
_PAIRS_AT_ONCE = 1 << 20

Nearest = Callable[[Sequence[float]], int]


class Look(NamedTuple):
    """The data of one sensor of an agent.

    Attributes:
        sensor: its name.
        kind: the name of its SensorType.
        form: how the data are held.
        first: node ids, or agent numbers.
        second: edge ids, or the nodes of the agents.
        other: any other data; for a look that is to be encoded as a disc, its `AgentLook`.
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


def make_look(
    sensor: str, sensor_type: object, data: object, numbers: Mapping[str, int], nodes: Mapping[str, int]
) -> Look:
    """Return a look with the data of a sensor.

    Args:
        sensor: its name.
        sensor_type: its SensorType; or any value that stands for its type.
        data: its data, as in a state.
        numbers: agent -> number.
        nodes: agent -> its node, or the node below it.
    """
    kind = _name_kind(sensor_type)
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


def take_observed_looks(
    ctx: HostContext,
    finder: FieldFinder,
    agents: Sequence[Any],
    states: Sequence[Mapping[str, Any]],
    numbers: Mapping[str, int],
    *,
    is_early: bool = False,
    has_discs: bool = False,
) -> list[tuple[int, list[Look]]]:
    """Return the numbers of agents, and the looks of their sensors in states from which they decide.

    Args:
        ctx: the context.
        finder: finds the fields of sensors.
        agents: the agents.
        states: the state of each of them.
        numbers: agent -> number.
        is_early: whether agents may have moved since.
        has_discs: whether looks at all agents around an agent are discs, which only `make_columns` takes.
    """
    columns = ctx.agent.block
    nodes = dict(zip(columns.names, columns.get_ids(columns.node), strict=True))
    finder.note_places()
    found = []
    for agent, state in zip(agents, states, strict=True):
        carried = agent.sensors
        node = state.get("curr_pos") if is_early else None
        has_fields = not is_early or isinstance(node, int)  # otherwise it flew
        own = []
        for name, (kind, data) in state["sensor"].items():
            sensor = carried.get(name)
            disc = find_disc(sensor, agent.name) if has_discs else None
            if disc is not None:
                own.append(make_disc(name, _name_kind(kind), disc))
                continue
            look = make_look(name, kind, data, numbers, nodes)
            own.append(look._replace(field=finder.find(sensor, agent, node)) if has_fields else look)
        found.append((numbers[agent.name], own))
    return found


def find_disc(sensor: ISensor | None, owner: str) -> AgentLook | None:
    """Return how a sensor reports all agents around the agent that carries it; None: it may report others."""
    of_agents: Any = sensor if hasattr(sensor, "in_arrays") else None
    look: AgentLook | None = None if of_agents is None else of_agents.in_arrays()
    if look is None or not look.is_plain or "sense" in vars(of_agents) or find_owner(of_agents) != owner:
        return None
    return look if not isfinite(look.radius) or compute_scale(look.radius) == 1.0 else None


def make_disc(sensor: str, kind: str, look: AgentLook) -> Look:
    """Return a look at all agents within a radius, which is encoded without these."""
    return Look(sensor, kind, _IN_DISC, [], [], look)


class AgentsOnMap(NamedTuple):
    """The living agents that stand on nodes, in order of creation; one item for each agent.

    Attributes:
        numbers: their numbers.
        nodes: the ids of their nodes.
        teams: their teams.
    """

    numbers: Sequence[int]
    nodes: Sequence[int]
    teams: Sequence[Any]


def make_columns(
    observers: Iterable[tuple[int, list[Look]]], fields: FieldTable, turn: int, living: AgentsOnMap | None = None
) -> dict[str, Any]:
    """Return the data of an event.

    Args:
        observers: agent numbers and looks.
        fields: the fields that were written before.
        turn: number of turns before this one.
        living: all living agents, if some looks are encoded as discs.
    """
    agents, counts, which, forms, sizes, ids, others, covered = [list[Any]() for _ in range(8)]
    sensors: dict[tuple[str, str, AgentLook | None], int] = {}
    looked = list(observers)
    seen = _find_seen(looked, living)
    place_of = {agent: place for place, agent in enumerate(seen)}
    for agent, own in looked:
        agents.append(agent)
        counts.append(len(own))
        for sensor, kind, form, first, second, other, field in own:
            disc = other if form == _IN_DISC else None
            which.append(sensors.setdefault((sensor, kind, disc), len(sensors)))
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
        "sensors": [(sensor, kind) for sensor, kind, _ in sensors],
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
        **({} if living is None else _describe_discs([disc for *_, disc in sensors], living, len(seen))),
        **fields.write(covered, turn),
    }


def _describe_discs(discs: Sequence[AgentLook | None], living: AgentsOnMap, listed: int) -> dict[str, Any]:
    """Return the radius of each sensor whose looks are discs, and which listed agents it shows: some living ones."""
    shown = np.zeros((len(discs), listed), np.bool_)
    for row, disc in enumerate(discs):
        if disc is not None:
            shown[row, : len(living.teams)] = [disc.is_showing(team) for team in living.teams]
    return {"radii": np.array([0.0 if disc is None else disc.radius for disc in discs]), "shown": shown}


def _find_seen(observers: Iterable[tuple[int, list[Look]]], living: AgentsOnMap | None) -> dict[int, int]:
    """Return the number and the node of each listed agent.

    These are all living agents, if some looks are discs; then those that other looks report at a node, ascending, with
    the node in the last look.
    """
    found: dict[int, int] = {}
    for _, own in observers:
        for look in own:
            if look.form == _AGENTS:
                found.update(zip(look.first, look.second, strict=True))
    listed = {} if living is None else dict(zip(living.numbers, living.nodes, strict=True))
    return listed | {agent: node for agent, node in sorted(found.items()) if agent not in listed}


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
    is_empty = np.isin(forms, (_OTHER, _IN_DISC))
    if (second != np.where(has_pairs, first, 0))[forms != _MAP].any() or first[is_empty].any():
        raise ValueError("a look has ids that its form does not have")
    has_other = np.isin(forms, WITH_OTHER)
    if type(data["others"]) is not list or len(data["others"]) != np.count_nonzero(has_other):
        raise ValueError("its other data are not one item for each look that has some")
    ends = np.concatenate(([0], np.cumsum(sizes))).tolist()
    others = np.concatenate(([0], np.cumsum(has_other))).tolist()
    return _LookColumns(np.repeat(agents, counts), which.tolist(), forms, ends, others)


def decode_looks(
    data: Mapping[str, Any],
    agent: int | None = None,
    fields: FieldTable | None = None,
    get_map: Callable[[], GraphColumns] | None = None,
) -> list[tuple[int, Look]]:
    """Decode looks, of all agents or of one: its number, and each of its looks.

    Args:
        data: the data of an event.
        agent: the number of the agent; None: all.
        fields: the fields that were read before; None: fields are left out.
        get_map: returns the map of discs, the first one of the recording; None: no look is a disc.

    Raises:
        KeyError, ValueError, TypeError, IndexError: not a result of `make_columns`.
    """
    columns = _read_columns(data)
    owners = columns.owners
    forms = columns.forms.tolist()
    covered = None if fields is None else _read_fields(data, columns, fields)
    rows = range(len(owners)) if agent is None else np.flatnonzero(owners == agent).tolist()
    discs = _read_discs(data, columns, get_map)
    in_discs = iter(()) if discs is None else discs.find_agents([row for row in rows if forms[row] == _IN_DISC])
    ids = data["ids"].tolist()
    seen, seen_at = (column.tolist() for column in _read_seen(data))
    found = []
    for row in rows:
        sensor, kind = data["sensors"][columns.which[row]]
        first, second = (ids[part] for part in columns.slice_parts(row))
        form = forms[row]
        other = data["others"][columns.others[row]] if form in WITH_OTHER else None
        if form == _IN_SPACE and (type(other) is not list or len(other) != len(first)):
            raise ValueError("a look has other positions than agents")
        if form == _LISTED:
            form = _AGENTS
            if first and min(first) < 0:
                raise ValueError("it lists an agent at a negative place")
            first, second = ([column[place] for place in first] for column in (seen, seen_at))
        field = None if covered is None else covered[row]
        if form == _IN_DISC:
            form = _AGENTS
            first, second, disc = next(in_discs)
            field = None if covered is None else disc
        found.append((int(owners[row]), Look(sensor, kind, form, first, second, other, field)))
    return found


def _read_seen(data: Mapping[str, Any]) -> tuple[IntArray, IntArray]:
    """Return the number and the node of each listed agent."""
    if "seen" not in data:
        return _NO_AGENTS, _NO_AGENTS
    numbers, nodes = (_convert_integers(data[name]) for name in ("seen", "seen_at"))
    if len(numbers) != len(nodes):
        raise ValueError("it lists agents without nodes")
    return numbers, nodes


def _add_up(sizes: IntArray, total: int) -> bool:
    """Return whether sizes are not negative and have a sum, without an overflow for any numbers."""
    if not len(sizes):
        return total == 0
    return int(sizes.min()) >= 0 and int(sizes.max()) <= total and int(sizes.sum()) == total


def _read_fields(data: Mapping[str, Any], columns: _LookColumns, fields: FieldTable) -> list[SensorField | None]:
    """Return the recorded field of each look; discs have none."""
    covered = fields.read(data, len(columns.owners))
    if "fields" in data and data["fields"][columns.forms == _IN_DISC].any():
        raise ValueError("a disc has a recorded field")
    return covered


class _Discs(NamedTuple):
    """The columns of looks at all agents within a radius, checked.

    Attributes:
        which: (looks,) place of the sensor, of all looks.
        middles: (looks,) place in the list of the agent that looks, for discs.
        numbers: (listed,) number of each listed agent.
        nodes: (listed,) its node.
        xy: (listed, 2) its position, if it looks or may be reported, map units.
        radii: (sensors,) map units.
        is_shown: (sensors, listed) whether it may be reported.
    """

    which: IntArray
    middles: IntArray
    numbers: IntArray
    nodes: IntArray
    xy: FloatArray
    radii: FloatArray
    is_shown: BoolArray

    def find_agents(self, looks: Sequence[int]) -> Iterator[tuple[list[int], list[int], SensorField | None]]:
        """Yield for each of these discs the numbers of the agents in it, their nodes, and its field, if it has an end.

        Args:
            looks: the places of the discs among all looks.
        """
        numbers = self.numbers.tolist()
        nodes = self.nodes.tolist()
        x, y = self.xy.T
        size = max(_PAIRS_AT_ONCE // max(len(numbers), 1), 1)
        for begin in range(0, len(looks), size):
            some = np.asarray(looks[begin : begin + size], np.int64)
            middles = self.middles[some]
            radii = self.radii[self.which[some]]
            with np.errstate(over="ignore"):
                dx = x - x[middles, None]
                dy = y - y[middles, None]
                is_near = dx * dx + dy * dy <= (radii * radii)[:, None]  # as `core.sight.is_within`
            is_seen = is_near & self.is_shown[self.which[some]]
            is_seen[np.arange(len(some)), middles] = False
            for row, middle, radius in zip(is_seen, middles.tolist(), radii.tolist(), strict=True):
                places = np.flatnonzero(row).tolist()
                field = SensorField(nodes[middle], radius, b"") if isfinite(radius) else None
                yield [numbers[one] for one in places], [nodes[one] for one in places], field


def _read_discs(
    data: Mapping[str, Any], columns: _LookColumns, get_map: Callable[[], GraphColumns] | None
) -> _Discs | None:
    """Check the columns of discs; None: no look is one. See `decode_looks`."""
    is_disc = columns.forms == _IN_DISC
    if not is_disc.any():
        return None
    if get_map is None:
        raise ValueError("it has discs, and no map is known")
    refuse_many([data])
    numbers, nodes = _read_seen(data)
    radii = _check_array(data["radii"], np.float64, (len(data["sensors"]),))
    is_shown = _check_array(data["shown"], np.bool_, (len(radii), len(numbers)))
    if not (radii >= 0.0).all():
        raise ValueError("a radius is negative or not a number")
    if len(np.unique(numbers)) < len(numbers):
        raise ValueError("it lists an agent twice")
    middles = kernels.find_rows(numbers, columns.owners, np.argsort(numbers))
    if (middles[is_disc] < 0).any():
        raise ValueError("an agent in the middle of a disc is not listed")
    known = get_map()
    rows = kernels.find_rows(known.node_ids, nodes, known.node_order)
    is_needed = np.logical_or.reduce(is_shown, axis=0)
    is_needed[middles[is_disc]] = True
    if (rows[is_needed] < 0).any():
        raise ValueError("an agent that discs report is at a node that is not on the map")
    xy = np.zeros((len(rows), 2))
    xy[is_needed] = known.xy[rows[is_needed]]
    return _Discs(np.array(columns.which, np.int64), middles, numbers, nodes, xy, radii, is_shown)


def refuse_many(events: Iterable[Mapping[str, Any]]) -> None:
    """Raise ValueError if the discs of a turn, times the listed agents, are too many to be read.

    Args:
        events: the data of its events.
    """
    count = sum(int(np.count_nonzero(data["forms"] == _IN_DISC)) * len(data.get("seen", ())) for data in events)
    if count > MOST_IN_DISCS:
        raise ValueError(f"its discs may report {count} agents, more than {MOST_IN_DISCS} in a turn")


def renumber_looks(
    data: Mapping[str, Any], number_of: Callable[[int], int], observer_of: Callable[[int], int] | None = None
) -> dict[str, Any]:
    """Return encoded looks with other numbers of agents.

    Args:
        data: result of `make_columns`.
        number_of: number of a seen agent -> new number of the same agent.
        observer_of: the same for the agents that looked; None: `number_of`.

    Raises:
        KeyError, ValueError, TypeError, IndexError: not a result of `make_columns`.
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
            game.internals.checkpoints.append(self._checkpoint)

    def _checkpoint(self) -> Callable[[], None]:
        """Return a function that drops the reports of a turn that has been taken back."""
        before = self._observed.copy()

        def drop() -> None:
            self._observed.clear()
            self._observed.update(before)

        return drop

    def note(self, agents: Sequence[Any], states: Sequence[Mapping[str, Any]]) -> None:
        """Note the reports in the states from which agents decide now."""
        moment = self._find_moment()
        reports = self._take(agents, states)
        for agent, state, own in zip(agents, states, reports, strict=True):
            self._observed[agent.name] = _Observation(own, moment, (state, _get_last_state(agent)))

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
        state = _get_last_state(agent)
        known = self._observed.get(agent.name)
        if known is not None and known.is_last(state):
            is_early = known.moment != now
            return [report._replace(is_early=is_early) for report in known.reports]
        refuse_unknown_look(state, f"agent {agent.name!r}")
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
        names, places = self._ctx.agent.positions.get_noted()
        return 0 if game is None else game.turn, (list(names), list(places))


def _get_last_state(agent: IAgent) -> Any:
    """Return the last state of an agent; `UNKNOWN_LOOK` if the batch of its game has not kept it."""
    try:
        return agent.state
    except BadValue:
        return UNKNOWN_LOOK


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


def list_sightings(look: Look, nearest: Nearest) -> Iterator[tuple[int | str, Sighting]]:
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


def _check_array(column: object, dtype: type, shape: tuple[int, ...]) -> "np.ndarray[Any, Any]":
    if not isinstance(column, np.ndarray) or column.dtype != dtype or column.shape != shape:
        raise TypeError(f"{shown(column)} is not an array of {dtype.__name__} with the shape {shape}")
    return column


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


def _name_kind(kind: object) -> str:
    """Return the name of the type of a sensor, which may be any value."""
    return str(getattr(kind, "name", kind))


def _are_ids(values: Collection[Any]) -> bool:
    # NOTE: inline for the many nodes that a sensor sees (benchmarks: spectators).
    return _INT.issuperset(map(type, values)) and (not values or (min(values) in _INT64 and max(values) in _INT64))


# -- while a game is recorded -----------------------------------------------------------------------------------------


class SharedLooks(NamedTuple):
    """Looks of sensors that show the same nodes from the same node.

    Attributes:
        sensor: one of the sensors.
        looks: (looks,) their places among all looks.
        rows: (looks,) the rows of their agents.
    """

    sensor: ISensor
    looks: IntArray
    rows: IntArray


class ReportWriter:
    """Writes the reports of the sensors of a context as data of events.

    A sensor that reports all agents around its own is encoded as a disc: the nodes of the agents say what it reports.
    There are discs while all agents stand on nodes of the first map of the recording, and until one of these changes.
    The agents are not asked for states if their sensors give discs, or nodes that depend only on where they stand.

    Args:
        ctx: the context.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self._phase = get_phase(ctx)
        self._finder = FieldFinder(ctx)
        self._fields = FieldTable()  # that were written
        self._replayed_fields = FieldTable()  # of the recording that is replayed
        self._first_map: GraphColumns | None = None
        self._has_first_nodes = False
        self._made_of: tuple[Any, ...] = ()  # what the next three depend on
        self._living: list[int] = []  # the rows of the living agents, if there are discs
        self._shared: list[SharedLooks] = []
        self._columns: dict[str, Any] | None = None  # data of an event without nodes; None: states are needed

    def follow_map(self) -> None:
        """Take the first map, or another one: called whenever the map has changed."""
        self.forget_fields()
        now = self._ctx.graph.columns()
        first = self._first_map
        if first is None:
            self._first_map = now
            self._has_first_nodes = True
        elif not (np.array_equal(first.node_ids, now.node_ids) and np.array_equal(first.xy, now.xy)):
            self._has_first_nodes = False

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that forgets what is written from now on, when the turn has been taken back."""
        fields = self._fields.copy()
        first_map = self._first_map
        has_first_nodes = self._has_first_nodes

        def forget() -> None:
            self._fields = fields
            self._first_map = first_map
            self._has_first_nodes = has_first_nodes
            self._made_of = ()
            self.forget_fields()

        return forget

    def forget_fields(self) -> None:
        """Find the fields of sensors again, because sensors have changed."""
        self._finder.forget()

    def rewrite(self, data: dict[str, Any], turn: int) -> dict[str, Any]:
        """Return an event of a replayed recording with the numbers of fields of this one; see `FieldTable`."""
        return self._fields.rewrite_event(data, self._replayed_fields, turn)

    def write(
        self, agents: Sequence[IAgent], states: Sequence[Mapping[str, Any]], numbers: Sequence[int], turn: int
    ) -> dict[str, Any]:
        """Return the data of an event with the reports in states.

        Args:
            agents: the agents that look.
            states: their states.
            numbers: the number of each agent of the context, by its row.
            turn: number of turns before this one.
        """
        number_of = dict(zip(self._ctx.agent.block.names, numbers, strict=False))
        living = self._list_living()
        has_discs = len(living) > 0
        looks = take_observed_looks(self._ctx, self._finder, agents, states, number_of, has_discs=has_discs)
        return make_columns(looks, self._fields, turn, self._describe_agents(looks, living, numbers))

    def write_without_states(self, agents: Sequence[IAgent], numbers: Sequence[int]) -> dict[str, Any] | None:
        """Return the data of an event with the reports that depend only on where agents stand; None if others do not.

        Args:
            agents: the agents that look.
            numbers: the number of each agent of the context, by its row.
        """
        if not self._are_on_nodes():
            return None
        counts = self._phase.sensor_changes, self._phase.owner_changes, self._ctx.agent.structure_version
        made_of = (*counts, self._has_first_nodes), agents, numbers
        if self._made_of != made_of:
            self._made_of = made_of[0], [*agents], [*numbers]
            self._living = self._list_living()
            self._columns = self._make_columns(agents, numbers)
        if self._columns is None:
            return None
        data = {**self._columns}
        nodes = self._find_nodes()
        if "seen" in data:
            data["seen_at"] = _narrow(nodes[self._living])
        if self._shared:
            data |= self._find_shown(nodes)
        return data

    def _are_on_nodes(self) -> bool:
        block = self._ctx.agent.block
        return not (block.flyers or block.travellers or block.removed)

    def _list_living(self) -> list[int]:
        """Return the rows of the living agents; empty if no looks can be discs."""
        living = [row for row, is_alive in enumerate(self._ctx.agent.block.alive) if is_alive]
        is_possible = self._has_first_nodes and self._are_on_nodes() and len(living) ** 2 <= MOST_IN_DISCS
        return living if is_possible else []

    def _find_nodes(self) -> IntArray:
        """Return the ids of the nodes of all agents, by row."""
        block = self._ctx.agent.block
        return np.asarray(block.get_ids(block.node), np.int64)

    def _describe_agents(
        self, looks: Sequence[tuple[int, list[Look]]], living: Sequence[int], numbers: Sequence[int]
    ) -> AgentsOnMap | None:
        """Return the agents in rows, if some looks are discs."""
        if not any(look.form == _IN_DISC for _, own in looks for look in own):
            return None
        teams = self._ctx.agent.block.teams
        nodes = self._find_nodes()[living].tolist()
        return AgentsOnMap([numbers[row] for row in living], nodes, [teams[row] for row in living])

    def _make_columns(self, agents: Sequence[IAgent], numbers: Sequence[int]) -> dict[str, Any] | None:
        """Return the data of an event without shown nodes; None if the states of agents are needed."""
        row_of = {name: row for row, name in enumerate(self._ctx.agent.block.names)}
        shared: dict[Any, tuple[ISensor, list[int], list[int]]] = {}
        looks = []
        count = 0
        for agent in agents:
            row = row_of[agent.name]
            own = [self._plan_look(name, sensor, agent.name) for name, sensor in agent.sensors.items()]
            planned = [look for look in own if look is not None]
            if len(planned) < len(own):
                return None
            for look in planned:
                if look.form != _IN_DISC:
                    sensor: Any = agent.sensors[look.sensor]
                    _, places, rows = shared.setdefault(sensor.shows_alike, (sensor, [], []))
                    places.append(count)
                    rows.append(row)
                count += 1
            looks.append((numbers[row], planned))
        self._shared = [SharedLooks(one, np.array(some), np.array(rows)) for one, some, rows in shared.values()]
        return make_columns(looks, self._fields, 0, self._describe_agents(looks, self._living, numbers))

    def _plan_look(self, name: str, sensor: ISensor, owner: str) -> Look | None:
        """Return a look of a sensor without what it shows; None if that depends not only on where agents stand."""
        kind = _name_kind(sensor.type)
        disc = find_disc(sensor, owner) if self._living else None
        if disc is not None:
            return make_disc(name, kind, disc)
        if getattr(sensor, "shows_alike", None) is None:
            return None
        return Look(name, kind, _IDS if kind == "NEIGHBOR" else _MAP, [], [], None)

    def _find_shown(self, nodes: IntArray) -> dict[str, Any]:
        """Return the columns with what sensors of nodes show from the nodes of all agents."""
        looks = len(self._columns["which"])  # type: ignore[index] # they are known
        sizes = np.zeros((looks, 2), np.int64)
        parts = []
        for sensor, places, rows in self._shared:
            starts, which = np.unique(nodes[rows], return_inverse=True)
            found = sensor.sense_many(starts)
            for side, one in enumerate((found, found.edges)):
                if one is not None:
                    sizes[places, side] = np.diff(one.offsets)[which]
                    parts.append((2 * places + side, which, one))
        ends = np.concatenate(([0], np.cumsum(sizes)))
        ids = np.empty(ends[-1], np.int64)
        for places, which, one in parts:
            ids[kernels.select_runs(ends, places)[0]] = one.values[kernels.select_runs(one.offsets, which)[0]]
        return {"sizes": _narrow(sizes), "ids": _narrow(ids)}
