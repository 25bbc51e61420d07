"""Modes of travel: which ways are open to walkers, bicycles, cars and robots, their speeds and directions.

The rules are data with their sources, in `gamms/data/modes.toml`. A mode is a function from the tags of a way to its
`Access`; any such function can replace it.
"""

import json
import math
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import msgspec
from msgspec import Meta

from gamms.arguments import as_path
from gamms.errors import BadFile, BadType, BadValue, nearest
from gamms.osm.network import (
    KEPT_TAGS,
    NETWORK_KEYS,
    ROADS,
    STATED_SECONDS,
    OSMType,
    Rule,
    Stops,
    add_directions,
    add_signs,
    find_closing_tag,
    keep_tags,
    make_attributes,
)
from gamms.osm.objects import (
    AGAINST,
    DIRECTIONS,
    OWN_NAMES,
    TWO_WAY,
    VARYING,
    has_direction,
    normalize_tags,
    parse_number,
    split_words,
)
from gamms.osm.speeds import (
    compute_speed_kph,
    find_network_speed_kph,
    find_signs,
    list_unread_signs,
    parse_duration_s,
    sign_in_force,
    sign_keys,
)
from gamms.text import shown

_FILE = Path(__file__).parent.parent / "data" / "modes.toml"
_GENERAL = ("vehicle", "access")  # keys that may close ways, but open none to a mode that is excluded from their class
_OPENING = frozenset(("yes", "designated", "permissive", "official"))
# Values of access keys that neither open nor close, unless a mode refuses them: who may pass, and for what purpose.
_USERS = frozenset(("bus", "customers", "employees", "guests", "hov", "permit", "psv", "residents", "taxi", "visitors"))
_PURPOSES = frozenset(("agricultural", "delivery", "destination", "emergency", "forestry", "loading", "military"))
_NEUTRAL = _USERS | _PURPOSES | {"discouraged", "dismount", "limited", "no", "private", "use_sidepath"}
_FASTEST_KPH = 300.0
_VEHICLE = "vehicle"  # the access key of everything that is not a walker
_TOLERANCE_M = 0.5  # if the mode does not state the width of its junctions


class _Access(NamedTuple):
    speed_kph: float
    forward: bool = True  # in the order of its vertices
    backward: bool = True


class Access(_Access):
    """The access of a mode of travel to an open way: a tuple of its speed and its directions.

    Args:
        speed_kph: km/h.
        forward: whether it is open in the order of its vertices.
        backward: whether it is open against them.
        backward_kph: km/h against the order of its vertices, if signs differ; None: `speed_kph`. This is an attribute
            beside the tuple: `_replace(speed_kph=…)` sets one speed for both directions.
    """

    backward_kph: float | None = None

    def __new__(
        cls, speed_kph: float, forward: bool = True, backward: bool = True, backward_kph: float | None = None
    ) -> Self:
        """Return the access."""
        access = super().__new__(cls, speed_kph, forward, backward)
        access.backward_kph = backward_kph
        return access

    def __eq__(self, other: object) -> bool:
        return super().__eq__(other) and self.backward_kph == getattr(other, "backward_kph", None)

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return super().__hash__()

    def __repr__(self) -> str:
        more = "" if self.backward_kph is None else f", backward_kph={self.backward_kph}"
        return f"Access(speed_kph={self.speed_kph}, forward={self.forward}, backward={self.backward}{more})"


ModeFunction = Callable[[Mapping[str, str]], Access | None]
"""A function from the tags of a way to its `Access`; None: the way is closed."""

_Speeds = Mapping[str, Annotated[float, Meta(gt=0.0, le=_FASTEST_KPH)]]
_Values = Mapping[str, tuple[str, ...]]


