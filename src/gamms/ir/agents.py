"""Agents as rows of columns: `AgentBlock`, through which every change is made, and the change logs for readers."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from itertools import chain, compress, count
from math import isnan, nan
from numbers import Integral
from operator import ne, not_
from typing import Any

import numpy as np

from gamms.core import strategies
from gamms.core.agents import AgentColumns, MoveColumns, NodeNumbers
from gamms.core.block import INT64, Block
from gamms.core.flight import Flights
from gamms.errors import BadValue
from gamms.ir.columns import ChangeLog, RowsByName, Selection, StructureLog, copy_column, drop
from gamms.ir.graph import FloatArray, IntArray, NodeFinder
from gamms.ir.journal import PLAIN, Journal
from gamms.ir.progress import Motion, Progress
from gamms.ir.schema import AGENT_COLUMNS, BY_ROW, CHANGE_EVENTS, IN_GAMES, PLACES

Position = tuple[float, float, float]  # x, y, z; map units
Quat = tuple[float, float, float, float]  # w, x, y, z; of length 1

UNTURNED: Quat = (1.0, 0.0, 0.0, 0.0)
PlaceAt = Callable[[float], Progress | None]  # time of the turn, from 0 to 1 -> position on an edge; None: on the node

_COLUMNS = {column.name: column for column in AGENT_COLUMNS}
_NUMBERS = [column.name for column in IN_GAMES if column.axis == "agent"]
_SHOWN = [name for name in _NUMBERS if name not in AgentColumns.__slots__]
_LISTS = [name for name in BY_ROW if name not in _NUMBERS and not _COLUMNS[name].numbers]
_PLACES = [column.name for column in PLACES if column.name in _LISTS]
_STRUCTURE = [name for name in _LISTS if name not in _PLACES]
_IN_AIR = [column.name for column in IN_GAMES if column.axis == "flyer"]
_OF_NODES = ("node", "previous")  # the columns with numbers of nodes
_OF_PROGRESS = [column.name for column in _COLUMNS["progress"].numbers]
_MOTIONS = tuple(Motion)
_EMPTY = Block(IN_GAMES)  # a game without agents
_NO_NUMBERS: memoryview[Any] = memoryview(array("d"))
_NO_FLIGHTS = Flights(memoryview(array(INT64)), _NO_NUMBERS, _NO_NUMBERS, _NO_NUMBERS)


class AgentBlock(AgentColumns):
    """The agents of a context, one row each in order of creation, with the methods that change them.

    Arguments are not validated here, but by the callers (`typing.actions`). Columns are read directly and written only
    through methods. Number columns are views of the arrays of a `core.block.Block`, which are replaced when agents are
    created or removed; columns of other values are lists.

    Args:
        graph: finds the nodes below flying agents; None: their nodes are set explicitly.
        journal: records changes.
        numbers: the numbers of the nodes; None: those of the graph, if it has any.

    Attributes:
        names, teams: of each agent; a team is any value set by the caller.
        modes: the edge attribute that says which edges each agent may use; None: all. It never changes.
        kind: 0 on the ground, 1 flying: the values of `AgentType`.
        node, previous: numbers of nodes; for a flying agent the nearest nodes below.
        heading: `(cos, sin)` if it was set; None if it follows from the last move, and for flying agents.
        flights: the positions, previous positions and rotations of flying agents.
        speed: map units per step for flying agents; on the ground the limit of the turn engine, NaN for one edge. See
            `get_speed`.
        has_int_speed: whether the speed was set to an integer, and is read as one.
        alive: whether the agent takes part.
        games: the block of one game with the number columns of agents, teams and the game.
        team_rows: team -> its row in team columns, in order of first use.
        has_teams: whether a team was created whose agent objects are made on demand.
        source, target, share, edge, motion: the position of an agent on an edge, see `progress_of`: the numbers of the
            nodes, the covered share, the number of the edge, and the motion. On a node the share is NaN and the motion
            0; the edge is -1 there, and in games that count edges.
        graph: finds the nodes below flying agents.
        flyers: the rows of flying agents, ascending.
        inactive: the rows of agents that are not alive.
        placed: the rows of agents that were relocated after their move of the turn.
        removed: the rows of removed agents, until `close_up`.
        journal: records changes; or `PLAIN` (records nothing), or `CLOSED` (no more changes).
        rows: the row of each name.
        structure: the log of rows that were added, removed, died, returned, or changed team, speed, sensors or
            strategy.
        trusts_nodes: whether any integer is accepted as a node, during the replay of a recording whose map has changed.
        version: a number that rises whenever a node, position, team or alive flag of an agent may have changed.
    """

    __slots__ = (
        *(name for name in (*_LISTS, *_NUMBERS) if name not in AgentColumns.__slots__),
        *("_logs", "_located_revision", "_unlocated", "flights", "flyers", "games"),
        *("graph", "has_teams", "inactive", "placed", "removed", "rows", "structure", "team_rows"),
        "trusts_nodes",
    )

    names: list[str]
    teams: list[Any]
    modes: list[str | None]
    kind: memoryview[int]
    heading: list[tuple[float, float] | None]
    speed: memoryview[float]
    has_int_speed: memoryview[bool]
    source: memoryview[int]
    target: memoryview[int]
    edge: memoryview[int]
    motion: memoryview[int]

    def __init__(
        self, graph: NodeFinder | None = None, journal: Journal = PLAIN, numbers: NodeNumbers | None = None
    ) -> None:
        self.numbers = _find_numbers(graph, "node_numbers") if numbers is None else numbers
        self._edge_numbers = None
        for name in _LISTS:
            setattr(self, name, [])
        self.games = _EMPTY.copy_game()  # NOTE: half of the time of a new block (w9 fork)
        self.flyers: list[int] = []
        self._show()
        self.has_teams = False
        self.team_rows: dict[Any, int] = {}
        self.inactive: set[int] = set()
        self.placed: set[int] = set()
        self.travellers: set[int] = set()
        self.removed: list[int] = []
        self.version = 0
        self.journal = journal
        self.structure = StructureLog()
        self.trusts_nodes = False
        self.graph = graph
        self.rows = RowsByName()
        self._changed: set[int] = set()  # changed rows, not yet published
        self._have_all_changed = False
        self._logs: list[ChangeLog] = []
        self.under_way = TurnPositions(self)
        self._unlocated: set[int] = set()  # rows of flying agents that moved since their node was found
        self._located_revision: int | None = None  # graph revision when the nodes of the other flying agents were found

    def copy_columns(self, names: Iterable[str]) -> dict[str, Any]:
        """Return copies of columns; number columns as arrays, with NaN for None."""
        columns: dict[str, Any] = {}
        for name in names:
            of = _COLUMNS[name]
            if name in _IN_AIR:
                columns[name] = np.full((len(self), *of.shape), nan)
                columns[name][self.flyers] = np.asarray(self.games.get_row(name)).reshape(-1, *of.shape)
                continue
            column = getattr(self, name)
            if name in _OF_NODES:
                column = self.get_ids(column)
            if of.shape:
                column = [one or (nan,) * of.shape[0] for one in column]
            columns[name] = list(column) if of.kind is None else np.array(column, of.kind).reshape(-1, *of.shape)
        return columns

    def _get_numbers_in_air(self, name: str, row: int) -> memoryview[float]:
        """Return the numbers of an agent in a column of flying agents; none if it does not fly."""
        at = bisect_left(self.flyers, row)
        flies = self.flyers[at : at + 1] == [row]
        width = _COLUMNS[name].shape[0]
        return self.games.get_row(name)[at * width : (at + flies) * width]

    def _show(self) -> None:
        """Set the number columns to views of the present agents."""
        row = self.games.get_row
        for name in _SHOWN:
            setattr(self, name, row(name))
        self.show(row("node"), row("previous"), row("share"), row("alive"))
        self.show_on_edges(self.source, self.target, self.edge, self.motion)
        self.flights = Flights(as_ids(self.flyers), *map(row, _IN_AIR)) if self.flyers else _NO_FLIGHTS

    @property
    def edge_numbers(self) -> NodeNumbers:
        """The numbers of the edges: those of the graph, if it has any."""
        if self._edge_numbers is None:
            self._edge_numbers = _find_numbers(self.graph, "edge_numbers")
        return self._edge_numbers

    def __len__(self) -> int:
        return len(self.names)

    def __getstate__(self) -> dict[str, Any]:
        """Return all attributes except the number views, which cannot be copied."""
        of_core = (
            "_changed",
            "_edge_numbers",
            "_have_all_changed",
            "journal",
            "numbers",
            "teams",
            "travellers",
            "under_way",
            "version",
        )
        names = {*self.__slots__, *of_core}.difference(_NUMBERS, ("flights",))
        return {name: getattr(self, name) for name in sorted(names)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore from `__getstate__`."""
        for name, value in state.items():
            setattr(self, name, value)
        self._show()

    # -- adding and removing ------------------------------------------------------------------------------------

    def add(
        self,
        name: str,
        node: int,
        team: Hashable = None,
        position: Position | None = None,
        speed: float | None = None,
        mode: str | None = None,
    ) -> int:
        """Add an agent on the ground at `node`, or a flying agent at `position`; return its row."""
        row = self.games.add(1)
        flies = position is not None
        if flies:
            self.games.add(1, "flyer")
            self.flyers.append(row)
        self._show()
        self.put(row, node)
        self.previous[row] = self.node[row]
        self.kind[row] = flies
        self.alive[row] = True
        self._write(row, "speed", speed)
        given: dict[str, Any] = {"names": name, "teams": team, "modes": mode}
        for column in _LISTS:
            getattr(self, column).append(given.get(column))
        self.rows.enter(name)
        self.number_teams((team,))
        self.structure.note((row,))
        self._note(row)
        if position is not None:
            self._write(row, "position", position)
            self._write(row, "previous_position", position)
            self._write(row, "quat", UNTURNED)
            self._unlocated.add(row)
        return row

    def add_all(self, names: Sequence[str], nodes: list[int], team: Hashable) -> int:
        """Add agents of one team at these nodes; return the row of the first."""
        count = len(names)
        first = self.games.add(count)
        self._show()
        self.numbers.write(as_ids(nodes), self.node[first:])
        self.previous[first:] = self.node[first:]
        np.asarray(self.alive)[first:] = True
        for column in _LISTS:
            getattr(self, column).extend(names if column == "names" else [team if column == "teams" else None] * count)
        rows = range(first, first + count)
        self.rows.enter_all(names)
        self.number_teams((team,))
        self.structure.note(rows)
        self._note_rows(rows)
        return first

    def number_teams(self, teams: Iterable[Any]) -> None:
        """Add rows for new teams to the team columns; None is not a team."""
        for team in teams:
            if team is not None and team not in self.team_rows:
                self.team_rows[team] = self.games.add(1, "team")
                self._show()

    def take_over(self, source: AgentBlock, row: int) -> int:
        """Move the agent of a row of another block to this block; return its new row."""
        new = self.add(source.names[row], source.get_node(row), position=source.flights.get_position(row))
        for name in (*_LISTS, *_NUMBERS):
            if name not in _OF_NODES and name not in _OF_PROGRESS:
                getattr(self, name)[new] = getattr(source, name)[row]
        self.previous[new] = self.numbers.number(source.get_previous_node(row))
        for name in _IN_AIR:
            self._write(new, name, read_vector(source, name, row))
        self._write(new, "progress", source.get_progress(row))
        self.number_teams((self.teams[new],))
        self._follow_progress(new)
        if not self.alive[new]:
            self.inactive.add(new)
        return new

    def take_all(self, values: Mapping[str, Any], structure: Mapping[str, list[Any]]) -> None:
        """Copy all agents of another block, from its `values` and `copy_structure`, to this block, which is empty."""
        for name, column in structure.items():
            setattr(self, name, column.copy())
        for name in (*_PLACES, "placed", "team_rows"):
            setattr(self, name, values[name].copy())
        self.numbers = values["numbers"]
        self._edge_numbers = values["edge_numbers"]
        self.games = values["games"].copy_game()
        self.flyers = [*compress(count(), self.games.get_row("kind"))]
        self._show()
        self._derive()
        self._unlocated = set(self.flyers)

    def remove(self, row: int) -> None:
        """Remove an agent; its row stays until `close_up`."""
        self.rows.leave(self.names[row])
        self.removed.append(row)
        self.structure.note((row,))

    def close_up(self) -> None:
        """Drop the rows of removed agents."""
        gone = sorted(self.removed)
        self.removed = []
        self.structure.close_up(gone, self.names)
        for name in _LISTS:
            drop(getattr(self, name), gone)
        are_left = [row not in {*gone} for row in self.flyers]
        self.games.close_up([at for at, is_left in enumerate(are_left) if not is_left], "flyer")
        self.games.close_up(gone)
        self.flyers = [row - bisect_left(gone, row) for row in compress(self.flyers, are_left)]
        self._show()
        self.rows.close_up(gone)
        self.journal.close_up(gone)
        for which in ("_unlocated", "inactive", "placed", "travellers"):
            setattr(self, which, {row - bisect_left(gone, row) for row in getattr(self, which).difference(gone)})
        self._note_all()

    def take_graph(self, graph: NodeFinder) -> None:
        """Find nodes in a graph, unless another one is known; its numbers of nodes are used if there are no agents."""
        if self.graph is None:
            self.graph = graph
            if not self.names:
                self.numbers = _find_numbers(graph, "node_numbers")
                self._edge_numbers = None

    def succeed(self, block: AgentBlock) -> None:
        """Take the place of another block: go on with its journal, and with higher version numbers."""
        self.graph = block.graph
        if not self.names:
            self.numbers = block.numbers
            self._edge_numbers = block._edge_numbers
        self.journal = block.journal
        self.version = block.version + 1
        self.rows.version = block.rows.version + 1
        self.structure.note_all(block.structure)

    def find_row(self, name: str) -> int:
        """Return the row of an agent (KeyError)."""
        return self.rows.find_row(name)

    # -- changes ------------------------------------------------------------------------------------------------

    def _note_moves(
        self, rows: Selection, before: Sequence[int], goals: Sequence[int], ends: memoryview[int], moved: int
    ) -> None:
        """Record the moves of the `moved` agents that did not stay."""
        journal = self.journal
        if not self.has_teams:
            goes = compress(zip(rows.rows, ends, strict=True), map(ne, before, goals))
            journal.log += chain.from_iterable((journal.ids[row], end) for row, end in goes)
        else:
            goers = rows.ascending
            nodes = rows.sort_values(ends)
            if moved < len(rows.rows):
                has_moved = rows.sort_values((np.asarray(before) != goals).data)
                goers = goers[has_moved]
                nodes = nodes[has_moved]
            journal.record_moves(goers, nodes)

    def set(self, row: int, column: str, value: object) -> None:
        """Set a column of `schema.CHANGE_EVENTS` for one agent, and record the change."""
        if self.is_closed:
            return
        journal = self.journal
        self._write(row, column, value)
        if column == "teams":
            self.number_teams((value,))
        if _COLUMNS[column].is_watched:
            self._note(row)
        if column == "alive":
            self.structure.note_lives()
        elif _COLUMNS[column].is_structure:
            self.structure.note((row,))
        if column == "node":
            self.placed.add(row)
        if column == "alive":
            (self.inactive.discard if value else self.inactive.add)(row)
        if column == "node" or (column == "alive" and not value and self.get_edge_position(row) is None):
            self.set_progress(row, None)
        if self.is_noting and column in CHANGE_EVENTS:
            event = CHANGE_EVENTS[column]
            plain = list(value) if column == "heading" and isinstance(value, tuple) else value
            journal.note(event.code, {"agent_name": self.names[row], event.key: plain})

    def _write(self, row: int, column: str, value: Any) -> None:
        """Write a value to a column; nodes are given by id."""
        if column == "progress":
            self._write_progress(row, value)
            return
        if column in _IN_AIR:
            numbers = self._get_numbers_in_air(column, row)
            numbers[:] = array("d", (nan,) * len(numbers) if value is None else value[: len(numbers)])
            return
        if column == "speed":
            self.has_int_speed[row] = isinstance(value, Integral)
            value = nan if value is None else value
        getattr(self, column)[row] = self.numbers.number(value) if column in _OF_NODES else value

    def _write_progress(self, row: int, progress: Progress | None) -> None:
        """Write the position of an agent on an edge."""
        if progress is None:
            self.share[row] = nan
            self.edge[row] = -1
            self.motion[row] = 0
            return
        self.source[row] = self.numbers.number(progress.source)
        self.target[row] = self.numbers.number(progress.target)
        self.share[row] = progress.share
        has_edge = progress.motion or progress.edge
        self.edge[row] = self.edge_numbers.number(progress.edge) if has_edge else -1
        self.motion[row] = progress.motion

    def _make_progress(self, source: int, target: int, share: float, edge: int, motion: int) -> Progress:
        return Progress(source, target, share, edge, _MOTIONS[motion])

    def put_back(self, row: int, node: int) -> None:
        """Place an agent on the ground, dead or alive, on a node, as if it had been there before."""
        self.set(row, "node", node)
        self.set(row, "previous", node)
        if not self.alive[row]:
            self.set(row, "alive", True)

    def set_progress(self, row: int, progress: Progress | None) -> None:
        """Set the position of an agent on its edge."""
        if self.get_progress(row) != progress:
            self._write_progress(row, progress)
            self._follow_progress(row)
            if self.is_noting:
                self.journal.progressed.add(self.journal.ids[row])

    def _follow_progress(self, row: int) -> None:
        """Update `travellers` after a change of the position on an edge."""
        if self.motion[row]:
            self.travellers.add(row)
            self._note(row)
        elif row in self.travellers:
            self.travellers.discard(row)
            self._note(row)

    def fly(self, row: int, position: Position, node: int | None = None) -> None:
        """Move a flying agent to `(x, y, z)`, map units, above a node; None: above the nearest node of the graph."""
        if self.is_closed:
            return
        journal = self.journal
        self.previous[row] = self.numbers.number(self.find_nearest_node(row))
        changed = self.flights.fly(row, *position)
        if node is not None:
            self.put(row, node)
        elif changed > 1:
            self._unlocated.add(row)
        self.placed.add(row)
        self._note(row)
        if self.is_noting:
            journal.record_flight(row, self.find_nearest_node(row), position)

    def set_rotation(self, row: int, quat: Quat) -> None:
        """Set the rotation of a flying agent."""
        if not self.is_closed:
            self.flights.set_rotation(row, *quat)
            if self.is_noting:
                self.journal.record_rotation(row, quat)

    def write(self, row: int, values: dict[str, Any]) -> None:
        """Overwrite columns of one agent without recording the change (used by replay and batches)."""
        for name, value in values.items():
            self._write(row, name, value)
            if _COLUMNS[name].is_structure:
                self.structure.note((row,))
        self.number_teams((self.teams[row],))
        self._follow_progress(row)
        self._note(row)
        if self.kind[row]:
            self._unlocated.add(row)

    # -- nodes below flying agents ------------------------------------------------------------------------------

    def find_nearest_node(self, row: int) -> int:
        """Return the node nearest to a flying agent, the first of several; cached until it or the graph changes.

        In a graph without nodes the previous result is returned.
        """
        if not self.is_closed:
            self._renew_flyer_nodes()
            if row in self._unlocated:
                self._locate(row)
        return self.get_node(row)

    def locate(self) -> None:
        """Update the nodes of all flying agents."""
        if not self.flyers or self.is_closed:
            return
        self._renew_flyer_nodes()
        if self._unlocated:  # NOTE: iterating over a set that was large is slow, even if it is empty
            for row in sorted(self._unlocated):
                self._locate(row)

    def _renew_flyer_nodes(self) -> None:
        """Mark the nodes below all flying agents as outdated if the graph has changed."""
        if self.graph is not None:
            revision = self.graph.revision
            if revision is None or revision != self._located_revision:
                self._unlocated.update(self.flyers)
                self._located_revision = revision

    def _locate(self, row: int) -> None:
        graph = self.graph
        position = self.flights.get_position(row)
        node = self.get_node(row)
        if graph is not None and position is not None:
            try:
                node = graph.nearest_node(position[0], position[1])
            except BadValue:
                if next(graph.get_nodes(), None) is not None:
                    raise
        self._unlocated.discard(row)
        if node != self.get_node(row):
            self.put(row, node)
            self._note(row)

    @contextmanager
    def accept_any_node(self) -> Iterator[None]:
        """Accept any integer as a node (used by replay, because the map may have changed since)."""
        before = self.trusts_nodes
        self.trusts_nodes = True
        try:
            yield
        finally:
            self.trusts_nodes = before

    # -- change logs --------------------------------------------------------------------------------------------

    def _note_rows(self, rows: Iterable[int]) -> None:
        """Note changes of agents."""
        self.version += 1
        self._changed.update(rows)

    def _note_all(self) -> None:
        """Note that all agents may have changed."""
        self.version += 1
        self._have_all_changed = True

    def subscribe(self) -> ChangeLog:
        """Return a log of all later changes; its first result is that everything may have changed."""
        log = ChangeLog(self.publish)
        self._logs.append(log)
        return log

    def publish(self) -> None:
        """Write the changes to the logs of all subscribers."""
        for log in self._logs:
            if self._have_all_changed:
                log.rows = None
            elif log.rows is not None:
                log.rows |= self._changed
        self._have_all_changed = False
        self._changed.clear()

    def copy_structure(self) -> dict[str, list[Any]]:
        """Return copies of the lists that change only with `structure`."""
        return {name: getattr(self, name).copy() for name in _STRUCTURE}

    def copy_values(self) -> dict[str, Any]:
        """Return copies of the positions and numbers of agents for `restore`; see `copy_structure` for the rest."""
        values = {name: getattr(self, name).copy() for name in (*_PLACES, "placed", "team_rows")}
        values["games"] = self.games.copy_game()
        values["numbers"] = self.numbers
        values["edge_numbers"] = self._edge_numbers
        return values

    def restore(self, values: dict[str, Any], structure: dict[str, list[Any]] | None) -> None:
        """Set the columns from `values` and `copy_structure`, for the same number of agents as now.

        Without a structure, agents, teams, speeds, alive flags and sensors must be unchanged since then.
        """
        for name in _PLACES:
            getattr(self, name)[:] = values[name]
        memory = self.games.memory
        if self.names:
            self.numbers = values["numbers"]
            self._edge_numbers = values["edge_numbers"]
        self.games.copy_row(0, 0, values["games"])
        if self.games.memory is not memory:
            self._show()
        self.team_rows = values["team_rows"].copy()
        self.placed = values["placed"].copy()
        self.under_way.places.clear()  # an error or Ctrl-C may come before they are put back
        self.under_way.pass_time(0.0)
        self._note_all()
        self._unlocated.update(self.flyers)
        if structure is None:
            self._find_travellers()
            return
        for name, column in structure.items():
            getattr(self, name)[:] = column
        self._derive()
        self.structure.note_all(self.structure)

    def _find_travellers(self) -> None:
        self.travellers = {*np.flatnonzero(self.motion).tolist()}

    def _derive(self) -> None:
        """Recompute the data derived from the columns, including the rows of names."""
        self.rows.reset(self.names)
        self.inactive = {*compress(count(), map(not_, self.alive))}
        self._find_travellers()
        self._note_all()


