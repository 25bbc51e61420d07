"""Deeds, which are actions other than moves: their declarations, checks of requests, and tables of them."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cache
from operator import itemgetter
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gamms.arguments import (
    as_array,
    as_bool,
    as_choice,
    as_float,
    as_int,
    as_items,
    as_key,
    as_known,
    as_mapping,
    as_name,
    as_one_shape,
    as_positive,
    as_text,
)
from gamms.errors import BadType, BadValue, UnknownName, nearest
from gamms.game.movement.streets import StreetGraph
from gamms.ir.columns import Column
from gamms.ir.deeds import ArrayDeeds, DeedNumbering, DeedRow
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray, as_node_id
from gamms.ir.obstacles import BoolArray
from gamms.plain import describe_flaw, is_same, to_plain
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing.context import HostContext
from gamms.typing.game import Deed

T = TypeVar("T")
OF_DEED = ("turn", "agent", "deed", "at")
"""Keys of every deed; declared fields must have other names."""
OF_LASTING = ("kind", "time", "since", "left", "by")
"""Keys of deeds that last, and of their events; the fields of such deeds must have other names."""

_OPTIONAL = "?"  # ends the kind of a field that may be missing


def _check_agent(value: object, name: str, ctx: HostContext) -> Any:
    return _check_known(as_text(getattr(value, "name", value), name), "agent", name, ctx.agent.agents)


def _check_team(value: object, name: str, ctx: HostContext) -> Any:
    return _check_known(as_key(value, name), "team", name, ctx.agent.teams)


def _check_node(value: object, name: str, ctx: HostContext) -> int:
    node = as_node_id(value, name, ctx.graph)
    if not ctx.graph.graph.has_node(node):
        raise UnknownName(f"node as {name}:", node)
    return node


def _check_edge(value: object, name: str, ctx: HostContext) -> int:
    try:
        return int(ctx.graph.graph.get_edge(as_int(value, name)).id)
    except KeyError:
        raise UnknownName(f"edge as {name}:", value) from None


def _check_sensor(value: object, name: str, ctx: HostContext) -> Any:
    return _check_known(as_text(value, name), "sensor", name, ctx.sensor.sensors)


def _check_known(value: Any, kind: str, name: str, known: Collection[Any]) -> Any:
    """Return a value if it is in `known` (UnknownName)."""
    return as_known(value, f"{kind} as {name}:", known)


def _check_plain(value: object, name: str, _: HostContext) -> Any:
    flaw = describe_flaw(value)
    if flaw:
        raise BadType(f"{name} must be a plain value, such as numbers, texts, lists and dicts of these: {flaw}.")
    return to_plain(value)


FIELD_KINDS: dict[str, Callable[[Any, str, HostContext], Any]] = {
    "agent": _check_agent,
    "team": _check_team,
    "node": _check_node,
    "edge": _check_edge,
    "sensor": _check_sensor,
    "integer": lambda value, name, _: as_int(value, name),
    "number": lambda value, name, _: as_float(value, name),
    "boolean": lambda value, name, _: as_bool(value, name),
    "text": lambda value, name, _: as_text(value, name),
    "value": _check_plain,
}
"""Kind of field -> a function that checks a value."""


_NUMBERED = ("agent", "node")  # kinds of fields whose values are numbers in arrays
_NUMERIC = {"integer": ("iu", np.int64), "number": ("iuf", np.float64), "boolean": ("b", np.bool_)}


class Duration(NamedTuple):
    """How a deed lasts.

    Attributes:
        turns: how many turns it takes; None: `seconds` says it.
        seconds: how many seconds it takes; None: `turns` says it.
        interrupted_by: what interrupts it: "move", or kinds of events, such as "tag".
        on_interrupt: "restart": after an interruption, the agent has to do all of it; "resume": the rest.
        blocks_moving: whether the agent stays where it is meanwhile.
    """

    turns: float | None = None
    seconds: float | None = None
    interrupted_by: tuple[str, ...] = ()
    on_interrupt: str = "restart"
    blocks_moving: bool = False

    def count_turns(self, turn_seconds: float) -> float:
        """Return how many turns it takes, given the length of a turn."""
        return self.seconds / turn_seconds if self.turns is None and self.seconds is not None else self.turns or 0.0


class LastingDeed(ReadOnlyMapping):
    """The declaration of a deed that lasts: field -> its kind, and how it lasts.

    Args:
        fields: field -> its kind.
        lasts: how it lasts.

    Attributes:
        lasts: see the argument.
    """

    __slots__ = ("lasts",)

    def __init__(self, fields: Mapping[str, Any], lasts: Duration) -> None:
        super().__init__(fields)
        self.lasts = lasts

    def __eq__(self, other: object) -> bool:
        return super().__eq__(other) and (not isinstance(other, LastingDeed) or self.lasts == other.lasts)

    __hash__ = None  # as that of a dict

    def __deepcopy__(self, memo: dict[int, Any]) -> "LastingDeed":
        return LastingDeed(dict(self._values), self.lasts)

    def __reduce__(self) -> tuple[Any, ...]:
        return LastingDeed, (dict(self._values), self.lasts)

    def make_declaration(self) -> dict[str, Any]:
        """Return the declaration as plain values."""
        given = {key: value for key, value in self.lasts._asdict().items() if value is not None}
        return {"fields": to_plain(self._values), **given, "interrupted_by": list(self.lasts.interrupted_by)}


def list_lasting(declared: Mapping[str, Any]) -> dict[str, Duration]:
    """Return deed -> how it lasts, for the declared deeds that last."""
    return {deed: fields.lasts for deed, fields in declared.items() if isinstance(fields, LastingDeed)}


def make_plain_declarations(declared: Mapping[str, Any]) -> dict[str, Any]:
    """Return declared deeds as plain values, from which `as_deeds` makes the same."""
    return {
        deed: fields.make_declaration() if isinstance(fields, LastingDeed) else to_plain(fields)
        for deed, fields in declared.items()
    }


class DeclaredField(NamedTuple):
    """A field of a deed: its kind, its choices if the kind is "choice", and whether it is required."""

    kind: str
    choices: tuple[Any, ...]
    is_required: bool


def as_deeds(value: object) -> Mapping[str, Mapping[str, Any]]:
    """Return declared deeds as a read-only mapping: deed -> field -> its kind, or a tuple of choices.

    The fields of a deed that lasts are a `LastingDeed`.

    Raises:
        BadType, BadValue: a declaration is invalid.
    """
    declared: dict[str, ReadOnlyMapping] = {}
    for deed, fields in as_mapping(value, "ctx.game.deeds").items():
        name = f"ctx.game.deeds[{shown(deed)}]"
        if not isinstance(deed, str) or not deed.isidentifier():
            raise BadValue(f"A deed is called by a name of letters, digits and _, not {shown(deed)}.")
        given = {} if fields is None else as_mapping(fields, name)
        if isinstance(given, LastingDeed):
            declared[deed] = given
        elif isinstance(given.get("fields", ""), Mapping | None):
            declared[deed] = _as_lasting(given, name)
        else:
            declared[deed] = _as_fields(given, name)
    return ReadOnlyMapping(declared)


def _as_fields(given: Mapping[Any, Any], name: str) -> ReadOnlyMapping:
    """Return checked fields: name -> kind."""
    return ReadOnlyMapping({key: _check_declaration(key, kind, name) for key, kind in given.items()})


_KEYS = ("fields", *Duration._fields)
_OWN_EVENTS = ("begun", "interrupted", "done")


def _as_lasting(given: Mapping[Any, Any], name: str) -> ReadOnlyMapping:
    """Return the checked declaration of a deed with the key `fields`: one that lasts, if it says how long."""
    for key in given:
        as_known(key, f"key of {name}:", _KEYS)
    fields = _as_fields(given["fields"] or {}, name)
    rest = {key: value for key, value in given.items() if key != "fields" and value is not None}
    if not rest:
        return fields
    for key in fields:
        if key in OF_LASTING:
            raise BadValue(f"A field of {name} cannot be called {key!r}, which deeds that last have. Use another name.")
    if ("turns" in rest) == ("seconds" in rest):
        raise BadValue(f"{name} needs either turns or seconds: how long the deed lasts.")
    checked: dict[str, Any] = {
        key: as_positive(rest[key], f"{name}[{key!r}]") for key in ("turns", "seconds") if key in rest
    }
    if "interrupted_by" in rest:
        checked["interrupted_by"] = _as_interrupting(rest["interrupted_by"], f"{name}['interrupted_by']")
    if "on_interrupt" in rest:
        checked["on_interrupt"] = as_choice(rest["on_interrupt"], f"{name}['on_interrupt']", ("restart", "resume"))
    if "blocks_moving" in rest:
        checked["blocks_moving"] = as_bool(rest["blocks_moving"], f"{name}['blocks_moving']")
    return LastingDeed(fields, Duration(**checked))


def _as_interrupting(given: object, name: str) -> tuple[str, ...]:
    """Return what interrupts a deed.

    Raises:
        BadType, BadValue: it is not a list of texts, or has an event of the deed itself.
        UnknownName (KeyError): a kind resembles an event of the library and is none.
    """
    items = as_items(given, name, "texts, such as ['move', 'tag']")
    kinds = tuple(as_name(kind, "what interrupts a deed") for kind in items)
    own = [kind for kind in kinds if kind in _OWN_EVENTS]
    if own:
        raise BadValue(
            f"{name} cannot have {own[0]!r}, an event of the deed itself. Name 'move', 'tag', or a kind of event that "
            "a rule emits."
        )
    for kind in kinds:
        if kind not in _INTERRUPTING and nearest(kind, _INTERRUPTING, _MISSPELLED):
            hint = " An event of your own needs a name that is less like this one."
            raise UnknownName(f"event in {name}:", kind, _INTERRUPTING, hint)
    return kinds


_INTERRUPTING = (
    "move", "tag", "eliminated", "respawned", "reach", "arrive", "take", "drop", "capture", "discover", "empty"
)  # fmt: skip # besides events of rules of the user
_MISSPELLED = 0.65  # how much, from 0 to 1, a name is like one of these


def _check_declaration(key: object, kind: object, name: str) -> Any:
    """Return the kind of a field, or a tuple of its choices."""
    if not isinstance(key, str) or not key.isidentifier():
        raise BadValue(f"A field of {name} is called by a name of letters, digits and _, not {shown(key)}.")
    if key in OF_DEED:
        raise BadValue(f"A field of {name} cannot be called {key!r}, which all deeds have. Use another name.")
    if isinstance(kind, str):
        if kind.removesuffix(_OPTIONAL) not in FIELD_KINDS:
            hint = nearest(kind, FIELD_KINDS) or f" Use one of: {', '.join(map(repr, FIELD_KINDS))}; or a list."
            raise BadValue(f"{name}[{key!r}] cannot be {kind!r}.{hint}")
        return kind
    if key in _KEYS and isinstance(kind, int | float | Mapping):
        raise BadValue(
            f"{name}[{key!r}] is no kind of field: for a deed that lasts, put its fields into fields, such as "
            "{'fields': {'bomb': 'node'}, 'turns': 4}."
        )
    if not isinstance(kind, Sequence) or not kind or any(describe_flaw(one) for one in kind):
        raise BadType(
            f"{name}[{key!r}] must be a kind of field, such as 'agent' or 'number', or a list of the values that it "
            f"may have, not {shown(kind)}."
        )
    return tuple(map(to_plain, kind))


def parse_field(kind: str | tuple[Any, ...]) -> DeclaredField:
    """Return the parsed declaration of a field."""
    if isinstance(kind, tuple):
        return DeclaredField("choice", kind, is_required=True)
    return _parse_kind(kind)


@cache
def _parse_kind(kind: str) -> DeclaredField:
    return DeclaredField(kind.removesuffix(_OPTIONAL), (), not kind.endswith(_OPTIONAL))


def check_wanted_deeds(given: object, declared: Mapping[str, Any], ctx: HostContext) -> dict[str, dict[str, Any]]:
    """Return the checked request of an agent: deed -> field -> plain value, in the declared order.

    Args:
        given: deed -> its fields; a deed with one required field accepts its value alone, and a deed without required
            fields accepts None or True.
        declared: the deeds of the game.
        ctx: the context, for the names of agents, nodes and so on.

    Raises:
        UnknownName (KeyError): a deed, field, agent, node or other name does not exist.
        BadType, BadValue: a field is missing or has an impossible value.
    """
    if not isinstance(given, Mapping):
        raise BadType(f"The deeds of an agent must be a dict from deeds to their fields, not {shown(given)}.")
    wanted = {}
    for deed, value in given.items():
        wanted[deed] = _check_fields(deed, value, get_fields(deed, declared), ctx)
    return wanted


def get_fields(deed: str, declared: Mapping[str, T]) -> T:
    """Return the declared fields of a deed.

    Raises:
        UnknownName (KeyError): the game does not declare the deed.
    """
    if deed not in declared:
        raise UnknownName("deed" if declared else "deed, as ctx.game.deeds declares none:", deed, declared)
    return declared[deed]


def _check_fields(deed: str, given: object, declared: Mapping[str, Any], ctx: HostContext) -> dict[str, Any]:
    fields = {key: parse_field(kind) for key, kind in declared.items()}
    values = _check_mapping(deed, given, [key for key, field in fields.items() if field.is_required])
    for key in values:
        as_known(key, f"field of the deed {deed!r}:", fields)
    checked = {}
    for key, field in fields.items():
        name = f"{key!r} of the deed {deed!r}"
        if values.get(key) is not None:
            checked[key] = check_value(values[key], field, name, ctx)
        elif field.is_required:
            raise make_missing_field_error(name, fields)
    return checked


def make_missing_field_error(name: str, fields: Iterable[str]) -> BadValue:
    """Return the error for a required field that is not given."""
    return BadValue(f"There is no {name}; it needs {_join_texts(fields)}.")


def _check_mapping(deed: str, given: object, required: list[str]) -> Mapping[Any, Any]:
    if isinstance(given, Mapping):
        return given
    if len(required) == 1:
        return {required[0]: given}
    if not required and (given is None or given is True):
        return {}
    needs = _join_texts(required) if required else "no field: give None"
    raise BadType(f"The deed {deed!r} needs {needs}, not {shown(given)}.")


def check_value(value: object, field: DeclaredField, name: str, ctx: HostContext) -> Any:
    """Return the value of a field as a plain value.

    Raises:
        UnknownName (KeyError), BadType, BadValue: it does not fit its kind, or is not one of the choices.
    """
    if field.kind != "choice":
        return FIELD_KINDS[field.kind](value, name, ctx)
    plain = _check_plain(value, name, ctx)
    if not any(is_same(plain, choice) for choice in field.choices):
        hint = nearest(value, field.choices) or f" Use one of: {_join_texts(field.choices)}."
        raise BadValue(f"{name} cannot be {shown(value)}.{hint}")
    return plain


def _join_texts(values: Iterable[object]) -> str:
    return ", ".join(map(shown, values))


# -- deeds as columns ---------------------------------------------------------------------------------------------

Check = Callable[[object, DeclaredField, str], Any]  # called with a value, its field, and its name in messages


def list_performed(state: GameState, *, is_moving: bool) -> list[Deed]:
    """Return the deeds of a turn, in the order of the agents' names, without those of agents that have left it.

    Args:
        state: the state of the game.
        is_moving: whether agents are about to move; then only their deeds count.
    """
    done = state.deed_log.list_rows_in_turn(state.row, state.turn + is_moving, is_moving=is_moving)
    moves = state.moves if done else None
    if moves is None:
        return []
    places = moves.order.index_of
    took_part = moves.took_part
    found = []
    for _, _, order, name, kind, _, _, fields in done:
        i = places.get(name)
        if i is not None and took_part[i]:
            found.append((i, order, name, kind, fields))
    found.sort(key=itemgetter(0, 1))
    slots = moves.slots
    starts = moves.starts
    return [Deed(name, slots[i].team, kind, starts[i], fields) for i, _, name, kind, fields in found]


def _check_integer(value: object, _: DeclaredField, name: str) -> int:
    return as_int(value, name)


class DeclaredDeeds:
    """The deeds that a game declares.

    Args:
        declared: deed -> its fields, as `ctx.game.deeds`.
        check: returns the checked plain value of a field, or raises; None: no deed is declared.
        names: (agents,) the names of the agents.
        streets: the graph.
        are_open: returns whether each edge, by id, is open in the game of the same index; None: `check` does that.

    Attributes:
        declared: deed -> its fields.
        lasting: deed -> how it lasts, for the deeds that last.
        numbering: what the numbers in these deeds mean.
    """

    def __init__(
        self,
        declared: Mapping[str, Mapping[str, Any]],
        check: Check | None,
        names: Sequence[str],
        streets: StreetGraph,
        are_open: Callable[[IntArray, IntArray], BoolArray] | None = None,
    ) -> None:
        self.declared = {deed: {key: parse_field(kind) for key, kind in of.items()} for deed, of in declared.items()}
        self.lasting = list_lasting(declared)
        self._check = check
        self._streets = streets
        kinds = {deed: {key: one.kind for key, one in of.items()} for deed, of in self.declared.items()}
        self.numbering = DeedNumbering(names, streets.columns.node_ids, kinds)
        self._are_open = are_open

    def check_deeds(
        self, deed: str, fields: Mapping[str, object], where: BoolArray, who: tuple[IntArray, IntArray],
        nodes: IntArray, order: int,
    ) -> ArrayDeeds:  # fmt: skip
        """Return the checked deeds of a call of `ArrayView.do` by agents on these nodes.

        `who` are the numbers of the games and of the agents; `order` is the number of the call.
        """
        known = self.get_fields(deed)
        for key in fields:
            as_known(key, f"field of the deed {deed!r}:", known)
        at, which = np.nonzero(where)
        values = {}
        for key, field in known.items():
            name = f"{key!r} of the deed {deed!r}"
            given = fields.get(key)
            if given is None and field.is_required:
                raise make_missing_field_error(name, known)
            column = self._check_column(given, field, name, where, (at, which))
            values[key] = column
            if field.kind == "edge" and self._are_open is not None:
                named = np.flatnonzero(column != np.array(None))
                edges = column[named].astype(np.int64)
                for edge in edges[~self._are_open(edges, who[0][at[named]])].tolist():
                    raise UnknownName(f"edge as {name}:", edge)
        return ArrayDeeds(deed, at, who[1][which], nodes[at, which], np.full(len(at), order), values)

    def get_fields(self, deed: str) -> Mapping[str, DeclaredField]:
        """Return the declared fields of a deed."""
        return get_fields(as_key(deed, "The name of a deed"), self.declared)

    def make_empty(self, deed: str) -> ArrayDeeds:
        """Return an empty table of deeds of a kind."""
        return self.make_arrays(deed, [])

    def make_arrays(self, kind: str, rows: Sequence[DeedRow]) -> ArrayDeeds:
        """Return deeds of one kind of plain functions as arrays, without those of other agents; their nodes are -1."""
        numbers = {name: number for number, name in enumerate(self.numbering.names)}
        known = [row for row in rows if row[3] in numbers]
        each = [(game, numbers[name], order, -1) for game, _, order, name, *_ in known]
        at, agents, order, nodes = np.array(each, np.int64).reshape(-1, 4).T
        return ArrayDeeds(kind, at, agents, nodes, order, self._make_columns(kind, [row[-1] for row in known]))

    def _make_columns(self, kind: str, each: Sequence[Mapping[str, Any]]) -> dict[str, Column]:
        """Return the values of plain fields as columns."""
        numbers: dict[str, Callable[[Any], int]] = {
            "agent": self.numbering.names.index,
            "node": lambda node: int(self._streets.rows(node)),
        }
        values: dict[str, Column] = {}
        for key, field in self.get_fields(kind).items():
            given = [fields.get(key) for fields in each]
            number = numbers.get(field.kind)
            if number is not None:
                values[key] = np.array([-1 if one is None else number(one) for one in given], np.int64)
                continue
            is_numeric = field.is_required and field.kind in _NUMERIC
            values[key] = np.empty(len(each), _NUMERIC[field.kind][1] if is_numeric else object)
            for i, one in enumerate(given):
                values[key][i] = one
        for key in ("since", "time") if kind in self.lasting else ():
            values[key] = np.array([fields[key] for fields in each], np.float64)
        return values

    def _check_column(
        self, given: object, field: DeclaredField, name: str, where: BoolArray, chosen: tuple[IntArray, IntArray]
    ) -> Column:
        """Return the checked values of a field for the chosen agents, (deeds,)."""
        if field.kind in _NUMBERED:
            return self._check_rows(-1 if given is None else given, field, name, where, chosen)
        if field.kind in _NUMERIC and given is not None and field.is_required:
            kinds, dtype = _NUMERIC[field.kind]
            values = np.asarray(given)
            if values.dtype.kind not in kinds:
                raise BadType(f"{name} must be of the kind {field.kind!r}, not {shown(given)}.")
            return as_one_shape({name: values}, where.shape)[0][chosen].astype(dtype)
        column = np.empty(len(chosen[0]), object)
        check = self._check
        if field.kind == "edge" and self._are_open is not None:
            check = _check_integer
        if given is None or check is None:
            return column
        if isinstance(given, np.ndarray):
            each = as_one_shape({name: given}, where.shape)[0][chosen].tolist()
            column[:] = [None if one is None else check(one, field, name) for one in each]
        else:
            column[:] = [check(given, field, name)] * len(column)
        return column

    def _check_rows(
        self, given: object, field: DeclaredField, name: str, where: BoolArray, chosen: tuple[IntArray, IntArray]
    ) -> Column:
        """Return the checked agent numbers or node rows of a field for the chosen agents, (deeds,)."""
        most = len(self.numbering.names if field.kind == "agent" else self._streets.counts)
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