@dataclass(slots=True, frozen=True, kw_only=True)
class Mode:
    """The rules of one mode of travel; calling it with the tags of a way returns its `Access`, or None."""

    name: str
    # Classes of ways that are open unless a tag closes them, with their usual km/h: values of `highway`, or tags of
    # other networks such as "railway=tram"; "waterway=*" is any value.
    highways: _Speeds
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
        plain = normalize_tags(tags)
        forward, backward = (not why for why in self._find_closing_tags(plain))
        if not forward and not backward:
            return None
        there, back = (self.speed_kph(plain, direction) for direction in DIRECTIONS)
        if forward and backward and there != back:
            return Access(there, backward_kph=back)
        return Access(there if forward else back, forward, backward)

    def why_closed(self, tags: Mapping[str, str]) -> str:
        """Return the tag that closes a way to this mode, such as "access=private"; empty if it is open."""
        plain = normalize_tags(tags)
        forward, backward = self._find_closing_tags(plain)
        if not forward or not backward:
            return ""
        return backward if forward == self._find_one_way_tags(plain)[0] else forward

    def is_stopped_by(self, tags: Mapping[str, str]) -> bool:
        """Return whether agents cannot pass a node with these tags, such as a bollard or a locked gate."""
        plain = normalize_tags(tags)
        barriers = split_words(plain.get("barrier"))
        signed = self._find_signed_access(plain, "")
        if signed.is_open is None:
            return any(word in self.barriers for word in barriers)
        return bool(barriers) and not signed.is_open

    def speed_kph(self, tags: Mapping[str, str], direction: str = "") -> float:
        """Return the speed on a way, open or not; for unlisted classes at most that of cars.

        Args:
            tags: of the way.
            direction: "forward", along its vertices, or "backward"; "": by the signs for both directions.
        """
        plain = normalize_tags(tags)
        highway = self._find_class(plain)
        listed = self.highways.get(highway, self.by_permission.get(highway))
        roads = [kph for name, kph in self.highways.items() if "=" not in name]
        usual = min(compute_speed_kph(plain), max(roads, default=_FASTEST_KPH)) if listed is None else listed
        sign = None if self.maxspeed == "ignored" else find_signs(plain, self.vehicles, direction)
        if sign is None:
            return usual
        return min(usual, sign.kph) if self.maxspeed == "limit" else sign.kph

    def ignored_values(self, tags: Mapping[str, str]) -> list[str]:
        """Return the tags for access, direction and speed with a word that the mode does not know, as "key=word"."""
        plain = normalize_tags(tags)
        found = list[str]()
        for key in (f"{key}{suffix}" for key in self.access for suffix in ("", *(f":{one}" for one in DIRECTIONS))):
            found += [f"{key}={word}" for word in split_words(plain.get(key)) if not self._is_access(word)]
        for key in self.oneway:
            found += [f"{key}={word}" for word in split_words(plain.get(key)) if not self._is_direction(key, word)]
            found += [f"{key}={word}" for word in split_words(plain.get(key)) if word in VARYING]
        return found if self.maxspeed == "ignored" else [*found, *list_unread_signs(plain, self.vehicles)]

    @property
    def vehicles(self) -> tuple[str, ...]:
        """The names of the mode in keys such as `maxspeed:bicycle`, the most specific first."""
        return tuple(key for key in self.access if key != "access")

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of the classes of ways: `highway`, and those of other networks."""
        classes = (*self.highways, *self.by_permission)
        return tuple(dict.fromkeys(name.partition("=")[0] if "=" in name else "highway" for name in classes))

    def stated_seconds(self, tags: Mapping[str, str]) -> float | None:
        """Return the time that a way of another network than roads takes by its `duration`, such as a ferry."""
        plain = normalize_tags(tags)
        return parse_duration_s(plain.get("duration")) if "=" in self._find_class(plain) else None

    def decisive_keys(self) -> frozenset[str]:
        """Return the keys of all tags that the mode reads."""
        rules = (self.closed, self.never, self.implied_oneway, self.contraflow)
        keys = {*self.access, *(key for rule in rules for key in rule)}
        directed = {f"{key}:{direction}" for key in keys for direction in DIRECTIONS}
        return frozenset(("highway", *self.keys, *keys, *directed, *self.oneway, *sign_keys(self.vehicles)))

    def signs(self, tags: Mapping[str, str]) -> list[dict[str, Any]]:
        """Return the signs of speed along the vertices of a way and against them; see `speeds.sign_in_force`."""
        if self.maxspeed == "ignored":
            return [{}, {}]
        return [sign_in_force(normalize_tags(tags), self.vehicles, direction) for direction in DIRECTIONS]

    def _find_class(self, tags: Mapping[str, str]) -> str:
        """Return the class of a way, of several the first that is known."""
        classes = split_words(tags.get("highway"))
        names = [*classes]
        for key in self.keys:
            words = split_words(tags.get(key)) if key != "highway" else []
            names += [name for word in words for name in (f"{key}={word}", f"{key}=*")]
        known = (one for one in names if one in self.highways or one in self.by_permission)
        return next(known, ";".join(classes) or "no")

    def _tag_of_class(self, name: str, tags: Mapping[str, str]) -> str:
        """Return the tag of a class of ways, or of an unknown one."""
        keys = [key for key in self.keys if key in tags]
        key = name.partition("=")[0] if "=" in name else next(iter(keys), "highway")
        if key == "highway" or "highway" in tags:
            return f"highway={name}"
        return f"{key}={';'.join(split_words(tags[key]))}"

    def _find_closing_tags(self, tags: Mapping[str, str]) -> tuple[str, str]:
        """Return the tags that close a way along its vertices and against them; empty where it is open."""
        there, back = self._find_one_way_tags(tags)
        if has_direction(tags):
            return self._find_closing_tag(tags, "forward", there), self._find_closing_tag(tags, "backward", back)
        closing = self._find_closing_tag(tags, "", "")
        return closing or there, closing or back

    def _find_closing_tag(self, tags: Mapping[str, str], direction: str, against_traffic: str) -> str:
        """Return the tag that closes a way in one direction; empty if it is open.

        Args:
            tags: of the way.
            direction: "forward" or "backward"; "": both.
            against_traffic: the tag by which the way is one-way in the other direction.
        """
        highway = self._find_class(tags)
        never = _find_closing_words(self.never, tags, direction)
        if never or (highway not in self.highways and highway not in self.by_permission):
            return never or self._tag_of_class(highway, tags)
        signed = self._find_signed_access(tags, direction)
        if signed.is_open is False:
            return signed.tag
        if signed.is_open is None:
            closing = _find_closing_words(self.closed, tags, direction)
            closing = closing if highway in self.highways else self._tag_of_class(highway, tags)
            return closing or against_traffic
        return "" if signed.is_directed else against_traffic

    def _find_signed_access(self, tags: Mapping[str, str], direction: str) -> "_SignedAccess":
        """Return what access keys say about an object in one direction; "" for both."""
        for key in self.access:
            for name in (f"{key}:{direction}", key) if direction else (key,):
                words = [word for word in split_words(tags.get(name)) if self._is_access(word) and word != "unknown"]
                if not words:
                    continue
                tag = f"{name}={';'.join(words)}"
                if all(word in self.refused for word in words):
                    return _SignedAccess(False, tag)
                is_opened = key not in _GENERAL and not _OPENING.isdisjoint(words)
                return _SignedAccess(True if is_opened else None, tag, is_directed=name != key)
        return _SignedAccess(None)

    def _is_access(self, word: str) -> bool:
        """Return whether a word is a known value of access keys."""
        return word in self.refused or word in _OPENING or word in _NEUTRAL or word == "unknown"

    def _find_one_way_tags(self, tags: Mapping[str, str]) -> tuple[str, str]:
        """Return the tags that close a one-way street along its vertices and against them; empty where it is open."""
        signs = ((key, word) for key in self.oneway for word in split_words(tags.get(key)))
        key, word = next(((key, word) for key, word in signs if self._is_direction(key, word)), ("", ""))
        closing = ("", "")
        if not key:
            closing = ("", _tag_among(self.implied_oneway, tags))
        elif word in self.oneway[key]:
            closing = ("", f"{key}={word}")
        elif word in AGAINST:
            closing = (f"{key}={word}", "")
        is_general = key in ("", "oneway", "oneway:vehicle")
        return ("", "") if is_general and _tag_among(self.contraflow, tags) else closing

    def _is_direction(self, key: str, word: str) -> bool:
        """Return whether a word is a known value of a key for one-way traffic."""
        return word in self.oneway[key] or word in AGAINST or word in TWO_WAY or word in VARYING


class _SignedAccess(NamedTuple):
    """What access keys say about a way or a node."""

    is_open: bool | None  # None: neither open nor closed
    tag: str = ""
    is_directed: bool = False  # whether the key names the direction


def _find_closing_words(rules: _Values, tags: Mapping[str, str], direction: str) -> str:
    """Return the first tag for a direction whose words all close a way, as "key=words", or ""."""
    for key, values in rules.items():
        directed = f"{key}:{direction}"
        if closing := find_closing_tag(tags, directed if directed in tags else key, values):
            return closing
    return ""


def _tag_among(rules: _Values, tags: Mapping[str, str]) -> str:
    """Return the first tag that has one of these values, as "key=word", or ""."""
    found = (f"{key}={word}" for key, values in rules.items() for word in split_words(tags.get(key)) if word in values)
    return next(found, "")


def modes(filepath: object = None) -> dict[str, Mode]:
    """Return the modes of travel in a TOML file by name; by default the modes of GAMMS.

    Each table of the file is a mode; `extends = "drive"` takes missing fields from that mode, of the file or of GAMMS.
    docs/maps.md explains the fields.

    Raises:
        FileNotFoundError: the file does not exist.
        BadFile: the file is not TOML, or a field is missing, unknown or impossible.
    """
    if filepath is None:
        return dict(_load_shipped())
    file = as_path(filepath, "filepath")
    return _read(file, {name: _list_fields(mode) for name, mode in _load_shipped().items()})


@cache
def _load_shipped() -> dict[str, Mode]:
    return _read(_FILE, {})


def _list_fields(mode: Mode) -> dict[str, Any]:
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


@dataclass(slots=True, frozen=True)
class ModeCombination:
    """The modes of travel of one graph, in the order in which they give its edges their `speed_kph`."""

    modes: tuple[ModeFunction, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the modes, which are attributes of edges."""
        return tuple(get_mode_name(mode) for mode in self.modes)


