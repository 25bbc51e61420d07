"""The deeds that agents have done: tables of them, and the log of one game or of many."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.columns import Column, GameLog, find_places, join_rows, select_rows
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray


class ArrayDeeds(NamedTuple):
    """Deeds of one kind in several games, by game, then by the agent's name; arrays are (deeds,).

    Attributes:
        kind: the name of the deed.
        at: the game, as an index in the view or turn; in logs, as a number in the batch.
        agents: the number of the agent in the roster.
        nodes: the row of the agent's node.
        order: orders the deeds of one agent in a turn.
        values: field -> values: agents as numbers, nodes as rows; -1 or None if the field is omitted.
    """

    kind: str
    at: IntArray
    agents: IntArray
    nodes: IntArray
    order: IntArray
    values: Mapping[str, Column]

    def select(self, which: BoolArray | IntArray) -> ArrayDeeds:
        """Return deeds selected by a mask or by indices."""
        return select_rows(self, which)


def join_deeds(parts: Sequence[ArrayDeeds]) -> ArrayDeeds:
    """Return the concatenated deeds of one kind; there is at least one part."""
    whole = join_rows(parts)
    return whole.select(np.lexsort((whole.agents, whole.at)))


DeedRow = tuple[int, int, int, str, str, int, int, dict[str, Any]]
"""One deed with plain values:

