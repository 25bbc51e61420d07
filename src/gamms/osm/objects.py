"""The objects of a map: which of them count, the words and numbers in their tags, and which tags are kept.

The readers of files and of servers' answers both follow them, for nodes, ways and relations:

- Of several versions of an object, the highest counts. An object that is deleted in it is not there.
- A way with fewer than two nodes is no line and is left out.
- An object that is given again with the same content counts once. A way that is given again with other nodes is a
  further piece of the way, if it shares no stretch with the first.
- Anything else contradicts itself: a node at two places, or one way or relation in two forms.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_items
from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown

LEAST_NODES = 2  # of a way
_NO_VERSION = -1  # of an object that is deleted
_KEEP_ONE = "Keep the one that is right"


NODE = "n"
WAY = "w"
RELATION = "r"

Member = tuple[str, int, str]
"""A member of a relation: its kind, id and role."""


Wanted = Callable[[str, Mapping[str, str]], bool]
"""From the kind and tags of an element to whether its nodes or members shall be read."""


class MapElement(NamedTuple):
    """A node, way or relation of a map.

    Attributes:
        kind: `NODE`, `WAY` or `RELATION`.
        id: its id in OpenStreetMap.
        tags: its tags.
        refs: the ids of the nodes of a way.
        places: the places of these nodes, in units of 1e-7 degrees; empty if the source does not know them.
        members: the members of a relation.
    """

    kind: str
    id: int
    tags: dict[str, str]
    refs: Sequence[int] = ()
    places: Sequence[tuple[int, int]] = ()
    members: Sequence[Member] = ()


class ObjectIds:
    """The ids of all objects of a map, to tell whether it gives one several times."""

    def __init__(self) -> None:
        self._parts: dict[str, list[IntArray]] = {}

    def add(self, kind: str, ids: IntArray) -> None:
        """Add ids of one kind of object, in the order of the map."""
        self._parts.setdefault(kind, []).append(ids)

    def has_repeats(self) -> bool:
        """Return whether an id is there several times for one kind of object."""
        return any(_has_repeats(np.concatenate(parts)) for parts in self._parts.values())


def _has_repeats(ids: IntArray) -> bool:
    if (np.diff(ids) > 0).all():  # the usual order of files
        return False
    return bool((np.diff(np.sort(ids)) == 0).any())


class ObjectVersions:
    """The versions that count, of objects of one kind that are deleted or given several times.

    Args:
        ids: (objects,) the id of each object of the map, in its order.
        versions: (objects,) 0 where the map does not say.
        deleted: (objects,) whether this version says that the object is deleted.
    """

    def __init__(self, ids: IntArray, versions: IntArray, deleted: BoolArray) -> None:
        order = np.lexsort((deleted, versions, ids))  # the last row of each id decides
        last = np.append(ids[order][1:] != ids[order][:-1], True)[: len(ids)]
        first = np.append(True, last[:-1])[: len(ids)]
        is_special = (~(first & last) | deleted[order])[last]
        rows = order[last][is_special]
        counting = np.where(deleted[rows], _NO_VERSION, versions[rows])
        self._counting = dict(zip(ids[rows].tolist(), counting.tolist(), strict=True))

    def is_counted(self, id: int, version: int) -> bool:
        """Return whether an object with this id and version counts."""
        counting: int = self._counting.get(id, version)
        return counting == version

    def are_counting(self, ids: IntArray, versions: IntArray) -> BoolArray:
        """Return a mask of the objects that count."""
        found = map(self.is_counted, ids.tolist(), versions.tolist())
        return np.fromiter(found, np.bool_, len(ids))


def find_nodes_at_two_places(ids: IntArray, places: IntArray | FloatArray) -> frozenset[int]:
    """Return the ids of nodes that are given at different places.

    Args:
        ids: (nodes,) of the nodes that count.
        places: (nodes, 2)
    """
    order = np.argsort(ids, kind="stable")
    again = ids[order][1:] == ids[order][:-1]
    moved = (places[order][1:] != places[order][:-1]).any(axis=1)
    return frozenset(ids[order][1:][again & moved].tolist())


class WayRules:
    """The rules for ways, applied to one after the other.

    Args:
        first: returns the nodes of the way with an id that was taken first and whether it is one-way, or None.
        unclear: ids of nodes that are at two places.

    Attributes:
        without_nodes: the number of ways that were left out, because they have fewer than two nodes.
    """

    def __init__(self, first: Callable[[int], tuple[Sequence[int], bool] | None], unclear: frozenset[int]) -> None:
        self.without_nodes = 0
        self._first = first
        self._unclear = unclear
        self._pieces: dict[int, _WayPieces] = {}

    def take(self, id: int, refs: Sequence[int], tags: Mapping[str, str]) -> bool:
        """Return whether a way with these nodes counts; False: it is no line, or already there.

        Raises:
            ValueError: the way contradicts an earlier one, or it is unclear where it is.
        """
        if len(refs) < LEAST_NODES:
            self.without_nodes += 1
            return False
        if self._unclear and (found := sorted(self._unclear.intersection(refs))):
            raise ValueError(f"node {found[0]} is there several times in one version, at different places. {_KEEP_ONE}")
        first = self._first(id)
        if first is None:
            return True
        if id not in self._pieces:
            self._pieces[id] = _WayPieces()
            self._pieces[id].add(first[0], one_way=first[1])
        is_new = self._pieces[id].add(refs, one_way=is_one_way_street(tags))
        if is_new is None:
            raise ValueError(f"way {id} is there several times in one version, with different nodes. {_KEEP_ONE}")
        return is_new


def is_one_way_street(tags: Mapping[str, str]) -> bool:
    """Return whether traffic on a way with these tags is one-way."""
    plain = normalize_tags(tags)
    return is_one_way(plain.get("oneway"), plain.get("junction"))


class _WayPieces:
    """The pieces of a way that is given several times in one version, each by its nodes."""

    def __init__(self) -> None:
        self._lines: set[tuple[int, ...]] = set()
        self._stretches: set[tuple[int, int]] = set()

    def add(self, refs: Sequence[int], *, one_way: bool) -> bool | None:
        """Return whether a piece is new, also backward unless it is one-way; None: it overlaps another piece."""
        directions = [(*refs,)]
        if not one_way:
            directions.append(directions[0][::-1])
        if not self._lines.isdisjoint(directions):
            return False
        stretches = {pair for line in directions for pair in pairwise(line)}
        if not self._stretches.isdisjoint(stretches):
            return None
        self._lines.update(directions)
        self._stretches |= stretches
        return True


def check_members(id: int, members: Sequence[Member], known: Sequence[Member]) -> None:
    """Check a relation that is given again.

    Raises:
        ValueError: it has other members than before.
    """
    if [*members] != [*known]:
        raise ValueError(f"relation {id} is there several times in one version, with different members. {_KEEP_ONE}")


# -- tags -------------------------------------------------------------------------------------------------------


DIRECTIONS = ("forward", "backward")  # along the vertices of a way, and against them
# Words of `oneway`, also of other programs: FT and TF are ArcGIS's "from, to", T and F those of Geographic Data Files.
AGAINST = frozenset(("-1", "-1.0", "reverse", "backward", "tf"))
ONE_WAY = AGAINST | {"yes", "y", "true", "1", "1.0", "forward", "ft"}
TWO_WAY = frozenset(("no", "n", "false", "0", "0.0"))
VARYING = frozenset(("reversible", "alternating"))  # two-way here
_WORD_OF_LETTER = {"T": "-1", "F": "yes", "t": "yes", "f": "no"}  # in small letters they are truths
_TRUTH_OF_WORD = {
    **dict.fromkeys(ONE_WAY | {"t"}, True),
    **dict.fromkeys(TWO_WAY | VARYING | {"f", "-0.0"}, False),
}
_MISSING = frozenset(("", "nan", "none", "null", "<na>"))  # also as text, in files of tables
_ITEM = re.compile(r"""\s*(?:'([^']*)'|"([^"]*)"|([^,]*))\s*(?:,|$)""")  # of a list that was written as text


