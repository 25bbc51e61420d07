"""The nodes that sensors of agents cover, as recordings hold them: each field once, then only its number.

A field is a place, a radius, and a bit for each node within it that is hidden or outside the angle of view. So a disc
takes a few bytes on any map, and a reader finds the same nodes without the sensor.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from itertools import islice
from math import inf, isfinite
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import NotOffered
from gamms.ir.graph import IntArray
from gamms.ir.sensor_results import Coverage
from gamms.typing import IAgent, IGraph, IGraphEngine, ISensor
from gamms.typing.context import HostContext
from gamms.typing.on_edges import locate
from gamms.typing.sensor_engine import find_place_of_look

Places = Mapping[str, tuple[float, float]]
"""Agent between nodes -> its position."""
Place = int | tuple[float, ...]
"""A node id, or a position."""

_TURNS = 256  # in which fields are numbered; readers that begin later read the reports of at most so many turns
_COLUMNS = ("fields", "first_field", "new_fields")
_MOST_KNOWN = 20_000  # poses
_NONE = np.zeros(0, np.int64)


class SensorField(NamedTuple):
    """The nodes within a radius of a place, without hidden ones.

    Attributes:
        place: a node id, or a position (x, y).
        radius: map units.
        hidden: a bit for each node within the radius, by ascending id, the first bit the highest: 1 for a node that is
            not covered; empty if all are covered.
    """

    place: Place
    radius: float
    hidden: bytes

    def list_nodes(self, graph: IGraph) -> IntArray:
        """Return the ids of its nodes, ascending.

        Raises:
            UnknownName (KeyError): its node does not exist.
            ValueError: its bits are not those of the map.
        """
        near = _find_nodes_near(graph, self.place, self.radius)
        if not self.hidden:
            return near
        if len(self.hidden) != -(-len(near) // 8):
            raise ValueError(f"{len(self.hidden)} bytes are not the bits of {len(near)} nodes")
        bits = np.unpackbits(np.frombuffer(self.hidden, np.uint8), count=len(near))
        covered: IntArray = near[bits == 0]
        return covered


def find_field(
    field: SensorField | None, sensor: ISensor, agent: IAgent, on_edges: Places, map_now: IGraphEngine
) -> IntArray:
    """Return the rows of the nodes that a sensor covers now; empty for sensors that do not report agents.

    Args:
        field: the recorded field; None: there is none, and the sensor is asked.
        sensor: the sensor.
        agent: the agent that carries it.
        on_edges: the positions of agents between nodes.
        map_now: the map.
    """
    return find_node_rows(
        map_now,
        _find_covered_nodes(sensor, agent, on_edges.get(agent.name))
        if field is None
        else field.list_nodes(map_now.graph),
    )


def find_coverage(
    sensor: ISensor, agent: IAgent, on_edge: tuple[float, float] | None, node: int | None = None
) -> Coverage | None:
    """Return the nodes on which a sensor of an agent would show other agents now; None: it does not tell.

    Args:
        sensor: the sensor.
        agent: the agent that carries it.
        on_edge: the position of the agent between nodes; None: it is at a node, or in the air.
        node: the node where it was; None: it is at its present node.
    """
    place: Any = find_place_of_look(sensor, agent.current_node_id if node is None else node, on_edge)
    try:
        return sensor.coverage(place, agent.name)
    except NotOffered:
        return None


def find_node_rows(map_now: IGraphEngine, ids: "Sequence[int] | IntArray") -> IntArray:
    """Return the rows of nodes (nodes,) with the given ids; -1 for unknown ids."""
    if not len(ids):
        return _NONE
    columns = map_now.columns()
    return kernels.find_rows(columns.node_ids, np.asarray(ids, np.int64), columns.node_order)


def find_edge_rows(map_now: IGraphEngine, ids: "Sequence[int] | IntArray") -> IntArray:
    """Return the rows of edges (edges,) with the given ids; -1 for unknown ids."""
    if not len(ids):
        return _NONE
    columns = map_now.columns()
    return kernels.find_rows(columns.edge_ids, np.asarray(ids, np.int64), columns.edge_order)


def find_pose(sensor: ISensor, agent: IAgent) -> tuple[Place, Any]:
    """Return the place of a sensor whose agent is at a node, and its height and direction, which change its field."""
    at = getattr(sensor, "at", None)
    if at is not None:
        return at, None
    if "AERIAL" in sensor.type.name:
        flying: Any = agent
        return tuple(map(float, flying.position)), tuple(flying.quat)
    turns = getattr(sensor, "turns_with_agent", False)
    return agent.current_node_id, tuple(agent.orientation) if turns else None


def find_places(ctx: HostContext) -> Places:
    """Return the positions of the agents between nodes."""
    positions = ctx.agent.positions
    if not positions.on_edges:
        return {}
    found = {positions.names[row]: locate(ctx.graph.graph, one) for row, one in positions.on_edges.items()}
    return {name: place.xy for name, place in found.items() if place is not None}


def _find_covered_nodes(
    sensor: ISensor, agent: IAgent, on_edge: tuple[float, float] | None, node: int | None = None
) -> IntArray:
    coverage = find_coverage(sensor, agent, on_edge, node)
    return _NONE if coverage is None else np.asarray(coverage.node_ids, np.int64)


def _as_recorded(place: Place) -> Place:
    return place if isinstance(place, int) else (float(place[0]), float(place[1]))


def _find_nodes_near(graph: IGraph, place: Place, radius: float) -> IntArray:
    if isinstance(place, int):
        x, y = graph.positions([place])[0].tolist()
    else:
        x, y = place[:2]
    return np.sort(graph.nodes_near(x, y, radius).ids)


# -- while a game is recorded -----------------------------------------------------------------------------------------


class FieldFinder:
    """Finds the fields of sensors, once for each sensor and pose until the map or the sensors change.

    Only built-in sensors of agents with a range have one: a sensor of a program may cover other nodes at each look.

    Args:
        ctx: the context.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self._known: dict[Any, SensorField | None] = {}
        self._radii: dict[str, tuple[float, bool] | None] = {}  # sensor -> its range, and whether its field is a disc
        self._on_edges: Places = {}

    def forget(self) -> None:
        """Find all fields again, because sensors or the map have changed."""
        self._known.clear()
        self._radii.clear()

    def note_places(self) -> None:
        """Take the present positions of agents between nodes."""
        self._on_edges = find_places(self._ctx)

    def find(self, sensor: ISensor | None, agent: IAgent, node: int | None = None) -> SensorField | None:
        """Return the field of a sensor; None if it has none, or there is no sensor.

        Args:
            sensor: the sensor.
            agent: the agent that carries it.
            node: the node where it was; then there is no field if its direction matters. None: the agent is there now.
        """
        if sensor is None:
            return None
        if sensor.sensor_id not in self._radii:
            is_built_in = bool(getattr(sensor, "sees_world_only", False)) and hasattr(sensor, "reports_all")
            radius = float(getattr(sensor, "range", inf)) if is_built_in else inf
            is_disc = bool(getattr(sensor, "covers_disc", False))
            self._radii[sensor.sensor_id] = (radius, is_disc) if isfinite(radius) else None
        radius_and_form = self._radii[sensor.sensor_id]
        if radius_and_form is None:
            return None
        radius, is_disc = radius_and_form
        place, direction = find_pose(sensor, agent)
        on_edge = None if getattr(sensor, "at", None) is not None else self._on_edges.get(agent.name)
        if node is not None and getattr(sensor, "at", None) is None:
            if direction is not None:
                return None
            place, on_edge = node, None
        if is_disc:
            return SensorField(_as_recorded(on_edge or place), radius, b"")
        key = sensor.sensor_id, place, direction, on_edge
        if key not in self._known:
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            covered = _find_covered_nodes(sensor, agent, on_edge, node)
            self._known[key] = self._describe(on_edge or place, radius, covered)
        return self._known[key]

    def _describe(self, place: Place, radius: float, covered: IntArray) -> SensorField | None:
        near = _find_nodes_near(self._ctx.graph.graph, place, radius)
        is_covered = np.isin(near, covered, assume_unique=True)
        if np.count_nonzero(is_covered) != len(covered):
            return None
        hidden = b"" if is_covered.all() else np.packbits(~is_covered).tobytes()
        return SensorField(_as_recorded(place), radius, hidden)


