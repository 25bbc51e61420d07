"""The components of a context: named objects of users, their classes, and the effects of a recording on them.

Values are stored in one dict per object, `__recorded_component_`; the class gets a property per field and an `__init__`
that takes the name first.
"""

from collections.abc import Callable, Iterator, KeysView, Mapping
from dataclasses import dataclass
from typing import Any

from gamms.arguments import as_key, find_signature
from gamms.deciding import UNDECIDED, DecidePhase, Guarded, refuse_while_deciding
from gamms.errors import BadType, Duplicate, UnknownName
from gamms.recorder import struct_types
from gamms.recorder.errors import RecordingError, report_damage
from gamms.recorder.struct_types import FieldType
from gamms.text import find_main_module, find_module, shown
from gamms.typing import IContext
from gamms.typing.recorder import C

Key = tuple[str, str]  # module and qualified name of a class

STORE = "__recorded_component_"
_KIND = "__recorded_class_"


@dataclass(frozen=True, slots=True)
class ComponentKind:
    """A component class: its fields in order, and the `__init__` of its author."""

    cls: Any  # a class
    fields: dict[str, FieldType]
    original_init: Callable[..., None]

    @property
    def key(self) -> Key:
        """The key of the class in the registry."""
        return find_module(self.cls), self.cls.__qualname__

    def begin(self, component: object, name: object) -> None:
        """Set the name of a component, and all its fields to None."""
        object.__setattr__(component, STORE, {**dict.fromkeys(self.fields), "name": name})


Recorded = tuple[set[Key], dict[Any, tuple[Key, dict[str, Any]]]]  # classes; name -> (class, values) of components
OnEvent = Callable[[str, dict[str, Any]], None]  # called with the name of an operation code, and its data

_MOST_CLASSES = 10_000  # limit of classes in a recording
_MOST_FIELDS = 1_000
_IMPOSSIBLE = "The recording declares an impossible component class"


