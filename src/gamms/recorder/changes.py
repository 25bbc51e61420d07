"""Changes of a game since they were last recorded, as events."""

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from functools import partial
from marshal import dumps
from operator import attrgetter, is_not
from typing import Any, Self

from gamms.deciding import get_phase
from gamms.ir import events as kinds
from gamms.ir.events import Log
from gamms.ir.game_state import FIELD_EVENTS, FIELDS
from gamms.plain import Plain, is_same, select_plain, to_plain
from gamms.recorder.keyframes import group_sensors, list_deciders, list_places
from gamms.typing import IVisualizationEngine
from gamms.typing.context import HostContext
from gamms.typing.game import find_strategy_name

Changes = dict[str, Any]  # changes of a dict: items to `set`, keys to `removed`, and `more` items of lists and sets

_NO_REFERENCES = 2  # last version of marshal that writes repeated values in full
_MARKED = (bool, int, float, str, bytes, type(None), list, tuple, set, frozenset, dict)
_HEAD = 5  # bytes before the items of a list: its type and length


class PlainCopy:
    """A copy of the plain part of a dict, to detect changes.

    Attributes:
        values: the plain part.
    """

    __slots__ = ("_marks", "values")

    def __bool__(self) -> bool:
        """Return whether there are any values."""
        return bool(self.values)

    def __init__(self, now: Mapping[Any, Any]) -> None:
        self.values = select_plain(now)
        self._marks = {key: _mark(value) for key, value in now.items()}

    def copy(self) -> "PlainCopy":
        """Return a copy that later calls of `find_changes` leave as it is."""
        twin = copy(self)
        twin.values = {**self.values}
        return twin

    def find_changes(self, now: Mapping[Any, Any]) -> Changes | None:
        """Return the changes since the last call; None if there are none."""
        # NOTE: marks are compared first, at a fifth of the cost, because this runs for every memory in every
        # turn.
        marks = {key: _mark(value) for key, value in now.items()}
        changed = {key: now[key] for key, mark in marks.items() if mark is None or mark != self._marks.get(key)}
        if not changed and len(now) == len(self._marks):
            return None
        found: Changes = {"set": {}, "more": {}, "removed": [key for key in self.values if key not in now]}
        for key, value in changed.items():
            more = self._find_added_items(key, value, marks[key])
            if more is not None:
                found["more"][key] = more
                self.values[key] = self.values[key] | more if isinstance(more, set) else [*self.values[key], *more]
            else:
                self._note(key, value, found)
        for key in found["removed"]:
            del self.values[key]
        self._marks = marks
        return {name: one for name, one in found.items() if one} or None

    def _find_added_items(self, key: Plain, value: Any, mark: bytes | None) -> Any:
        """Return the items added to a list or a set; None for any other change."""
        if type(value) not in (list, set) or mark is None:
            return None
        known: Any = self.values.get(key)
        before = self._marks.get(key)
        if type(known) is not type(value) or not known or before is None or len(value) <= len(known):
            return None
        if type(value) is list and mark.startswith(before[_HEAD:], _HEAD):
            return to_plain(value[len(known) :])
        return to_plain(value - known) if type(value) is set and known <= value else None

    def _note(self, key: Plain, value: object, found: Changes) -> None:
        """Record a value that may have changed."""
        for name, one in select_plain({key: value}).items():
            if name not in self.values or not is_same(one, self.values[name]):
                found["set"][name] = one
                self.values[name] = one
            return
        if key in self.values:  # the value is no longer plain
            found["removed"].append(key)


def _mark(value: Any) -> bytes | None:
    """Return bytes that differ for different values; None if there are none."""
    if type(value) not in _MARKED:  # for example an array: marshal stores its bytes but not its shape
        return None
    try:
        return dumps(value, _NO_REFERENCES)
    except ValueError:
        return None


class _Detector:
    """Detects changes of one field of a game since the last call; this base class compares the whole value.

    Attributes:
        known: the value at the last call.
    """

    def __init__(self, value: Any) -> None:
        self.known = self._make_plain(value)

    def accept(self, value: Any, data: Plain) -> None:  # noqa: ARG002 - named as in `_EachItemDetector`
        """Accept the change of a replayed event as known."""
        self.known = self._make_plain(value)

    def detect(self, value: Any) -> list[Any]:
        """Return the data of events that describe the change."""
        before = self.known
        self.known = self._make_plain(value)
        return [] if is_same(before, self.known) else [self.known or {}]

    def copy(self) -> Self:
        """Return a copy that later calls of `detect` leave as it is."""
        twin = copy(self)
        twin.known = self._copy_known()
        return twin

    def _copy_known(self) -> Any:
        return self.known

    def _make_plain(self, value: Any) -> Any:
        return to_plain(value)