Travel = ModeFunction | ModeCombination
"""The mode of travel of a graph, or its several modes."""

_NO_NAMES = OWN_NAMES | {
    *KEPT_TAGS,
    *NETWORK_KEYS,
    "duration",
    "oneway",
    "across_area",
    "underground",
}  # other attributes of edges


def as_travel(value: object, tags: Collection[str] = ()) -> Travel:
    """Return the mode of travel, or the several modes of a list; see `as_mode`.

    Args:
        value: as users give it.
        tags: the tags that edges keep besides the usual ones.

    Raises:
        BadType: the value, or an item of the list, is none.
        BadValue: the list is empty, or two modes have one name, or a mode has the name of another attribute of edges.
    """
    if not isinstance(value, (list, tuple)):
        return as_mode(value)
    several = ModeCombination(tuple(as_mode(one) for one in value))
    if not several.modes:
        raise BadValue("osm_type is an empty list. Name the modes of travel, such as ['walk', 'drive'].")
    for row, name in enumerate(several.names):
        if name in several.names[:row]:
            raise BadValue(f"osm_type has two modes with the name {name!r}, which is the name of their attribute.")
        if name in _NO_NAMES or name in tags or not name.isidentifier():
            raise BadValue(
                f"A mode in a list cannot have the name {name!r}, because edges state its speeds under its name. "
                "Give the function another name."
            )
    return several