class Components(Guarded):
    """Components by name and component classes by module and qualified name.

    Each operation is checked first, then reported to `on_event`, then performed: if the report fails, nothing changes.
    """

    _called = "ctx.record"

    def __init__(self, on_event: OnEvent, phase: DecidePhase = UNDECIDED) -> None:
        self._phase = phase
        self._on_event = on_event
        self._component_registry: dict[Key, type] = {}
        self._components: dict[Any, Any] = {}
        self._classes: dict[Key, ComponentKind] = {}  # registered classes, and those unregistered since
        self._built = 0
        self._is_silent = False  # while a recording creates a component, whose next records follow in the file

    # -- interface of 1.0.0
    # ---------------------------------------------------------------------------------------

    @refuse_while_deciding
    def component(self, struct: Mapping[str, object] | None) -> Callable[[C], C]:
        """Return a class decorator: each field of the struct, a dict of names to types, is recorded when it is set.

        A field is None until it is set; new values are not checked. Types: int, float, str, bool, None, Optional,
        Union, tuple[...] and list[...] of these.

        Raises:
            BadType (TypeError): the struct or the class is not suitable; raised when the class is decorated.
        """

        def decorate(cls: C) -> C:
            if struct is None:
                print("The struct is None: nothing of this class is recorded.")  # noqa: T201 - published behaviour
                return cls
            if not isinstance(struct, Mapping):
                raise BadType(f"The struct of a component must be a dict of field names to types, not {shown(struct)}.")
            fields = {check_name(name): struct_types.parse_hint(hint).make_optional() for name, hint in struct.items()}
            check_class(cls, fields)
            self._register(cls, fields, {name: str(field) for name, field in fields.items()})
            return cls

        return decorate

    def get_component(self, name: object) -> Any:
        """Return a component by name.

        Raises:
            UnknownName (KeyError): the component does not exist.
        """
        try:
            return self._components[name]
        except (KeyError, TypeError):
            raise UnknownName("component", name, self._components) from None

    @refuse_while_deciding
    def delete_component(self, name: object) -> None:
        """Delete a component; the object continues to exist, but is not recorded.

        Raises:
            UnknownName (KeyError): the component does not exist.
        """
        if _find_kind(self.get_component(name), name):
            self._on_event("COMPONENT_DELETE", {"name": name})
        del self._components[name]

    def component_iter(self) -> KeysView[Any]:
        """Return the names of all components."""
        return self._components.keys()

    @refuse_while_deciding
    def add_component(self, name: object, obj: object) -> None:
        """Store any object under a name. A deleted component that is added again is recorded again.

        Raises:
            Duplicate (ValueError): the name is taken.
        """
        if as_key(name, "The name of a component") in self._components:
            raise Duplicate("a component", name)
        if _find_kind(obj, name):
            for event in _list_events(obj):
                self._on_event(*event)
        self._components[name] = obj

    def is_component_registered(self, key: Key) -> bool:
        """Return whether a class is registered, by module and qualified name."""
        return _as_class_key(key) in self._component_registry

    @refuse_while_deciding
    def unregister_component(self, key: Key) -> None:
        """Unregister a class; its components stay.

        Raises:
            UnknownName (KeyError): the class is not registered.
        """
        key = _as_class_key(key)
        if key not in self._component_registry:
            raise UnknownName("component class", key)
        self._on_event("COMPONENT_UNREGISTER", {"key": list(key)})
        del self._component_registry[key]

    def get_recorded(self) -> Recorded:
        """Return the present state, for `list_events_since`."""
        kinds = {name: _find_kind(one, name) for name, one in self._components.items()}
        values = {name: dict(getattr(self._components[name], STORE)) for name, kind in kinds.items() if kind}
        return set(self._component_registry), {name: (kind.key, values[name]) for name, kind in kinds.items() if kind}

    def make_keyframe(self) -> dict[str, Any]:
        """Return the part of a keyframe: `classes`, each with the names of its fields, and all `values` by name."""
        return {
            "classes": [[*key, list(kind.fields)] for key, kind in self._classes.items()],
            "values": {
                name: {field: value for field, value in values.items() if field != "name"}
                for name, (_, values) in self.get_recorded()[1].items()
            },
        }

    def list_events_since(self, known: Recorded) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield the events between a result of `get_recorded` and the present state."""
        classes, components = known
        now = self.get_recorded()[1]
        gone = [name for name, (key, _) in components.items() if name not in now or now[name][0] != key]
        new = [name for name in now if name not in components or name in gone]
        needed = {now[name][0] for name in new}
        yield from (("COMPONENT_DELETE", {"name": name}) for name in gone)
        for key, kind in self._classes.items():
            if key not in classes and (key in self._component_registry or key in needed):
                yield (
                    "COMPONENT_REGISTER",
                    _make_registration(key, {name: str(one) for name, one in kind.fields.items()}),
                )
        for name, (_, values) in now.items():
            yield from (
                _list_events(self._components[name]) if name in new else _list_updates(values, components[name][1])
            )
        for key in self._classes:
            if key in classes | needed and key not in self._component_registry:
                yield "COMPONENT_UNREGISTER", {"key": list(key)}

    # -- called by components
    # -------------------------------------------------------------------------------------

    def begin(self, component: object, name: object) -> None:
        """Add a new component.

        Raises:
            Duplicate (ValueError): the name is taken; nothing was reported.
        """
        if self._is_silent:
            return
        if as_key(name, "The name of a component") in self._components:
            raise Duplicate("a component", name)
        self._keep(name, component)

    def _keep(self, name: object, component: Any) -> None:
        kind = get_kind(component)
        assert kind is not None  # noqa: S101 - only components come here
        self._on_event("COMPONENT_CREATE", {"name": name, "type": list(kind.key)})
        self._components[name] = component

    def abandon(self, component: object) -> None:
        """Remove a component whose `__init__` failed."""
        name = getattr(component, STORE)["name"]
        if self._components.get(name) is component:
            self.delete_component(name)

    def assign(self, component: object, field: str, value: object) -> None:
        """Set a field, and report it."""
        store = getattr(component, STORE)
        kind = get_kind(component)
        if kind is not None:
            value = kind.fields[field].convert(value)
        if not self._is_silent and self._components.get(store["name"]) is component:
            self._on_event("COMPONENT_UPDATE", _update(store["name"], field, value))
        store[field] = value

    # -- called for recordings
    # ------------------------------------------------------------------------------------

    @refuse_while_deciding
    def apply(self, opcode_name: str, data: dict[str, Any], *, lenient: bool = False) -> None:
        """Apply a record of one of the five operation codes. Nothing is imported or evaluated.

        Only declared fields are set, to plain values of any type: games do not check types, either.

        Args:
            opcode_name: for example "COMPONENT_CREATE".
            data: data of the record.
            lenient: for recordings of 1.0.0, which wrote records before checking them: skip operations that it refused
                (a second component with the same name, operations on unknown components).

        Raises:
            RecordingError: the record cannot be applied; nothing changed.
        """
        doing = _APPLIED.get(opcode_name)
        if doing is None or not isinstance(data, dict):
            raise RecordingError(f"{shown(opcode_name)} is not an operation on components, or its data are not a map.")
        doing(self, data, lenient)

    def _apply_register(self, data: dict[str, Any], lenient: bool) -> None:
        key = _get_key(data, "key")
        struct = data.get("struct", {})
        if not isinstance(struct, dict) or len(struct) > _MOST_FIELDS:
            raise RecordingError(f"A component class is declared without a map with at most {_MOST_FIELDS} fields.")
        with report_damage(_IMPOSSIBLE, (BadType,)):
            fields = {check_name(name): struct_types.parse(text) for name, text in struct.items()}
        kind = self._classes.get(key)
        is_other = kind is not None and kind.fields != fields
        if kind is None or (is_other and key not in self._component_registry):
            self._build(key, fields, struct)
            return
        if is_other and not lenient:
            raise RecordingError(f"The component class {key} has other fields here than in the recording.")
        self._on_event("COMPONENT_REGISTER", _make_registration(key, struct))
        self._component_registry.setdefault(key, kind.cls)

    def _build(self, key: Key, fields: dict[str, FieldType], texts: dict[str, str]) -> None:
        if self._built >= _MOST_CLASSES:
            raise RecordingError(f"The recording declares more than {_MOST_CLASSES} component classes.")
        module, qualname = key
        cls = type(qualname.rpartition(".")[2] or qualname, (), {"__module__": module, "__qualname__": qualname})
        with report_damage(_IMPOSSIBLE, (BadType,)):
            check_class(cls, fields)
        self._built += 1
        self._register(cls, fields, texts)

    def _apply_create(self, data: dict[str, Any], lenient: bool) -> None:
        name = _get_name(data)
        key = _get_key(data, "type")
        if key not in self._classes:
            raise RecordingError(f"The recording creates a component of the unknown class {key}.")
        if name in self._components:
            if lenient:
                return
            raise RecordingError(f"The recording creates a second component named {shown(name)}.")
        self._keep(name, self._make_component(self._classes[key], name))

    def _make_component(self, kind: ComponentKind, name: object) -> Any:
        """Return a component with all fields None; calls its author's `__init__` if this needs no arguments."""
        self._is_silent = True
        try:
            with report_damage(f"The component {shown(name)} of class {kind.key} cannot be made", (Exception,)):
                component = kind.cls.__new__(kind.cls)
                kind.begin(component, name)
                if is_without_arguments(kind.original_init):
                    kind.original_init(component)
                kind.begin(component, name)
                return component
        finally:
            self._is_silent = False

    def _apply_update(self, data: dict[str, Any], lenient: bool) -> None:
        name = _get_name(data)
        field = data.get("key")
        if name not in self._components and lenient:
            return
        kind = _find_kind(self._components.get(name), name)
        if kind is None:
            raise RecordingError(f"The recording changes {shown(name)}, which is not a recorded component.")
        if not isinstance(field, str) or field not in kind.fields:
            raise RecordingError(f"The recording sets {shown(field)} of {shown(name)}, no field of {kind.key}.")
        self.assign(self._components[name], field, data.get("value"))

    def _apply_delete(self, data: dict[str, Any], lenient: bool) -> None:
        name = _get_name(data)
        if name in self._components:
            self.delete_component(name)
        elif not lenient:
            raise RecordingError(f"The recording deletes the unknown component {shown(name)}.")

    def _apply_unregister(self, data: dict[str, Any], lenient: bool) -> None:
        key = _get_key(data, "key")
        if key in self._component_registry:
            self.unregister_component(key)
        elif not lenient:
            raise RecordingError(f"The recording unregisters the unknown component class {key}.")

    # -- private
    # --------------------------------------------------------------------------------------------------

    @refuse_while_deciding
    def _register(self, cls: Any, fields: dict[str, FieldType], texts: dict[str, str]) -> None:
        """Make a checked class a component; of two classes with the same key and fields the first is kept."""
        kind = ComponentKind(cls, fields, cls.__init__)
        key = kind.key
        is_known = key in self._component_registry
        is_same = is_known and self._classes[key].fields == fields
        if is_known and not is_same:
            self._on_event("COMPONENT_UNREGISTER", {"key": list(key)})
            del self._component_registry[key]
        if not is_same:
            self._on_event("COMPONENT_REGISTER", _make_registration(key, texts))
            self._component_registry[key] = cls
            self._classes[key] = kind
        for field in fields:
            setattr(cls, field, _make_property(field, self))
        cls.name = property(lambda component: getattr(component, STORE)["name"], doc="The name of the component.")
        cls.__init__ = _make_init(kind, self)
        setattr(cls, _KIND, kind)