class _ValueDetector(_Detector):
    """Detects a new value of a whole field of the game.

    Args:
        name: name of the field.
        value: present value.
    """

    def __init__(self, name: str, value: Any) -> None:
        self._name = name
        super().__init__(value)

    def detect(self, value: Any) -> list[Any]:
        before = self.known
        self.known = self._make_plain(value)
        return [] if is_same(before, self.known) else [{self._name: self.known}]

    def _make_plain(self, value: Any) -> Any:
        captured = FIELDS[self._name].captured
        return to_plain(value) if captured is None else captured(value)


class _EntryDetector(_Detector):
    """Detects entries appended to a list."""

    def detect(self, value: list[Any]) -> list[Any]:
        before = self.known
        self.known = len(value)
        return [to_plain(entry) for entry in value[before:]]

    def _make_plain(self, value: list[Any]) -> int:
        return len(value)


class _ItemDetector(_Detector):
    """Detects changed items of a dict."""

    def detect(self, value: Mapping[Any, Any]) -> list[Any]:
        found = self.known.find_changes(value)
        return [] if found is None else [found]

    def _copy_known(self) -> "PlainCopy":
        known: PlainCopy = self.known
        return known.copy()

    def _make_plain(self, value: Mapping[Any, Any]) -> "PlainCopy":
        return PlainCopy(value)


class _FactDetector(_Detector):
    """Detects facts that were published or withdrawn."""

    def detect(self, value: Mapping[str, Any]) -> list[Any]:
        known = self.known
        if value.keys() == known.keys() and not any(map(is_not, value.values(), known.values())):
            return []
        now = dict(value)
        self.known = now
        changed = {
            name: fact
            for name, fact in now.items()
            if name not in known or not (fact is known[name] or is_same(to_plain(fact), to_plain(known[name])))
        }
        removed = [name for name in known if name not in now]
        return [{"set": select_plain(changed), "removed": removed}] if changed or removed else []

    def _make_plain(self, value: Mapping[str, Any]) -> dict[str, Any]:
        return dict(value)


class _EachItemDetector(_Detector):
    """Detects changed items of dicts by key: of the memories of agents or teams, or of the reports of sensors.

    Args:
        data_of: function from key -> changes to the data of the event.
        keys_in: function from the data of an event to the keys of changed dicts.
        value: the dicts by key.
    """

    def __init__(
        self, data_of: Callable[[dict[Any, Changes]], Plain], keys_in: Callable[[Plain], Iterable[Any]], value: object
    ) -> None:
        self._data_of = data_of
        self._keys_in = keys_in
        super().__init__(value)

    def accept(self, value: Mapping[Any, dict[Any, Any]], data: Plain) -> None:
        for key in self._keys_in(data):
            self.known[key] = PlainCopy(value[key])

    def detect(self, value: Mapping[Any, dict[Any, Any]]) -> list[Any]:
        found = {}
        known = self.known
        if not known and not any(value.values()):
            return []
        for key in sorted(value) if all(type(key) is str for key in value) else value:
            if value[key] or key in known:
                changes = known.setdefault(key, PlainCopy({})).find_changes(value[key])
                if changes is not None:
                    found[key] = changes
        for key in [key for key in known if key not in value]:
            found[key] = {"removed": list(known.pop(key).values)}
        return [self._data_of(found)] if found else []

    def _copy_known(self) -> "dict[Any, PlainCopy]":
        return {key: one.copy() for key, one in self.known.items()}

    def _make_plain(self, value: Mapping[Any, dict[Any, Any]]) -> "dict[Any, PlainCopy]":
        return {name: PlainCopy(memory) for name, memory in value.items() if memory}


_of_agents = partial(_EachItemDetector, lambda found: {"agents": found, "teams": []}, lambda data: list(data["agents"]))
_of_teams = partial(
    _EachItemDetector,
    lambda found: {"agents": {}, "teams": [(to_plain(team), one) for team, one in found.items()]},
    lambda data: dict(data["teams"]),
)
_of_sensors = partial(
    _EachItemDetector,
    lambda found: {"looks": [[*key, one] for key, one in found.items()]},
    lambda data: [(sensor, owner) for sensor, owner, _ in data["looks"]],
)