def _make_network_mode(given: Mapping[Any, object]) -> Mode:
    """Return the mode of a network that is no road: all ways with one of these tags.

    Args:
        given: key -> a value, a list of values, True for any value, or values with their km/h.

    Raises:
        BadType, BadValue: it is something else.
    """
    classes: dict[str, float] = {}
    names = list[str]()
    for key, values in given.items():
        listed = ["*"] if values is True else [values] if isinstance(values, str) else values
        if not isinstance(key, str) or not isinstance(listed, (list, tuple, set, frozenset, Mapping)) or not listed:
            raise BadType(
                f"osm_type[{shown(key)}] must be a value, a list of values, values with their km/h, or True for any, "
                f"not {shown(values)}."
            )
        for value in sorted(listed) if isinstance(listed, (set, frozenset)) else listed:
            if not isinstance(value, str):
                raise BadType(f"osm_type[{key!r}] must have texts as values, not {shown(value)}.")
            word = value.strip().lower()
            kph = listed[value] if isinstance(listed, Mapping) else find_network_speed_kph(key, word)
            if not 0.0 < parse_number(kph) <= _FASTEST_KPH:
                raise BadValue(
                    f"osm_type[{key!r}][{value!r}] must be a speed up to {_FASTEST_KPH:g} km/h, not {shown(kph)}."
                )
            classes[word if key == "highway" else f"{key}={word}"] = parse_number(kph)
            names.append(key if word == "*" else word)
    if not classes:
        raise BadValue("osm_type is an empty dict. Name keys and values, such as {'railway': ['rail', 'tram']}.")
    never = _load_shipped()["walk"].never
    cars = _load_shipped()["drive"]
    return replace(
        cars,
        name="_".join(names),
        highways=classes,
        by_permission={},
        access=(),
        refused=(),
        closed={},
        never=never,
        oneway={"oneway": cars.oneway["oneway"]},
        implied_oneway={},
        barriers=(),
        tolerance=_TOLERANCE_M,
    )


