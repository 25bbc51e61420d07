"""Observation vectors for learners: one float vector of fixed length for each agent.

Positions, offsets and distances by road are in units of half the longer side of the bounding box of the map's nodes.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gamms.core import observe, routes
from gamms.game.block.columns import play_in_threads
from gamms.game.conflicts import flatten
from gamms.game.movement.roads import OpenRoads, RoadTables
from gamms.game.movement.streets import StreetGraph
from gamms.game.movement.travel import ReachableNodes
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.limits import max_memory, refuse_above

OWN = ("x", "y")  # relative to the center of the map
OTHER = ("is_seen", "is_mate", "dx", "dy", "road")  # for each other agent: offsets to its node, the distance by road
MOVE = ("is_legal", "dx", "dy")  # for each action; offsets from the agent to the action's node
FARTHEST = 2.0  # the distance by road of all agents that are farther away, and of those without a path

_MOST_BYTES = 512 * 2**20  # of distances by road, of which older ones are then searched again
_ENTRY_BYTES = 8
_FEW_PAIRS = 1 << 20  # of nodes: all their distances are searched, because a full row is read without a search in it

Vectors32 = np.ndarray[tuple[int, ...], np.dtype[np.float32]]


class ObservationVectors(NamedTuple):
    """Observation vectors of the agents of a view.

    Attributes:
        values: (games, agents, entries) float32; all 0 for dead agents.
        names: (entries,) the names of the entries, such as `other_0.dx`.
        mask: (games, agents) whether each agent is alive.
        legal: (games, agents, actions) whether each action is legal; dead agents can only stay.
        counts: (games, agents) the number of legal actions.
    """

    values: Vectors32
    names: tuple[str, ...]
    mask: BoolArray
    legal: BoolArray
    counts: IntArray


class Encoder:
    """Builds observation vectors for agents on one or several maps.

    Args:
        xy: for each map, the positions of its nodes, (nodes, 2).
        agents: the number of agents in a game.
        others: the number of other agents in a vector: the nearest visible ones.
        actions: the number of actions in a vector.
    """

    def __init__(self, xy: Sequence[FloatArray], agents: int, others: int, actions: int) -> None:
        self._boxes = [_find_bounding_box(one) for one in xy]
        self._agents = agents
        self._others = others
        self._actions = actions
        refuse_above(200.0 * (actions + others), f"Vectors of {others} others")  # of their names
        shares = [(one - centre) / scale for one, (centre, scale) in zip(xy, self._boxes, strict=True)]
        self._places = flatten(np.concatenate(shares), np.float64)
        self._on_nodes = flatten(np.zeros(0), np.float64)
        self.names = (
            *OWN,
            *(f"action_{number}.{name}" for number in range(actions) for name in MOVE),
            *(f"other_{number}.{name}" for number in range(others) for name in OTHER),
        )

    def allocate_vectors(self, mask: BoolArray, more: int) -> ObservationVectors:
        """Return uninitialized vectors with `more` additional entries at the end.

        Args:
            mask: (games, agents) whether each agent is alive.
            more: the number of additional entries: all 0 except the last one, which is n / (n + 100) after n turns.
        """
        entries = len(self.names) + more
        bytes_ = 4.0 * mask.size * entries
        if bytes_ > max_memory():
            refuse_above(bytes_, f"{mask.size} vectors of {self._others} others")
        values = np.empty((*mask.shape, entries), np.float32)
        is_legal = np.empty((*mask.shape, self._actions), np.bool_)
        return ObservationVectors(values, self.names, mask, is_legal, np.empty(mask.shape, np.int64))

    def make_output(self, vectors: ObservationVectors, xy: FloatArray | None = None) -> observe.VectorObservations:
        """Return the buffers of vectors that the core writes to.

        Args:
            vectors: the vectors to write.
            xy: (games, agents, 2) the positions of the agents, on a single map; None: the positions of their nodes.
        """
        own = self._on_nodes
        if xy is not None:
            centre, scale = self._boxes[0]
            own = flatten((xy - centre) / scale, np.float64)
        written: Any = (
            vectors.values.reshape(-1).data,
            vectors.legal.view(np.uint8).reshape(-1).data,
            vectors.counts.reshape(-1).data,
        )
        return observe.VectorObservations(
            self._places, own, self._actions, self._others, vectors.values.shape[-1], *written
        )

    def make_scratch(self, ways: routes.NearbyDistances | None, threads: int) -> list[observe.NearestAgents]:
        """Return new scratch buffers, in which each thread collects the agents that an agent sees."""
        return [make_buffers(self._agents, self._others, ways) for _ in range(threads)]


def _find_bounding_box(xy: FloatArray) -> tuple[FloatArray, float]:
    """Return the center of the bounding box of nodes, (2,), and half of its longer side; 1 if that is 0."""
    low, high = (xy.min(axis=0), xy.max(axis=0)) if len(xy) else (np.zeros(2), np.zeros(2))
    return (low + high) / 2.0, float((high - low).max()) / 2.0 or 1.0


def get_legal_buffers(offsets: IntArray, targets: IntArray) -> tuple[Any, Any]:
    """Return offsets and rows of legal nodes as int32 buffers; see `core.observe.Observers`."""
    return flatten(offsets, np.int32), flatten(targets, np.int32)


class RoadDistances:
    """Distances by road in the games of a batch on one map, in which roads may be closed, for vectors.

    Args:
        roads: the open roads of the games.

    Attributes:
        first: (games,) see `core.observe.Observers.first_road`.
    """

    def __init__(self, roads: OpenRoads) -> None:
        self._roads = roads
        self._tables: RoadTables | None = None  # None: no road was closed yet
        self.first = np.zeros(len(roads.number), np.int64)
        self._core: routes.NearbyDistances | None = None  # None: not made yet

    def take_roads(self) -> routes.NearbyDistances:
        """Return the distances on the current roads of all games."""
        roads = self._roads
        if self._core is None:
            self._core = make_distances([roads.streets])
        if (self._tables is not None or roads.differ) and self._tables is not roads.tables:
            self._tables = roads.tables
            self.first[:] = self._tables.first
            offsets, tails, lengths = roads.join_arcs(self._tables.maps, "length", reverse=True)
            scaled = np.asarray(lengths) / compute_scale(roads.streets)
            ids = flatten(np.arange(roads.streets.num_nodes), np.int64)
            self._core.take(ids, offsets, tails, flatten(scaled, np.float64))
        return self._core


def compute_scale(streets: StreetGraph) -> float:
    """Return half of the longer side of a map, which is the unit of vectors, in map units."""
    return _find_bounding_box(streets.columns.xy)[1]


def make_distances(streets: Sequence[StreetGraph]) -> routes.NearbyDistances:
    """Return distances by road on one or several maps, whose nodes follow each other."""
    arcs = [one.get_reversed_ways("length") for one in streets]
    first = np.cumsum([0, *(one.num_nodes for one in streets)])
    counts = np.concatenate([np.diff(one.offsets) for one in arcs])
    offsets: Any = flatten(np.concatenate(([0], np.cumsum(counts))), np.int64)
    tails: Any = flatten(
        np.concatenate([one.ends + before for one, before in zip(arcs, first, strict=False)]), np.int64
    )
    scaled = [one.weights / compute_scale(of) for one, of in zip(arcs, streets, strict=True)]
    nodes = int(first[-1])
    room = max(nodes, min(2 * nodes * nodes, _MOST_BYTES // _ENTRY_BYTES))
    # The operating system provides memory only for entries that are used.
    pool: Any = np.zeros(room, np.int32).data, np.zeros(room, np.float32).data
    working: Any = [column.data for column in np.zeros((3, nodes), np.int64)]
    paths = routes.Paths(ReachableNodes(nodes).core, *working)
    ids: Any = flatten(np.arange(nodes), np.int64)
    edges: Any = ids, offsets, tails, flatten(np.concatenate(scaled), np.float64)
    columns: Any = *edges, paths, *pool, FARTHEST
    return routes.NearbyDistances(*columns)


def find_distances(ways: routes.NearbyDistances, streets: Sequence[StreetGraph], square: float) -> None:
    """Search the distances by road between all nodes that are near each other; see `make_distances`.

    Args:
        ways: receives the distances.
        streets: the maps.
        square: the square of the distance within which nodes are near, map units; negative: none are.
    """
    # NOTE: on the streets of Helsinki, with 8,651 nodes, this takes 2.5 s for nodes up to 200 m apart. Searched in the
    # steps of 1,024 games, the same distances take 20 times as long as all else at first (benchmarks: learning).
    if square < 0:
        return
    if sum(one.num_nodes for one in streets) ** 2 <= _FEW_PAIRS:
        square = np.inf
    first = np.cumsum([0, *(one.num_nodes for one in streets)]).tolist()
    xy = np.concatenate([one.columns.xy for one in streets])
    order = [np.argsort(one.columns.xy[:, 0]) + begin for one, begin in zip(streets, first, strict=False)]
    columns: Any = flatten(np.concatenate(order), np.int64), flatten(xy, np.float64), np.zeros(first[-1], np.int64).data
    near = routes.NodesByX(*columns)
    for begin, end in pairwise(first):
        ways.find_all(near, begin, end, square)


def make_buffers(agents: int, others: int, ways: routes.NearbyDistances | None = None) -> observe.NearestAgents:
    """Return scratch buffers for one thread: the agents that an agent sees, and the nearest `others` of them.

    `ways` are the distances by road; None: they are not asked for.
    """
    seen: Any = *(np.zeros(agents, np.int64).data for _ in range(2)), np.zeros(agents, np.uint8).data
    nearest: Any = np.zeros(others + 1).data, np.zeros(others + 1, np.int64).data
    buffers: Any = *seen, *nearest, ways
    return observe.NearestAgents(*buffers)


def write_vectors(
    observers: observe.Observers,
    output: observe.VectorObservations,
    places: IntArray,
    rooms: Sequence[observe.NearestAgents],
) -> None:
    """Write the observation vectors of agents.

    Args:
        observers: the agents.
        output: the buffers of the vectors; see `Encoder.make_output`.
        places: the games to write, as indices into the games of the observers.
        rooms: scratch buffers; for each, a thread writes a part of the games.
    """
    chosen = flatten(places, np.int64)

    def observe_part(room: observe.NearestAgents, begin: int, end: int) -> None:
        observe.observe_aside(observers, output, room, chosen, begin, end)

    write_in_threads(observe_part, len(places), rooms)


def write_in_threads(
    write: Callable[[observe.NearestAgents, int, int], object], games: int, rooms: Sequence[observe.NearestAgents]
) -> None:
    """Call `write(room, begin, end)` for equal parts of the games, each in its own thread.

    Only a single thread searches distances by road. If several lack some, one thread writes all games again.
    """
    for room in rooms:
        room.searches = len(rooms) == 1
        room.lacks = False
    play_in_threads(lambda thread, begin, end: write(rooms[thread], begin, end), games, len(rooms))
    if any(room.lacks for room in rooms):
        rooms[0].searches = True
        write(rooms[0], 0, games)