DETECTED: dict[str, tuple[int, Callable[[Any], _Detector]]] = {
    "events": (kinds.GAME_EVENT, _EntryDetector),
    "deeds": (kinds.GAME_DEED, _EntryDetector),
    "messages": (kinds.GAME_MESSAGE, _EntryDetector),
    **{name: (event.code, partial(_ValueDetector, name)) for name, event in FIELD_EVENTS.items()},
    "data": (kinds.GAME_DATA, _ItemDetector),
    "over": (kinds.GAME_OVER, _Detector),
    "facts": (kinds.GAME_FACTS, _FactDetector),
    "agent_facts": (kinds.GAME_PRIVATE_FACTS, _of_agents),
    "team_facts": (kinds.GAME_PRIVATE_FACTS, _of_teams),
    "memories": (kinds.GAME_MEMORY, _of_agents),
    "team_memories": (kinds.GAME_MEMORY, _of_teams),
    "delayed_looks": (kinds.DELAYED_LOOKS, _of_sensors),
}
"""Field of `GameState` -> (event kind of its changes, detector class)."""

_VALUES = attrgetter(*DETECTED)


class GameChanges:
    """Detects changes of `ctx.game` and of the random stream of its context.

    Attributes:
        pace: increment of the turn number in the last turn.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self._game = ctx.game
        self._state = ctx.game.internals.state
        self._detectors = [(name, kind, make(getattr(self._state, name))) for name, (kind, make) in DETECTED.items()]
        self._is_known = True  # whether any memory may have items
        self._rng_state = to_plain(ctx.rng_state())
        self._turn = self._state.turn
        self.pace = 0
        self._places = list_places(ctx)

    def copy(self) -> "GameChanges":
        """Return a copy that later calls of `detect` leave as it is."""
        twin = copy(self)
        twin._detectors = [(name, kind, detector.copy()) for name, kind, detector in self._detectors]
        return twin

    def accept(self, kind: int, data: Plain) -> None:
        """Accept the change of a replayed event as known."""
        if kind == kinds.GAME_TURN:
            self._turn = self._state.turn
            self.pace = int(data["pace"])
        elif kind == kinds.GAME_CHANCE:
            self._rng_state = to_plain(self._ctx.rng_state())
        for name, code, detector in self._detectors:
            if code == kind:
                detector.accept(getattr(self._state, name), data)
                self._is_known = True

    def count(self, log: Log) -> None:
        """Add an event with the turn number, if the counting has changed."""
        now = self._state.turn
        before = self._turn
        pace = self.pace
        if now == before + pace:
            self._turn = now
            return
        self.pace = now - before
        self._turn = now
        starts = self._game.internals.starts if before <= 0 else {}
        moved = {name: at for name, at in starts.items() if name not in self._places or self._places[name] != at}
        log.append(
            (kinds.GAME_TURN, {"turn": now, "pace": self.pace, **({"starts": to_plain(moved)} if moved else {})})
        )

    def detect(self, log: Log) -> None:
        """Add events for all other changes."""
        # NOTE: most games have no scores, facts or data, and this runs every turn (benchmarks: w4).
        values = _VALUES(self._state)
        if self._is_known or any(values):
            for value, (_, kind, detector) in zip(values, self._detectors, strict=True):
                if value or detector.known:
                    log += [(kind, data) for data in detector.detect(value)]
            self._is_known = any(detector.known for _, _, detector in self._detectors)
        if (rng_state := self._ctx.rng_state()) is not None and not is_same(rng_state, self._rng_state):
            self._rng_state = to_plain(rng_state)
            log.append((kinds.GAME_CHANCE, {"chance": self._rng_state}))


class StrategyChanges:
    """Detects agents for which another strategy or plan decides than at the last call."""

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self._functions = self._read_strategies()
        self._named = dict(zip(ctx.agent.agents, self._functions, strict=True))

    def detect(self, log: Log) -> None:
        """Add an event for the changes."""
        now = self._read_strategies()
        if now == self._functions:
            return
        before = self._named
        self._functions = now
        self._named = dict(zip(self._ctx.agent.agents, now, strict=True))
        log += [
            (kinds.AGENT_STRATEGY, {"agent_name": name, "strategy": find_strategy_name(function)})
            for name, function in self._named.items()
            if function is not before.get(name)
        ]

    def _read_strategies(self) -> list[Any]:
        return list_deciders(self._ctx, self._ctx.agent.storage.list_strategies())


class SensorChanges:
    """Detects added, removed and changed sensors since the last call.

    Args:
        ctx: the context.
        check: called with added or changed sensors, to warn of values that cannot be recorded.
    """

    def __init__(self, ctx: HostContext, check: Callable[[list[dict[str, Any]]], None]) -> None:
        self._ctx = ctx
        self._phase = get_phase(ctx)
        self._check = check
        self._all = ctx.sensor.sensors
        self.accept()

    @property
    def are_due(self) -> bool:
        """Return whether anything may have changed."""
        return self._phase.sensor_changes != self._count or len(self._all) != self._size

    def accept(self) -> None:
        """Accept the present state as known."""
        self._known = {one["id"]: self._find_sensor_state(one) for one in self._describe_sensors()}

    def detect(self) -> Log:
        """Return a list with the event for the changes, or an empty list."""
        before = self._known
        described = self._describe_sensors()
        self._known = {one["id"]: self._find_sensor_state(one) for one in described}
        removed = [id for id, (sensor, *_) in before.items() if self._known.get(id, (None,))[0] is not sensor]
        changed = [
            one
            for one in described
            if one["id"] in removed
            or one["id"] not in before
            or not is_same(before[one["id"]][1], self._known[one["id"]][1])
        ]
        self._check(changed)
        if not changed and not removed:
            return []
        return [(kinds.SENSORS, {"sensor_kinds": group_sensors(changed), **({"removed": removed} if removed else {})})]

    def _describe_sensors(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = self._ctx.sensor.storage.describe_sensors()
        self._count = self._phase.sensor_changes
        self._size = len(found)
        return found

    def _find_sensor_state(self, described: dict[str, Any]) -> tuple[Any, Plain]:
        """Return a sensor's identity, because another sensor may get its name, and its settings."""
        return self._ctx.sensor.sensors[described["id"]], [described["type"], select_plain(described["keywords"])]


