"""The agents that are near a place, remembered as long as agents and the graph stay as they are.

`Memory` is all that the built-in sensors of a context share.
"""

from collections.abc import Callable, Collection, Mapping
from itertools import count
from math import inf
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_int
from gamms.deciding import phase_of
from gamms.errors import UnknownName
from gamms.ir.columns import ChangeLog
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.positions import Positions
from gamms.sensor.views import Place, Views, ViewsPastObstacles, coordinates, on_ground
from gamms.typing import IContext
from gamms.typing.graph_engine import IGraph
from gamms.typing.on_edges import Line, PassedNode

_MOST_IDS = 1 << 22  # of nodes: what may be remembered in all
_SLACK = 1e-6  # map units: boxes are compared with this tolerance, because places on an edge are rounded
_SHARE = 8  # of agents that look: where so many did, the others will, too
_SEVERAL_AGENTS = 32  # so many are found for all that look
_MANY_AGENTS = 128  # so many are looked up by node
_MOST_COMPARED = 1000  # agents whose places are compared at the first look from a place
_MOST_RANGES = 64  # at which looks are counted
_MOST_PLACES = 1 << 16  # looked from once that are remembered
_FAR = 1e150  # of which squares are infinite
_WIDE = 4096  # nodes: a disc with more is compared with the places of all agents instead
_LOOKS_OF_SOME = 8  # questions of looks in space between two moves, from which on the places of all agents are found
_LOOKS_WITHOUT_CELLS = 8  # of those in space at one moment: with fewer, looking at all is cheaper than making cells


class Coordinates(NamedTuple):
    """Where agents are in space, in the order of their creation."""

    xyz: FloatArray  # (agents, 3)  of the node or the place on an edge, on the ground, or of an agent that flies
    is_flying: BoolArray  # (agents,)
    is_outside: BoolArray  # (agents,)  not in a tunnel

    def of(self, rows: IntArray) -> "Coordinates":
        """Return where some of them are."""
        return Coordinates(self.xyz[rows], self.is_flying[rows], self.is_outside[rows])