def _find_numbers(graph: NodeFinder | None, name: str) -> NodeNumbers:
    """Return the numbers of the nodes or edges of a graph, its attribute of this name; new ones if it has none."""
    found: NodeNumbers | None = getattr(graph, name, None)
    return NodeNumbers() if found is None else found


def read_vector(block: AgentBlock, name: str, row: int) -> tuple[float, ...] | None:
    """Return the numbers of an agent in a column of vectors; None: it has none."""
    if name not in _IN_AIR:
        found: tuple[float, ...] | None = getattr(block, name)[row]
        return found
    numbers = block._get_numbers_in_air(name, row)
    return None if not numbers or isnan(numbers[0]) else tuple(numbers)


def get_speed(block: AgentBlock, row: int) -> float | None:
    """Return the speed of an agent, as an integer if it was set to one; None: it has none."""
    return read_speed(block.speed[row], block.has_int_speed[row])


def list_speeds(games: Block) -> list[float | None]:
    """Return the speeds of all agents; see `get_speed`."""
    return [*map(read_speed, games.get_row("speed"), games.get_row("has_int_speed"))]


def read_speed(number: float, is_int: bool) -> float | None:
    """Return a speed as Python reads it, from the columns `speed` and `has_int_speed`."""
    if isnan(number):
        return None
    return int(number) if is_int else number


