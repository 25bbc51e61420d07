"""Modes of travel: which ways are open to walkers, bicycles, cars and robots, their speeds and directions.

The rules are data with their sources, in `gamms/data/modes.toml`. A mode is a function from the tags of a way to its
`Access`; any such function can replace it.
"""

import json
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
from msgspec import Meta

from gamms.arguments import as_path
from gamms.errors import BadFile, BadType, BadValue, nearest
from gamms.osm.network import KEPT_TAGS, OSMType, Rule, Stops, attributes_of
from gamms.osm.objects import number_of
from gamms.osm.speeds import signed_kph, speed_kph
from gamms.text import shown

_FILE = Path(__file__).parent.parent / "data" / "modes.toml"
_GENERAL = ("vehicle", "access")  # keys that may close ways, but open none to a mode that is excluded from their class
_OPENING = ("yes", "designated", "permissive", "official")
_AGAINST = ("-1", "reverse", "backward")
_FASTEST_KPH = 300.0
_TOLERANCE_M = 0.5  # if the mode does not state the width of its junctions


class Access(NamedTuple):
    """The access of a mode of travel to an open way."""

    speed_kph: float
    forward: bool = True  # in the order of its vertices
    backward: bool = True


ModeFunction = Callable[[Mapping[str, str]], Access | None]
"""A function from the tags of a way to its `Access`; None: the way is closed."""

_Speeds = Mapping[str, Annotated[float, Meta(gt=0.0, le=_FASTEST_KPH)]]
_Values = Mapping[str, tuple[str, ...]]


@dataclass(slots=True, frozen=True, kw_only=True)
class Mode:
    """The rules of one mode of travel; calling it with the tags of a way returns its `Access`, or None."""

    name: str
    highways: _Speeds  # classes of ways that are open unless a tag closes them, with their usual km/h
    by_permission: _Speeds  # classes that are open only if the mode's own key says so
    access: tuple[str, ...]  # keys that open and close ways; the first one that a way has decides
    refused: tuple[str, ...]  # values of these keys that close a way
    closed: _Values  # tag -> values that close a way unless the mode's own key opens it
    never: _Values  # tag -> values that close a way in any case
    oneway: _Values  # key -> values for one-way traffic along the vertices; the first key that a way has decides
    implied_oneway: _Values  # tag -> values that imply one-way traffic if no key decides
    contraflow: _Values  # tag -> values that allow the other direction if the general `oneway` closes it
    maxspeed: Literal["ignored", "limit", "speed"]  # meaning of a sign: none, an upper bound, or the speed itself
    tolerance: Annotated[float, Meta(ge=0.0)]  # meters: the default of loaders for merging junctions
    barriers: tuple[str, ...] = ()  # values of `barrier` of nodes that stop agents unless the mode's own key opens them
    slope: Literal["ignored", "walked"] = "ignored"  # whether slopes change travel times as for walkers

    def __call__(self, tags: Mapping[str, str]) -> Access | None:
        """Return how a way with these tags may be used; None: it is closed."""
        if self.why_closed(tags):
            return None
        return Access(self.speed_kph(tags), *self._directions(tags))

    def why_closed(self, tags: Mapping[str, str]) -> str:
        """Return the tag that closes a way to this mode, such as "access=private"; empty if it is open."""
        highway = tags.get("highway", "no")
        never = _match(self.never, tags)
        if never or (highway not in self.highways and highway not in self.by_permission):
            return never or f"highway={highway}"
        is_open, why = self._signed(tags)
        if is_open is not None:
            return why
        return f"highway={highway}" if highway not in self.highways else _match(self.closed, tags)

    def is_stopped_by(self, tags: Mapping[str, str]) -> bool:
        """Return whether agents cannot pass a node with these tags, such as a bollard or a locked gate."""
        is_open, _ = self._signed(tags)
        return tags.get("barrier") in self.barriers if is_open is None else "barrier" in tags and not is_open

    def _signed(self, tags: Mapping[str, str]) -> tuple[bool | None, str]:
        """Return whether access keys open or close an object, None if neither; and the tag that closes it."""
        key = next((key for key in self.access if tags.get(key, "unknown") != "unknown"), None)
        if key is not None and tags[key] in self.refused:
            return False, f"{key}={tags[key]}"
        return (True if key is not None and key not in _GENERAL and tags[key] in _OPENING else None), ""

    def speed_kph(self, tags: Mapping[str, str]) -> float:
        """Return the speed on a way, open or not; for unlisted classes at most that of cars."""
        highway = tags.get("highway", "no")
        listed = self.highways.get(highway, self.by_permission.get(highway))
        return self._speed(min(speed_kph(tags), max(self.highways.values())) if listed is None else listed, tags)

    def _speed(self, usual: float, tags: Mapping[str, str]) -> float:
        sign = None if self.maxspeed == "ignored" else signed_kph(tags)
        if sign is None:
            return usual
        return min(usual, sign) if self.maxspeed == "limit" else sign

    def _directions(self, tags: Mapping[str, str]) -> tuple[bool, bool]:
        key = next((key for key in self.oneway if key in tags), None)
        if key is None:
            along = bool(_match(self.implied_oneway, tags))
            against = False
        else:
            along = tags[key] in self.oneway[key]
            against = tags[key] in _AGAINST
        if key in (None, "oneway") and _match(self.contraflow, tags):
            return True, True
        return not against, not along


