"""Observations of nodes: the neighborhood of an agent, the whole map as a graph, and where moves leave enemies room.

All are functions for `observation=`, from a view to numbers, and give the same in a single game and in a batch.
"""

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from gamms.arguments import as_array, as_count
from gamms.core import observe
from gamms.errors import BadType, BadValue
from gamms.game.array_functions.view import ArrayView, get_observers, split_by_map
from gamms.game.block.sensing import VisibleAgentPairs
from gamms.game.block.vectors import make_buffers
from gamms.game.conflicts import flatten
from gamms.game.movement.roads import MultiMapStreets
from gamms.game.movement.streets import StreetGraph
from gamms.ir.graph import FloatArray, IntArray
from gamms.limits import refuse_above
from gamms.rl.learners import Float32Array
from gamms.text import shown

NEAR = ("is_there", "dx", "dy", "hops", "action", "mates", "enemies")
"""The entries of each node of `neighbourhood`."""
NODE = ("x", "y", "is_here", "action", "mates", "enemies")
"""The entries of each node of `graph`."""
PURSUIT = ("is_legal", "stays", "enemy", "mate", "mate_to_enemy", "share", "room", "rings", "depth", "ways_out")
"""The entries of each action of `pursuit_observation`."""

HopArray = np.ndarray[tuple[int, ...], np.dtype[np.int16]]
"""Distances in edges."""

_PER_UNIT = 10.0  # edges in a unit of distance
_MOST_EDGES = 100  # of a distance; also that without a path, or to an agent that is not seen


class Neighbourhood:
    """The nodes around an agent, nearest first, (games, agents, nodes, entries); made by `neighbourhood`.

    Args:
        hops: the largest distance in edges.
        nodes: the largest number of nodes.

    Attributes:
        names: the names of the entries.
    """

    names = NEAR
    of_each = True

    def __init__(self, hops: int, nodes: int | None) -> None:
        self.hops = hops
        self._most = nodes
        self._tables: WeakKeyDictionary[StreetGraph, tuple[IntArray, IntArray, FloatArray]] = WeakKeyDictionary()

    def __call__(self, view: ArrayView) -> Float32Array:
        """Return the entries of the nodes around the agents of a view."""
        if isinstance(view.streets, MultiMapStreets):
            parts = [(places, self(part)) for places, part in split_by_map(view)]
            order = np.argsort(np.concatenate([places for places, _ in parts]))
            most = max(part.shape[2] for _, part in parts)
            padded = [np.pad(part, ((0, 0), (0, 0), (0, most - part.shape[2]), (0, 0))) for _, part in parts]
            return np.concatenate(padded)[order]
        if view.streets not in self._tables:
            self._tables[view.streets] = self._make_table(view.streets)
        near, far, places = self._tables[view.streets]
        return _observe_nodes(view, self.hops, near, far, places)

    def _make_table(self, streets: StreetGraph) -> tuple[IntArray, IntArray, FloatArray]:
        """Return for each node the rows of its neighborhood, their distances padded with -1, and all positions."""
        source, node, far = _find_neighborhoods(streets, self.hops)
        counts = np.bincount(source, minlength=len(streets.counts))
        most = int(counts.max(initial=1)) if self._most is None else self._most
        refuse_above(len(counts) * most * 24, f"A neighbourhood of {most} nodes of each of {len(counts)}")
        rank = np.arange(len(source)) - np.repeat(np.cumsum(counts) - counts, counts)
        kept = rank < most
        source = source[kept]
        node = node[kept]
        far = far[kept]
        rank = rank[kept]
        rows = np.zeros((len(counts), most), np.int64)
        hops = np.full((len(counts), most), -1)
        rows[source, rank] = node
        hops[source, rank] = far
        return rows, hops, _compute_positions(streets)