_APPLIED: dict[str, Callable[[Components, dict[str, Any], bool], None]] = {
    "COMPONENT_REGISTER": Components._apply_register,
    "COMPONENT_CREATE": Components._apply_create,
    "COMPONENT_UPDATE": Components._apply_update,
    "COMPONENT_DELETE": Components._apply_delete,
    "COMPONENT_UNREGISTER": Components._apply_unregister,
}


# -- events -------------------------------------------------------------------------------------------------------


def _as_class_key(key: object) -> Key:
    if not isinstance(key, (tuple, list)) or [type(part) for part in key] != [str, str]:
        raise BadType(f"A component class is named by (cls.__module__, cls.__qualname__), not {shown(key)}.")
    return find_main_module(key[0]), key[1]


def _make_registration(key: Key, texts: dict[str, str]) -> dict[str, Any]:
    return {"key": list(key), "struct": dict(texts)}


def _update(name: object, field: str, value: object) -> dict[str, Any]:
    return {"name": name, "key": field, "value": list(value) if isinstance(value, list) else value}


def _list_events(component: object) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the events that create this component."""
    kind = get_kind(component)
    store = getattr(component, STORE)
    assert kind is not None  # noqa: S101 - only components come here
    yield "COMPONENT_CREATE", {"name": store["name"], "type": list(kind.key)}
    yield from _list_updates(store, dict.fromkeys(store, None))


def _list_updates(values: dict[str, Any], before: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the events that change the values `before` to `values`."""
    for field, value in values.items():
        if field != "name" and value is not before[field] and repr(value) != repr(before[field]):
            yield "COMPONENT_UPDATE", _update(values["name"], field, value)


