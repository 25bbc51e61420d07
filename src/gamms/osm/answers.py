"""What is wrong with the answer of a map server: looked at before anything is made of it or kept of it.

The functions return the fault in words, and nothing where there is none.
"""

import math
from collections.abc import Iterator
from itertools import chain
from typing import Any

_FARTHEST = (180.0, 90.0)  # degrees of longitude and latitude
_MOST_CUT = 1 / 3  # share of ways that may lack nodes: where a map was cut, some do; where it is damaged, most do
_POLYGONS = ("Polygon", "MultiPolygon")


def fault_of_places(answer: Any) -> str:
    """The fault of Nominatim's answer to the question where a place is; an empty one has none."""
    if not isinstance(answer, list) or not all(isinstance(place, dict) for place in answer):
        return "it is no list of places"
    return next((fault for place in answer if (fault := _fault_of_place(place))), "")


def fault_of_streets(answer: Any) -> str:
    """The fault of Overpass's answer to the question for streets; an empty one has none."""
    fault = _fault_of_elements(answer)
    if fault:
        return fault
    nodes = {element["id"] for element in answer["elements"] if element["type"] == "node"}
    ways = (element for element in answer["elements"] if element["type"] == "way")
    cut = next((way["id"] for way in ways if not nodes.issuperset(way["nodes"])), None)
    return "" if cut is None else f"it lacks nodes of the way {cut}"


def fault_of_areas(answer: Any) -> str:
    """The fault of Overpass's answer to the question for buildings and the like; an empty one has none."""
    fault = _fault_of_elements(answer)
    if fault:
        return fault
    nodes = {element["id"] for element in answer["elements"] if element["type"] == "node"}
    ways = [element for element in answer["elements"] if element["type"] == "way"]
    cut = sum(not nodes.issuperset(way["nodes"]) for way in ways)
    return f"it lacks nodes of {cut} of its {len(ways)} ways" if cut > _MOST_CUT * len(ways) else ""


def _fault_of_elements(answer: Any) -> str:
    if not isinstance(answer, dict) or not isinstance(answer.get("elements"), list):
        return "it has no list of elements"
    if answer.get("remark"):
        return f"it is incomplete, for the server remarks {str(answer['remark'])[:200]!r}"
    return next((f"{str(one)[:100]} is no element" for one in answer["elements"] if not _is_element(one)), "")


def _fault_of_place(place: dict[str, Any]) -> str:
    try:
        is_ranked = math.isfinite(float(place["importance"]))  # Nominatim may write numbers as text
    except (KeyError, TypeError, ValueError):
        is_ranked = False
    shape = place.get("geojson")
    if not is_ranked:
        return "a place has no importance"
    if shape is not None and (not isinstance(shape, dict) or not isinstance(shape.get("type"), str)):
        return "a place has a geometry without a type"
    if shape is None or shape["type"] not in _POLYGONS or _is_outline(shape.get("coordinates"), shape["type"]):
        return ""
    return "a place has a boundary that is no polygon"


def _is_outline(coordinates: Any, kind: str) -> bool:
    try:
        rings = coordinates if kind == "Polygon" else list(chain.from_iterable(coordinates))
        return bool(rings) and all(len(ring) >= 4 and all(map(_is_position, ring)) for ring in rings)
    except TypeError:
        return False


def _is_position(place: Any) -> bool:
    return (
        isinstance(place, list)
        and len(place) >= 2
        and all(_is_number(x) and abs(x) <= most for x, most in zip(place, _FARTHEST, strict=False))
    )


def _is_element(element: Any) -> bool:
    if not isinstance(element, dict) or not isinstance(element.get("type"), str):
        return False
    tags = element.get("tags", {})
    if not isinstance(tags, dict) or not all(isinstance(text, str) for text in _texts(tags)):
        return False
    check = _ELEMENTS.get(element["type"])
    return check is None or (_is_id(element.get("id")) and check(element))


def _texts(tags: dict[Any, Any]) -> Iterator[Any]:
    return chain(tags.keys(), tags.values())


def _is_node(node: dict[str, Any]) -> bool:
    return _is_position([node.get("lon"), node.get("lat")])


def _is_way(way: dict[str, Any]) -> bool:
    nodes = way.get("nodes")
    return isinstance(nodes, list) and all(map(_is_id, nodes))


def _is_relation(relation: dict[str, Any]) -> bool:
    members = relation.get("members")
    return isinstance(members, list) and all(
        isinstance(member, dict) and {"type", "ref", "role"} <= member.keys() for member in members
    )


_ELEMENTS = {"node": _is_node, "way": _is_way, "relation": _is_relation}


def _is_id(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