def is_against(oneway: object) -> bool:
    """Return whether the traffic of a one-way road runs against the order of its vertices."""
    return not AGAINST.isdisjoint(_list_oneway_words(oneway))


def is_one_way(oneway: object, junction: object) -> bool:
    """Return whether traffic is one-way; without a word that is known, only in roundabouts."""
    words = _list_oneway_words(oneway)
    if not ONE_WAY.isdisjoint(words):
        return True
    is_known = any(word in TWO_WAY or word in VARYING for word in words)
    return not is_known and "roundabout" in split_words(junction)


def _list_oneway_words(value: object) -> list[str]:
    text = value.strip() if isinstance(value, str) else ""
    return split_words(_WORD_OF_LETTER.get(text, value))


def split_words(value: object) -> list[str]:
    """Return the words of a value without the spaces around them, in lower case.

    Texts are split at semicolons. A list gives the words of its items, also if it was written as text, as GraphML files
    have it: "['residential', 'service']".
    """
    if value is None:
        return []
    if type(value) is str and (value.isdecimal() or (value.isidentifier() and value.islower())):  # most values
        return [value]
    found: list[str] = []
    for item in list_items(value):
        if isinstance(item, (list, tuple)):
            found += split_words(item)
        elif isinstance(item, str) or not is_missing(item):
            found += [word for part in _format_item(item).split(";") if (word := part.strip().lower())]
    return found