class ContextChanges:
    """All detectors of changes that the journal does not record.

    Attributes:
        game: detector of the fields of the game.
        strategies: detector of the strategies.
        sensors: detector of the sensors.
    """

    def __init__(self, ctx: HostContext, check: Callable[[list[dict[str, Any]]], None]) -> None:
        """Store the present state for comparison; `check` is called with added or changed sensors."""
        self.game = GameChanges(ctx)
        self.strategies = StrategyChanges(ctx)
        self.sensors = SensorChanges(ctx, check)

    def copy(self) -> "ContextChanges":
        """Return a copy that later calls of `detect` leave as it is."""
        twin = copy(self)
        twin.game = self.game.copy()
        twin.strategies = copy(self.strategies)
        twin.sensors = copy(self.sensors)
        return twin


class DrawingChanges:
    """Compares the drawings of artists with the last recorded ones.

    Args:
        visual: the visual engine of the context.
        with_custom: whether custom drawers are called; otherwise only drawings of a replay are recorded.

    Attributes:
        first: the drawings at the beginning.
    """

    def __init__(self, visual: IVisualizationEngine, *, with_custom: bool) -> None:
        self._artists = getattr(visual, "artists", None)  # a custom engine may have no artists
        self._with_custom = with_custom
        self._known: dict[str, Any] = {}
        self.first = [data for _, data in self.list_changes()]

    @property
    def edits(self) -> int:
        """A number that changes when an artist is declared, added or removed."""
        return 0 if self._artists is None else int(self._artists.edits)

    @property
    def noted(self) -> list[Any]:
        """The last recorded drawings of the artists."""
        return list(self._known.values())

    def describe_artists(self) -> dict[str, Any]:
        """Return descriptions of all artists as plain values; see `Artists.describe_artists`."""
        if self._artists is None:
            return {"artists": [], "is_declared": False}
        return select_plain(self._artists.describe_artists(with_drawings=self._with_custom))

    def list_changes(self) -> Log:
        """Return events for the drawings that have changed."""
        artists = self._artists
        if artists is None or not (self._with_custom or self._known or artists.drawings.commands):
            return []
        known = self._known
        self._known = artists.record_drawings(with_custom=self._with_custom)
        return [
            (kinds.VISUAL_COMMANDS, data)
            for name, data in self._known.items()
            if name not in known or not is_same(known[name], data)
        ]
