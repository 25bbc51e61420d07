"""The tags of a map that are kept besides the usual ones, and the tags of nodes."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from gamms.arguments import as_items
from gamms.errors import BadType, BadValue
from gamms.text import shown

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


def node_keys(tags: Sequence[str]) -> tuple[str, ...]:
    """Return the keys of node tags to keep if these tags are requested."""
    return ("highway", *(name for name in tags if name != "highway"))


def node_tags(given: Mapping[int, Mapping[str, str]], refs: set[int], tags: Sequence[str]) -> NodeTags:
    """Return the kept tags of nodes, by their ids, if these tags are requested.

    Args:
        given: id -> all tags.
        refs: the ids of nodes on roads.
        tags: the requested tags.
    """
    keys = node_keys(tags)
    of = {ref: {name: given[ref][name] for name in keys if name in given[ref]} for ref in given.keys() & refs}
    return NodeTags(of, frozenset(ref for ref, kept in of.items() if any(name in kept for name in tags)))