class MapGraph:
    """The whole map as each agent knows it, (games, agents, nodes, entries); made by `graph`.

    Args:
        nodes: the number of nodes in observations; None: that of the map.

    Attributes:
        names: the names of the entries.
    """

    names = NODE
    of_each = True

    def __init__(self, nodes: int | None = None) -> None:
        self._nodes = nodes
        self._edges: dict[int, IntArray] = {}  # by the number of the map, in the order of the last observations

    @property
    def edge_index(self) -> IntArray:
        """The edges of the map that was observed last, (2, edges): rows of sources and of targets.

        Raises:
            BadValue: nothing was observed yet.
        """
        return self.edges_of(next(reversed(self._edges), 0))

    def edges_of(self, map: int) -> IntArray:
        """Return the edges of a map by its number, as in `games.maps`, (2, edges): rows of sources and of targets.

        Raises:
            BadValue: the map was not observed yet.
        """
        if map not in self._edges:
            raise BadValue(
                f"The edges of map {shown(map)} are known when it was observed: reset the environment first, with "
                "games on this map."
            )
        return self._edges[map]

    def __call__(self, view: ArrayView) -> Float32Array:
        """Return the entries of all nodes.

        Raises:
            BadValue: the map has more nodes than the observation.
        """
        streets = view.streets
        games, agents = view.node.shape
        columns = (streets.whole if isinstance(streets, MultiMapStreets) else streets).columns
        count = len(columns.node_ids)
        nodes = count if self._nodes is None else self._nodes
        if count > nodes:
            raise BadValue(f"rl.graph(nodes={nodes}) has no room for map {view.map}, which has {count} nodes.")
        self._edges.pop(view.map, None)
        self._edges[view.map] = np.stack((columns.sources, columns.targets)).astype(np.int64)
        refuse_above(games * agents * nodes * len(NODE) * 4, f"A map of {nodes} nodes for {games * agents} agents")
        none = np.zeros((count, 0), np.int64)
        found = _observe_nodes(view, 0, none, none, _compute_positions(view.streets))
        return np.pad(found, ((0, 0), (0, 0), (0, nodes - count), (0, 0))) if nodes > count else found

    def data(self, observation: Float32Array, maps: IntArray | None = None) -> dict[str, Float32Array | IntArray]:
        """Return graphs for PyTorch Geometric: `Data(**graph.data(observation))`, after `torch.as_tensor`.

        Args:
            observation: the observation of one agent, (nodes, entries), or of several, (rows, nodes, entries).
            maps: the number of the map of each row, (rows,), or of the one agent; None: all are on the map that was
                observed last.

        Returns:
            `x` (nodes, entries) and `edge_index` (2, edges), concatenated over the rows; for several rows also `batch`,
            (nodes,), the row of each node.

        Raises:
            BadValue: a map was not observed yet.
        """
        values = np.asarray(observation, np.float32)
        nodes, entries = values.shape[-2:]
        rows = values.reshape(-1, nodes, entries)
        if maps is None:
            moved = self.edge_index[:, None, :] + (np.arange(len(rows)) * nodes)[None, :, None]
            edges = moved.reshape(2, -1)
        else:
            numbers = np.broadcast_to(as_array(maps, "maps", "integers"), len(rows)).tolist()
            each = [self.edges_of(map) + row * nodes for row, map in enumerate(numbers)]
            edges = np.concatenate(each, axis=1) if each else np.zeros((2, 0), np.int64)
        found: dict[str, Float32Array | IntArray] = {"x": rows.reshape(-1, entries), "edge_index": edges}
        return found if values.ndim == 2 else {**found, "batch": np.repeat(np.arange(len(rows)), nodes)}