# -- data of records ----------------------------------------------------------------------------------------------


def _get_name(data: dict[str, Any]) -> Any:
    name = data.get("name")
    if "name" not in data or not (name is None or isinstance(name, str | int | float)):
        raise RecordingError("A record does not name a component.")
    return name


def _get_key(data: dict[str, Any], part: str) -> Key:
    key = data.get(part)
    if not isinstance(key, list | tuple) or len(key) != 2 or not all(isinstance(one, str) for one in key):
        raise RecordingError("A record does not name a component class by module and qualified name.")
    module, qualname = key
    if not (module + qualname).isprintable() or not qualname or len(module + qualname) > 1000:
        raise RecordingError("A record names an invalid component class.")
    return find_main_module(module), qualname


# -- classes ------------------------------------------------------------------------------------------------------


def get_kind(component: object) -> ComponentKind | None:
    """Return the kind of a component; None for other objects."""
    return getattr(type(component), _KIND, None) if STORE in getattr(component, "__dict__", ()) else None


def _find_kind(component: object, name: object) -> ComponentKind | None:
    """Return the kind of an object that is recorded under this name, else None."""
    kind = get_kind(component)
    return kind if kind is not None and getattr(component, STORE)["name"] == name else None


def check_name(name: object) -> str:
    """Return the checked name of a field.

    Raises:
        BadType (TypeError): the name is not a text, or is reserved.
    """
    if not isinstance(name, str):
        raise BadType(f"The name of a field must be a str, not {shown(name)}.")
    if name in ("name", STORE, _KIND) or (name.startswith("__") and name.endswith("__")):
        raise BadType(f"A field cannot be called {shown(name)}: the name is reserved. Choose another.")
    return name


