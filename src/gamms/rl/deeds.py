"""Declared deeds as a finite list of choices for learners: no deed, or a deed with concrete field values."""

from collections.abc import Mapping, Sequence
from itertools import chain, product
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from gamms.errors import BadValue
from gamms.game.array_functions.view import ArrayView, get_movement, list_lasting_deeds
from gamms.game.deeds import DeclaredField
from gamms.game.movement.streets import StreetGraph
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown

_MOST = 4096  # choices
_LEFT_OUT = -1  # the number of an option: the field is omitted
_NEAR = ("node", "edge")  # kinds of fields whose options are indices of legal nodes, or of edges that leave the node


class _DeedOptions(NamedTuple):
    """A deed: its fields, the number of its first choice, and the options of each choice.

    Attributes:
        name: the declared name.
        first: the number of its first choice.
        fields: name -> its declaration and its options, which are empty for the kinds in `_NEAR`.
        options: (choices, fields) numbers of options.
    """

    name: str
    first: int
    fields: dict[str, tuple[DeclaredField, Sequence[Any]]]
    options: IntArray


class DeedChoices:
    """The deeds that an agent can choose: choice 0 is none; then each deed with each combination of its fields.

    The options of a field are: the agents, teams or sensors, sorted by name at the start; the k-th legal node of the
    agent; the k-th edge that leaves its node; false and true; or the values of a list. For an optional field, the
    first option omits it, and for a kind with infinitely many values this is the only option.

    Args:
        declared: the deeds of the game.
        known: the agents, teams and sensors at the start, by kind.
        streets: the graph of the map.
        width: the largest number of legal nodes of an agent.

    Attributes:
        names: the names of the choices.

    Raises:
        BadValue: a required field has infinitely many values, or there are more than 4096 choices.
    """

    def __init__(
        self,
        declared: Mapping[str, Mapping[str, DeclaredField]],
        known: Mapping[str, Sequence[Any]],
        streets: StreetGraph,
        width: int,
    ) -> None:
        self._columns = streets.columns
        self._degrees = np.diff(self._columns.offsets)
        numbers = {"node": range(width), "edge": range(int(self._degrees.max(initial=0)))}
        known = {"boolean": (False, True), **numbers, **known}
        self._deeds: list[_DeedOptions] = []
        names = ["nothing"]
        for deed, declarations in declared.items():
            fields = {key: _list_options(deed, key, field, known) for key, field in declarations.items()}
            ways = [[*([] if one.is_required else [_LEFT_OUT]), *range(len(values))] for one, values in fields.values()]
            many = len(names) + int(np.prod([len(one) for one in ways], dtype=np.float64))
            if many > _MOST:
                raise BadValue(
                    f"With the deed {deed!r} there are {many} choices, and learners have {_MOST} at most: declare "
                    "fewer fields, or lists of fewer values."
                )
            options = np.array([*product(*ways)], np.int64).reshape(many - len(names), len(fields))
            self._deeds.append(_DeedOptions(deed, len(names), fields, options))
            names += [_make_name(deed, fields, row) for row in options.tolist()]
        self.names = tuple(names)
        self._needs = {
            kind: self._find_needed(kind) for kind in _NEAR
        }  # (choices,) the number of nodes and edges that a choice needs
        self._names = self._list_named_agents()

    def __len__(self) -> int:
        return len(self.names)

    def compute_masks(self, view: ArrayView) -> BoolArray:
        """Return a mask of the choices of a view's agents, (games, agents, choices); a rule may still refuse one.

        While an agent does a deed that lasts, it can choose no deed that lasts.
        """
        degrees = self._degrees[view.node][..., None]
        found: BoolArray = (self._needs["node"] <= view.counts[..., None]) & (self._needs["edge"] <= degrees)
        found[..., 1:] &= view.mask[..., None]
        for number, _ in list_lasting_deeds(view):
            deed = self._deeds[number]
            found[..., deed.first : deed.first + len(deed.options)] &= view["doing"].kind[..., None] < 0
        are_there = view.is_there
        if not are_there.all():
            for choice, agent in self._names:
                found[..., choice] &= are_there[:, agent, None]
        return found

    def make_arguments(self, chosen: IntArray, view: ArrayView) -> dict[str, tuple[BoolArray, dict[str, Any]]]:
        """Return choices, (games, agents), as arguments of `Batch.step`."""
        found = {}
        for deed in self._deeds:
            where = (chosen >= deed.first) & (chosen < deed.first + len(deed.options))
            if where.any():
                rows = deed.options[np.where(where, chosen - deed.first, 0)]
                columns = enumerate(deed.fields.items())
                found[deed.name] = where, {key: self._find_values(*of, rows[..., i], view) for i, (key, of) in columns}
        return found

    def do(self, chosen: IntArray, view: ArrayView) -> None:
        """Perform the chosen deeds of a view's agents, (games, agents)."""
        for deed, (where, fields) in self.make_arguments(chosen, view).items():
            view.do(deed, where, **fields)

    def make_plain(self, choice: int, legal: Sequence[int], node: int) -> dict[str, dict[str, Any]]:
        """Return a choice as the deeds in `state["action"]`; {} if the agent does not have this choice.

        Args:
            choice: the number of the choice.
            legal: ids of the agent's legal nodes.
            node: the id of the agent's node.
        """
        row = int(np.flatnonzero(self._columns.node_ids == node)[0])
        edges = self._columns.edge_ids[self._find_edges(row)].tolist()
        for deed in self._deeds:
            if not 0 <= choice - deed.first < len(deed.options):
                continue
            if self._needs["node"][choice] > len(legal) or self._needs["edge"][choice] > len(edges):
                return {}
            near = {"node": legal, "edge": edges}
            options = zip(deed.options[choice - deed.first].tolist(), deed.fields.items(), strict=True)
            return {
                deed.name: {key: near.get(of.kind, known)[k] for k, (key, (of, known)) in options if k != _LEFT_OUT}
            }
        return {}

    def _find_edges(self, node: int) -> IntArray:
        columns = self._columns
        return columns.out_edges[columns.offsets[node] : columns.offsets[node + 1]]

    def _find_values(self, field: DeclaredField, known: Sequence[Any], options: IntArray, view: ArrayView) -> Any:
        """Return the values of a field, (games, agents), as `ArrayView.do` takes them."""
        if field.kind == "agent":
            return options
        is_given = options != _LEFT_OUT
        if field.kind == "node":
            chosen = np.clip(options, 0, view.counts - 1)[..., None]
            rows = np.take_along_axis(view.legal_rows()[0], chosen, axis=-1)[..., 0]
            return np.where(is_given, rows, _LEFT_OUT)
        if field.kind == "boolean" and field.is_required:
            return options == 1
        values = np.empty(options.shape, object)
        for place in np.argwhere(is_given).tolist():
            at = tuple(place)
            if field.kind == "edge":
                edges = self._find_edges(int(view.node[at]))
                values[at] = int(self._columns.edge_ids[edges[options[at]]]) if options[at] < len(edges) else None
            else:
                values[at] = known[options[at]]
        return values

    def _list_named_agents(self) -> list[tuple[int, int]]:
        """Return pairs (choice, agent) for the choices that name an agent."""
        found = []
        for deed in self._deeds:
            for i, (field, _) in enumerate(deed.fields.values()):
                if field.kind == "agent":
                    rows = enumerate(deed.options[:, i].tolist(), deed.first)
                    found += [(choice, agent) for choice, agent in rows if agent != _LEFT_OUT]
        return found

    def _find_needed(self, kind: str) -> IntArray:
        needed = [np.zeros(1, np.int64)]
        for deed in self._deeds:
            columns = [i for i, (field, _) in enumerate(deed.fields.values()) if field.kind == kind]
            needed.append(deed.options[:, columns].max(axis=1, initial=_LEFT_OUT) + 1)
        return np.concatenate(needed)