def _match(rules: _Values, tags: Mapping[str, str]) -> str:
    """Return the first tag of a way that matches the rules, as "key=value", or ""."""
    return next((f"{key}={tags[key]}" for key, values in rules.items() if tags.get(key) in values), "")


def modes(filepath: object = None) -> dict[str, Mode]:
    """Return the modes of travel in a TOML file by name; by default the modes of GAMMS.

    Each table of the file is a mode; `extends = "drive"` takes missing fields from that mode, of the file or of GAMMS.
    docs/maps.md explains the fields.

    Raises:
        FileNotFoundError: the file does not exist.
        BadFile: the file is not TOML, or a field is missing, unknown or impossible.
    """
    if filepath is None:
        return dict(_shipped())
    file = as_path(filepath, "filepath")
    return _read(file, {name: _fields_of(mode) for name, mode in _shipped().items()})


@cache
def _shipped() -> dict[str, Mode]:
    return _read(_FILE, {})


def _fields_of(mode: Mode) -> dict[str, Any]:
    return {field.name: getattr(mode, field.name) for field in fields(Mode) if field.name != "name"}


def _read(file: Path, known: Mapping[str, dict[str, Any]]) -> dict[str, Mode]:
    where = repr(str(file))
    found = dict(known)
    try:
        tables = tomllib.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadFile(f"{where} is not a TOML file: {str(error)[:200]}.") from None
    result = {}
    for name, table in tables.items():
        found[name] = _complete(table, found, f"{where}, mode {name!r}")
        try:
            result[name] = msgspec.convert({"name": name, **found[name]}, Mode)
        except msgspec.ValidationError as error:
            raise BadFile(f"{where}, mode {name!r}: {error}.") from None
    return result


def _complete(table: object, known: Mapping[str, dict[str, Any]], where: str) -> dict[str, Any]:
    """Return the fields of a table of the file, completed from the mode that it extends."""
    if not isinstance(table, dict):
        raise BadFile(f"{where} must be a table of fields, not {shown(table)}.")
    given = dict(table)
    names = [field.name for field in fields(Mode) if field.name != "name"]
    base = given.pop("extends", None)
    if base is not None and base not in known:
        raise BadFile(f"{where} extends {shown(base)}, which is not an earlier mode.{nearest(base, known)}")
    for field in given:
        if field not in names:
            raise BadFile(f"{where} has no field {field!r}.{nearest(field, names)}")
    return {**(known[base] if base is not None else {}), **given}


def as_mode(value: object) -> ModeFunction:
    """Return a mode of travel from an `OSMType`, a name, a `Mode` or a function.

    Raises:
        BadType: the value is none of these.
    """
    if callable(value) and not isinstance(value, type):
        return value
    name = value.name if isinstance(value, OSMType) else value
    mode = _shipped().get(name.rpartition(".")[2].lower()) if isinstance(name, str) else None
    if mode is None:
        raise BadType(
            "osm_type must be OSMType.WALK, BIKE or DRIVE, one of the names "
            f"{', '.join(_shipped())}, a Mode or a function, not {shown(value)}.{nearest(value, _shipped())}"
        )
    return mode


def name_of(mode: ModeFunction) -> str:
    """Return the name of a mode for a graph, such as "drive", or that of the function."""
    return mode.name if isinstance(mode, Mode) else str(getattr(mode, "__name__", type(mode).__name__))


def tolerance_of(mode: ModeFunction | None) -> float:
    """Return the default tolerance of loaders, in meters."""
    return mode.tolerance if isinstance(mode, Mode) else _TOLERANCE_M


