"""Agents as rows of columns: `AgentBlock`, which owns every change of them, and the change logs that others read."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import compress, count
from operator import ne, not_
from typing import Any

import numpy as np

from gamms.core.agents import AgentColumns, Moves, PointedColumns
from gamms.core.block import INT64, Block
from gamms.errors import BadValue
from gamms.ir.columns import ChangeLog, RowsByName, Selection, StructureLog, copied_column, drop
from gamms.ir.graph import NodeFinder
from gamms.ir.journal import PLAIN, Journal
from gamms.ir.progress import Progress
from gamms.ir.schema import AGENT_COLUMNS, BY_ROW, CHANGE_EVENTS, IN_GAMES, PLACES

Position = tuple[float, float, float]  # x, y, z; map units
Quat = tuple[float, float, float, float]  # w, x, y, z; of length 1

UNTURNED: Quat = (1.0, 0.0, 0.0, 0.0)
PlaceAt = Callable[[float], Progress | None]  # a time of the turn, from 0 to 1 -> where on an edge; None: on the node

_COLUMNS = {column.name: column for column in AGENT_COLUMNS}
_NUMBERS = [column.name for column in IN_GAMES if column.axis == "agent"]
_SHOWN = [name for name in _NUMBERS if name not in AgentColumns.__slots__]
_LISTS = [name for name in BY_ROW if name not in _NUMBERS]
_PLACES = [column.name for column in PLACES if column.name in _LISTS]
_STRUCTURE = [name for name in _LISTS if name not in _PLACES]


class AgentBlock(AgentColumns):
    """Agents, one row each in the order of their creation, and the verbs that change them.

    What callers pass is validated before (`typing.actions`), not here. Columns are read directly and written through
    the verbs alone. Columns of numbers are views of the arrays of a `core.block.Block`, which are others once agents
    come or go; columns whose values may be None or anything are lists.

    Args:
        graph: finds the nodes below flyers; None: their nodes are those that were written.
        journal: how it writes.

    Attributes:
        names, teams: of each agent; a team is whatever the caller calls one.
        kind: 0 on the ground, 1 in the air: the values of `AgentType`.
        node, previous: ids of nodes; of a flyer those below it, the nearest ones.
        heading: `(cos, sin)` where it was set; None where it follows from the last move, and for flyers.
        position, previous_position: `(x, y, z)` of flyers, map units; None on the ground.
        quat: `(w, x, y, z)` of flyers, of length 1; None on the ground.
        speed: of flyers, map units per step; on the ground what the turn engine lets it move, None for one edge.
        alive: whether it takes part.
        games: the block of one game, which holds the columns of numbers, those of teams and of the game too.
        team_rows: team -> its row in columns of teams, in the order in which teams came.
        has_teams: whether a team was created, so that its members are made only when a program asks for them.
        progress: on the edge that an agent on the ground is moving along; None where it has covered nothing of one.
        graph: finds the nodes below flyers.
        flyers: the rows of flyers, ascending.
        travellers: the rows of agents whose progress has a motion.
        inactive: the rows of agents that are not alive.
        placed: the rows of agents that were put where they are since they moved in a turn.
        removed: the rows of agents that were removed; `close_up` closes them up.
        journal: how it writes: plainly (`PLAIN`), noting what it writes, or not at all (`CLOSED`).
        rows: of the agents, by their names.
        structure: which rows came, went, died, returned, or got another team, speed, sensor or strategy.
        trusts_nodes: whether any integer is taken for a node, because a recording is replayed whose map has changed.
        under_way: where agents are within a turn, where some of them decide while others go on.
    """

    __slots__ = (
        *(name for name in BY_ROW if name not in AgentColumns.__slots__),
        *("_have_all_changed", "_logs", "_located_revision", "_unlocated", "_version", "flyers", "games"),
        *("graph", "has_teams", "inactive", "placed", "removed", "rows", "structure", "team_rows", "travellers"),
        *("trusts_nodes", "under_way"),
    )

    names: list[str]
    teams: list[Any]
    kind: memoryview[int]
    heading: list[tuple[float, float] | None]
    position: list[Position | None]
    previous_position: list[Position | None]
    quat: list[Quat | None]
    speed: list[float | None]
    alive: memoryview[bool]
    progress: list[Progress | None]

    def __init__(self, graph: NodeFinder | None = None, journal: Journal = PLAIN) -> None:
        for name in _LISTS:
            setattr(self, name, [])
        self.games = Block(IN_GAMES)
        self._show()
        self.has_teams = False
        self.team_rows: dict[Any, int] = {}
        self.flyers: list[int] = []
        self.inactive: set[int] = set()
        self.placed: set[int] = set()
        self.travellers: set[int] = set()
        self.removed: list[int] = []
        self._version = 0
        self.journal = journal
        self.structure = StructureLog()
        self.trusts_nodes = False
        self.graph = graph
        self.rows = RowsByName()
        self._changed: set[int] = set()  # rows; not published yet
        self._have_all_changed = False
        self._logs: list[ChangeLog] = []
        self.under_way = UnderWay(self)
        self._unlocated: set[int] = set()  # rows of flyers that have moved since their node was found
        self._located_revision: int | None = None  # of the graph, when the nodes of the other flyers were found

    def arrays(self, names: Iterable[str]) -> dict[str, Any]:
        """Return copies of columns, those of numbers as arrays, where NaN stands for None."""
        columns: dict[str, Any] = {}
        for name in names:
            column, of = getattr(self, name), _COLUMNS[name]
            if of.shape:
                column = [one or (np.nan,) * of.shape[0] for one in column]
            columns[name] = list(column) if of.kind is None else np.array(column, of.kind).reshape(-1, *of.shape)
        return columns

    def _show(self) -> None:
        """Let the columns of numbers be views of the agents that there are now."""
        row = self.games.row
        self.show(row("node"), row("previous"))
        for name in _SHOWN:
            setattr(self, name, row(name))

    def __len__(self) -> int:
        return len(self.names)

    def __getstate__(self) -> dict[str, Any]:
        """Return all but the views of numbers, which cannot be copied."""
        names = {*self.__slots__, "_changed", "journal", "progress", "teams"}.difference(_NUMBERS)
        return {name: getattr(self, name) for name in sorted(names)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Become a copy."""
        for name, value in state.items():
            setattr(self, name, value)
        self._show()

    # -- coming and going ---------------------------------------------------------------------------------------

    def add(
        self, name: str, node: int, team: Hashable = None, position: Position | None = None, speed: float | None = None
    ) -> int:
        """Add an agent that stands on `node`, or one that flies at `position`; returns its row."""
        row, flies = self.games.add(1), position is not None
        self._show()
        self.node[row] = self.previous[row] = node
        self.kind[row], self.alive[row] = flies, True
        given = {"names": name, "teams": team, "speed": speed}
        if flies:
            given |= {"position": position, "previous_position": position, "quat": UNTURNED}
        for column in _LISTS:
            getattr(self, column).append(given.get(column))
        self.rows.enter(name)
        self.number_teams((team,))
        self.structure.note((row,))
        self._changed.add(row)
        if flies:
            self.flyers.append(row)
            self._unlocated.add(row)
        return row

    def add_all(self, names: Sequence[str], nodes: list[int], team: Hashable) -> int:
        """Add agents of one team that stand on these nodes; returns the row of the first."""
        count = len(names)
        first = self.games.add(count)
        self._show()
        self.node[first:] = self.previous[first:] = as_ids(nodes)
        np.asarray(self.alive)[first:] = True
        for column in _LISTS:
            getattr(self, column).extend(names if column == "names" else [team if column == "teams" else None] * count)
        rows = range(first, first + count)
        self.rows.enter_all(names)
        self.number_teams((team,))
        self.structure.note(rows)
        self._changed.update(rows)
        return first

    def number_teams(self, teams: Iterable[Any]) -> None:
        """Add rows to columns of teams for those that have none; None is no team."""
        for team in teams:
            if team is not None and team not in self.team_rows:
                self.team_rows[team] = self.games.add(1, "team")
                self._show()

    def take_over(self, source: AgentBlock, row: int) -> int:
        """Add the agent in a row of another block; returns its row here."""
        new = self.add(source.names[row], source.node[row], position=source.position[row])
        for name in BY_ROW:
            getattr(self, name)[new] = getattr(source, name)[row]
        self.number_teams((self.teams[new],))
        self._follow_progress(new)
        if not self.alive[new]:
            self.inactive.add(new)
        return new

    def take_all(self, source: AgentBlock) -> None:
        """Take copies of all agents of another block into this one, which has none yet."""
        for name in (*_LISTS, "placed", "team_rows"):
            setattr(self, name, getattr(source, name).copy())
        self.has_teams = source.has_teams
        self.games = source.games.copied()
        self._show()
        self._derive()
        self._unlocated = set(self.flyers)

    def remove(self, row: int) -> None:
        """Remove an agent; its row stays until `close_up`."""
        self.rows.leave(self.names[row])
        self.removed.append(row)
        self.structure.note((row,))

    def close_up(self) -> None:
        """Close up the rows of agents that were removed."""
        gone, self.removed = sorted(self.removed), []
        self.structure.close_up(gone, self.names)
        self.progress = self.progress.copy()  # orders of earlier turns have that of theirs
        for name in _LISTS:
            drop(getattr(self, name), gone)
        self.games.close_up(gone)
        self._show()
        self.rows.close_up(gone)
        self.journal.close_up(gone)
        for which in ("_unlocated", "inactive", "placed", "travellers"):
            setattr(self, which, {row - bisect_left(gone, row) for row in getattr(self, which).difference(gone)})
        self.flyers = [*compress(count(), self.kind)] if self.flyers else []
        self._have_all_changed = True

    def succeed(self, block: AgentBlock) -> None:
        """Take the place of another block: write as it does, with other versions than it had."""
        self.graph, self.journal = block.graph, block.journal
        self._version, self.rows.version = block.version + 1, block.rows.version + 1
        self.structure.note_all(block.structure.version)

    def row_of(self, name: str) -> int:
        """Return the row of an agent (KeyError)."""
        return self.rows.of(name)

    # -- verbs --------------------------------------------------------------------------------------------------

    def move_all(self, rows: Selection, nodes: Sequence[int]) -> None:
        """Move many agents on the ground; one that stays keeps its previous node."""
        if self.is_closed:
            return
        if 2 * len(rows.rows) > len(self.node):
            self._have_all_changed = True
        else:
            self._changed |= rows.as_set
        ends = as_ids(nodes)
        before = rows.of(self.node) if self.is_noting else ()
        moved = self.move_rows(rows.buffer, ends)
        if self.is_noting and moved:
            self._note_moves(rows, before, ends, moved)

    def _note_moves(self, rows: Selection, before: Sequence[int], ends: memoryview[int], moved: int) -> None:
        """Note the moves of those that did not stay, so many."""
        journal = self.journal
        if not self.has_teams:
            goes = compress(zip(rows.rows, ends, strict=True), map(ne, before, ends))
            journal.log += [number for row, end in goes for number in (journal.ids[row], end)]
        else:
            goers = rows.ascending
            nodes = rows.in_order(ends)
            if moved < len(rows.rows):
                has_moved = rows.in_order((np.asarray(before) != ends).data)
                goers = goers[has_moved]
                nodes = nodes[has_moved]
            journal.moved(goers, nodes)

    def set(self, row: int, column: str, value: object) -> None:
        """Set the value of an agent in one of the columns of `schema.CHANGE_EVENTS`, and note it."""
        if self.is_closed:
            return
        journal = self.journal
        getattr(self, column)[row] = value
        if column == "teams":
            self.number_teams((value,))
        if _COLUMNS[column].is_watched:
            self._changed.add(row)
        if _COLUMNS[column].is_structure:
            self.structure.note((row,))
        if column == "node":
            self.placed.add(row)
        if column == "alive":
            (self.inactive.discard if value else self.inactive.add)(row)
        if column == "node" or (column == "alive" and not value and self.on_edge(row) is None):
            self.set_progress(row, None)
        if self.is_noting and column in CHANGE_EVENTS:
            event = CHANGE_EVENTS[column]
            plain = list(value) if column == "heading" and isinstance(value, tuple) else value
            journal.note(event.code, {"agent_name": self.names[row], event.key: plain})

    def on_edge(self, row: int) -> Progress | None:
        """Return where on an edge an agent is; None: on its node, or in the air."""
        if row not in self.travellers:
            return None
        place_at = self.under_way.places.get(row)
        if place_at is not None:
            return place_at(self.under_way.time)
        progress = self.progress[row]
        return progress if progress is not None and progress.source == self.node[row] else None

    def set_progress(self, row: int, progress: Progress | None) -> None:
        """Set how far along an edge an agent is."""
        if self.progress[row] != progress:
            self.progress[row] = progress
            self._follow_progress(row)
            if self.is_noting:
                self.journal.progressed.add(self.journal.ids[row])

    def _follow_progress(self, row: int) -> None:
        """Keep `travellers` as the column of progress says."""
        progress = self.progress[row]
        if progress is not None and progress.motion:
            self.travellers.add(row)
            self._changed.add(row)
        elif row in self.travellers:
            self.travellers.discard(row)
            self._changed.add(row)

    def fly(self, row: int, position: Position, node: int | None = None) -> None:
        """Move a flyer to `(x, y, z)`, map units, above a node; None: above the nearest one in the graph."""
        if self.is_closed:
            return
        journal = self.journal
        self.previous[row] = self.nearest(row)
        before = self.previous_position[row] = self.position[row]
        if node is not None:
            self.node[row] = node
        elif before is None or position[0] != before[0] or position[1] != before[1]:
            self._unlocated.add(row)
        self.position[row] = position
        self.placed.add(row)
        self._changed.add(row)
        if self.is_noting:
            journal.flew(row, self.nearest(row), position)

    def turn(self, row: int, quat: Quat) -> None:
        """Turn a flyer."""
        if not self.is_closed:
            self.quat[row] = quat
            if self.is_noting:
                self.journal.turned(row, quat)

    def write(self, row: int, values: dict[str, Any]) -> None:
        """Overwrite columns of one agent and note nothing in the journal (used by replay and by batches)."""
        for name, value in values.items():
            getattr(self, name)[row] = value
            if _COLUMNS[name].is_structure:
                self.structure.note((row,))
        self.number_teams((self.teams[row],))
        self._follow_progress(row)
        self._changed.add(row)
        if self.kind[row]:
            self._unlocated.add(row)

    # -- the nodes below flyers ---------------------------------------------------------------------------------

    def nearest(self, row: int) -> int:
        """Return the node nearest to a flyer, found again only if it or the graph has changed; the first of several.

        In a graph without nodes it is the one of before.
        """
        if not self.is_closed:
            self._renew_flyer_nodes()
            if row in self._unlocated:
                self._locate(row)
        return self.node[row]

    def locate(self) -> None:
        """Find the nodes of all flyers."""
        if not self.flyers or self.is_closed:
            return
        self._renew_flyer_nodes()
        if self._unlocated:  # NOTE: a set that was large takes long to go through, empty as it is
            for row in sorted(self._unlocated):
                self._locate(row)

    def _renew_flyer_nodes(self) -> None:
        """Let the nodes below all flyers be found again if the graph has changed."""
        if self.graph is not None:
            revision = self.graph.revision
            if revision is None or revision != self._located_revision:
                self._unlocated.update(self.flyers)
                self._located_revision = revision

    def _locate(self, row: int) -> None:
        graph, position, node = self.graph, self.position[row], self.node[row]
        if graph is not None and position is not None:
            try:
                node = graph.nearest_node(position[0], position[1])
            except BadValue:
                if next(graph.get_nodes(), None) is not None:
                    raise
        self._unlocated.discard(row)
        if node != self.node[row]:
            self.node[row] = node
            self._changed.add(row)

    @contextmanager
    def accepting_any_node(self) -> Iterator[None]:
        """Take any integer for a node (used by replay, because the map may have changed since)."""
        before, self.trusts_nodes = self.trusts_nodes, True
        try:
            yield
        finally:
            self.trusts_nodes = before

    # -- what has changed ---------------------------------------------------------------------------------------

    @property
    def version(self) -> int:
        """A number that changes whenever a node, position, team or life of an agent may have."""
        if self._changed or self._have_all_changed:
            self.publish()
        return self._version

    def subscribe(self) -> ChangeLog:
        """Return a log of what changes from now on; at first all may have."""
        log = ChangeLog(self.publish)
        self._logs.append(log)
        return log

    def publish(self) -> None:
        """Write what has changed into the logs of all subscribers."""
        self._version += bool(self._changed) or self._have_all_changed
        for log in self._logs:
            if self._have_all_changed:
                log.rows = None
            elif log.rows is not None:
                log.rows |= self._changed
        self._have_all_changed = False
        self._changed.clear()

    def structure_values(self) -> dict[str, list[Any]]:
        """Return copies of the lists that stay until `structure` changes."""
        return {name: getattr(self, name).copy() for name in _STRUCTURE}

    def values(self) -> dict[str, Any]:
        """Return copies of all else that `restore` takes: where agents are, and all numbers."""
        values = {name: getattr(self, name).copy() for name in (*_PLACES, "placed", "team_rows")}
        values["games"] = self.games.copied()
        return values

    def restore(self, values: dict[str, Any], structure: dict[str, list[Any]] | None) -> None:
        """Set the columns to what `values` and `structure_values` gave, of as many agents as there are now.

        Without a structure, agents, teams, speeds, lives and sensors are those of then.
        """
        for name in _PLACES:
            getattr(self, name)[:] = values[name]
        memory = self.games.memory
        self.games.copy_row(0, 0, values["games"])
        if self.games.memory is not memory:
            self._show()
        self.team_rows = values["team_rows"].copy()
        self.placed = values["placed"].copy()
        self._have_all_changed = True
        self._unlocated.update(self.flyers)
        if structure is None:
            self._find_travellers()
            return
        for name, column in structure.items():
            getattr(self, name)[:] = column
        self._derive()
        self.structure.note_all(self.structure.version)

    def _find_travellers(self) -> None:
        self.travellers = {row for row, one in compress(enumerate(self.progress), self.progress) if one and one.motion}

    def _derive(self) -> None:
        """Derive again what follows from the columns, the rows of names among it."""
        self.rows.reset(self.names)
        self.flyers = [*compress(count(), self.kind)]
        self.inactive = {*compress(count(), map(not_, self.alive))}
        self._find_travellers()
        self._have_all_changed = True