def normalize_tags(tags: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return tags with their keys in lower case and without spaces around them; an exact key comes first."""
    keys = "".join(tags)
    if keys.islower() and len(keys.split(None, 1)) == 1:  # most maps: no key has a space
        return tags
    plain = {key.strip().lower(): value for key, value in tags.items()}
    plain.update((key, tags[key]) for key in plain if key in tags)
    return plain


def has_direction(tags: Mapping[str, Any]) -> bool:
    """Return whether a tag holds for one direction of a way, such as `vehicle:forward`."""
    return any(":forward" in key or ":backward" in key for key in tags)


def list_items(value: object) -> list[Any]:
    """Return the items of a list, also of one that was written as text; the value itself if it is not a list."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, (list, tuple)):
        return [*plain]
    text = plain.strip() if isinstance(plain, str) else ""
    if text.startswith("[") and text.endswith("]"):
        return ["".join(parts).strip() for parts in _ITEM.findall(text[1:-1]) if any(parts)]
    return [plain]


def is_missing(value: object) -> bool:
    """Return whether a value stands for none: None, NaN, an empty text, or one of these as text."""
    if isinstance(value, str):
        return value.strip().lower() in _MISSING
    return value is None or (isinstance(value, float) and math.isnan(value)) or type(value).__name__ == "NAType"


def parse_number(value: object) -> float:
    """Return a value as a number, also if it is written as text; NaN if it is not a number."""
    if type(value).__name__ in ("bool", "bool_"):
        return math.nan
    try:
        return float(value)  # type: ignore[arg-type] # the error is the check
    except (TypeError, ValueError, OverflowError):
        return math.nan


def parse_truth(value: object) -> bool | None:
    """Return a truth, also one that is written as text or number; None if the value is not a truth.

    A road that was joined of one-way and other parts is one-way. Words of `oneway` count as truths.
    """
    truths = [_TRUTH_OF_WORD.get(word) for word in split_words(value)]
    return None if not truths or None in truths else any(truths)


def _format_item(item: object) -> str:
    """Return an item as text; a whole number has no decimals."""
    if isinstance(item, str):
        return item
    return f"{item:.15g}" if isinstance(item, float) else shown(item)


def read_edge_values(data: Mapping[Any, Any], what: str) -> dict[Any, Any]:
    """Return the attributes of an edge of another program, with `oneway`, `speed_kph` and `travel_time` as values.

    They may be written as text, as GraphML files have them; missing ones are left out.

    Args:
        data: the attributes.
        what: the subject of error messages, such as "Edge (0, 1)".

    Raises:
        BadValue: one of the three is not a truth, a speed or a time.
    """
    read = dict(data)
    for name, (as_value, wanted) in _READERS.items():
        if name not in data:
            continue
        if is_missing(data[name]):
            del read[name]
            continue
        value = as_value(data[name])
        if value is None:
            raise BadValue(f"{what} has the {name} {shown(data[name])}. Give {wanted}, or leave it out.")
        read[name] = value
    return read


def _parse_speed(value: object) -> float | None:
    """Return a speed, of several their mean; None if one is not a positive number."""
    speeds = [parse_number(item) for item in list_items(value)]
    is_valid = bool(speeds) and all(0.0 < speed < math.inf for speed in speeds)
    return sum(speeds) / len(speeds) if is_valid else None


def _parse_time(value: object) -> float | None:
    seconds = parse_number(value)
    return seconds if 0.0 <= seconds < math.inf else None


_READERS = {
    "oneway": (parse_truth, "True or False"),
    "speed_kph": (_parse_speed, "kilometers per hour, as a number"),
    "travel_time": (_parse_time, "seconds, as a number"),
}


OWN_NAMES = frozenset(  # attributes that are not tags
    ("id", "osmid", "x", "y", "z", "linestring", "geometry", "length", "grade", "speed_kph", "travel_time", "reversed")
)
_MOST_TAGS = 256
_LONGEST_TAG = 255


class NodeTags(NamedTuple):
    """The tags of a map's nodes, by their OpenStreetMap ids."""

    of: Mapping[int, Mapping[str, str]] = MappingProxyType({})
    staying: frozenset[int] = frozenset()  # nodes that remain nodes even if they merely continue a road


def as_tags(tags: object) -> tuple[str, ...]:
    """Return the checked names of tags that a caller wants to keep.

    Raises:
        BadType: they are not a list of texts.
        BadValue: they are too many, or one has the name of an attribute of GAMMS.
    """
    names = tuple(as_items(tags, "tags", "names of tags"))
    for name in names:
        if not isinstance(name, str):
            raise BadType(f"tags must be a list of names of tags, such as ['surface'], not of {shown(name)}.")
        if name in OWN_NAMES or not 0 < len(name) <= _LONGEST_TAG:
            raise BadValue(
                f"tags contains {shown(name)}, which is not a valid tag, or is reserved for an attribute of GAMMS."
            )
    if len(names) > _MOST_TAGS:
        raise BadValue(f"tags has {len(names)} names; the limit is {_MOST_TAGS}.")
    return names


def find_node_keys(tags: Sequence[str]) -> tuple[str, ...]:
    """Return the keys of node tags to keep if these tags are requested."""
    return ("highway", *(name for name in tags if name != "highway"))


def select_node_tags(given: Mapping[int, Mapping[str, str]], refs: set[int], tags: Sequence[str]) -> NodeTags:
    """Return the kept tags of nodes, by their ids, if these tags are requested.

    Args:
        given: id -> all tags.
        refs: the ids of nodes on roads.
        tags: the requested tags.
    """
    keys = find_node_keys(tags)
    of = {ref: {name: given[ref][name] for name in keys if name in given[ref]} for ref in given.keys() & refs}
    return NodeTags(of, frozenset(ref for ref, kept in of.items() if any(name in kept for name in tags)))