def check_class(cls: object, fields: Mapping[str, FieldType]) -> None:
    """Check that a class can become a component.

    Raises:
        Return the numbers of the events in turns `first` to `last - 1`, optionally only of some kinds.
    """
    if not isinstance(cls, type):
        raise BadType(f"Only a class can be a component, not {shown(cls)}.")
    if not cls.__dictoffset__:
        raise BadType(f"{cls.__qualname__} has __slots__ and no __dict__: a component needs one for its fields.")
    taken = [field for field in fields if hasattr(cls, field)]
    if taken:
        raise BadType(f"{cls.__qualname__} already has an attribute {taken[0]!r}. Name the field differently.")
    if "name" in _list_parameters(cls):
        raise BadType(
            f"The __init__ of {cls.__qualname__} has a parameter 'name', which is reserved: a component takes its name "
            "as the first argument, before those of its own __init__. Call the parameter differently."
        )


def is_without_arguments(init: Callable[..., None]) -> bool:
    """Return whether an `__init__` can be called without arguments."""
    try:
        find_signature(init).bind(object())
    except (TypeError, ValueError):
        return False
    return True


def _list_parameters(cls: type[Any]) -> Mapping[str, Any]:
    try:
        return find_signature(cls.__init__).parameters
    except ValueError:  # for a class not written in Python
        return {}


def _make_property(field: str, components: Components) -> property:
    def get(self: object) -> Any:
        value = getattr(self, STORE)[field]
        # a copy, because changes of the list itself are not recorded
        return list(value) if isinstance(value, list) else value

    def put(self: object, value: object) -> None:
        components.assign(self, field, value)

    return property(get, put, doc=f"The recorded field {shown(field)}; a list is handed out as a copy.")


def _make_init(kind: ComponentKind, components: Components) -> Callable[..., None]:
    def __init__(self: object, name: object, *args: object, **kwargs: object) -> None:  # noqa: N807 - it becomes the method
        kind.begin(self, name)
        components.begin(self, name)
        try:
            kind.original_init(self, *args, **kwargs)
        except BaseException:
            components.abandon(self)
            raise

    return __init__


# -- functions of 1.0.0 -------------------------------------------------------------------------------------------


def component(ctx: IContext, struct: Mapping[str, object] | None = None) -> Callable[[C], C]:
    """Return a class decorator; equal to `ctx.record.component(struct)`."""
    return ctx.record.component(struct)


def check_validity(data_type: object) -> None:
    """Check the type of a field of a component.

    Raises:
        BadType (TypeError): the type is not allowed.
    """
    if data_type is None:
        raise BadType("The type of a field cannot be None alone. Use Optional[...] of another type.")
    struct_types.parse_hint(data_type)
