"""Which tags of a map are kept besides the usual ones, and what nodes say of themselves."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from gamms.arguments import as_items
from gamms.errors import BadType, BadValue
from gamms.text import shown

OWN_NAMES = frozenset(  # of attributes that are no tags
    ("id", "osmid", "x", "y", "z", "linestring", "geometry", "length", "grade", "speed_kph", "travel_time", "reversed")
)
_MOST_TAGS, _LONGEST_TAG = 256, 255


class NodeTags(NamedTuple):
    """What the nodes of a map say of themselves, by their numbers in OpenStreetMap."""

    of: Mapping[int, Mapping[str, str]] = MappingProxyType({})
    staying: frozenset[int] = frozenset()  # those that stay nodes where a road merely goes on


def as_tags(tags: object) -> tuple[str, ...]:
    """Return the names of tags that a caller wants to have kept.

    Raises:
        BadType: they are no list of texts.
        BadValue: they are too many, or one has the name of an attribute of ours.
    """
    names = tuple(as_items(tags, "tags", "names of tags"))
    for name in names:
        if not isinstance(name, str):
            raise BadType(f"tags must be a list of names of tags, such as ['surface'], not of {shown(name)}.")
        if name in OWN_NAMES or not 0 < len(name) <= _LONGEST_TAG:
            raise BadValue(f"tags cannot have {shown(name)}, which is no tag or the name of an attribute of GAMMS.")
    if len(names) > _MOST_TAGS:
        raise BadValue(f"tags has {len(names)} names, and {_MOST_TAGS} are the most.")
    return names


def node_keys(tags: Sequence[str]) -> tuple[str, ...]:
    """Return which tags of nodes are kept if these tags are asked for."""
    return ("highway", *(name for name in tags if name != "highway"))


def node_tags(given: Mapping[int, Mapping[str, str]], refs: set[int], tags: Sequence[str]) -> NodeTags:
    """Return what is kept of the tags of nodes, by their numbers, if these tags are asked for.

    Args:
        given: number -> all tags.
        refs: the numbers of nodes that roads lead through.
        tags: what is asked for.
    """
    keys = node_keys(tags)
    of = {ref: {name: given[ref][name] for name in keys if name in given[ref]} for ref in given.keys() & refs}
    return NodeTags(of, frozenset(ref for ref, kept in of.items() if any(name in kept for name in tags)))
