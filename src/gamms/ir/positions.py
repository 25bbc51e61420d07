"""The positions of agents, for sensors, rules and drawing; updated on access."""

from collections.abc import Callable, Collection, Mapping, MutableSequence, Sequence
from typing import Any

import numpy as np

from gamms.ir.agents import AgentBlock
from gamms.ir.columns import ChangeLog, copy_column
from gamms.ir.graph import FloatArray, IntArray, read_only
from gamms.ir.progress import Progress


def _freeze_values(values: object, kind: type) -> Any:
    """Return a read-only array of the values of a column."""
    return read_only(np.array(values, kind))


class Positions:
    """The positions of the agents of a block, in order of creation.

    Results are read-only and valid until an agent changes; returned arrays never change. Agents that are not alive are
    on no node.

    Args:
        block: the agents.

    Attributes:
        block: as given.
    """

    __slots__ = ("_flyer_xyz", "_flyers", "_node_ids", "_noted", "_noted_at", "_read_at", "block")

    def __init__(self, block: AgentBlock) -> None:
        self.block = block
        self._noted: list[str] = []  # names, as a list that is never changed
        self._noted_at = -1  # structure version of the names
        self._read_at = -1  # version of the arrays
        self._node_ids: IntArray
        self._flyers: IntArray
        self._flyer_xyz: FloatArray

    @property
    def version(self) -> int:
        """A number that changes whenever a node, position, team or alive flag of an agent may have changed."""
        block = self.block
        if block.flyers:
            block.locate()
        return block.version

    @property
    def structure_version(self) -> int:
        """A number that changes whenever agents are created or deleted, or a team or alive flag may have changed."""
        return self.block.structure.version

    @property
    def names(self) -> Sequence[str]:
        """The names, (agents,)."""
        return self.block.names

    @property
    def teams(self) -> Sequence[Any]:
        """The teams, (agents,)."""
        return self.block.teams

    @property
    def nodes(self) -> "memoryview[int]":
        """The node ids (agents,), for flying agents the nodes below them."""
        block = self.block
        if block.flyers:
            block.locate()
        return block.get_ids(block.node)

    @property
    def previous_nodes(self) -> Sequence[int]:
        """The ids (agents,) of the nodes before their last moves."""
        return self.block.get_ids(self.block.previous)

    def get_names(self) -> list[str]:
        """Return the names as a list that is never changed, valid until agents change."""
        version = self.block.structure.version
        if self._noted_at != version:
            self._noted = list(self.block.names)
            self._noted_at = version
        return self._noted

    def get_noted(self) -> tuple[Sequence[str], Sequence[Any]]:
        """Return the names and `places`, which may be stored; see `get_names`."""
        block = self.block
        names = self._noted if self._noted_at == block.structure.version else self.get_names()
        if block.flyers or block.travellers:
            return names, self.places
        # NOTE: inline, because it runs every turn (benchmarks: turns; teams).
        node = block.get_ids(block.node)
        return names, copy_column(node) if block.has_teams else node.tolist()

    @property
    def places(self) -> MutableSequence[Any]:
        """The positions of the agents (agents,), as a list or a view of an array.

        Node ids; for flying agents points (x, y, z), for agents on edges their `Progress`.
        """
        places = self._add_flyers(self.block.get_ids(self.block.node), self.block.flights.get_position)
        if self.block.travellers:
            for row, progress in self.on_edges.items():
                places[row] = progress
        return places

    @property
    def previous_places(self) -> MutableSequence[Any]:
        """The positions before the last moves (agents,), in the same form: node ids and points."""
        return self._add_flyers(self.block.get_ids(self.block.previous), self.block.flights.get_previous_position)

    def _add_flyers(self, nodes: "memoryview[int]", point_of: Callable[[int], Any]) -> MutableSequence[Any]:
        if not (self.block.flyers or self.block.travellers):
            places: MutableSequence[Any] = copy_column(nodes) if self.block.has_teams else nodes.tolist()
            return places
        places = nodes.tolist()
        for row in self.block.flyers:
            places[row] = point_of(row)
        return places

    @property
    def node_ids(self) -> IntArray:
        """The node ids (agents,) as an array."""
        self._catch_up()
        return self._node_ids

    def find_node_ids(self, rows: Sequence[int] | IntArray) -> IntArray:
        """Return the node ids of some agents (rows,), at a cost independent of the number of other agents."""
        block = self.block
        block.locate()
        found: IntArray = np.array(block.get_ids(np.asarray(block.node).take(rows).data), np.int64)
        return found

    @property
    def flyers(self) -> IntArray:
        """The rows (flyers,) of flying agents, ascending."""
        self._catch_up()
        return self._flyers

    @property
    def flyer_xyz(self) -> FloatArray:
        """The positions of flying agents (flyers, 3), map units."""
        self._catch_up()
        return self._flyer_xyz

    @property
    def travellers(self) -> Collection[int]:
        """The rows of agents that may be on an edge."""
        return self.block.travellers

    def get_edge_position(self, row: int) -> Progress | None:
        """Return the position of an agent on an edge; None on a node, or in the air."""
        place: Progress | None = self.block.get_edge_position(row)
        return place

    def subscribe(self) -> ChangeLog:
        """Return a log of agents that change their node or edge; moves along the same edge are not included."""
        return self.block.subscribe()

    @property
    def on_edges(self) -> Mapping[int, Progress]:
        """Row -> position of the agents on edges."""
        block = self.block
        return {
            row: progress for row in sorted(block.travellers) if (progress := block.get_edge_position(row)) is not None
        }

    @property
    def inactive(self) -> Collection[int]:
        """The rows of agents that are not alive."""
        return self.block.inactive

    @property
    def living(self) -> IntArray:
        """The rows of living agents, ascending."""
        rows = np.arange(len(self.block))
        inactive = self.block.inactive
        return np.delete(rows, list(inactive)) if inactive else rows

    def find_row(self, name: str) -> int:
        """Return the row of an agent (KeyError)."""
        return self.block.rows.find_row(name)

    def name_rows(self, rows: list[int]) -> dict[str, int]:
        """Return name -> node id of agents given by rows of the last query."""
        names = self.block.names
        node_of = self.block.get_node
        return {names[row]: node_of(row) for row in rows}

    def _catch_up(self) -> None:
        """Read the arrays again if something has changed."""
        version = self.version
        block = self.block
        if version != self._read_at:
            self._read_at = version
            self._node_ids = _freeze_values(block.get_ids(block.node), np.int64)
            self._flyers = _freeze_values(block.flyers, np.int64)
            self._flyer_xyz = _freeze_values(np.reshape(block.games.get_row("position"), (-1, 3)), np.float64)