* the number of the game;
* the number of the agent in the turn, by which deeds are sorted and refused;
* a number by which the deeds of one agent are sorted: from `AFTER_OTHERS` on for deeds that have lasted;
* the name of the agent, by which it is found after agents have come and gone;
* the name of the deed;
* the turn;
* the id of the agent's node;
* its fields, without omitted ones.
"""


AFTER_OTHERS = 1 << 32
"""Sorts deeds that have lasted after those that the agent has done at once in the same turn."""


class DeedNumbering(NamedTuple):
    """What the numbers in arrays of deeds mean.

    Attributes:
        names: (agents,) the names of the agents.
        node_ids: (nodes,) the ids of the nodes.
        kinds: deed -> field -> its kind; agents and nodes are numbers in these fields.
    """

    names: Sequence[str]
    node_ids: IntArray
    kinds: Mapping[str, Mapping[str, str]]

    def list_fields(self, deeds: ArrayDeeds) -> list[dict[str, Any]]:
        """Return the fields of each deed as plain values, without omitted ones."""
        columns = [(key, self._make_plain(column, self.kinds[deeds.kind][key])) for key, column in deeds.values.items()]
        return [{key: column[i] for key, column in columns if column[i] is not None} for i in range(len(deeds.at))]

    def _make_plain(self, column: Column, kind: str) -> list[Any]:
        """Return the values of a field as plain values; None if it is omitted."""
        each: list[Any] = column.tolist()
        if kind not in ("agent", "node"):
            return each
        known = self.names if kind == "agent" else self.node_ids.tolist()
        return [known[number] if number >= 0 else None for number in each]


AsArrays = Callable[[list[DeedRow]], ArrayDeeds]
"""Called with deeds of one kind, whose numbers of games are indices; returns them as arrays."""


class PlainDeeds(NamedTuple):
    """Deeds of plain functions in one part of a turn: their checked values, as they were given.

    Attributes:
        part: the part of the turn.
        given: the deeds; those of a game are sorted by agent and order.
    """

    part: int
    given: list[DeedRow]

    def add(self, game: int, agent: int, name: str, turn: int, node: int, deeds: Mapping[str, dict[str, Any]]) -> None:
        """Add the deeds of an agent, deed -> its fields; the other arguments are those of `DeedRow`."""
        given = self.given
        for kind, fields in deeds.items():
            given.append((game, agent, len(given), name, kind, turn, node, fields))

    def list_rows(self) -> list[DeedRow]:
        """Return each deed."""
        return self.given

    def remove_refused(self, refused: Collection[tuple[int, int, str | None]]) -> PlainDeeds:
        """Return the deeds that are not refused; see `DeedLog.refuse`."""
        return self._replace(given=[row for row in self.given if not _is_refused(row[0], row[1], row[4], refused)])

    def remove_kinds(self, kinds: Collection[str]) -> PlainDeeds:
        """Return the deeds of other kinds."""
        return self._replace(given=[row for row in self.given if row[4] not in kinds])

    def remove_games(self, games: IntArray) -> PlainDeeds:
        """Return the deeds of other games."""
        left_out = set(games.tolist())
        return self._replace(given=[row for row in self.given if row[0] not in left_out])

    def select_kind(self, kind: str, number: IntArray, turn: IntArray, as_arrays: AsArrays) -> ArrayDeeds:
        """Return the deeds of a kind in a turn; see `DeedLog.list_in_turn`."""
        given: list[DeedRow] = [(int(number[game]), *of) for game, *of in self.given if of[3] == kind]  # type: ignore[misc] # a tuple of the same types
        return as_arrays([row for row in given if row[0] >= 0 and row[5] == turn[row[0]]])


class DeedsInArrays(NamedTuple):
    """Deeds of array functions in one part of a turn, all of one kind.

    Attributes:
        part: the part of the turn.
        numbering: what their numbers mean.
        deeds: the deeds; their `at` are numbers of games.
        turns: (deeds,) the turn of each deed.
    """

    part: int
    numbering: DeedNumbering
    deeds: ArrayDeeds
    turns: IntArray

    def list_rows(self) -> list[DeedRow]:
        """Return each deed."""
        deeds = self.deeds
        names = self.numbering.names
        columns = (deeds.at, deeds.agents, deeds.order, self.turns, self.numbering.node_ids[deeds.nodes])
        each = zip(*(column.tolist() for column in columns), self.numbering.list_fields(deeds), strict=True)
        return [
            (game, agent, order, names[agent], deeds.kind, turn, node, fields)
            for game, agent, order, turn, node, fields in each
        ]

    def remove_refused(self, refused: Collection[tuple[int, int, str | None]]) -> DeedsInArrays:
        """Return the deeds that are not refused; see `DeedLog.refuse`."""
        each = zip(self.deeds.at.tolist(), self.deeds.agents.tolist(), strict=True)
        kind = self.deeds.kind
        return self._select_deeds(np.array([not _is_refused(*one, kind, refused) for one in each], np.bool_))

    def remove_kinds(self, kinds: Collection[str]) -> DeedsInArrays | None:
        """Return the deeds of other kinds; None: all are of these."""
        return None if self.deeds.kind in kinds else self

    def remove_games(self, games: IntArray) -> DeedsInArrays:
        """Return the deeds of other games."""
        return self._select_deeds(~np.isin(self.deeds.at, games))

    def _select_deeds(self, which: BoolArray) -> DeedsInArrays:
        return self._replace(deeds=self.deeds.select(which), turns=self.turns[which])

    def select_kind(self, kind: str, number: IntArray, turn: IntArray, _: AsArrays) -> ArrayDeeds | None:
        """Return the deeds in a turn, None: they are of another kind; see `DeedLog.list_in_turn`."""
        if kind != self.deeds.kind:
            return None
        deeds = self.deeds._replace(at=number[self.deeds.at])
        return deeds.select((deeds.at >= 0) & (self.turns == turn[deeds.at]))


def _is_refused(game: int, agent: int, kind: str, refused: Collection[tuple[int, int, str | None]]) -> bool:
    return (game, agent, kind) in refused or (game, agent, None) in refused


DoneDeeds = PlainDeeds | DeedsInArrays


class DeedLog(GameLog[list[DoneDeeds]]):
    """The deeds of one game, or of all games of a batch: those of the turn, and the log.

    In each part of a turn, `request_deeds` collects the requested deeds, `do` starts the deeds of the part, and `note`
    logs the deeds that were not refused. Deeds that last are not logged then: `list_begun` returns them, and `add`
    logs each when it is done. Entries of the log are dicts, which are made when they are read.

    Args:
        num_games: the number of games.

    Attributes:
        last: the deeds of the last turn that was played, or is under way; a list that is replaced, never changed.
    """

    def __init__(self, num_games: int = 1) -> None:
        super().__init__(num_games)
        self.last: list[DoneDeeds] = []
        self._now: list[DoneDeeds] = []  # of its last part
        self._refused: set[tuple[int, int, str | None]] = set()  # game, agent, kind; None: all kinds
        self._read: list[DoneDeeds] = []  # the deeds of which `_rows` has been made
        self._rows: dict[int, list[DeedRow]] = {}  # by game
        self._begun: dict[int, list[DeedRow]] = {}  # by game
        self.begin_turn()

    def begin_turn(self) -> None:
        """Drop requested deeds that were not executed."""
        self._wanted: list[DoneDeeds] = []

    def request_deeds(self, deeds: DoneDeeds) -> None:
        """Collect requested deeds."""
        self._wanted.append(deeds)

    def do(self, part: int, *, is_first: bool) -> None:
        """Start the requested deeds of a part of the turn; `is_first`: no other part was played before."""
        self._now = [one for one in self._wanted if one.part == part]
        self._wanted = [one for one in self._wanted if one.part != part]
        self.last = self._now if is_first else [*self.last, *self._now]
        self._refused.clear()

    def refuse(self, game: int, agent: int, kind: str | None) -> None:
        """Refuse the deeds of one kind of an agent in the current part of the turn; None: of all kinds."""
        self._refused.add((game, agent, kind))

    def withdraw(self, failed: Iterable[tuple[int, int]]) -> None:
        """Refuse all deeds of agents whose action failed, given as (game, agent) pairs."""
        self._refused.update((game, agent, None) for game, agent in failed)

    def note(self, lasting: Collection[str] = ()) -> None:
        """Log the deeds of the current part of the turn, except refused ones and those of kinds that last."""
        self._begun.clear()
        if self._refused or lasting:
            before = self.last[: len(self.last) - len(self._now)]
            self._now = [one.remove_refused(self._refused) for one in self._now]
            for row in _list_rows(self._now) if lasting else ():
                if row[4] in lasting:
                    self._begun.setdefault(row[0], []).append(row)
            others = [one.remove_kinds(lasting) for one in self._now] if lasting else self._now
            self._now = [one for one in others if one is not None]
            self.last = [*before, *self._now] if before else self._now
        if self._now:
            self._pending.append(self._now)

    def list_begun(self, game: int) -> list[DeedRow]:
        """Return the deeds that last and that agents of a game begin or continue in the current part of the turn."""
        return sorted(self._begun.get(game, ()), key=itemgetter(1, 2))

    def add(self, game: int, done: Iterable[DeedRow]) -> None:
        """Log deeds of a game that have lasted until a moment of the present turn."""
        table = PlainDeeds(0, [(game, *row[1:]) for row in done])
        self.last = [*self.last, table]
        self._pending.append([table])

    # -- the deeds of a turn -----------------------------------------------------------------------------------------

    def list_in_turn(
        self, games: IntArray, turn: IntArray, kind: str, as_arrays: AsArrays, *, is_moving: bool
    ) -> list[ArrayDeeds]:
        """Return the deeds of one kind that were done in a turn; their `at` are indices into `games`.

        Args:
            games: the numbers of the games.
            turn: (games,) the number of the turn in each game.
            kind: the name of the deed.
            as_arrays: returns deeds of plain functions as arrays.
            is_moving: whether the agents of the last part of the turn are about to move; then only their deeds count.
        """
        number = find_places(games, self._num_games)
        tables = self._now if is_moving else self.last
        found = [one.select_kind(kind, number, turn, as_arrays) for one in tables]
        return [one for one in found if one is not None]

    def list_rows_in_turn(self, game: int, turn: int, *, is_moving: bool) -> list[DeedRow]:
        """Return the deeds of a game in a turn; see `list_in_turn`."""
        tables = self._now if is_moving else self.last
        if self._read is not tables:
            self._read = tables
            self._rows = {}
            for row in _list_rows(tables):
                self._rows.setdefault(row[0], []).append(row)
        return [row for row in self._rows.get(game, ()) if row[5] == turn]

    def list_last(self, game: int) -> list[DoneDeeds]:
        """Return the deeds of a game in its last turn, as those of a game that is alone."""
        if self._num_games == 1:
            return self.last
        return [PlainDeeds(0, _list_rows_alone(game, self.last))]

    def move_part(self, game: int, target: DeedLog, agents: Mapping[int, int]) -> None:
        """Let the log of a single game go on in the part of the turn that a game is in, after `do`.

        Args:
            game: the number of the game here.
            target: the other log.
            agents: the numbers of agents here -> there.
        """

        def renumber(rows: list[DeedRow]) -> list[DeedRow]:
            return [(row[0], agents[row[1]], *row[2:]) for row in rows if row[1] in agents]

        now = {
            id(one): PlainDeeds(0, renumber(_list_rows_alone(game, [one.remove_refused(self._refused)])))
            for one in self._now
        }
        target._now = [*now.values()]
        target.last = [now.get(id(one)) or PlainDeeds(0, renumber(_list_rows_alone(game, [one]))) for one in self.last]
        target._begun = {0: renumber(_renumber_game(0, self._begun.get(game, [])))}

    def go_to(self, last: list[DoneDeeds]) -> None:
        """Restore the deeds of the last turn, which were `last` at that moment, and drop those of the present turn."""
        self.begin_turn()
        self.last = last
        self._now = last

    # -- the games ---------------------------------------------------------------------------------------------------

    def begin(self, games: IntArray, entries: Sequence[dict[str, Any]], last: Iterable[DoneDeeds] = ()) -> None:
        """Start the empty logs of some games with entries of earlier turns, and with the deeds of the last turn.

        Args:
            games: the numbers of the games.
            entries: the entries of each game.
            last: the deeds of a game that is alone, see `list_last`.
        """
        super().begin(games, entries)
        rows = _list_rows(last)
        if rows:
            self.last = [*self.last, *(PlainDeeds(0, _renumber_game(game, rows)) for game in games.tolist())]

    def forget(self, games: IntArray) -> None:
        """Remove the deeds of games."""
        super().forget(games)
        self.last = [one.remove_games(games) for one in self.last]

    def clear(self) -> None:
        """Remove the deeds of all games."""
        super().clear()
        self.last = []

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes all later changes."""
        undo_log = super().checkpoint()
        last = self.last

        def undo() -> None:
            undo_log()
            self.last = last

        return undo

    def _list_entries(self, noted: list[DoneDeeds]) -> Iterator[tuple[int, dict[str, Any]]]:
        rows = noted[0].list_rows()
        if len(noted) > 1:
            rows = sorted(_list_rows(noted), key=itemgetter(0, 1, 2))
        for game, _, _, name, kind, turn, node, fields in rows:
            yield game, {"turn": turn, "agent": name, "deed": kind, "at": node, **fields}


def _list_rows(tables: Iterable[DoneDeeds]) -> list[DeedRow]:
    """Return the deeds of several tables."""
    return [row for one in tables for row in one.list_rows()]


def _list_rows_alone(game: int, tables: Iterable[DoneDeeds]) -> list[DeedRow]:
    """Return the deeds of a game as those of a game that is alone."""
    return _renumber_game(0, [row for row in _list_rows(tables) if row[0] == game])


def _renumber_game(game: int, rows: Iterable[DeedRow]) -> list[DeedRow]:
    """Return deeds as those of a game with this number."""
    return [(game, *row[1:]) for row in rows]