class PlacesOfNodes(dict[int, tuple[float, float]]):
    """Node id -> (x, y), of nodes that were asked for."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx

    def __missing__(self, node: int) -> tuple[float, float]:
        place = self[node] = coordinates(self._ctx, node)
        return place


class NearbyAgents:
    """The agents of one context, as sensors find them.

    Attributes:
        places_of_nodes: where nodes are; valid after a question of who is near.
    """

    def __init__(self, ctx: IContext, views: Views) -> None:
        self._ctx, self._phase = ctx, phase_of(ctx)
        self._views = views
        self._graph: IGraph | None = None
        self._key: tuple[Positions | None, int, int | None] = (None, 0, None)
        self._places: FloatArray | None = None
        self._coordinates: Coordinates | None = None  # at these places
        self._living = np.zeros(0, np.int64)  # their rows
        self._cells: kernels.CellIndex | None = None  # of these
        self._looks_in_space = 0  # at these coordinates
        self._moved: tuple[Positions | None, int] = (None, 0)  # when agents moved last
        self._looks_since = 0  # of those in space
        self._travellers = Travellers(ctx)
        self._positions: Positions | None = None  # of which the looks are
        self._version = 0  # of them
        self._moment: object = None  # in which it was looked whether they are still so
        self._looks: dict[float, LooksAtRange] = {}
        self._checked: tuple[Positions | None, int | None] = (None, None)  # that no agent is on a removed node
        self._revision: int | None = None  # of the graph that the discs are of
        self._discs: dict[float, dict[Place, Collection[int] | None]] = {}
        self._looked_from: set[tuple[float, Place]] = set()  # once, by range: no disc is remembered yet
        self._ids: dict[int, int] = {}  # one object per id
        self.places_of_nodes = PlacesOfNodes(ctx)
        self._kept = 0

    def places(self) -> FloatArray:
        """Return where all agents are (agents, 2); those on an edge are between its ends.

        Raises:
            UnknownName (KeyError): an agent stands on a node that was removed.
        """
        positions, graph = self._ctx.agent.positions, self._ctx.graph.graph
        if self._places is None or not self._are_places_known(positions):
            xy = self._xy_of(positions)
            for row in positions.travellers:
                xy[row] = self._travellers.place(positions, row) or xy[row]
            self._places, self._key, self._coordinates = xy, (positions, positions.version, graph.revision), None
        return self._places

    def _are_places_known(self, positions: Positions) -> bool:
        revision = self._ctx.graph.graph.revision
        return revision is not None and self._key == (positions, positions.version, revision)

    def coordinates(self) -> Coordinates:
        """Return where all agents are in space.

        Raises:
            UnknownName (KeyError): an agent stands on a node that was removed.
        """
        xy, positions = self.places(), self._ctx.agent.positions
        if self._coordinates is None:
            # On an edge an agent is as high as the node that it passed last, and in its tunnel.
            xyz, is_on_surface = on_ground(self._ctx, positions.node_ids, xy)
            is_flying = np.zeros(len(xy), np.bool_)
            xyz[positions.flyers], is_flying[positions.flyers] = positions.flyer_xyz, True
            self._coordinates = Coordinates(xyz, is_flying, is_on_surface | is_flying)
            self._living, self._cells, self._looks_in_space = positions.living, None, 0
        return self._coordinates

    def living_near(self, x: float, y: float, radius: float) -> IntArray:
        """Return the rows of the living agents above and below a disc, ascending, and perhaps of others that live.

        Raises:
            UnknownName (KeyError): an agent stands on a node that was removed.
        """
        if self._is_moving(self._ctx.agent.positions):
            return self._living_above(self._catch_up(), x, y, radius)
        xyz, living = self.coordinates().xyz, self._living
        self._looks_in_space += 1
        if self._looks_in_space > _LOOKS_WITHOUT_CELLS and self._cells is None:
            self._cells = kernels.build_cells(xyz[living, :2])
        rows = None if self._cells is None else kernels.candidate_rows(self._cells, x, y, radius)
        return living if rows is None else living[np.sort(rows)]

    def in_space(self, rows: IntArray) -> Coordinates:
        """Return where some agents are, (rows,)."""
        positions = self._ctx.agent.positions
        if not self._is_moving(positions):
            return self.coordinates().of(rows)
        listed: list[int] = rows.tolist()
        xyz, is_on_surface = on_ground(self._ctx, positions.node_ids_of(listed), self.xy(listed))
        flyers = positions.flyers
        places = np.searchsorted(flyers, rows)
        is_flying = np.append(flyers, -1)[places] == rows
        xyz[is_flying] = positions.flyer_xyz[places[is_flying]]
        return Coordinates(xyz, is_flying, is_on_surface | is_flying)

    def _is_moving(self, positions: Positions) -> bool:
        """Return whether it pays to look some agents up, because one of many may move after each look."""
        if self._phase.moment is not None or positions.travellers or len(positions.names) <= _MOST_COMPARED:
            return False
        if self._moved != (positions, positions.version):
            self._moved, self._looks_since = (positions, positions.version), 0
        self._looks_since += 1
        return self._looks_since <= _LOOKS_OF_SOME and not self._are_places_known(positions)

    def _living_above(self, positions: Positions, x: float, y: float, radius: float) -> IntArray:
        reach = kernels.widened(radius)
        ids = self._ctx.graph.graph.nodes_near(x, y, reach).ids.tolist()
        flyers, inactive = positions.flyers, positions.inactive
        is_near = (np.abs(positions.flyer_xyz[:, :2] - (x, y)) <= reach).all(axis=1)
        flying = [row for row in flyers[is_near].tolist() if row not in inactive]
        return np.array(sorted({*positions.rows_on(ids), *flying}), np.int64)

    def xy(self, rows: list[int]) -> FloatArray:
        """Return where some agents are on the map (rows, 2)."""
        positions = self._ctx.agent.positions
        # While agents decide, many ask for what is the same for all; else one may move after each look.
        if not positions.travellers and (self._phase.moment is not None or self._are_places_known(positions)):
            return self.places()[rows]
        xy = self._xy_of(positions, rows)
        for i, row in enumerate(rows if positions.travellers else ()):
            xy[i] = self._travellers.place(positions, row) or xy[i]
        return xy

    def by_name(self, place: Place, radius: float) -> dict[str, int]:
        """Return a fresh dict of the living agents within a radius of a place: name -> what is reported of it."""
        if radius < inf:
            # NOTE: most looks of most games end here, and most of these are of a moment in which others have looked
            # (benchmarks: peers).
            moment, positions = self._phase.moment, self._positions
            if moment is None or moment is not self._moment or positions is None:
                positions = self._catch_up()
            looks = self._looks.get(radius)
            if looks is None or looks.version != self._version:
                looks = self._looks_at(radius)
            if looks.is_frequent and type(place) is int:
                known = looks.by_name or looks.name_all(radius, positions, self.places)
                if place in known:
                    looks.count += 1
                    return known[place].copy()
            rows = self._rows_within(positions, looks, place, radius)
            nodes = positions.found(rows)
        else:
            if not isinstance(place, tuple) and not self._ctx.graph.graph.has_node(place):
                raise UnknownName("node", place)
            positions, revision, rows = self._ctx.agent.positions, self._ctx.graph.graph.revision, None
            if (positions, revision) != self._checked or revision is None:
                self._xy_of(positions)  # which finds agents on removed nodes
                self._checked = positions, revision
            nodes = dict(positions.by_name)
        if positions.travellers:
            on_edges = sorted(set(positions.travellers) - set(positions.inactive)) if rows is None else rows
            nodes.update(self.on_edges(positions, on_edges))
        return nodes

    def known_by_name(self, radius: float, looks: int) -> Mapping[int, dict[str, int]]:
        """Return what `by_name` returns of nodes with an agent, for so many looks; none where it is not worth its cost.

        To be called while agents decide, and valid as long as nothing changes.
        """
        if radius == inf:
            return {}
        positions, counted = self._catch_up(), self._looks_at(radius)
        if not counted.is_frequent:
            return {}
        counted.count += looks
        return counted.by_name or counted.name_all(radius, positions, self.places)

    def on_edges(self, positions: Positions, rows: list[int]) -> dict[str, int]:
        """Return what is reported of those agents that are on edges, by their names."""
        travellers = positions.travellers
        moving = [row for row in rows if row in travellers] if travellers else []
        return {positions.names[row]: self._travellers.sighting(positions, row) for row in moving}

    def within(self, place: Place, radius: float) -> tuple[Positions, list[int]]:
        """Return where agents are, and the rows of those within `radius` of a place, the rim included.

        Raises:
            UnknownName (KeyError): there is no such node, or an agent stands on one that was removed.
        """
        positions = self._catch_up()
        if radius == inf:
            if type(place) is not int or place not in self.places_of_nodes:
                self._checked_place(place)
            return positions, positions.living_rows
        return positions, self._rows_within(positions, self._looks_at(radius), place, radius)

    def _rows_within(self, positions: Positions, looks: "LooksAtRange", place: Place, radius: float) -> list[int]:
        looks.count += 1
        if looks.is_frequent and type(place) is int:
            around = looks.look_from_all(radius, positions, self.places)
            if place in around:
                return around[place]
        try:
            disc = self._discs[radius][place]
        except (KeyError, TypeError):  # not known, or not hashable
            disc = self._new_disc(self._checked_place(place), radius, len(positions.names))
        if disc is None:
            return self._compared(place, radius)
        rows = positions.rows_on(disc)
        looks.found += len(rows)
        if positions.travellers:
            rows = sorted([*rows, *self._travellers.within(positions, coordinates(self._ctx, place), radius)])
        return rows

    def near_nodes(self, ids: list[int], radius: float) -> tuple[Positions, tuple[IntArray, IntArray] | None]:
        """Return where agents are, and those near nodes; see `near_places`."""
        positions, xy = self._catch_up(), self.places()
        here = xy if ids == [*positions.nodes] and not positions.travellers else self._ctx.graph.graph.positions(ids)
        return positions, near_places(here, radius, positions, xy)

    def _catch_up(self) -> Positions:
        """Forget what is no longer so, and return where agents are."""
        moment = self._phase.moment
        if moment is not None and moment is self._moment and self._positions is not None:
            return self._positions
        graph = self._graph = self._ctx.graph.graph if self._graph is None else self._graph
        revision, positions = graph.revision, self._ctx.agent.positions
        if revision != self._revision or revision is None:
            self._forget(revision)
        if positions is not self._positions:
            self._looks.clear()
        self._positions, self._version, self._moment = positions, positions.version, moment
        return positions

    def _looks_at(self, radius: float) -> "LooksAtRange":
        """Return the looks at a range since agents have moved, come or gone."""
        looks = self._looks.get(radius)
        if looks is None:
            if len(self._looks) >= _MOST_RANGES:
                self._looks.clear()
            looks = self._looks[radius] = LooksAtRange()
        if looks.version != self._version:
            looks.renew(self._version, len(self._positions.names))  # type: ignore[union-attr] # known by now
        return looks

    def _checked_place(self, place: Place) -> Place:
        known = place if isinstance(place, tuple) else as_int(place, "The id of a node")
        coordinates(self._ctx, known)  # it is there
        return known

    def _forget(self, revision: int | None) -> None:
        self.places()  # which finds agents on removed nodes
        self._revision, self._kept = revision, 0
        self._looks.clear()
        self._discs.clear()
        self._looked_from.clear()
        self._ids.clear()
        self.places_of_nodes.clear()

    def _new_disc(self, place: Place, radius: float, agents: int) -> Collection[int] | None:
        """Return the ids of the nodes in a disc; None where it does not pay to know them."""
        # NOTE: a search for nodes takes as long as some looks at all places, where these are known since agents last
        # moved (benchmarks: OCCLUDED_AGENT).
        are_known = self._revision is not None and self._key == (self._positions, self._version, self._revision)
        if are_known and agents <= _MOST_COMPARED and (radius, place) not in self._looked_from:
            if len(self._looked_from) >= _MOST_PLACES:
                self._looked_from.clear()
            self._looked_from.add((radius, place))
            return None
        seen = self._views.known(radius).get(place)
        if seen is None:
            x, y = coordinates(self._ctx, place)
            ids = self._ctx.graph.graph.nodes_near(x, y, radius).ids.tolist()
        else:
            ids = [*seen.nodes]
        # NOTE: a tuple of shared ints is a sixth of a set, and what counts is how much memory a look touches
        # (benchmarks: 1,000 agents in Helsinki). Few agents are looked up in the set.
        are_many = agents >= _MANY_AGENTS
        disc = tuple([self._ids.setdefault(id, id) for id in ids]) if are_many else {*ids}
        kept = disc if len(disc) <= _WIDE else None
        if self._kept > _MOST_IDS:
            self._discs.clear()
            self._kept = 0
        self._discs.setdefault(radius, {})[place] = kept
        self._kept += 16 + len(kept or ())
        return kept

    def _compared(self, place: Place, radius: float) -> list[int]:
        xy, living = self.places(), self._ctx.agent.positions.living
        dx, dy = (xy[living] - coordinates(self._ctx, place)).T
        with np.errstate(over="ignore"):  # infinitely far away is far away
            rows: list[int] = living[dx * dx + dy * dy <= radius * radius].tolist()
        return rows

    def _xy_of(self, positions: Positions, rows: list[int] | None = None) -> FloatArray:
        """Return where the nodes are that some agents are on, or have passed last (rows, 2); None: of all."""
        graph, nodes = self._ctx.graph.graph, positions.node_ids if rows is None else positions.node_ids_of(rows)
        try:
            return graph.positions(nodes)
        except UnknownName:
            lost = next(i for i, node in enumerate(nodes.tolist()) if not graph.has_node(node))
            name = positions.names[lost if rows is None else rows[lost]]
            raise UnknownName(f"node under agent {name!r}:", int(nodes[lost])) from None


class LooksAtRange:
    """The looks at one range at a version of where agents are.

    Where there were many before, who is around each node with an agent on it is worked out at once. In the paper's
    loop, in which each agent moves after its look, there never are (benchmarks: where it broke).

    Attributes:
        version: of where agents are; see `Positions`.
        count: how many looks there were.
        found: how many agents were found.
        is_frequent: whether `around` is worth its cost.
        around: node id -> the rows of the living agents within the range, ascending; None: not worked out.
        by_name: node id -> name -> node id, of the same agents; None: not worked out.
    """

    __slots__ = ("_pairs", "around", "by_name", "count", "found", "is_frequent", "version")

    def __init__(self) -> None:
        self.version = self.count = self.found = 0
        self.is_frequent = False
        self._pairs: tuple[list[int], list[int], list[int]] | None = None
        self.around: dict[int, list[int]] | None = None
        self.by_name: dict[int, dict[str, int]] | None = None

    def renew(self, version: int, agents: int) -> None:
        """Begin to count again, now that agents have moved."""
        looks, found = self.count, self.found
        are_many = agents >= _SEVERAL_AGENTS and looks * _SHARE >= agents
        self.is_frequent = are_many and found * agents <= looks * _MOST_IDS
        self.version, self.count, self.found = version, 0, 0
        self._pairs = self.around = self.by_name = None

    def look_from_all(
        self, radius: float, positions: Positions, places: Callable[[], FloatArray]
    ) -> dict[int, list[int]]:
        """Return `around`; `places` gives where agents are (agents, 2)."""
        if self.around is None:
            nodes, numbers, rows = self._pairs_of_all(radius, positions, places)
            ends = np.searchsorted(numbers, np.arange(len(nodes) + 1)).tolist()
            self.around = {node: rows[i:end] for node, i, end in zip(nodes, ends, ends[1:], strict=False)}
        return self.around

    def name_all(
        self, radius: float, positions: Positions, places: Callable[[], FloatArray]
    ) -> dict[int, dict[str, int]]:
        """Return `by_name`; `places` gives where agents are (agents, 2)."""
        if self.by_name is None:
            nodes, numbers, rows = self._pairs_of_all(radius, positions, places)
            found: list[dict[str, int]] = [{} for _ in nodes]
            names, node_of = positions.names, positions.nodes
            for i, row in zip(numbers, rows, strict=True):
                found[i][names[row]] = node_of[row]
            self.by_name = dict(zip(nodes, found, strict=True))
        return self.by_name

    def _pairs_of_all(
        self, radius: float, positions: Positions, places: Callable[[], FloatArray]
    ) -> tuple[list[int], list[int], list[int]]:
        """Return the nodes with an agent, and pairs of the number of one of them and the row of an agent around it."""
        if self._pairs is None:
            xy, row_on = places(), dict(zip(positions.nodes, count(), strict=False))
            found = near_places(xy if len(row_on) == len(xy) else xy[list(row_on.values())], radius, positions, xy)
            if found is None:
                self._pairs = [], [], []
            else:
                self._pairs = [*row_on], found[0].tolist(), found[1].tolist()
            self.found += len(self._pairs[1])
        return self._pairs


def near_places(
    here: FloatArray, radius: float, positions: Positions, xy: FloatArray
) -> tuple[IntArray, IntArray] | None:
    """Return the living agents within a radius of places (places, 2), as numbers of places and rows, ascending.

    None: an agent is on an edge, or it is too far for arrays. `xy` says where agents are (agents, 2).
    """
    squares = sum(float(np.vdot(each, each)) for each in ((xy,) if here is xy else (xy, here)))
    if positions.travellers or not squares + radius * radius < _FAR * _FAR:
        return None
    living = positions.living if positions.inactive else None
    # NOTE: in rows of their own, as subtracting columns of a table copies them (benchmarks: peers).
    there = kernels.Area(*(xy if living is None else xy[living]).T.copy())
    parts = [*kernels.near_each_other(kernels.Area(*here.T.copy()), there, radius)]
    at, rows = parts[0] if len(parts) == 1 else [np.concatenate(part) for part in zip(*parts, strict=True)]
    return at, rows if living is None else living[rows]


class Travellers:
    """The agents on edges, as sensors find them: by the boxes around their edges, and exactly where that is not enough.

    An agent that goes on along its edge changes no box, so that many agents can be asked in the course of a turn
    (benchmarks: travel).
    """

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._moved: ChangeLog | None = None
        self._key: tuple[Positions | None, int | None, int] = (None, None, 0)
        self._boxes: FloatArray = np.zeros((4, 0))  # (4, agents)  least x, y, greatest x, y; NaN for those on nodes
        self._edges: dict[
            int, tuple[Line, float]
        ] = {}  # by row, of the edge that one is on, or was last, and its length
        self._places: dict[int, tuple[float, float] | None] = {}  # by row

    def place(self, positions: Positions, row: int) -> tuple[float, float] | None:
        """Return where an agent is that is on an edge; None for others. Where the edge is gone, it is at its node."""
        self._catch_up(positions)
        return self._place(positions, row)

    def within(self, positions: Positions, place: tuple[float, float], radius: float) -> list[int]:
        """Return the rows of the living agents on edges within `radius` of a place, the rim included, ascending."""
        self._catch_up(positions)
        (x, y), reach, (left, low, right, high) = place, radius + _SLACK, self._boxes
        is_near = (left <= x + reach) & (right >= x - reach) & (low <= y + reach) & (high >= y - reach)
        found = []
        for row in np.flatnonzero(is_near).tolist():
            at_x, at_y = self._place(positions, row) or (inf, inf)
            dx, dy = at_x - x, at_y - y
            if dx * dx + dy * dy <= radius * radius and row not in positions.inactive:
                found.append(row)
        return found

    def sighting(self, positions: Positions, row: int) -> int:
        """Return what is reported of an agent: the node that it is on or has passed, and where on an edge it is."""
        node, progress = positions.nodes[row], positions.on_edge(row)
        xy = None if progress is None else self.place(positions, row)
        if progress is None or xy is None or not self._edges[row][0].lengths:
            return node
        edge = progress.source, progress.target, progress.edge
        return PassedNode(node, edge, progress.share * self._edges[row][1], xy)

    def _place(self, positions: Positions, row: int) -> tuple[float, float] | None:
        if row not in self._places:
            progress = positions.on_edge(row)
            self._places[row] = None if progress is None else self._edges[row][0].at(progress.share)[:2]
        return self._places[row]

    def _catch_up(self, positions: Positions) -> None:
        """Find the edges of the agents that are on others now, and forget where agents were."""
        graph = self._ctx.graph.graph
        key = positions, graph.revision, positions.version
        if key == self._key and graph.revision is not None:
            return
        if self._moved is None or positions is not self._key[0]:
            self._moved = positions.subscribe()
        rows, size = self._moved.take(), len(positions.names)
        if rows is None or graph.revision is None or graph.revision != self._key[1] or self._boxes.shape[1] != size:
            self._boxes, rows, self._edges = np.full((4, size), np.nan), set(positions.travellers), {}
        self._key, self._places = key, {}
        for row in rows:
            progress = positions.on_edge(row)
            if progress is None:
                self._boxes[:, row] = np.nan
                continue
            try:
                edge = graph.get_edge(progress.edge)
                points, length = edge.points, edge.length
            except UnknownName:  # it is gone: the agent counts as on its node
                points, length = coordinates(self._ctx, progress.source), 0.0
            xs, ys = points[::2], points[1::2]
            self._boxes[:, row] = min(xs), min(ys), max(xs), max(ys)
            self._edges[row] = Line.of(points), length


class Memory:
    """What sensors share; one per context.

    Attributes:
        views, views_past_obstacles: what was seen from where.
        nearby: which agents are near a place.
    """

    def __init__(self, ctx: IContext) -> None:
        self.views = Views(ctx)
        self.views_past_obstacles = ViewsPastObstacles(ctx)
        self.nearby = NearbyAgents(ctx, self.views)


def memory_of(ctx: IContext) -> Memory:
    """Return the memory of the context's sensor engine; one of its own for a sensor in an engine of another class."""
    shared = getattr(getattr(ctx.sensor, "storage", None), "memory", None)
    return shared if isinstance(shared, Memory) else Memory(ctx)