def get_choices(view: ArrayView, declared: Mapping[str, Mapping[str, DeclaredField]]) -> DeedChoices | None:
    """Return the deed choices in a view, computed once for its map; None: no deeds are declared."""
    if not declared:
        return None
    known = _known.setdefault(view.streets, {})
    roster = view.roster
    sensors = sorted(set(chain.from_iterable(getattr(agent, "sensors", {}) for agent in roster.agents)))
    teams = [team for team in roster.teams if team is not None]
    width = view.num_actions
    key = repr((declared, roster.names, teams, sensors, width))
    if key not in known:
        of_game = {"agent": roster.names, "team": teams, "sensor": sensors}
        known[key] = DeedChoices(declared, of_game, get_movement(view).streets, width)
    return known[key]


_known: WeakKeyDictionary[StreetGraph, dict[str, DeedChoices]] = WeakKeyDictionary()


def _list_options(
    deed: str, key: str, field: DeclaredField, known: Mapping[str, Sequence[Any]]
) -> tuple[DeclaredField, Sequence[Any]]:
    """Return a field with its options."""
    values = field.choices if field.kind == "choice" else known.get(field.kind, ())
    if field.is_required and not values:
        raise BadValue(
            f"The field {key!r} of the deed {deed!r} is of the kind {field.kind!r}, and learners cannot have all "
            f"of its values: list those that they may choose, {key}: [1, 2], among the fields of the deed."
        )
    return field, values


def _make_name(deed: str, fields: Mapping[str, tuple[DeclaredField, Sequence[Any]]], row: Sequence[int]) -> str:
    parts = []
    for option, (key, (field, known)) in zip(row, fields.items(), strict=True):
        if option != _LEFT_OUT:
            value = f"{field.kind} {option}" if field.kind in _NEAR else shown(known[option])
            parts.append(f"{key}={value}")
    return f"{deed}({', '.join(parts)})"