def neighbourhood(hops: int = 2, nodes: int | None = None) -> Neighbourhood:
    """Return an observation of the nodes around an agent: `rl.vector_env(…, observation=rl.neighbourhood(2))`.

    It is (nodes, entries), nearest nodes first: the nodes that actions lead to, in the order of the actions, then those
    two edges away, and so on. Missing nodes have the entries 0, and -1 for `action`. The entries are `NEAR`; for
    agents that are out, all are 0.

    Args:
        hops: the largest distance in edges.
        nodes: the largest number of nodes, which keeps the nearest; None: the size of the map's largest neighborhood.

    Raises:
        BadType, BadValue: an argument is not a positive integer.
    """
    if isinstance(hops, ArrayView):
        raise BadType("observation=rl.neighbourhood makes an observation: call it, rl.neighbourhood(2).")
    return Neighbourhood(as_count(hops, "hops"), None if nodes is None else as_count(nodes, "nodes"))


def graph(nodes: int | None = None) -> MapGraph:
    """Return an observation of all nodes of the map, (nodes, entries), for graph networks.

    The entries are `NODE`; for agents that are out, all are 0. `edge_index` has the edges, and `data` converts
    observations to graphs for PyTorch Geometric.

    Args:
        nodes: the number of nodes in observations, so that those of several maps have one shape: the rows behind the
            nodes of a map are 0, and have no edges. None: that of the map.

    Raises:
        BadType, BadValue: the argument is not a positive integer.
    """
    if isinstance(nodes, ArrayView):
        raise BadType("observation=rl.graph makes an observation: call it, rl.graph().")
    return MapGraph(None if nodes is None else as_count(nodes, "nodes"))


def pursuit_observation(view: ArrayView) -> Float32Array:
    """Describe where each action leads: `rl.vector_env(…, observation=rl.pursuit_observation)`.

    The entries, `PURSUIT` for each action, do not depend on the size of the map, so that a network for each action
    (`save_policy(…, shared=0)`) plays on all maps. Distances are in edges; enemies and mates are those that the agent's
    sensors show; entries of illegal actions and of agents that are out are 0. The room of the enemies are the nodes
    that one of them reaches before the agent, from where the action leads, and before its mates.

    Raises:
        TooLarge: the entries would take too much memory.
    """
    found = np.zeros((*view.node.shape, view.num_actions, len(PURSUIT)), np.float32)
    for games, part in split_by_map(view):
        rows, is_legal = part.legal_rows()
        is_legal &= part.mask[..., None]
        values = np.where(is_legal[..., None], _find_pursuit_entries(part, rows), np.float32(0.0))
        found[games, :, : rows.shape[2]] = values
    return found.reshape(*view.node.shape, -1)


pursuit_observation.names = PURSUIT  # type: ignore[attr-defined]
pursuit_observation.of_each = True  # type: ignore[attr-defined] # see `Observation`


def _find_pursuit_entries(view: ArrayView, rows: IntArray) -> Float32Array:
    """Return the entries of moves to the rows of nodes, (games, agents, most), in games with the same open roads."""
    far, roads = _count_hops(view)
    refuse_above(rows.size * (6 * len(far) + 3 * len(roads)), f"What {rows.size} moves leave of {len(far)} nodes")
    enemies = view.enemies()
    to_enemy = _find_least_distances(view, enemies, far)
    of_mate = _find_least_distances(view, view.mates(), far)
    apart = np.full(view.node.shape, _MOST_EDGES)
    np.minimum.at(apart, (enemies.at, enemies.viewers), of_mate[enemies.at, enemies.viewers, enemies.nodes])
    is_room = to_enemy[:, :, None] < np.minimum(far[rows], of_mate[:, :, None])
    room = is_room.sum(axis=3)
    rings = (is_room[..., roads[:, 0]] & is_room[..., roads[:, 1]]).sum(axis=3) - room + (room > 0)
    columns = (
        np.ones(rows.shape),
        rows == view.node[..., None],
        np.take_along_axis(to_enemy, rows, axis=2) / _PER_UNIT,
        np.take_along_axis(of_mate, rows, axis=2) / _PER_UNIT,
        np.broadcast_to(apart[..., None] / _PER_UNIT, rows.shape),
        room / len(far),
        np.log1p(room) / 3.0,
        np.log1p(np.maximum(rings, 0)),
        (is_room * to_enemy[:, :, None]).max(axis=3) / _PER_UNIT,
        (is_room & (to_enemy[:, :, None] <= 1)).sum(axis=3) / 3.0,
    )
    return np.stack(columns, axis=3, dtype=np.float32)


