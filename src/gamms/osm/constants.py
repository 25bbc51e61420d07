"""The buildings and areas that block the view, their heights, and the color of each kind.

Programs read and change these tables by name; the loaders of buildings take them as arguments.
"""

from gamms.ir.obstacles import COLOR_TYPES

__all__ = ["BARRIER_HEIGHTS", "COLOR_TYPES", "HEIGHT_ESTIMATES_TYPES", "OSM_OBSTACLE_TAGS", "wall_estimates"]

OSM_OBSTACLE_TAGS: dict[str, bool | list[str]] = {  # key -> values that block the view; True: all
    "building": True,
    "building:part": True,
    "landuse": ["industrial", "commercial", "retail", "residential", "construction", "forest", "military", "railway"],
    "natural": ["wood", "forest", "scrub"],
    "leisure": ["sports_centre", "stadium"],
    "amenity": ["school", "university", "hospital", "parking"],
    "man_made": ["bridge", "tower", "water_tower", "storage_tank", "silo", "chimney", "communications_tower", "mast"],
    "power": ["substation", "generator", "plant"],
    "aeroway": ["terminal", "hangar"],
}

HEIGHT_ESTIMATES_TYPES: dict[tuple[str, str], tuple[float, int]] = {  # (key, value) -> (height in meters, type)
    ("building", "house"): (8.0, 0),
    ("building", "residential"): (10.0, 1),
    ("building", "apartments"): (18.0, 2),
    ("building", "commercial"): (15.0, 3),
    ("building", "retail"): (12.0, 4),
    ("building", "industrial"): (14.0, 5),
    ("building", "warehouse"): (11.0, 6),
    ("building", "school"): (12.0, 7),
    ("building", "hospital"): (20.0, 8),
    ("building", "university"): (18.0, 9),
    ("building", "church"): (25.0, 10),
    ("building", "garage"): (4.0, 11),
    ("building", "hangar"): (16.0, 12),
    ("building", "stadium"): (35.0, 13),
    ("building", "yes"): (10.0, 14),
    ("natural", "wood"): (15.0, 15),
    ("natural", "forest"): (18.0, 16),
    ("landuse", "forest"): (18.0, 16),
    ("leisure", "sports_centre"): (12.0, 17),
    ("leisure", "stadium"): (35.0, 18),
    ("man_made", "tower"): (45.0, 19),
    ("man_made", "water_tower"): (35.0, 20),
    ("man_made", "storage_tank"): (18.0, 21),
    ("man_made", "silo"): (30.0, 22),
    ("man_made", "chimney"): (55.0, 23),
    ("man_made", "communications_tower"): (50.0, 24),
    ("man_made", "mast"): (40.0, 25),
    ("man_made", "bridge"): (12.0, 26),
    ("power", "substation"): (8.0, 27),
    ("power", "plant"): (25.0, 28),
    ("power", "generator"): (6.0, 29),
    ("aeroway", "terminal"): (18.0, 30),
    ("aeroway", "hangar"): (16.0, 31),
    ("landuse", "industrial"): (14.0, 32),
    ("landuse", "commercial"): (15.0, 33),
    ("landuse", "retail"): (12.0, 34),
    ("landuse", "residential"): (10.0, 35),
    ("landuse", "military"): (12.0, 36),
}


BARRIER_HEIGHTS: dict[str, float] = {  # height in meters of lines with `barrier` whose tags do not give one
    "city_wall": 8.0,
    "wall": 2.0,
    "retaining_wall": 2.0,
    "hedge": 2.0,
    "fence": 1.8,
}
_GARAGES = 11  # types
_OTHER = 14
_ONE_STOREY: dict[tuple[str, str], tuple[float, int]] = {
    ("building", "garages"): (4.0, _GARAGES),
    **{("building", kind): (3.0, _OTHER) for kind in ("cabin", "container", "greenhouse", "hut", "kiosk", "shed")},
}
_SITES = (  # areas without walls around them, whatever stands on them
    "landuse",
    "leisure",
    ("man_made", "bridge"),
    ("power", "plant"),
)


def wall_estimates() -> dict[tuple[str, str], tuple[float, int]]:
    """Return the default heights for loaders of buildings: HEIGHT_ESTIMATES_TYPES in its current state, with changes.

    Land use, sports grounds, bridges and the grounds of power plants are left out, because they have no walls. A
    building of an unlisted kind counts as `building=yes`, unless it is not a building (`no`, `proposed`,
    `construction`, `razed`, `demolished`) or has no walls (`roof`, `carport`). Garages and huts have one story. Parts
    of buildings count.
    """
    walls = {row: one for row, one in HEIGHT_ESTIMATES_TYPES.items() if row not in _SITES and row[0] not in _SITES}
    default = walls.get(("building", "yes"))
    if default is None:
        return walls
    return {("building:part", "*"): default, ("building", "*"): default, **_ONE_STOREY, **walls}