def list_mode_keys(mode: ModeFunction) -> tuple[str, ...]:
    """Return the keys of which a way needs one to be read for a mode.

    A function is asked about other networks than roads if it closes a way without tags: one that opens it, or fails,
    decides among roads only.
    """
    if isinstance(mode, Mode):
        return mode.keys
    try:
        is_choosy = mode({}) is None
    except Exception:  # noqa: BLE001 # it reads the tags of roads; if it fails for them, too, its error is told there
        is_choosy = False
    return (*ROADS, *NETWORK_KEYS) if is_choosy else ROADS


def explain_name(value: object, known: Iterable[str]) -> str:
    """Return the way out for a value that is no mode: a list for several names in one text, else the nearest name."""
    if isinstance(value, str) and "," in value:
        return f" Several modes are a list: [{', '.join(name.strip() for name in value.split(','))}]."
    return nearest(value, known)


def as_mode(value: object) -> ModeFunction:
    """Return a mode of travel from an `OSMType`, a name, a `Mode`, a function or a dict of the tags of a network.

    Raises:
        BadType: the value is none of these.
    """
    if callable(value) and not isinstance(value, type):
        return value
    if isinstance(value, Mapping):
        return _make_network_mode(value)
    name = value.name if isinstance(value, OSMType) else value
    mode = _load_shipped().get(name.rpartition(".")[2].lower()) if isinstance(name, str) else None
    if mode is None:
        raise BadType(
            "osm_type must be OSMType.WALK, BIKE or DRIVE, one of the names "
            f"{', '.join(_load_shipped())}, a Mode, a function, a dict of tags or a list of these, not {shown(value)}."
            f"{explain_name(value, _load_shipped())}"
        )
    return mode


def get_mode_name(mode: Travel) -> str:
    """Return the name of a mode for a graph, such as "drive", or that of the function; of several, "walk,drive"."""
    if isinstance(mode, ModeCombination):
        return ",".join(mode.names)
    return mode.name if isinstance(mode, Mode) else str(getattr(mode, "__name__", type(mode).__name__))


def find_tolerance(mode: Travel | None) -> float:
    """Return the default tolerance of loaders, in meters; of several modes the least."""
    if isinstance(mode, ModeCombination):
        return min(map(find_tolerance, mode.modes))
    return mode.tolerance if isinstance(mode, Mode) else _TOLERANCE_M


def find_stops(mode: ModeFunction | None) -> Stops | None:
    """Return the test for nodes that agents of a mode cannot pass; None: they pass all."""
    return mode.is_stopped_by if isinstance(mode, Mode) else None


def find_vehicles(mode: ModeFunction | None) -> tuple[str, ...]:
    """Return the names of a mode in turn restrictions, the most specific first; empty if none hold for it.

    They hold for vehicles, so not for walkers; nothing is known about the vehicle of a function.
    """
    return mode.vehicles if isinstance(mode, Mode) and _VEHICLE in mode.access else ()


def honour_traffic(mode: ModeFunction) -> ModeFunction:
    """Return the mode for agents that obey the one-way streets of cars; a function is returned unchanged."""
    if not isinstance(mode, Mode) or "oneway" in mode.oneway:
        return mode
    cars = _load_shipped()["drive"]
    oneway = {**mode.oneway, "oneway": cars.oneway["oneway"]}
    return replace(mode, oneway=oneway, implied_oneway=cars.implied_oneway)