def find_first_turn(turn: int) -> int:
    """Return the turn, as a number of turns before it, from which on events are read to know the fields of a turn."""
    return turn // _TURNS * _TURNS


class FieldTable:
    """The fields of a recording by number, while it is written or read.

    Numbers begin with 0 again in the first report of every 256 turns, so that a reader may begin there.
    """

    def __init__(self) -> None:
        self._known: dict[int, SensorField] = {}  # by number, of those that were read
        self._numbers: dict[SensorField, int] = {}  # of those that were written
        self._span = -1

    def copy(self) -> "FieldTable":
        """Return a copy that later calls of `write` leave as it is."""
        twin = copy(self)
        twin._numbers = self._numbers.copy()
        return twin

    def write(self, fields: Sequence[SensorField | None], turn: int) -> dict[str, Any]:
        """Return the columns of an event with the fields of its looks; empty if no look has a field.

        Args:
            fields: the field of each look.
            turn: number of turns before this one.
        """
        if not any(fields):
            return {}
        if find_first_turn(turn) != self._span:
            self._span = find_first_turn(turn)
            self._numbers.clear()
        first = len(self._numbers)
        numbers = [0 if one is None else 1 + self._numbers.setdefault(one, len(self._numbers)) for one in fields]
        new = list(map(tuple, islice(self._numbers, first, None))) if len(self._numbers) > first else []
        column = np.array(numbers, np.min_scalar_type(max(numbers)))
        return dict(zip(_COLUMNS, (column, first, new), strict=True))

    def rewrite_event(self, data: dict[str, Any], source: "FieldTable", turn: int) -> dict[str, Any]:
        """Return an event of another recording with the numbers of this one.

        Args:
            data: the columns of the event.
            source: the fields of the other recording that were read before.
            turn: number of turns before this one.

        Raises:
            KeyError, ValueError, TypeError: not a result of `write`.
        """
        if _COLUMNS[0] not in data:
            return data
        fields = source.read(data, len(data["which"]))
        return {key: value for key, value in data.items() if key not in _COLUMNS} | self.write(fields, turn)

    def read(self, data: Mapping[str, Any], looks: int) -> list[SensorField | None]:
        """Return the field of each look of an event; None without a field, or if it was written before the first read.

        Args:
            data: the columns of the event.
            looks: the number of its looks.

        Raises:
            KeyError, ValueError, TypeError: not a result of `write`.
        """
        if _COLUMNS[0] not in data:
            return [None] * looks
        numbers, first, given = (data[key] for key in _COLUMNS)
        if type(given) is not list or not all(type(one) is tuple for one in given):
            raise TypeError("its new fields are not a list of tuples")
        new = [_check_field(*one) for one in given]
        if not isinstance(numbers, np.ndarray) or numbers.dtype.kind != "u" or numbers.shape != (looks,):
            raise TypeError("its fields are not a column of one number for each look")
        if type(first) is not int or first < 0 or (looks and int(numbers.max()) > first + len(new)):
            raise ValueError("a look has a field with a number that does not exist")
        if first == 0:
            self._known.clear()
        self._known |= enumerate(new, first)
        return [self._known.get(number - 1) for number in numbers.tolist()]  # 0 is no field


def _check_field(place: object, radius: object, hidden: object) -> SensorField:
    is_node = type(place) is int
    is_position = isinstance(place, tuple) and len(place) == 2 and all(type(part) is float for part in place)
    if not (is_node or is_position) or (is_position and not np.isfinite(place).all()):  # type: ignore[call-overload]
        raise TypeError("the place of a field is neither a node nor a position")
    if type(radius) is not float or not 0.0 <= radius < inf or type(hidden) is not bytes:
        raise TypeError("a field has no radius, or no bits")
    return SensorField(place, radius, hidden)  # type: ignore[arg-type]