@lru_cache(maxsize=256)  # strategies ask for each agent that they see
def are_mates(team: Hashable, other: Hashable) -> bool:
    """Return whether agents of two teams are mates; None: an agent without a team."""
    numbers = {one: number for number, one in enumerate(dict.fromkeys([None, team, other]))}
    return strategies.are_mates(numbers[team], numbers[other], numbers[None])


def as_ids(nodes: Sequence[int]) -> memoryview[int]:
    """Return node ids as a buffer for the core: 64-bit integers, without a copy if possible."""
    if type(nodes) is list:
        return memoryview(array(INT64, nodes))
    if type(nodes) is memoryview and nodes.format == INT64:
        return nodes
    return np.ascontiguousarray(nodes, np.int64).data


def make_moves(starts: Sequence[int], ends: Sequence[int]) -> MoveColumns:
    """Return moves in the form of the core: without copies if the arrays are writable 64-bit integers."""
    columns = [as_ids(one) for one in (starts, ends)]
    first, last = [copy_column(one) if one.readonly else one for one in columns]
    return MoveColumns(first, last)


class TurnPositions:
    """The positions of the agents of a block within a turn.

    These positions are not recorded; the positions at the end of the turn are.

    Attributes:
        time: time within the turn, from 0 to 1.
        places: row -> function from a time after its departure to the position of the agent on an edge.
    """

    __slots__ = ("_block", "_departed", "places", "time")

    def __init__(self, block: AgentBlock) -> None:
        self._block = block
        self._departed: set[int] = set()  # rows of agents that depart now
        self.time = 0.0
        self.places: dict[int, PlaceAt] = {}

    def depart(self, row: int, place_at: PlaceAt) -> None:
        """Set the position of an agent to a function of time, from now until it arrives."""
        self.places[row] = place_at
        self._departed.add(row)
        self._block.travellers.add(row)

    def pass_time(self, time: float) -> None:
        """Advance the time of the turn."""
        self.time = time
        if self._departed:
            self._block._note_rows(self._departed)
        self._departed.clear()

    def arrive(self, row: int, node: int) -> None:
        """Put an agent on a node."""
        self.put_back(row, node)
        self._block.travellers.discard(row)

    def put_back(self, row: int, node: int) -> None:
        """Return an agent to its position at the start of the turn: its node, or its progress."""
        self.places.pop(row, None)
        self._departed.discard(row)
        self._block.write(row, {"node": node})