def make_closed_rule(mode: ModeFunction) -> Rule:
    """Return the rule for reading the ways that are closed to a mode, with the closing tag as `why`."""
    rule = make_rule(mode)

    def closed(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        if rule(osmid, tags) is not None:
            return None
        why = mode.why_closed(tags) if isinstance(mode, Mode) else get_mode_name(mode)
        return {"osmid": osmid, "why": why, "oneway": False}, False

    return closed


def make_rule(mode: ModeFunction, names: Collection[str] = KEPT_TAGS) -> Rule:
    """Return the rule for reading the ways of a mode of travel; `names` are the tags to keep."""
    decide = _cache_answers(mode) if isinstance(mode, Mode) else lambda tags: (mode(tags), _NO_SIGNS)
    kept = (*names, *(key for key in mode.keys if key not in names)) if isinstance(mode, Mode) else names

    def rule(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        try:
            access, signs = decide(tags)
        except Exception as error:
            raise BadValue(f"{get_mode_name(mode)} failed for way {osmid}: {type(error).__name__}: {error}.") from error
        if access is None:
            return None
        if not isinstance(access, Access):
            raise BadType(f"{get_mode_name(mode)} must return an Access or None, not {shown(access)}.")
        speed, forward, backward = access
        back = speed if access.backward_kph is None else access.backward_kph
        for kph in (speed, back):
            if not 0.0 < parse_number(kph) < math.inf:
                raise BadValue(
                    f"{get_mode_name(mode)} gives way {osmid} the speed {shown(kph)}: it must be more than 0 km/h."
                )
        if not forward and not backward:
            return None
        found = {**make_attributes(osmid, tags, kept), "oneway": not (forward and backward)}
        seconds = mode.stated_seconds(tags) if isinstance(mode, Mode) and "duration" in tags else None
        if seconds is not None:
            return {**found, "speed_kph": float(speed), STATED_SECONDS: seconds}, not forward
        if "maxspeed" in names:
            found = add_directions(found, signs, against=not forward)
        speeds = [{"speed_kph": float(speed)}, {"speed_kph": float(back)}]
        return add_directions(found, speeds, against=not forward), not forward

    return rule


def make_paced_rule(mode: ModeFunction, osm_type: OSMType, names: Iterable[str] = KEPT_TAGS) -> Rule:
    """Return the rule that takes all ways, with the directions of `keep_tags` and the speeds and signs of a mode.

    The speeds are those of signs and classes if the mode is a function, which knows no speeds of ways that it closes.
    """

    def rule(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool]:
        kept, against = keep_tags(osmid, tags, osm_type, names)
        if not isinstance(mode, Mode):
            return add_signs(kept, tags, against=against), against
        speeds = [{"speed_kph": mode.speed_kph(tags, direction)} for direction in DIRECTIONS]
        signed = add_directions(kept, mode.signs(tags), against=against)
        return add_directions(signed, speeds, against=against), against

    return rule


_MOST_KNOWN = 10_000
_LONGEST_KNOWN = 255  # characters of a value
_NO_SIGNS: Sequence[Mapping[str, Any]] = ({}, {})


def _cache_answers(mode: Mode) -> Callable[[Mapping[str, str]], tuple[Access | None, Sequence[Mapping[str, Any]]]]:
    """Return a function from tags to the access and the signs of a mode; it remembers answers: most ways are alike."""
    keys = mode.decisive_keys()
    known: dict[tuple[tuple[str, str], ...], tuple[Access | None, Sequence[Mapping[str, Any]]]] = {}

    def decide(tags: Mapping[str, str]) -> tuple[Access | None, Sequence[Mapping[str, Any]]]:
        plain = normalize_tags(tags)
        read = tuple([(key, value) for key, value in plain.items() if key in keys])
        found = known.get(read)
        if found is None:
            found = mode(plain), mode.signs(plain)
            if len(known) < _MOST_KNOWN and all(len(value) <= _LONGEST_KNOWN for _, value in read):
                known[read] = found
        return found

    return decide


def keep_more_tags(rule: Rule, names: Sequence[str]) -> Rule:
    """Return a rule by which ways keep further tags."""

    def with_tags(osmid: int, tags: Mapping[str, str]) -> tuple[dict[str, Any], bool] | None:
        found = rule(osmid, tags)
        return found and ({**{name: tags[name] for name in names if name in tags}, **found[0]}, found[1])

    return with_tags if names else rule


WayFilter = Callable[[Mapping[str, str]], object] | Mapping[str, str | bool | Sequence[str]]


def filter_rule(rule: Rule | None, given: WayFilter | None) -> Rule | None:
    """Return a rule that also applies the caller's filter.

    Args:
        rule: the rule without the filter.
        given: a function from tags to a bool; or tag -> the required value, a list of such values, or True for any.

    Raises:
        BadType: the filter is neither.
    """
    if rule is None or given is None:
        return rule
    keep = _make_tag_function(given) if isinstance(given, Mapping) else given
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


def _make_tag_function(given: Mapping[str, object]) -> Callable[[Mapping[str, str]], bool]:
    wanted: dict[str, set[str] | None] = {}
    for tag, values in given.items():
        listed = [values] if isinstance(values, str) else values
        if not (values is True or (isinstance(listed, (list, tuple, set)) and all(isinstance(v, str) for v in listed))):
            raise BadType(f"filter[{tag!r}] must be a value, a list of values, or True for any, not {shown(values)}.")
        wanted[tag] = set(listed) if isinstance(listed, (list, tuple, set)) else None
    return lambda tags: all(tag in tags and (one is None or tags[tag] in one) for tag, one in wanted.items())
