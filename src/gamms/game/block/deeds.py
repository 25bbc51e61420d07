"""Deeds of many games at once: declarations of views, queries of rules, and logs."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_array, as_int, as_key, as_known, as_one_shape
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.block.columns import AgentTable, GameLog, joined_rows, places_of, some_rows
from gamms.game.deeds import DeclaredField, field_of, fields_of, missing_field
from gamms.game.movement.streets import StreetGraph
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown

Column = np.ndarray[Any, Any]
Check = Callable[[object, DeclaredField, str], Any]  # called with a value, its field, and what it is called
_NUMERIC = {"integer": ("iu", np.int64), "number": ("iuf", np.float64), "boolean": ("b", np.bool_)}


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

    def those(self, which: Any) -> "ArrayDeeds":
        """Return deeds selected by a mask or by indices."""
        return some_rows(self, which)


def joined(parts: Sequence[ArrayDeeds]) -> ArrayDeeds:
    """Return the concatenated deeds of one kind; there is at least one part."""
    whole = joined_rows(parts)
    return whole.those(np.lexsort((whole.agents, whole.at)))


def _integer(value: object, _: DeclaredField, name: str) -> int:
    return as_int(value, name)


class DeclaredDeeds:
    """The deeds that a game declares.

    Args:
        declared: deed -> its fields, as `ctx.game.deeds`.
        check: returns the checked plain value of a field, or raises; None: no deed is declared.
        roster, streets: the agents and the graph.
        are_open: returns whether each edge, by id, is open in the game of the same index; None: `check` does that.

    Attributes:
        declared: deed -> its fields.
    """

    def __init__(
        self,
        declared: Mapping[str, Mapping[str, Any]],
        check: Check | None,
        roster: AgentTable,
        streets: StreetGraph,
        are_open: Callable[[IntArray, IntArray], BoolArray] | None = None,
    ) -> None:
        self.declared = {deed: {key: field_of(kind) for key, kind in of.items()} for deed, of in declared.items()}
        self._check = check
        self._roster = roster
        self._streets = streets
        self._are_open = are_open

    def checked(
        self, deed: str, fields: Mapping[str, object], where: BoolArray, who: tuple[IntArray, IntArray],
        nodes: IntArray, order: int,
    ) -> ArrayDeeds:  # fmt: skip
        """Return the checked deeds of a call of `ArrayView.do` by agents on these nodes.

        `who` are the numbers of the games and of the agents; `order` is the number of the call.
        """
        known = self.fields_of(deed)
        for key in fields:
            as_known(key, f"field of the deed {deed!r}:", known)
        at, which = np.nonzero(where)
        values = {}
        for key, field in known.items():
            name = f"{key!r} of the deed {deed!r}"
            given = fields.get(key)
            if given is None and field.is_required:
                raise missing_field(name, known)
            column = self._column(given, field, name, where, (at, which))
            values[key] = column
            if field.kind == "edge" and self._are_open is not None:
                named = np.flatnonzero(column != np.array(None))
                edges = column[named].astype(np.int64)
                for edge in edges[~self._are_open(edges, who[0][at[named]])].tolist():
                    raise UnknownName(f"edge as {name}:", edge)
        return ArrayDeeds(deed, at, who[1][which], nodes[at, which], np.full(len(at), order), values)

    def fields_of(self, deed: str) -> Mapping[str, DeclaredField]:
        """Return the declared fields of a deed."""
        return fields_of(as_key(deed, "The name of a deed"), self.declared)

    def nothing(self, deed: str) -> ArrayDeeds:
        """Return an empty table of deeds of a kind."""
        return self._from_plain(deed, [], np.zeros((1, 1), np.int64))

    def from_plain(
        self, done: Sequence[tuple[int, int, int, str, Mapping[str, Any]]], nodes: IntArray
    ) -> list[ArrayDeeds]:
        """Return checked deeds of plain functions as arrays, one table for each kind.

        Args:
            done: tuples of game, agent number, position among the agent's deeds, kind, and field -> value.
            nodes: (games, agents) rows of the agents' nodes.
        """
        by_kind: dict[str, list[Any]] = {}
        for one in done:
            by_kind.setdefault(one[3], []).append(one)
        return [self._from_plain(kind, sorted(those, key=itemgetter(0, 1)), nodes) for kind, those in by_kind.items()]

    def _from_plain(self, kind: str, done: Sequence[Any], nodes: IntArray) -> ArrayDeeds:
        numbers: dict[str, Callable[[Any], int]] = {
            "agent": self._roster.names.index,
            "node": lambda node: int(self._streets.rows(node)),
        }
        at, agents, order = (np.array([one[i] for one in done], np.int64) for i in range(3))
        values: dict[str, Column] = {}
        for key, field in self.fields_of(kind).items():
            given = [one[4].get(key) for one in done]
            number = numbers.get(field.kind)
            if number is not None:
                values[key] = np.array([-1 if one is None else number(one) for one in given], np.int64)
                continue
            is_numeric = field.is_required and field.kind in _NUMERIC
            values[key] = np.empty(len(done), _NUMERIC[field.kind][1] if is_numeric else object)
            for i, one in enumerate(given):
                values[key][i] = one
        return ArrayDeeds(kind, at, agents, nodes[at, agents], order, values)

    def _column(
        self, given: object, field: DeclaredField, name: str, where: BoolArray, chosen: tuple[IntArray, IntArray]
    ) -> Column:
        """Return the checked values of a field for the chosen agents, (deeds,)."""
        if field.kind in ("agent", "node"):
            return self._rows(-1 if given is None else given, field, name, where, chosen)
        if field.kind in _NUMERIC and given is not None and field.is_required:
            kinds, dtype = _NUMERIC[field.kind]
            values = np.asarray(given)
            if values.dtype.kind not in kinds:
                raise BadType(f"{name} must be of the kind {field.kind!r}, not {shown(given)}.")
            return as_one_shape({name: values}, where.shape)[0][chosen].astype(dtype)
        column = np.empty(len(chosen[0]), object)
        check = self._check
        if field.kind == "edge" and self._are_open is not None:
            check = _integer
        if given is None or check is None:
            return column
        if isinstance(given, np.ndarray):
            each = as_one_shape({name: given}, where.shape)[0][chosen].tolist()
            column[:] = [None if one is None else check(one, field, name) for one in each]
        else:
            column[:] = [check(given, field, name)] * len(column)
        return column

    def _rows(
        self, given: object, field: DeclaredField, name: str, where: BoolArray, chosen: tuple[IntArray, IntArray]
    ) -> Column:
        """Return the checked agent numbers or node rows of a field for the chosen agents, (deeds,)."""
        most = len(self._roster.names if field.kind == "agent" else self._streets.counts)
        try:
            values = as_array(given, name, "integers")
        except BadType:
            raise BadType(f"{name} must be {field.kind}s by their numbers, not {shown(given)}.") from None
        rows = as_one_shape({name: values}, where.shape)[0][chosen].astype(np.int64)
        wrong = rows[(rows < (0 if field.is_required else -1)) | (rows >= most)]
        if len(wrong):
            raise BadValue(
                f"{name}: there is no {field.kind} number {wrong[0]}; they are numbered from 0 to {most - 1}."
            )
        return rows

    def plain(self, deeds: ArrayDeeds, key: str) -> list[Any]:
        """Return the values of a field as plain values; None if it is omitted."""
        kind = self.declared[deeds.kind][key].kind
        column = deeds.values[key]
        if kind not in ("agent", "node"):
            return list(column.tolist())
        known = self._roster.names if kind == "agent" else self._streets.columns.node_ids.tolist()
        return [known[number] if number >= 0 else None for number in column.tolist()]

    def fields(self, deeds: ArrayDeeds) -> list[dict[str, Any]]:
        """Return the fields of each deed as plain values, without omitted ones."""
        columns = {key: self.plain(deeds, key) for key in deeds.values}
        return [
            {key: column[i] for key, column in columns.items() if column[i] is not None} for i in range(len(deeds.at))
        ]

    def entries(self, deeds: ArrayDeeds) -> Iterator[dict[str, Any]]:
        """Yield the log entry of each deed, without the turn."""
        columns = deeds.agents.tolist(), self._streets.ids(deeds.nodes).tolist(), self.fields(deeds)
        for agent, node, fields in zip(*columns, strict=True):
            yield {"agent": self._roster.names[agent], "deed": deeds.kind, "at": node, **fields}


class _PerformedDeeds(NamedTuple):
    """Deeds of one kind in games on one map, with the turn of each deed, (deeds,)."""

    declared: DeclaredDeeds
    deeds: ArrayDeeds
    turns: IntArray

    def those(self, which: BoolArray) -> "_PerformedDeeds":
        """Return the deeds selected by a mask."""
        return self._replace(deeds=self.deeds.those(which), turns=self.turns[which])


class DeedLog(GameLog[list[_PerformedDeeds]]):
    """The log of the deeds of all games of a batch.

    In each part of a turn, `want` collects the requested deeds, `do` starts the deeds of the part, and `note` logs the
    deeds that were not refused.

    Args:
        part_of: (agents,) the part of the turn in which each agent decides.
        num_games: the number of games in the batch.
    """

    def __init__(self, part_of: IntArray, num_games: int) -> None:
        super().__init__(num_games)
        self._part_of = part_of
        self._last: list[_PerformedDeeds] = []  # of the last turn that was played, or is under way
        self._now: list[_PerformedDeeds] = []  # of its last part
        self._refused: set[tuple[int, int, str]] = set()  # game, agent, kind
        self._plain: dict[int, dict[int, dict[str, dict[str, Any]]]] | None = None  # the same by game and agent
        self.begin_turn()

    def begin_turn(self) -> None:
        """Drop requested deeds that were not executed."""
        self._wanted: list[_PerformedDeeds] = []

    def want(self, declared: DeclaredDeeds, deeds: Iterable[ArrayDeeds], turn: IntArray) -> None:
        """Collect the requested deeds of a part of the turn.

        Args:
            declared: the deeds that the games declare.
            deeds: a table for each kind, of agents that decide in one part of the turn.
            turn: (games,) the number of turns played.
        """
        self._wanted += [_PerformedDeeds(declared, one, turn[one.at] + 1) for one in deeds if len(one.at)]

    def do(self, part: int) -> None:
        """Start the requested deeds of the agents that decide in a part of the turn."""
        self._now = [one for one in self._wanted if self._part_of[one.deeds.agents[0]] == part]
        self._last = [*self._last, *self._now] if part else self._now
        self._plain = None
        self._refused.clear()

    def refuse(self, game: int, agent: int, kind: str) -> None:
        """Refuse the deeds of one kind of an agent in the current part of the turn."""
        self._refused.add((game, agent, kind))

    def withdraw(self, failed: Collection[tuple[int, int]]) -> None:
        """Refuse all deeds of agents whose action failed, given as (game, agent) pairs."""
        kinds = {one.deeds.kind for one in self._now}
        self._refused |= {(*pair, kind) for pair in failed for kind in kinds}

    def note(self) -> None:
        """Log the deeds of the current part of the turn, except refused ones."""
        if self._refused:
            before = self._last[: len(self._last) - len(self._now)]
            self._now = [one.those(self._are_done(one.deeds)) for one in self._now]
            self._last = [*before, *self._now]
            self._plain = None
        if self._now:
            self._pending.append(self._now)

    def _are_done(self, deeds: ArrayDeeds) -> BoolArray:
        each = zip(deeds.at.tolist(), deeds.agents.tolist(), strict=True)
        return np.array([(*one, deeds.kind) not in self._refused for one in each], np.bool_)

    def done_in(self, games: IntArray, took_part: BoolArray, *, is_moving: bool) -> list[ArrayDeeds]:
        """Return the deeds of games in this turn; their `at` are indices into `games`.

        Args:
            games: the numbers of the games.
            took_part: (games, agents) the agents whose deeds to return.
            is_moving: whether the agents of the last part of the turn are about to move; then only their deeds count.
        """
        number = places_of(games, self._num_games)
        found = [one.deeds._replace(at=number[one.deeds.at]) for one in (self._now if is_moving else self._last)]
        return [deeds.those((deeds.at >= 0) & took_part[deeds.at, deeds.agents]) for deeds in found]

    def plain_of(self, game: int) -> dict[int, dict[str, dict[str, Any]]]:
        """Return the deeds of a game in this turn: agent number -> deed -> its fields."""
        if self._plain is None:
            self._plain = {}
            rows = [row for one in self._last for row in self._rows(one, one.declared.fields(one.deeds))]
            for number, agent, _, kind, fields in sorted(rows, key=itemgetter(0, 1, 2)):
                self._plain.setdefault(number, {}).setdefault(agent, {})[kind] = fields
        return self._plain.get(game, {})

    def _rows(
        self, done: _PerformedDeeds, values: Iterable[dict[str, Any]]
    ) -> Iterator[tuple[int, int, int, str, Any]]:
        """Yield game, agent, order, kind and a value of each deed."""
        deeds = done.deeds
        columns = deeds.at.tolist(), deeds.agents.tolist(), deeds.order.tolist()
        for game, agent, order, value in zip(*columns, values, strict=True):
            yield game, agent, order, deeds.kind, value

    def forget(self, games: IntArray) -> None:
        """Remove the deeds of games."""
        super().forget(games)
        self._last = [one.those(~np.isin(one.deeds.at, games)) for one in self._last]
        self._plain = None

    def clear(self) -> None:
        """Remove the deeds of all games."""
        super().clear()
        self._last = []
        self._plain = None

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes all later changes."""
        undo_log = super().checkpoint()
        last = self._last

        def undo() -> None:
            undo_log()
            self._last = last
            self._plain = None

        return undo

    def _entries(self, noted: list[_PerformedDeeds]) -> Iterator[tuple[int, dict[str, Any]]]:
        rows: list[tuple[int, int, int, str, Any]] = []
        for one in noted:
            entries = zip(one.turns.tolist(), one.declared.entries(one.deeds), strict=True)
            rows += self._rows(one, ({"turn": turn, **entry} for turn, entry in entries))
        for game, *_, entry in sorted(rows, key=itemgetter(0, 1, 2)):
            yield game, entry


def deed_log_of(settings: Mapping[str, Any], roster: AgentTable, num_games: int) -> DeedLog | None:
    """Return the log of deeds of games with these settings; None: they declare no deeds."""
    return DeedLog(roster.part_of(settings["order"]), num_games) if settings["deeds"] else None
