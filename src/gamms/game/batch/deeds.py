"""Deeds of many games at once: what strategies declare through their views, rules find in turns, and results list."""

from collections.abc import Callable, Collection, Mapping, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_array, as_int, as_key, as_one_shape
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch.columns import Roster, joined_rows, some_rows
from gamms.game.deeds import DeclaredField, field_of
from gamms.game.streets import Streets
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown

Column = np.ndarray[Any, Any]
Check = Callable[[object, DeclaredField, str], Any]  # called with a value, its field, and what it is called
_NUMERIC = {"integer": ("iu", np.int64), "number": ("iuf", np.float64), "boolean": ("b", np.bool_)}


class ArrayDeeds(NamedTuple):
    """Deeds of one kind, of several games, by game and in each by the name of the agent; arrays (deeds,).

    Attributes:
        kind: as declared.
        at: the games, numbered as in the turn.
        agents: numbers in the roster.
        nodes: the rows of the nodes where the agents were.
        order: of several deeds of one agent in a turn, that with the smaller number comes first.
        values: field -> its values: agents by their numbers, nodes by their rows; -1 or None where one is left out.
    """

    kind: str
    at: IntArray
    agents: IntArray
    nodes: IntArray
    order: IntArray
    values: Mapping[str, Column]

    def those(self, which: Any) -> "ArrayDeeds":
        """Return some of the deeds: a mask, or their numbers."""
        return some_rows(self, which)

    def without(self, actors: Collection[tuple[int, int]]) -> "ArrayDeeds":
        """Return the deeds but those of some agents, each given with its game in the turn."""
        if not actors:
            return self
        known = zip(self.at.tolist(), self.agents.tolist(), strict=True)
        return self.those(np.array([actor not in actors for actor in known], np.bool_))


def joined(parts: Sequence[ArrayDeeds]) -> ArrayDeeds:
    """Return deeds of one kind as one; there is at least one part."""
    whole = joined_rows(parts)
    return whole.those(np.lexsort((whole.agents, whole.at)))


def _integer(value: object, _: DeclaredField, name: str) -> int:
    return as_int(value, name)


class DeclaredDeeds:
    """The deeds that a game declares.

    Args:
        declared: deed -> its fields, as `ctx.game.deeds`.
        check: returns the value of a field, plain, or raises; None: nothing is declared.
        roster, streets: of the batch.
        are_open: returns which edges, by their ids, are open in games of these numbers; None: `check` knows that.

    Attributes:
        declared: deed -> its fields.
    """

    def __init__(
        self,
        declared: Mapping[str, Mapping[str, Any]],
        check: Check | None,
        roster: Roster,
        streets: Streets,
        are_open: Callable[[IntArray, IntArray], BoolArray] | None = None,
    ) -> None:
        self.declared = {deed: {key: field_of(kind) for key, kind in of.items()} for deed, of in declared.items()}
        self._check, self._roster, self._streets, self._are_open = check, roster, streets, are_open

    def checked(
        self, deed: str, fields: Mapping[str, object], where: BoolArray, who: tuple[IntArray, IntArray],
        nodes: IntArray, order: int,
    ) -> ArrayDeeds:  # fmt: skip
        """Return what agents on these nodes want to do, checked, as `ArrayView.do`.

        `who` are the numbers of the games and of the agents; `order` is the place among all deeds.
        """
        known = self.fields_of(deed)
        for key in fields:
            if key not in known:
                raise UnknownName(f"field of the deed {deed!r}:", key, known)
        at, which = np.nonzero(where)
        values = {}
        for key, field in known.items():
            name, given = f"{key!r} of the deed {deed!r}", fields.get(key)
            if given is None and field.is_required:
                raise BadValue(f"There is no {name}; it needs {', '.join(map(shown, known))}.")
            values[key] = column = self._column(given, field, name, where, (at, which))
            if field.kind == "edge" and self._are_open is not None:
                named = np.flatnonzero(column != np.array(None))
                edges = column[named].astype(np.int64)
                for edge in edges[~self._are_open(edges, who[0][at[named]])].tolist():
                    raise UnknownName(f"edge as {name}:", edge)
        return ArrayDeeds(deed, at, who[1][which], nodes[at, which], np.full(len(at), order), values)

    def fields_of(self, deed: str) -> Mapping[str, DeclaredField]:
        """Return the fields of a deed."""
        known = self.declared
        if as_key(deed, "The name of a deed") not in known:
            raise UnknownName("deed" if known else "deed, as ctx.game.deeds declares none:", deed, known)
        return known[deed]

    def nothing(self, deed: str) -> ArrayDeeds:
        """Return no deeds of a kind."""
        return self._from_plain(deed, [], np.zeros((1, 1), np.int64))

    def from_plain(
        self, done: Sequence[tuple[int, int, int, str, Mapping[str, Any]]], nodes: IntArray
    ) -> list[ArrayDeeds]:
        """Return deeds that scalar forms do, which were checked, in arrays: those of each kind.

        Args:
            done: game, number of the agent, place among the deeds of that agent, kind, and field -> value.
            nodes: (games, agents) rows of the nodes where agents are.
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
            given, number = [one[4].get(key) for one in done], numbers.get(field.kind)
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
        """Return the values of a field of the deeds that are done."""
        if field.kind in ("agent", "node"):
            return self._rows(-1 if given is None else given, field, name, where, chosen)
        if field.kind in _NUMERIC and given is not None and field.is_required:
            kinds, dtype = _NUMERIC[field.kind]
            values = np.asarray(given)
            if values.dtype.kind not in kinds:
                raise BadType(f"{name} must be of the kind {field.kind!r}, not {shown(given)}.")
            return as_one_shape({name: values}, where.shape)[0][chosen].astype(dtype)
        column, check = np.empty(len(chosen[0]), object), self._check
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
        """Return numbers of agents or rows of nodes, which are not checked by the scalar form."""
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
        """Return the values of a field as scalar forms have them, None where one is left out."""
        kind, column = self.declared[deeds.kind][key].kind, deeds.values[key]
        if kind not in ("agent", "node"):
            return list(column.tolist())
        known = self._roster.names if kind == "agent" else self._streets.columns.node_ids.tolist()
        return [known[number] if number >= 0 else None for number in column.tolist()]
