"""Distances and steps in games in which other roads are closed: those of the whole map, where no closed road matters.

A way is as long as on the whole map, and leads over the same nodes, where no edge that is closed is on a shortest path
to its target there. For the other targets, the nodes around each are searched, those of all maps and targets at once.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_numbers_of, as_one_shape
from gamms.game.batch.roads import OpenRoads, RoadMap, refuse_several_maps
from gamms.game.batch.routes import RouteTable, shared_routes
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray


class RoutesOfMaps:
    """What `RouteTable` says, in games in which other roads are closed.

    Args:
        roads: of all games.
        weight: of the edges.
        games: that are meant by `at`, by their numbers in the batch; None: `at` are these numbers.
    """

    def __init__(self, roads: OpenRoads, weight: str | None, games: IntArray | None) -> None:
        self._roads, self._weight, self._games = roads, weight, games

    def distances(
        self,
        sources: IntArray,
        targets: IntArray,
        *,
        at: IntArray | None = None,
    ) -> FloatArray:
        """Return how far it is from nodes to others in games; see `RouteTable`."""
        given = self._as_given(sources, targets, at)
        far: FloatArray = self._answers(
            tuple(one.ravel() for one in given),
            np.float64,
            lambda ways: ways.values(ways.starts)[0],
            lambda table, sources, targets: table.distances(sources, targets),
        )
        return far.reshape(given[0].shape)

    def actions(
        self, sources: IntArray, targets: IntArray, allowed: BoolArray | None = None, *, at: IntArray | None = None
    ) -> IntArray:
        """Return the actions that lead to targets in games; see `RouteTable`."""
        given = self._as_given(sources, targets, at)
        if allowed is not None:
            allowed = as_array(allowed, "allowed", "booleans", (self._roads.streets.num_nodes,))
        found: IntArray = self._answers(
            tuple(one.ravel() for one in given),
            np.int64,
            lambda ways: ways.actions(self._roads, allowed),
            lambda table, starts, ends: table.actions(starts, ends, allowed),
        )
        return found.reshape(given[0].shape)

    def following(self, sources: IntArray, targets: IntArray, *, at: IntArray | None = None) -> IntArray:
        """Return the row of the next node on the shortest path in games; see `RouteTable`."""
        found: IntArray = self._answers(
            tuple(self._as_given(sources, targets, at)),
            np.int64,
            lambda ways: ways.values(ways.starts)[1],
            lambda table, starts, ends: table.following(starts, ends),
        )
        return found

    def _as_given(self, sources: object, targets: object, at: object) -> list[IntArray]:
        """Return rows of nodes and the games, by their numbers in the batch, of one shape."""
        checked, games, places = self._roads.streets.checked, self._games, self._as_places(at)
        pairs = {"sources": checked(sources, "sources"), "targets": checked(targets, "targets")}
        return as_one_shape(pairs | {"at": places if games is None else games[places]})

    def _as_places(self, at: object) -> IntArray:
        if at is None:
            refuse_several_maps("What view.routes() says without at=, the games by their places in the view,")
        return as_numbers_of(at, "at", len(self._roads.number if self._games is None else self._games), "games")

    def _answers(
        self,
        queries: tuple[IntArray, ...],
        kind: type[np.generic],
        ask: "Callable[[_Ways], Any]",
        ask_table: Callable[[RouteTable, IntArray, IntArray], Any],
    ) -> Any:
        """Return what the ways say of queries, and tables of their maps of those where ways are searched too near."""
        starts, ends, games = queries
        found, are_wider = np.empty(len(starts), kind), self._roads.are_wider[games]
        for is_wider in np.unique(are_wider).tolist():
            those, base = np.flatnonzero(are_wider == is_wider), self._base(is_wider=is_wider)
            for part in base.ready(starts[those], ends[those]):
                some = those[part]
                ways = _Ways(base, self._changed, starts[some], ends[some], games[some], self._roads)
                found[some] = ask(ways)
                unsure = some[~ways.are_known]
                for roads, places in self._roads.by_map(games[unsure]):
                    rows = unsure[places]
                    found[rows] = ask_table(self._table(roads), starts[rows], ends[rows])
        return found

    def _base(self, *, is_wider: bool) -> RouteTable:
        """Return the tables of the map of the start, or of the one on which those roads are open that were closed."""
        return self._known("wider routes", self._roads.whole) if is_wider else self._table(None)

    def _table(self, roads: RoadMap | None) -> RouteTable:
        """Return the tables of a map."""
        if roads is None:
            return self._known("routes", self._roads.streets)
        self._roads.use(roads)
        key = "routes", self._weight
        if key not in roads.shared:
            roads.shared[key] = shared_routes(roads.streets, self._weight)
        table: RouteTable = roads.shared[key]
        return table

    def _known(self, key: str, streets: Streets) -> RouteTable:
        known = self._roads.shared
        if (key, self._weight) not in known:
            known[key, self._weight] = shared_routes(streets, self._weight)
        table: RouteTable = known[key, self._weight]
        return table

    def _changed(self, roads: RoadMap | None) -> "_Changed":
        """Return the arcs of a map that are others than those of the one whose tables are asked."""
        if roads is None:
            none = np.zeros(0, np.int64)
            return _Changed(none, none, none, np.zeros(0))
        key = "changed arcs", self._weight
        if key not in roads.shared:
            roads.shared[key] = self._found_changed(roads)
        found: _Changed = roads.shared[key]
        return found

    def _found_changed(self, roads: RoadMap) -> "_Changed":
        streets, arcs = self._roads.whole, self._base(is_wider=roads.is_wider).arcs
        columns, nodes = streets.columns, streets.num_nodes
        ways, shut = columns.targets * nodes + columns.sources, self._roads.not_open_on(roads)
        if not roads.is_wider:
            shut = shut[shut < len(self._roads.streets.columns.edge_ids)]
        changed = np.unique(ways[shut])
        starts, ends = np.divmod(changed, max(nodes, 1))
        others = np.flatnonzero(np.isin(ways, changed))  # parallel ones
        others = others[roads.ranks(others) >= 0]
        weights = np.full(len(changed), np.inf)
        np.minimum.at(weights, np.searchsorted(changed, ways[others]), streets.weights(self._weight)[others])
        entries, runs = kernels.chosen_runs(arcs.offsets, starts)
        which = np.repeat(np.arange(len(starts)), np.diff(runs))
        is_it = arcs.ends[entries] == ends[which]  # one, or none where its weight is infinite
        rows, which = entries[is_it], which[is_it]
        differs = weights[which] != arcs.weights[rows]
        rows, which = rows[differs], which[differs]
        return _Changed(rows, starts[which], ends[which], weights[which])


class _Changed(NamedTuple):
    """The reversed arcs that are other ones on a map than on the whole one.

    Attributes:
        arcs: their rows, ascending.
        starts, ends: rows of nodes: where they lead from, and to.
        weights: on this map; infinite: it has none.
    """

    arcs: IntArray
    starts: IntArray
    ends: IntArray
    weights: FloatArray


class _Ways:
    """The ways of some queries, of which tables of the whole map are ready.

    Args:
        whole: these tables.
        changed: returns the arcs that a map has changed.
        starts, ends, games: (queries,) rows of nodes, and numbers of games.
        roads: of all games.

    Attributes:
        starts: as given.
        are_known: (queries,) whether what is said of each holds.
    """

    def __init__(
        self,
        whole: RouteTable,
        changed: Callable[[RoadMap | None], _Changed],
        starts: IntArray,
        ends: IntArray,
        games: IntArray,
        roads: OpenRoads,
    ) -> None:
        self._whole, self.starts, self._ends, self._games = whole, starts, ends, games
        self._nodes, self._ids = roads.streets.num_nodes, roads.streets.columns.node_ids
        _, first, map_of = np.unique(roads.number[games], return_index=True, return_inverse=True)
        maps = [changed(roads.of(game)) for game in games[first].tolist()]
        none = _Changed(*(np.zeros(0, np.int64),) * 3, np.zeros(0))
        self._arcs = _Changed(*(np.concatenate(columns) for columns in zip(none, *maps, strict=True)))
        last = np.cumsum([len(one.arcs) for one in maps], dtype=np.int64)
        pairs, self._pair_of = np.unique(map_of * self._nodes + ends, return_inverse=True)
        of_map, self._targets = np.divmod(pairs, max(self._nodes, 1))
        self._ranges = np.append(0, last)[of_map], np.append(0, last)[of_map + 1]
        self._line = self._lines_of_others()
        self.are_known = np.ones(len(starts), np.bool_)
        self._search()

    def _lines_of_others(self) -> IntArray:
        """Return numbers of the pairs of a map and a target whose ways may be other ones, (pairs,); -1: the same."""
        pairs, entries = kernels.expand_ranges(*self._ranges)
        arcs, targets = self._arcs, self._targets[pairs]
        before, after = (self._whole.values(rows[entries], targets)[0] for rows in (arcs.starts, arcs.ends))
        weights = self._whole.arcs.weights[arcs.arcs[entries]]
        is_other = np.zeros(len(self._targets), np.bool_)
        is_other[pairs[np.isfinite(before) & (before + weights == after)]] = True
        return np.where(is_other, np.cumsum(is_other) - 1, -1)

    def _search(self) -> None:
        """Find the ways around the targets of these pairs, as if each had a graph of its own."""
        others, arcs, nodes = np.flatnonzero(self._line >= 0), self._whole.arcs, self._nodes
        self._keys = np.zeros(0, np.int64)
        if not len(others):
            return
        targets = self._targets[others]
        lines, rows, far, are_all = self._whole.around(targets)
        self._keys, self._rows = lines * nodes + rows, rows
        used, runs = kernels.chosen_runs(arcs.offsets, rows)
        before = np.repeat(np.arange(len(rows)), np.diff(runs))
        after, is_there = self._places(lines[before] * nodes + arcs.ends[used])
        weights = arcs.weights[used]
        line, entries = kernels.expand_ranges(self._ranges[0][others], self._ranges[1][others])
        changed = line * len(arcs.ends) + self._arcs.arcs[entries]
        wanted = lines[before] * len(arcs.ends) + used
        places = np.minimum(np.searchsorted(changed, wanted), len(changed) - 1)
        is_changed = changed[places] == wanted
        weights = np.where(is_changed, self._arcs.weights[entries[places]], weights)
        kept = np.flatnonzero(is_there & np.isfinite(weights))
        counts = np.bincount(before[kept], minlength=len(rows))
        self._graph = kernels.Arcs(np.append(0, np.cumsum(counts)), after[kept], weights[kept])
        self._before = np.append(before[kept], 0)  # the last one for nodes that no arc leads to
        self._roots = self._places(np.arange(len(others)) * nodes + targets)[0]
        self._far = kernels.shortest_distances(self._graph, self._roots)
        limit = np.zeros(len(others))
        np.maximum.at(limit, lines, far)
        limit[are_all] = np.inf
        which = np.flatnonzero(self._line[self._pair_of] >= 0)
        place, is_there = self._places(self._key(self.starts[which], which))
        line = self._line[self._pair_of[which]]
        self.are_known[which] = np.where(is_there, self._far[place], np.inf) <= limit[line]

    @cached_property
    def _tree(self) -> IntArray:
        """The last arcs to the nodes of that graph."""
        return kernels.last_arcs_to_nearest(self._graph, self._roots, self._ids[self._rows], self._far)

    def _key(self, rows: IntArray, which: IntArray) -> IntArray:
        found: IntArray = self._line[self._pair_of[which]] * self._nodes + rows
        return found

    def _places(self, keys: IntArray) -> tuple[IntArray, BoolArray]:
        places = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return places, self._keys[places] == keys

    def values(self, rows: IntArray, which: IntArray | None = None) -> tuple[FloatArray, IntArray]:
        """Return how far it is from nodes on the way of queries, and the nodes that come next.

        Args:
            rows: of the nodes, (which,).
            which: numbers of queries; None: all.
        """
        which = np.arange(len(rows)) if which is None else which
        far, following = self._whole.values(rows, self._ends[which])
        others = np.flatnonzero(self._line[self._pair_of[which]] >= 0)
        if len(others):
            place, is_there = self._places(self._key(rows[others], which[others]))
            far[others] = np.where(is_there, self._far[place], np.inf)
            arcs = self._tree[place]
            has_next = is_there & (arcs >= 0)
            following[others] = np.where(has_next, self._rows[self._before[arcs]], rows[others])
        return far, following

    def actions(self, roads: OpenRoads, allowed: BoolArray | None) -> IntArray:
        """Return the actions that lead to targets; -1: no path."""
        far, reached = self.values(self.starts)
        choices = roads.choices(self.starts, self._games)
        counts = roads.counts(choices)[:, None]
        columns = np.arange(int(counts.max(initial=1)))
        legal, is_legal = roads.ends(choices[:, None], np.minimum(columns, counts - 1)), columns < counts
        legal = np.where(is_legal, legal, -1)
        has_path, at = np.isfinite(far), reached.copy()
        going = np.flatnonzero(has_path & (reached != self.starts) & (at != self._ends))
        while len(going):  # on, as long as the next node on the way is legal, too
            on = self.values(at[going], going)[1]
            goes = (legal[going] == on[:, None]).any(axis=1)
            if allowed is not None:
                goes &= allowed[at[going]] & allowed[on]
            going, on = going[goes], on[goes]
            reached[going] = at[going] = on
            going = going[on != self._ends[going]]
        is_direct = (legal == self._ends[:, None]).any(axis=1)
        reached = np.where(is_direct, self._ends, reached)
        actions = (legal == reached[:, None]).argmax(axis=1)
        if allowed is not None:
            actions[~allowed[reached]] = 0
        return np.where(has_path | is_direct, actions, -1)