def _find_least_distances(view: ArrayView, pairs: VisibleAgentPairs, far: HopArray) -> HopArray:
    """Return the distance of each node from the nearest of the agents that each agent sees, (games, agents, nodes)."""
    found = np.full((*view.node.shape, len(far)), _MOST_EDGES, np.int16)
    np.minimum.at(found, (pairs.at, pairs.viewers), far[pairs.nodes])
    return found


_HOPS: WeakKeyDictionary[StreetGraph, tuple[HopArray, IntArray]] = WeakKeyDictionary()
"""Map -> distances in edges, (nodes, nodes), and the two nodes of each road, (roads, 2)."""


def _count_hops(view: ArrayView) -> tuple[HopArray, IntArray]:
    """Return the distances between all nodes of the map in edges, and its roads; see `_HOPS`."""
    streets = view.streets
    if streets not in _HOPS:
        nodes = len(streets.counts)
        refuse_above(nodes * nodes * 32, f"The distances between all of {nodes} nodes")
        every = np.arange(nodes)
        far = np.minimum(view.routes(None).distances(every[:, None], every), _MOST_EDGES).astype(np.int16)
        ends = np.sort(np.stack((streets.columns.sources, streets.columns.targets), axis=1), axis=1)
        _HOPS[streets] = far, np.unique(ends[ends[:, 0] < ends[:, 1]], axis=0)
    return _HOPS[streets]


def _find_neighborhoods(streets: StreetGraph, hops: int) -> tuple[IntArray, IntArray, IntArray]:
    """Return pairs of nodes up to `hops` edges apart and their distances, sorted by the first node and the distance.

    Equal distances are in the order of the actions that lead there.
    """
    nodes = len(streets.counts)
    source = np.arange(nodes)
    node = source
    known = source * nodes + node
    found = [(source, node, np.zeros(nodes, np.int64))]
    for far in range(1, hops + 1):
        counts = streets.counts[node]
        refuse_above(int(counts.sum()) * 80, f"A neighbourhood of {hops} hops on {nodes} nodes")
        action = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        source = np.repeat(source, counts)
        node = streets.legal[np.repeat(node, counts), action]
        key, first = np.unique(source * nodes + node, return_index=True)
        first = np.sort(first[~np.isin(key, known)])
        source = source[first]
        node = node[first]
        known = np.concatenate((known, source * nodes + node))
        found.append((source, node, np.full(len(node), far)))
    sources, targets, distances = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.argsort(sources, kind="stable")
    return sources[order], targets[order], distances[order]


def _compute_positions(streets: StreetGraph) -> FloatArray:
    """Return positions of nodes, (nodes, 2), relative to the map's center, in halves of its longer side."""
    xy = streets.columns.xy
    low = xy.min(axis=0)
    high = xy.max(axis=0)
    places: FloatArray = (xy - (low + high) / 2.0) / (float((high - low).max()) / 2.0 or 1.0)
    return places


def _observe_nodes(view: ArrayView, hops: int, near: IntArray, far: IntArray, places: FloatArray) -> Float32Array:
    """Return the entries of nodes around the agents of a view, (games, agents, nodes, entries); 0 hops: all nodes."""
    most, entries = (near.shape[1], len(NEAR)) if hops else (len(near), len(NODE))
    found = np.empty((*view.node.shape, most, entries), np.float32)
    columns: Any = flatten(near, np.int64), flatten(far, np.int64), flatten(places, np.float64), found.reshape(-1).data
    nodes = observe.NodeFeatures(most, hops, *columns)
    observe.observe_nodes_aside(get_observers(view), nodes, make_buffers(len(view.roster.names), 0), 0, len(found))
    return found
