"""Deeds, which are actions other than moves: their declarations, and checks of requests."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

from gamms.arguments import as_bool, as_float, as_int, as_key, as_known, as_mapping, as_text
from gamms.errors import BadType, BadValue, UnknownName, nearest
from gamms.ir.graph import as_node_id
from gamms.plain import is_same, to_plain, why_not_plain
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing.context import HostContext

T = TypeVar("T")
OF_DEED = ("turn", "agent", "deed", "at")
"""Keys of every deed; declared fields must have other names."""

_OPTIONAL = "?"  # ends the kind of a field that may be missing


def _agent(value: object, name: str, ctx: HostContext) -> Any:
    return _known(as_text(getattr(value, "name", value), name), "agent", name, ctx.agent.agents)


def _team(value: object, name: str, ctx: HostContext) -> Any:
    return _known(as_key(value, name), "team", name, ctx.agent.teams)


def _node(value: object, name: str, ctx: HostContext) -> int:
    node = as_node_id(value, name, ctx.graph)
    return node if ctx.graph.graph.has_node(node) else _known(node, "node", name, ())


def _edge(value: object, name: str, ctx: HostContext) -> int:
    try:
        return int(ctx.graph.graph.get_edge(as_int(value, name)).id)
    except KeyError:
        return int(_known(value, "edge", name, ()))


def _sensor(value: object, name: str, ctx: HostContext) -> Any:
    return _known(as_text(value, name), "sensor", name, ctx.sensor.sensors)


def _known(value: Any, kind: str, name: str, known: Collection[Any]) -> Any:
    """Return a value if it is in `known` (UnknownName)."""
    return as_known(value, f"{kind} as {name}:", known)


def _plain(value: object, name: str, _: HostContext) -> Any:
    flaw = why_not_plain(value)
    if flaw:
        raise BadType(f"{name} must be a plain value, such as numbers, texts, lists and dicts of these: {flaw}.")
    return to_plain(value)


FIELD_KINDS: dict[str, Callable[[Any, str, HostContext], Any]] = {
    "agent": _agent,
    "team": _team,
    "node": _node,
    "edge": _edge,
    "sensor": _sensor,
    "integer": lambda value, name, _: as_int(value, name),
    "number": lambda value, name, _: as_float(value, name),
    "boolean": lambda value, name, _: as_bool(value, name),
    "text": lambda value, name, _: as_text(value, name),
    "value": _plain,
}
"""Kind of field -> a function that checks a value."""


class DeclaredField(NamedTuple):
    """A field of a deed: its kind, its choices if the kind is "choice", and whether it is required."""

    kind: str
    choices: tuple[Any, ...]
    is_required: bool


def as_deeds(value: object) -> Mapping[str, Mapping[str, Any]]:
    """Return declared deeds as a read-only mapping: deed -> field -> its kind, or a tuple of choices.

    Raises:
        BadType, BadValue: a declaration is invalid.
    """
    declared = {}
    for deed, fields in as_mapping(value, "ctx.game.deeds").items():
        name = f"ctx.game.deeds[{shown(deed)}]"
        if not isinstance(deed, str) or not deed.isidentifier():
            raise BadValue(f"A deed is called by a name of letters, digits and _, not {shown(deed)}.")
        given = {} if fields is None else as_mapping(fields, name)
        declared[deed] = ReadOnlyMapping({key: _declaration(key, kind, name) for key, kind in given.items()})
    return ReadOnlyMapping(declared)


def _declaration(key: object, kind: object, name: str) -> Any:
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
    if not isinstance(kind, Sequence) or not kind or any(why_not_plain(one) for one in kind):
        raise BadType(
            f"{name}[{key!r}] must be a kind of field, such as 'agent' or 'number', or a list of the values that it "
            f"may have, not {shown(kind)}."
        )
    return tuple(map(to_plain, kind))


def field_of(kind: str | tuple[Any, ...]) -> DeclaredField:
    """Return the parsed declaration of a field."""
    if isinstance(kind, tuple):
        return DeclaredField("choice", kind, is_required=True)
    return DeclaredField(kind.removesuffix(_OPTIONAL), (), not kind.endswith(_OPTIONAL))


def wanted_deeds(given: object, declared: Mapping[str, Any], ctx: HostContext) -> dict[str, dict[str, Any]]:
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
        wanted[deed] = _checked_fields(deed, value, fields_of(deed, declared), ctx)
    return wanted


def fields_of(deed: str, declared: Mapping[str, T]) -> T:
    """Return the declared fields of a deed.

    Raises:
        UnknownName (KeyError): the game does not declare the deed.
    """
    if deed not in declared:
        raise UnknownName("deed" if declared else "deed, as ctx.game.deeds declares none:", deed, declared)
    return declared[deed]


def _checked_fields(deed: str, given: object, declared: Mapping[str, Any], ctx: HostContext) -> dict[str, Any]:
    fields = {key: field_of(kind) for key, kind in declared.items()}
    values = _by_field(deed, given, [key for key, field in fields.items() if field.is_required])
    for key in values:
        as_known(key, f"field of the deed {deed!r}:", fields)
    checked = {}
    for key, field in fields.items():
        name = f"{key!r} of the deed {deed!r}"
        if values.get(key) is not None:
            checked[key] = checked_value(values[key], field, name, ctx)
        elif field.is_required:
            raise missing_field(name, fields)
    return checked


def missing_field(name: str, fields: Iterable[str]) -> BadValue:
    """Return the error for a required field that is not given."""
    return BadValue(f"There is no {name}; it needs {_listed(fields)}.")


def _by_field(deed: str, given: object, required: list[str]) -> Mapping[Any, Any]:
    if isinstance(given, Mapping):
        return given
    if len(required) == 1:
        return {required[0]: given}
    if not required and (given is None or given is True):
        return {}
    needs = _listed(required) if required else "no field: give None"
    raise BadType(f"The deed {deed!r} needs {needs}, not {shown(given)}.")


def checked_value(value: object, field: DeclaredField, name: str, ctx: HostContext) -> Any:
    """Return the value of a field as a plain value.

    Raises:
        UnknownName (KeyError), BadType, BadValue: it does not fit its kind, or is not one of the choices.
    """
    if field.kind != "choice":
        return FIELD_KINDS[field.kind](value, name, ctx)
    plain = _plain(value, name, ctx)
    if not any(is_same(plain, choice) for choice in field.choices):
        hint = nearest(value, field.choices) or f" Use one of: {_listed(field.choices)}."
        raise BadValue(f"{name} cannot be {shown(value)}.{hint}")
    return plain


def _listed(values: Iterable[object]) -> str:
    return ", ".join(map(shown, values))
