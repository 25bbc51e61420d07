"""The sensor engine: creates sensors and stores them by name."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from copy import deepcopy
from itertools import filterfalse
from math import inf, tau
from typing import Any, Literal, NamedTuple, TypeGuard, Unpack, overload

from gamms.arguments import as_declared, as_mapping, as_member, as_name
from gamms.compat import Surface
from gamms.core.copies import ONLY_PLAIN, NotPlain, copy_deep
from gamms.deciding import ContextPart, Guarded, copy_part, get_phase, refuse_to_judges
from gamms.errors import ContextTerminated, Duplicate, UnknownName, UnknownType, nearest
from gamms.progress import delay_interrupts
from gamms.readonly import ReadOnlyMapping
from gamms.sensor.air import AerialAgentSensor, AerialSensor
from gamms.sensor.catalog import KINDS, SHARED_KEYWORDS, SYNONYMS
from gamms.sensor.detection import DetectingSensor
from gamms.sensor.function import FunctionSensor
from gamms.sensor.ground import AgentSensor, MapSensor, NeighborSensor, OccludedAgentSensor, OccludedMapSensor
from gamms.sensor.nearby import SensorCaches
from gamms.sensor.sensor import Sensor
from gamms.sensor.sighting_errors import forget_delayed
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.sensor_engine import (
    ISensor,
    ISensorEngine,
    SensorDeclaration,
    SensorOptions,
    SensorType,
    find_owner,
    get_kind,
    refuse_no_sensor,
)

_ALL_ROUND = tau + 0.1  # larger angles are in degrees by mistake, not rounding errors

# Sensor types by their class, for type checkers.
_Neighbor = Literal[SensorType.NEIGHBOR]
_Map = Literal[SensorType.MAP, SensorType.RANGE, SensorType.ARC]
_OccludedMap = Literal[SensorType.OCCLUDED_MAP]
_Agent = Literal[SensorType.AGENT, SensorType.AGENT_RANGE, SensorType.AGENT_ARC]
_OccludedAgent = Literal[SensorType.OCCLUDED_AGENT]
_Aerial = Literal[SensorType.AERIAL, SensorType.OCCLUDED_AERIAL]
_AerialAgent = Literal[SensorType.AERIAL_AGENT, SensorType.OCCLUDED_AERIAL_AGENT]


class SensorSettings(NamedTuple):
    """The sensors and their settings at one moment."""

    sensors: tuple[Any, ...]
    owners: tuple[str | None, ...]
    keywords: tuple[dict[str, Any] | None, ...]  # None: a custom class
    simple: tuple[Sensor, ...]  # sensors whose only state is the data they have shown
    # for each other sensor, functions that return and restore its state
    memories: tuple[tuple[Callable[[], Any], Callable[[Any], None]], ...]


class SensorsSnapshot(NamedTuple):
    """The sensors at one moment."""

    settings: SensorSettings
    shown: list[Any]  # data and place of each simple sensor
    sensed: list[Any]  # state of the other sensors


class SensorEngine(Surface, ContextPart, ISensorEngine):
    """The sensors of one context."""

    _called = "ctx.sensor"

    def __init__(self, ctx: IContext) -> None:
        self._phase = get_phase(ctx)
        self.ctx = ctx
        self._sensors: dict[str, ISensor] = {}
        self._warned: set[tuple[SensorType, str]] = set()
        self._storage = SensorStorage(self)

    @property
    def sensors(self) -> dict[str, ISensor]:  # type: ignore[override] # an attribute, in the contract
        """The sensors by name; read-only while agents decide."""
        is_open = not self._phase.is_deciding
        return self._sensors if is_open else ReadOnlyMapping(self._sensors)  # type: ignore[return-value] # it reads like it

    def __repr__(self) -> str:
        kinds = Counter(sensor.type.name for sensor in self._sensors.values())
        return f"SensorEngine({', '.join(f'{number} {kind}' for kind, number in kinds.items())})"

    @property
    def storage(self) -> "SensorStorage":
        """Operations of other engines on the sensors; not for strategies."""
        self._phase.refuse_look("use ctx.sensor.storage")
        return self._storage

    @overload
    def create_sensor(
        self, sensor_id: str, sensor_type: _Neighbor, **options: Unpack[SensorOptions]
    ) -> NeighborSensor: ...
    @overload
    def create_sensor(self, sensor_id: str, sensor_type: _Map, **options: Unpack[SensorOptions]) -> MapSensor: ...
    @overload
    def create_sensor(
        self, sensor_id: str, sensor_type: _OccludedMap, **options: Unpack[SensorOptions]
    ) -> OccludedMapSensor: ...
    @overload
    def create_sensor(self, sensor_id: str, sensor_type: _Agent, **options: Unpack[SensorOptions]) -> AgentSensor: ...
    @overload
    def create_sensor(
        self, sensor_id: str, sensor_type: _OccludedAgent, **options: Unpack[SensorOptions]
    ) -> OccludedAgentSensor: ...
    @overload
    def create_sensor(self, sensor_id: str, sensor_type: _Aerial, **options: Unpack[SensorOptions]) -> AerialSensor: ...
    @overload
    def create_sensor(
        self, sensor_id: str, sensor_type: _AerialAgent, **options: Unpack[SensorOptions]
    ) -> AerialAgentSensor: ...
    @overload
    def create_sensor(
        self, sensor_id: str, sensor_type: SensorType | str | None = None, **options: Unpack[SensorOptions]
    ) -> Sensor: ...
    @refuse_to_judges
    @as_declared(ISensorEngine.create_sensor)
    def create_sensor(
        self, sensor_id: str, sensor_type: SensorType | str | None = None, **options: Unpack[SensorOptions]
    ) -> Sensor:
        """Create and store a built-in sensor; the contract explains the keywords."""
        synonym = options.pop("type", None)
        sensor_type = _check_type(synonym if sensor_type is None else sensor_type, sensor_id)
        kind = KINDS[sensor_type]
        self._refuse_name(sensor_id)
        sensor = kind.create(self.ctx, sensor_id, sensor_type, options)  # type: ignore[arg-type] # a dict
        if options:
            self._warn_of_ignored(sensor_id, sensor_type, options.keys() - kind.list_names() - SHARED_KEYWORDS)
            fov = options.get("fov")
            if isinstance(fov, float | int) and _ALL_ROUND < fov < inf:
                self.ctx.logger.warning(
                    f"Sensor {sensor_id!r} sees everything: fov={fov} is in radians. Did you mean math.radians({fov})?"
                )
        self._keep(sensor)
        return sensor

    @refuse_to_judges
    def from_function(self, sensor_id: str, fn: Callable[..., Any]) -> FunctionSensor:
        """Create and store a sensor whose `data` is the result of a function."""
        self._refuse_name(sensor_id)
        sensor = FunctionSensor(self.ctx, sensor_id, fn)
        self._keep(sensor)
        return sensor

    @refuse_to_judges
    def from_declaration(self, sensor_id: str, declaration: SensorDeclaration) -> Sensor:
        """Create the sensor that a factory such as `gamms.sensor.agent_range` declares, and keep it."""
        given = {
            as_name(key, "a declared keyword"): value for key, value in as_mapping(declaration, "declaration").items()
        }
        known = self._sensors.get(sensor_id)
        if known is not None and find_owner(known) is None:
            self.delete_sensor(sensor_id)
        if "function" in given:
            function: Any = given["function"]
            return self.from_function(sensor_id, function)
        options: Any = {"sensor_type": None, **given}
        created: Sensor = self.create_sensor(sensor_id, **options)
        return created

    @refuse_to_judges
    def add_sensor(self, sensor: ISensor) -> None:
        """Store a sensor under its own name."""
        refuse_no_sensor(sensor)
        self._refuse_name(sensor.sensor_id)
        self._keep(sensor)

    @refuse_to_judges
    def delete_sensor(self, sensor_id: str) -> None:
        """Remove a sensor from its agents and from the engine; its name becomes free."""
        sensor = self.get_sensor(sensor_id)
        with delay_interrupts(at_most_once=True):
            for agent in self.ctx.agent.create_iter():
                carried: Mapping[str, ISensor] = getattr(agent, "sensors", {})
                for name in [name for name, one in carried.items() if one is sensor]:
                    agent.deregister_sensor(name)
            del self._sensors[sensor_id]
            self._phase.change_sensors()
            forget_delayed(self.ctx, sensor_id)

    def get_sensor(self, sensor_id: str) -> ISensor:
        """Return a sensor by name (KeyError)."""
        try:
            return self._sensors[sensor_id]
        except (KeyError, TypeError):
            raise UnknownName("sensor", sensor_id, self._sensors) from None

    @refuse_to_judges
    def custom(self, name: str) -> Callable[[type], type]:
        """Return a decorator for the class of a custom kind of sensor, `SensorType.<name>`.

        Raises:
            BadValue: the name is not an identifier, or is reserved by enums.
        """
        if as_name(name, "a kind of sensor") in SensorType.__members__:
            self.ctx.logger.warning(f"SensorType.{name} exists already and is used again.")
        member = get_kind(name)

        def decorate(cls: type) -> type:
            # The type of a built-in parent class is ignored; duck-typed classes count as sensors from now
            # on.
            cls.type = property(lambda _: member, lambda _, __: None)  # type: ignore[attr-defined] # ISensor's property
            ISensor.register(cls)
            if "type" in getattr(cls, "__abstractmethods__", ()):
                cls.__abstractmethods__ = cls.__abstractmethods__ - {"type"}  # type: ignore[attr-defined] # an ABC has it
            return cls

        return decorate

    @refuse_to_judges
    def terminate(self) -> None:
        """Close the engine; sensors stay readable."""

    def _warn_of_ignored(self, sensor_id: str, kind: SensorType, ignored: Iterable[str]) -> None:
        """Warn about keywords that a kind ignores, once for each kind and keyword."""
        for name in sorted(ignored):
            if (kind, name) not in self._warned:
                self._warned.add((kind, name))
                self.ctx.logger.warning(
                    f"Sensor {sensor_id!r}: {kind.name} ignores {name}=.{_suggest_keyword(kind, name)}"
                )

    def _keep(self, sensor: ISensor) -> None:
        self._sensors[sensor.sensor_id] = sensor
        self._phase.change_sensors()

    def _refuse_name(self, sensor_id: str) -> None:
        if self.ctx.is_terminated():
            raise ContextTerminated("ctx.sensor")
        if as_name(sensor_id, "a sensor") in self._sensors:
            raise Duplicate("a sensor", sensor_id)


class SensorStorage(Guarded):
    """Operations of other engines on the sensors of a context: describe, restore and copy.

    Attributes:
        memory: the caches shared by the built-in sensors.
    """

    _called = "ctx.sensor.storage"

    def __init__(self, engine: SensorEngine) -> None:
        self._engine = engine
        self._phase = get_phase(engine.ctx)
        self.memory = SensorCaches(engine.ctx)
        self._settings_now: SensorSettings | None = None
        self._changes = -1, -1  # change counters at the last look-up of the settings

    def describe_sensors(self) -> list[dict[str, Any]]:
        """Return `id` and `type` of every sensor, and for built-in kinds the `keywords` that create it."""
        described: list[dict[str, Any]] = []
        for sensor_id, sensor in self._engine._sensors.items():
            kind = KINDS.get(sensor.type)
            is_ours = kind is None or kind.is_of(sensor)
            keywords = kind.list_keywords(sensor) if kind is not None and is_ours else {}
            type_name = (sensor.type if is_ours else SensorType.CUSTOM).name
            described.append({"id": sensor_id, "type": type_name, "keywords": keywords})
        return described

    def put(self, described: Mapping[str, Any]) -> None:
        """Create a sensor from a description of `described`, or update the sensor of this name.

        A sensor of another built-in kind is replaced; a custom one stays. A kind that is not built in cannot be
        created; this logs a warning.
        """
        name = described["id"]
        kind = SensorType.__members__.get(str(described["type"]))
        known = self._engine._sensors.get(name)
        if known is None and kind not in KINDS:
            self._engine.ctx.logger.warning(f"Sensor {name!r} has the kind {described['type']}: add it yourself.")
        if kind not in KINDS or (known is not None and not _is_built_in(known)):
            return
        if known is not None and known.type is not kind:
            self._engine.delete_sensor(name)
            known = None
        made = known or self._engine.create_sensor(name, kind)
        KINDS[kind].change(made, described["keywords"])

    def snapshot(self) -> SensorsSnapshot:
        """Return the sensors, their settings and their data, for `restore`."""
        settings = self._get_settings()
        shown = [one for sensor in settings.simple for one in sensor._last]
        return SensorsSnapshot(settings, shown, [sensed() for sensed, _ in settings.memories])

    @property
    def have_memories(self) -> bool:
        """Whether any sensor has more state than the data that it has shown, such as a count of its looks."""
        return len(self._get_settings().memories) > 0

    def restore_keywords(self, before: SensorsSnapshot) -> None:
        """Restore the settings of sensors before agents carry them again: settings decide which agents may."""
        if self._get_settings() is not before.settings:
            for sensor, keywords in zip(before.settings.sensors, before.settings.keywords, strict=True):
                if keywords is not None and _find_keywords(sensor) != keywords:
                    _set(sensor, keywords)

    def restore(self, before: SensorsSnapshot, *, forget: bool = False) -> None:
        """Restore the sensors; with `forget`, clear all sensed data, also of custom classes."""
        if self._get_settings() is not before.settings:
            self.restore_keywords(before)
            self._phase.change_sensors()
            self.show(before.settings)
            for sensor in before.settings.simple:
                if not _is_simple(sensor):
                    sensor.reset()
        if not forget:
            shown = iter(before.shown)
            for sensor, data, look in zip(before.settings.simple, shown, shown, strict=True):
                last = sensor._last
                last[0] = data
                last[1] = look
            for (_, restore), sensed in zip(before.settings.memories, before.sensed, strict=True):
                restore(sensed)
            return
        for sensor in before.settings.sensors:
            if hasattr(sensor, "reset"):
                sensor.reset()

    def capture(self, *, only_plain: bool) -> dict[str, tuple[ISensor, Any]]:
        """Return the sensors and their attributes, for `copy_from`.

        Args:
            only_plain: whether later changes of the sensors leave the result as it is.

        Raises:
            NotPlain: a sensor has other attributes than plain values, draws, or is of a class of the user's.
        """
        return {
            name: (one, _find_attributes(one, only_plain=only_plain)) for name, one in self._engine._sensors.items()
        }

    def copy_from(self, sensors: Mapping[str, tuple[ISensor, Any]], other: SensorEngine, memo: dict[int, Any]) -> None:
        """Copy the sensors of another context into this one, which must have none.

        Args:
            sensors: the sensors, see `capture`.
            other: the sensor engine of the other context, whose sensors may have changed since.
            memo: maps other parts of the context to their copies, and gets the copies; see `copy.deepcopy`.
        """
        storage = other._storage
        memo[id(other)] = self._engine
        memo[id(storage)] = self
        memo[id(storage.memory)] = self.memory
        for name, part in vars(storage.memory).items():
            memo[id(part)] = getattr(self.memory, name)
        for sensor, attributes in sensors.values():
            slots = attributes[1] if isinstance(attributes, tuple) else {}
            for sensed in slots.get("_last", sensor._last) if isinstance(sensor, Sensor) else ():
                memo[id(sensed)] = sensed  # later looks do not change earlier data
        self._engine._sensors |= {name: _copy_sensor(*one, memo) for name, one in sensors.items()}
        self._engine._warned |= other._warned

    def hide(self, before: SensorsSnapshot, known: Collection[str]) -> None:
        """Reset sensors that no `known` agent carries to their settings in a snapshot, and clear their data.

        Used for copies, so the snapshot may be from another context.
        """
        then = {
            one.sensor_id: keywords
            for one, keywords in zip(before.settings.sensors, before.settings.keywords, strict=True)
        }
        for name, sensor in self._engine._sensors.items():
            if find_owner(sensor) in known:
                continue
            if hasattr(sensor, "reset"):
                sensor.reset()
            keywords = then.get(name)
            if keywords is not None and not isinstance(sensor, FunctionSensor) and _find_keywords(sensor) != keywords:
                _set(sensor, keywords)

    def _get_settings(self) -> SensorSettings:
        """Return the present settings of the sensors; the same object as long as nothing has changed."""
        # NOTE: most snapshots are of games whose sensors do not change (benchmarks: snapshots).
        known = self._settings_now
        changes = self._get_counts()
        sensors = tuple(self._engine._sensors.values())
        if known is None or self._changes != changes or known.sensors != sensors:
            simple = tuple([one for one in sensors if _is_simple(one)])
            memories = tuple(filter(None, map(_find_memory, filterfalse(_is_simple, sensors))))
            owners = tuple(map(find_owner, sensors))
            keywords = tuple(map(_find_keywords, sensors))
            known = SensorSettings(sensors, owners, keywords, simple, memories)
            self._settings_now = known
            self._changes = changes
        return known

    def share(self) -> SensorSettings:
        """Return the present set of sensors and their owners, for `show`."""
        return self._get_settings()

    def show(self, settings: SensorSettings) -> None:
        """Set the sensors of the context to a set that `share` has returned, with their owners."""
        self._engine._sensors.clear()
        for sensor, owner in zip(settings.sensors, settings.owners, strict=True):
            self._engine._sensors[sensor.sensor_id] = sensor
            if find_owner(sensor) != owner:
                sensor.set_owner(owner)
        self._settings_now = settings
        self._changes = self._get_counts()

    def _get_counts(self) -> tuple[int, int]:
        return self._phase.sensor_changes, self._phase.owner_changes


def _is_built_in(sensor: ISensor) -> bool:
    return isinstance(sensor, Sensor) and sensor.type in KINDS


def _find_keywords(sensor: ISensor) -> dict[str, Any] | None:
    if isinstance(sensor, FunctionSensor):
        return {"function": sensor.function}
    return KINDS[sensor.type].list_keywords(sensor) if _is_built_in(sensor) else None


def _set(sensor: ISensor, keywords: dict[str, Any]) -> None:
    if isinstance(sensor, FunctionSensor):
        sensor.function = keywords["function"]
    else:
        KINDS[sensor.type].apply(sensor, keywords)


def _is_simple(sensor: object) -> TypeGuard[Sensor]:
    return isinstance(sensor, Sensor) and sensor._is_stateless


def _find_memory(sensor: object) -> tuple[Callable[[], Any], Callable[[Any], None]] | None:
    """Return functions that return and restore the state of a sensor; custom classes may lack them."""
    if isinstance(sensor, DetectingSensor):
        return sensor._take_snapshot, sensor._restore
    give = getattr(sensor, "snapshot", None)
    restore = getattr(sensor, "restore", None)
    return (give, restore) if callable(give) and callable(restore) else None


def _find_attributes(sensor: ISensor, *, only_plain: bool) -> Any:
    """Return the attributes of a sensor and those in slots; None for a class that is no `Sensor`; see `capture`."""
    attributes: Any = sensor.__getstate__() if isinstance(sensor, Sensor) else None
    if not only_plain:
        return attributes
    if not (_is_simple(sensor) and sensor._is_ours):
        raise NotPlain
    others, slots = attributes
    slots["_last"] = sensor._last.copy()
    function = {"_function": sensor.function} if isinstance(sensor, FunctionSensor) else {}
    plain = {name: value for name, value in (others or {}).items() if name not in function}
    return copy_deep(plain, ONLY_PLAIN) | function, slots


def _copy_sensor(sensor: ISensor, attributes: object, memo: dict[int, Any]) -> ISensor:
    """Return a copy; a custom sensor that cannot be copied is shared."""
    if isinstance(sensor, Sensor):
        return copy_part(sensor, memo, attributes)
    try:
        return deepcopy(sensor, memo)
    except Exception:  # noqa: BLE001 - whatever a caller's object raises when it is copied
        memo[id(sensor)] = sensor
        return sensor


def _check_type(kind: object, sensor_id: str) -> SensorType:
    member = as_member(SensorType, kind)
    known = [one.name for one in KINDS]
    if member in KINDS:
        return member
    if member is not None:
        hint = " A custom sensor is an object of your own class: ctx.sensor.add_sensor(obj)."
    else:
        name = (kind if isinstance(kind, str) else shown(kind)).rpartition(".")[2]
        names = [one.lower() for one in known] if name.islower() else known
        hint = nearest(name if name.islower() else name.upper(), names)
        hint = hint or f" Use a SensorType: {', '.join(known)}."
    seen = str(kind) if isinstance(kind, SensorType) else shown(kind)
    raise UnknownType(f"Unknown sensor type {seen} for sensor {shown(sensor_id)}.{hint}")


def _suggest_keyword(kind: SensorType, name: str) -> str:
    """Return a hint to replace a keyword that a kind ignores."""
    known = KINDS[kind].list_names()
    others = [other.name for other, one in KINDS.items() if name in one.list_names()]
    if others:
        return f" These kinds take it: {', '.join(others)}."
    if SYNONYMS.get(name) in known:
        return f" Did you mean {SYNONYMS[name]!r}?"
    return nearest(name, known) or (f" It takes: {', '.join(sorted(known))}." if known else " It takes none.")
