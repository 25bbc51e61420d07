"""Where agents are: one object that sensors, rules and drawing ask, brought up to date whenever it is asked."""

from bisect import bisect_left
from collections.abc import Collection, Iterable, Mapping, MutableSequence, Sequence
from typing import Any

import numpy as np

from gamms.ir.agents import AgentBlock
from gamms.ir.columns import ChangeLog, copied_column
from gamms.ir.graph import FloatArray, IntArray, read_only
from gamms.ir.progress import Progress

_FEW = 8  # where fewer than one row in so many has changed, arrays are copied and changed instead of made again


def _frozen(values: object, kind: type) -> Any:
    """Return a read-only array of what a column holds."""
    return read_only(np.array(values, kind))


_NO_ROWS: IntArray = _frozen([], np.int64)
_NO_XYZ: FloatArray = _frozen(np.zeros((0, 3)), np.float64)


class Positions:
    """Where the agents of a block are, in the order of their creation.

    What it returns is valid until an agent changes, and not to be written to; arrays that were returned stay as they
    are. Agents that are not alive stand on no node.

    Args:
        block: the agents.
    """

    __slots__ = (
        *("_block", "_by_name", "_by_node", "_flyer_xyz", "_flyers", "_log", "_moved", "_node_ids", "_node_of"),
        *("_noted", "_noted_at", "_renamed", "_stale"),
    )

    def __init__(self, block: AgentBlock) -> None:
        self._block, self._log = block, block.subscribe()
        self._by_node: dict[int, set[int]] | None = None
        self._by_name: dict[str, int] | None = None
        self._node_of: list[int | None] = []  # row -> the node on which it is in `_by_node`
        self._noted: list[str] = []  # the names, as they were noted
        self._noted_at = -1  # at this version of the structure
        self._forget()

    @property
    def version(self) -> int:
        """A number that changes whenever a node, position, team or life of an agent may have."""
        block = self._block
        if block.flyers:
            block.locate()
        return block.version

    @property
    def structure_version(self) -> int:
        """A number that changes whenever agents come or go, or a team or life of one may have changed."""
        return self._block.structure.version

    @property
    def names(self) -> Sequence[str]:
        """The names (agents,)."""
        return self._block.names

    @property
    def teams(self) -> Sequence[Any]:
        """The teams (agents,)."""
        return self._block.teams

    @property
    def nodes(self) -> Sequence[int]:
        """The node ids (agents,), of flyers those below them, as Python's ints."""
        self._catch_up()
        return self._block.node

    @property
    def previous_nodes(self) -> Sequence[int]:
        """The ids (agents,) of the nodes before their last moves."""
        return self._block.previous

    def noted(self) -> tuple[Sequence[str], Sequence[Any]]:
        """Return the names and `places`, to be kept; the names are one list until agents come, go or change."""
        block = self._block
        if self._noted_at != block.structure.version:
            self._noted, self._noted_at = list(block.names), block.structure.version
        if block.flyers or block.travellers:
            return self._noted, self.places
        # NOTE: in line, for every turn (benchmarks: turns; teams).
        node = block.node
        return self._noted, block.copied.of(node, block.version).data if block.has_teams else node.tolist()

    @property
    def places(self) -> MutableSequence[Any]:
        """Where the agents are (agents,), as a list or a view of an array of its own.

        Ids of nodes; of those who fly points (x, y, z), of those on an edge their `Progress`.
        """
        places = self._with_flyers(self._block.node, self._block.position)
        if self._block.travellers:
            for row, progress in self.on_edges.items():
                places[row] = progress
        return places

    @property
    def previous_places(self) -> MutableSequence[Any]:
        """Where the agents were before their last moves (agents,), in the same form: ids of nodes, and points."""
        return self._with_flyers(self._block.previous, self._block.previous_position)

    def _with_flyers(self, nodes: Any, points: Sequence[Any]) -> MutableSequence[Any]:
        if not (self._block.flyers or self._block.travellers):
            places: MutableSequence[Any] = copied_column(nodes) if self._block.has_teams else nodes.tolist()
            return places
        places = nodes.tolist()
        for row in self._block.flyers:
            places[row] = points[row]
        return places

    @property
    def node_ids(self) -> IntArray:
        """The same (agents,) as an array."""
        self._catch_up_arrays()
        return self._node_ids

    def node_ids_of(self, rows: list[int]) -> IntArray:
        """Return those of some agents (rows,), at a cost that does not grow with the number of others."""
        self._catch_up()
        if self._stale is not None and not self._stale:
            return self._node_ids[rows]
        # NOTE: after a move, the array of all would have to be copied (benchmarks: OCCLUDED_AGENT after a move).
        node = self._block.node
        return np.array([node[row] for row in rows], np.int64)

    @property
    def flyers(self) -> IntArray:
        """The rows (flyers,) of those who fly, ascending."""
        self._catch_up_arrays()
        return self._flyers

    @property
    def flyer_xyz(self) -> FloatArray:
        """Where these are (flyers, 3), map units."""
        self._catch_up_arrays()
        return self._flyer_xyz

    @property
    def travellers(self) -> Collection[int]:
        """The rows of agents that may be on an edge."""
        return self._block.travellers

    def on_edge(self, row: int) -> Progress | None:
        """Return where on an edge an agent is; None: on its node, or in the air."""
        return self._block.on_edge(row)

    def subscribe(self) -> ChangeLog:
        """Return a log of the agents that are elsewhere from now on; one that goes on along its edge is not in it."""
        return self._block.subscribe()

    @property
    def on_edges(self) -> Mapping[int, Progress]:
        """Row -> where it is, of the agents that are on an edge."""
        block = self._block
        return {row: progress for row in sorted(block.travellers) if (progress := block.on_edge(row)) is not None}

    @property
    def inactive(self) -> Collection[int]:
        """The rows of the agents that are not alive."""
        return self._block.inactive

    @property
    def living(self) -> IntArray:
        """The rows of the agents that are alive, ascending."""
        rows = np.arange(len(self._block))
        inactive = self._block.inactive
        return np.delete(rows, list(inactive)) if inactive else rows

    @property
    def living_rows(self) -> list[int]:
        """The same as a fresh list."""
        rows, inactive = range(len(self._block)), self._block.inactive
        return [row for row in rows if row not in inactive] if inactive else list(rows)

    @property
    def by_node(self) -> Mapping[int, set[int]]:
        """Node id -> the rows of the living agents on it; nodes without one are missing, and so are those on edges."""
        self._catch_up()
        if self._by_node is None:
            self._by_node = {}
            self._moved.update(range(len(self._block)))
        if self._moved:
            self._follow(self._moved)
            self._moved.clear()
        return self._by_node

    @property
    def by_name(self) -> Mapping[str, int]:
        """Name -> node id of the living agents, in the order of their creation; those on edges have passed it last."""
        self._catch_up()
        if self._by_name is not None and self._renamed:
            self._rename(self._renamed)
            self._renamed.clear()
        if self._by_name is None:
            names, nodes = self._block.names, self._block.node
            self._by_name = {names[row]: nodes[row] for row in self.living.tolist()}
        return self._by_name

    def rows_on(self, node_ids: Iterable[int]) -> list[int]:
        """Return the rows of the living agents on some nodes, ascending."""
        by_node = self.by_node
        return sorted([row for node in by_node.keys() & node_ids for row in by_node[node]])

    def row_of(self, name: str) -> int:
        """Return the row of an agent (KeyError)."""
        return self._block.rows.of(name)

    def found(self, rows: list[int]) -> dict[str, int]:
        """Return name -> node id of agents whose rows were asked for just now."""
        names, nodes = self._block.names, self._block.node
        return {names[row]: nodes[row] for row in rows}

    def _catch_up(self) -> None:
        """Read what has changed; occupancy, names and arrays follow when they are asked for."""
        # NOTE: asked after every single move of the paper's loop (benchmarks: sense).
        if self._block.flyers:
            self._block.locate()
        rows = self._log.take()
        if rows is None:
            self._forget()
        elif rows:
            if self._stale is not None:
                self._stale |= rows
            if self._by_node is not None:
                self._moved |= rows
            if self._by_name is not None:
                self._renamed |= rows

    def _forget(self) -> None:
        self._by_node, self._by_name, self._node_of = None, None, []
        self._moved: set[int] = set()  # rows that `_by_node` does not show yet
        self._renamed: set[int] = set()  # rows that `_by_name` does not show yet
        self._node_ids = self._flyers = _NO_ROWS
        self._flyer_xyz = _NO_XYZ
        self._stale: set[int] | None = None  # rows that the arrays do not show yet; None: any

    def _rename(self, rows: Iterable[int]) -> None:
        """Enter the nodes of some rows by name; all are entered again where one is new, or lives again."""
        names, node, inactive = self._block.names, self._block.node, self._block.inactive
        by_name: dict[str, int] = self._by_name  # type: ignore[assignment] # asked where it is known
        for row in rows:
            name = names[row]
            if row in inactive:
                by_name.pop(name, None)
            elif name in by_name:
                by_name[name] = node[row]
            else:
                self._by_name = None
                return

    def _follow(self, rows: Iterable[int]) -> None:
        """Move some rows, new ones among them, to their nodes."""
        node, inactive, node_of = self._block.node, self._block.inactive, self._node_of
        travellers = self._block.travellers
        by_node: dict[int, set[int]] = self._by_node  # type: ignore[assignment] # asked where it is known
        node_of += [None] * (len(node) - len(node_of))
        for row in rows:
            is_off = row in inactive or (row in travellers and self._block.on_edge(row) is not None)
            here, before = None if is_off else node[row], node_of[row]
            if here == before:
                continue
            if before is not None:
                there = by_node[before]
                there.discard(row)
                if not there:
                    del by_node[before]
            node_of[row] = here
            if here is not None:
                if here in by_node:
                    by_node[here].add(row)
                else:
                    by_node[here] = {row}

    def _catch_up_arrays(self) -> None:
        self._catch_up()
        stale, block = self._stale, self._block
        if stale is not None and not stale:
            return
        self._stale = set()
        if stale is not None and len(self._node_ids) == len(block) and len(stale) < len(block) // _FEW:
            self._node_ids = _changed(self._node_ids, stale, [block.node[row] for row in stale])
            flown = [row for row in stale if block.kind[row]] if block.flyers else []
            if flown:
                at = [bisect_left(block.flyers, row) for row in flown]
                self._flyer_xyz = _changed(self._flyer_xyz, at, [block.position[row] for row in flown])
            return
        self._node_ids = _frozen(block.node, np.int64)
        if block.flyers:
            self._flyers = _frozen(block.flyers, np.int64)
            self._flyer_xyz = _frozen([block.position[row] for row in block.flyers], np.float64)


def _changed(array: np.ndarray[Any, Any], rows: Iterable[int], values: list[Any]) -> Any:
    """Return a read-only copy with other values in some rows."""
    array = array.copy()
    for row, value in zip(rows, values, strict=True):
        array[row] = value
    return read_only(array)