def as_ids(nodes: Sequence[int]) -> memoryview[int]:
    """Return ids of nodes as the core reads them: 64-bit integers, the same memory where they are such."""
    if type(nodes) is list:
        return memoryview(array(INT64, nodes))
    if type(nodes) is memoryview and nodes.format == INT64:
        return nodes
    return np.ascontiguousarray(nodes, np.int64).data


def moves_of(starts: Sequence[int], ends: Sequence[int]) -> Moves:
    """Return moves as the core has them: in the same memory where these are 64-bit integers that can be written to."""
    columns = [as_ids(one) for one in (starts, ends)]
    first, last = [copied_column(one) if one.readonly else one for one in columns]
    return Moves(first, last)


class UnderWay:
    """Where the agents of a block are within a turn that is under way.

    Nothing of this is noted: where agents are when the turn is over is written then.

    Attributes:
        time: of the turn, from 0 to 1.
        places: row -> where on an edge the agent is at each time from its departure on.
    """

    __slots__ = ("_block", "_departed", "places", "time")

    def __init__(self, block: AgentBlock) -> None:
        self._block = block
        self._departed: set[int] = set()  # rows, of those that begin to move now
        self.time = 0.0
        self.places: dict[int, PlaceAt] = {}

    def depart(self, row: int, place_at: PlaceAt) -> None:
        """Let an agent be where a function says, at each time from now on, until it arrives."""
        self.places[row] = place_at
        self._departed.add(row)
        self._block.travellers.add(row)

    def pass_time(self, time: float) -> None:
        """Let it be a later time of the turn."""
        self.time = time
        self._block._changed |= self._departed
        self._departed.clear()

    def arrive(self, row: int, node: int) -> None:
        """Put an agent on a node."""
        self.put_back(row, node)
        self._block.travellers.discard(row)

    def put_back(self, row: int, node: int) -> None:
        """Put an agent back to where the turn began: to its node, or to where its progress says."""
        self.places.pop(row, None)
        self._departed.discard(row)
        self._block.write(row, {"node": node})


def show_game(block: AgentBlock, games: PointedColumns, number: int) -> None:
    """Put agents on the ground where they are in a game of a batch, and note nothing in the journal."""
    games.point(number)
    block._have_all_changed = True


def show_progress(block: AgentBlock, on_edges: Mapping[int, Progress]) -> None:
    """Let agents have covered this of edges in a game of a batch, by row, and note nothing in the journal."""
    if on_edges or any(block.progress):
        block.progress[:] = map(on_edges.get, range(len(block.progress)))
        block.travellers = {row for row, progress in on_edges.items() if progress.motion}


def show_lives(block: AgentBlock, alive: bytes) -> None:
    """Let agents live that live in a game of a batch, (agents,) booleans, and note nothing in the journal."""
    before = bytes(block.alive)
    block.alive[:] = memoryview(alive).cast("?")
    block.inactive = {row for row, lives in enumerate(alive) if not lives}
    block.structure.note([row for row, lives in enumerate(alive) if lives != before[row]])