def stops_of(mode: ModeFunction | None) -> Stops | None:
    """Return the test for nodes that agents of a mode cannot pass; None: they pass all."""
    return mode.is_stopped_by if isinstance(mode, Mode) else None


def honouring_traffic(mode: ModeFunction) -> ModeFunction:
    """Return the mode for agents that obey the one-way streets of cars; a function is returned unchanged."""
    if not isinstance(mode, Mode) or "oneway" in mode.oneway:
        return mode
    cars = _shipped()["drive"]
    oneway = {**mode.oneway, "oneway": cars.oneway["oneway"]}
    return replace(mode, oneway=oneway, implied_oneway=cars.implied_oneway)


def closed_rule(mode: ModeFunction) -> Rule:
    """Return the rule for reading the ways that are closed to a mode, with the closing tag as `why`."""
    rule = rule_of(mode)

    def closed(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        if rule(osmid, tags) is not None:
            return None
        why = mode.why_closed(tags) if isinstance(mode, Mode) else name_of(mode)
        return {"osmid": osmid, "why": why, "oneway": False}, False

    return closed


def rule_of(mode: ModeFunction, names: Iterable[str] = KEPT_TAGS) -> Rule:
    """Return the rule for reading the ways of a mode of travel; `names` are the tags to keep."""

    def rule(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        try:
            access = mode(tags)
        except Exception as error:
            raise BadValue(f"{name_of(mode)} failed for way {osmid}: {type(error).__name__}: {error}.") from error
        if access is None:
            return None
        if not isinstance(access, Access):
            raise BadType(f"{name_of(mode)} must return an Access or None, not {shown(access)}.")
        speed, forward, backward = access
        if not 0.0 < number_of(speed) < math.inf:
            raise BadValue(f"{name_of(mode)} gives way {osmid} the speed {shown(speed)}: it must be more than 0 km/h.")
        if not forward and not backward:
            return None
        one_way = not (forward and backward)
        return {**attributes_of(osmid, tags, names), "oneway": one_way, "speed_kph": float(speed)}, not forward

    return rule


def keeping(rule: Rule, names: Sequence[str]) -> Rule:
    """Return a rule by which ways keep further tags."""

    def with_tags(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        found = rule(osmid, tags)
        return found and ({**{name: tags[name] for name in names if name in tags}, **found[0]}, found[1])

    return with_tags if names else rule


WayFilter = Callable[[Mapping[str, str]], object] | Mapping[str, str | bool | Sequence[str]]


def filtered(rule: Rule | None, given: WayFilter | None) -> Rule | None:
    """Return a rule that also applies the caller's filter.

    Args:
        rule: the rule without the filter.
        given: a function from tags to a bool; or tag -> the required value, a list of such values, or True for any.

    Raises:
        BadType: the filter is neither.
    """
    if rule is None or given is None:
        return rule
    keep = _of_values(given) if isinstance(given, Mapping) else given
    if not callable(keep):
        raise BadType(f"filter must be a function from tags to a bool, or a dict of tags, not {shown(given)}.")
    return lambda osmid, tags: rule(osmid, tags) if keep(tags) else None


def filter_in_words(given: WayFilter | None) -> str:
    """Return a filter as a text: the JSON of a dict, or the name of a function; "" for None."""
    if isinstance(given, Mapping):
        return json.dumps({tag: sorted(one) if isinstance(one, set) else one for tag, one in given.items()})
    return "" if given is None else str(getattr(given, "__name__", type(given).__name__))


def filter_of_words(text: str) -> WayFilter | None:
    """Return the filter that `filter_in_words` wrote.

    Raises:
        BadValue: it was a function, of which only the name is known.
    """
    if text and not text.startswith("{"):
        raise BadValue(f"The graph was filtered by the function {shown(text)}. Give it again: report(…, filter=…).")
    return json.loads(text) if text else None


def _of_values(given: Mapping[str, object]) -> Callable[[Mapping[str, str]], bool]:
    wanted: dict[str, set[str] | None] = {}
    for tag, values in given.items():
        listed = [values] if isinstance(values, str) else values
        if not (values is True or (isinstance(listed, (list, tuple, set)) and all(isinstance(v, str) for v in listed))):
            raise BadType(f"filter[{tag!r}] must be a value, a list of values, or True for any, not {shown(values)}.")
        wanted[tag] = set(listed) if isinstance(listed, (list, tuple, set)) else None
    return lambda tags: all(tag in tags and (one is None or tags[tag] in one) for tag, one in wanted.items())