def show_flights(block: AgentBlock, rows: Sequence[int], flights: Flights, agents: Sequence[int], game: int) -> None:
    """Show flying agents of a game of a batch in these rows, above the nodes that the block has for them."""
    for row, agent in zip(rows, agents, strict=True):
        flights.copy_to(block.flights, agent, game, row, 0)
    block._unlocated.clear()


def show_positions(block: AgentBlock, node: IntArray, previous: IntArray) -> None:
    """Show the current and the previous nodes of all agents, (agents,) ids by row, without recording changes."""
    ids: Any = np.ascontiguousarray([node, previous], np.int64)
    block.numbers.write(ids[0].data, block.node)
    block.numbers.write(ids[1].data, block.previous)
    block._note_all()


def show_numbers(block: AgentBlock, memory: bytes) -> None:
    """Show all number columns as they were in `block.games.memory` at another moment, without recording changes.

    Agents have not come or left since, and the sets of rows that follow from other columns are the same.
    """
    before = bytes(block.alive)
    block.games.memory[:] = memory
    if bytes(block.alive) != before:
        _follow_lives(block)
    block._note_all()


def show_column(block: AgentBlock, name: str, values: Sequence[Any] | FloatArray) -> None:
    """Show the headings, or additional numbers, of all agents, (agents,) by row, without recording changes."""
    column = getattr(block, name)
    if not isinstance(column, list):
        column = np.asarray(column)
    column[:] = values


def show_progress(block: AgentBlock, on_edges: Mapping[int, Progress]) -> None:
    """Show the progress of agents on edges in a game of a batch, by row, without recording changes."""
    before = np.flatnonzero(~np.isnan(block.share)).tolist()
    for row in before:
        if row not in on_edges:
            block._write_progress(row, None)
    for row, progress in on_edges.items():
        block._write_progress(row, progress)
    if before or on_edges:
        block.travellers = {row for row, progress in on_edges.items() if progress.motion}


def show_lives(block: AgentBlock, alive: bytes) -> None:
    """Show which agents are alive in a game of a batch, (agents,) booleans, without recording changes."""
    block.alive[:] = memoryview(alive).cast("?")
    _follow_lives(block)


def _follow_lives(block: AgentBlock) -> None:
    """Notice that agents have died or returned."""
    block.inactive = {row for row, is_alive in enumerate(bytes(block.alive)) if not is_alive}
    block.structure.note_lives()
