"""Road networks of places, by name or by area, from OpenStreetMap's servers or from their cached answers.

`overpass.py` downloads the streets; the remaining steps are those for files.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from gamms.arguments import as_bool, as_float, refuse_keywords, spell_out_options
from gamms.errors import BadType, BadValue, PlaceError
from gamms.ir.geometry import check_box
from gamms.ir.geometry import make_polygon as polygon_of
from gamms.ir.graph import FloatArray
from gamms.ir.projection import WGS84, find_utm_crs, project
from gamms.osm.load import (
    ElevationSource,
    GraphRecipe,
    MapOptions,
    ModeOfTravel,
    adapt_recipe,
    as_ground,
    cut,
    for_a_graph,
    make_recipe,
)
from gamms.osm.modes import as_travel, find_tolerance
from gamms.osm.network import OSMType, RoadNetwork, as_osm_type
from gamms.osm.objects import as_tags
from gamms.osm.overpass import Location, StreetOptions, download_streets_of_place, download_streets_of_polygon
from gamms.osm.topology import consolidate
from gamms.progress import show_progress
from gamms.text import shown

if TYPE_CHECKING:
    import networkx as nx
    from shapely import MultiPolygon, Polygon
    from shapely.geometry.base import BaseGeometry

_MOST_RADIUS_M = 75_000.0
_CORNERS = 64  # of a circle

_DEFAULTS = {
    **StreetOptions()._asdict(),
    "tolerance": None,
    "strong": None,
    "elevation": None,
}  # for areas; None: as the mode says


class PlaceOptions(MapOptions, total=False):
    """Options of the functions that make graphs of areas."""

    osm_type: ModeOfTravel | Sequence[ModeOfTravel]
    """The mode of travel, or a list of modes, as for `graph_from_file`: `OSMType.WALK`."""
    resolution: float
    """Meters between nodes: 10.0."""
    simplify: bool
    """Cut streets from junction to junction: True; False makes a node at every vertex of the map."""
    retain_all: bool
    """Keep every part of the map, not only the largest connected one: False."""
    truncate_by_edge: bool
    """Keep streets whole that cross the boundary: True."""
    custom_filter: str | list[str] | None
    """Overpass filters that replace those of the mode, as for `create_osm_graph`: None."""
    tolerance: float | None
    """Meters; junctions joined by a street of at most twice this length become one node: None, as the mode says."""
    bidirectional: bool | None
    """Let agents go against one-way streets; False keeps the directions: None, as the mode says."""
    offline: bool
    """Never use the network, only earlier downloads: False."""
    strong: bool | None
    """Keep the largest part in which every node can be reached from every other: None, yes."""


@for_a_graph
def create_osm_graph(
    location: Location,
    osm_type: OSMType | str = OSMType.WALK,
    resolution: float = 10.0,
    simplify: bool = True,
    retain_all: bool = False,
    truncate_by_edge: bool = True,
    custom_filter: str | list[str] | None = None,
    tolerance: float = 10.0,
    bidirectional: bool | None = None,
    offline: bool = False,
) -> "nx.DiGraph[int]":
    """Make a graph of the streets of a place, with the ways and defaults of gamms 1.0.0 and the speeds of the mode.

    `graph_from_place` uses the modes of travel, like `graph_from_file`.

    Args:
        location: a name such as "Kluuvi, Helsinki", a dict such as `{"city": "Turku"}`, or a list of these.
        osm_type: streets and paths for WALK, BIKE or DRIVE.
        resolution: meters between nodes, as for `graph_from_xml`.
        simplify: turn nodes that merely continue a street into vertices of its polyline before it is cut.
        retain_all: keep every part of the map, not only the largest connected one.
        truncate_by_edge: keep streets whole that cross the boundary.
        custom_filter: Overpass filters that replace those of `osm_type`, such as '["highway"~"primary|secondary"]';
            a list is the union of its items.
        tolerance: meters; junctions joined by streets and within twice this distance become one node.
        bidirectional: let agents go against one-way streets; False keeps the directions, None does so for BIKE and
            DRIVE.
        offline: never use the network, only earlier downloads.

    Returns:
        A directed graph as from `graph_from_xml`: UTM meters, its CRS in `G.graph["crs"]`.

    Raises:
        PlaceError: the place is unknown, has no streets of this type, or with `offline` was never downloaded.
        NetworkError: a server cannot be reached, is busy, or sends an invalid answer.
        BadValue, BadType: an argument is impossible.
        MissingExtra: requests is not installed.
    """
    rest = (resolution, simplify, retain_all, truncate_by_edge, custom_filter, tolerance, bidirectional, offline)
    options = StreetOptions(as_osm_type(osm_type), *rest)
    return _make_graph(download_streets_of_place, location, shown(location), options, _make_recipe(options))


_with_place_options = spell_out_options(**_DEFAULTS)


@for_a_graph
@_with_place_options
def graph_from_place(location: Location, **options: Unpack[PlaceOptions]) -> "nx.DiGraph[int]":
    """Make a graph of the streets of a place for a mode of travel, like `graph_from_file` for a file.

    `location` is as for `create_osm_graph`, and `PlaceOptions` explains the other arguments; the result and the
    errors are those of `create_osm_graph`.
    """
    return _make_graph_of_area(download_streets_of_place, location, shown(location), options)


@for_a_graph
@_with_place_options
def graph_from_bbox(
    left: float, bottom: float, right: float, top: float, **options: Unpack[PlaceOptions]
) -> "nx.DiGraph[int]":
    """Make a graph of the streets between two longitudes, `left` and `right`, and two latitudes, `bottom` and `top`.

    A box across 180 degrees is refused, because map servers end there; `graph_from_file` reads one with `clip`.
    `PlaceOptions` explains the other arguments; the result and the errors are those of `create_osm_graph`.
    """
    box = check_box((left, bottom, right, top), ("left", "bottom", "right", "top"))
    name = f"the box {(left, bottom, right, top)}"
    return _make_graph_of_area(download_streets_of_polygon, box.make_region(), name, options)


@for_a_graph
@_with_place_options
def graph_from_point(lat: float, lon: float, radius_m: float, **options: Unpack[PlaceOptions]) -> "nx.DiGraph[int]":
    """Make a graph of the streets within `radius_m` meters of a position in degrees, in a straight line.

    `PlaceOptions` explains the other arguments; the result and the errors are those of `create_osm_graph`.
    """
    circle = _make_circle(lat, lon, radius_m)
    name = f"the circle of {radius_m} m around lat={lat}, lon={lon}"
    return _make_graph_of_area(download_streets_of_polygon, polygon_of(circle), name, options)


@for_a_graph
@_with_place_options
def graph_from_polygon(polygon: "Polygon | MultiPolygon", **options: Unpack[PlaceOptions]) -> "nx.DiGraph[int]":
    """Make a graph of the streets inside a shapely Polygon or MultiPolygon of degrees (longitude, latitude).

    `PlaceOptions` explains the other arguments; the result and the errors are those of `create_osm_graph`.
    """
    name = f"the polygon {str(polygon)[:60]}"
    return _make_graph_of_area(download_streets_of_polygon, polygon, name, options)


def get_network_type(osm_type: OSMType | str) -> str:
    """Return the network type of OSMnx for a mode of travel: "walk", "bike" or "drive".

    Args:
        osm_type: a member of OSMType, or its name.

    Raises:
        BadType: the value is not an OSMType.
    """
    return as_osm_type(osm_type).name.lower()


def _make_graph_of_area(
    streets_of: Callable[..., RoadNetwork], area: "Location | BaseGeometry", name: str, given: PlaceOptions
) -> "nx.DiGraph[int]":
    refuse_keywords(given, PlaceOptions.__annotations__, "A graph of an area")
    rest: dict[str, Any] = {**_DEFAULTS, **given}
    rest["tags"] = as_tags(rest["tags"])
    mode = as_travel(rest.pop("osm_type"), rest["tags"])
    bidirectional = rest["bidirectional"]
    strong = rest.pop("strong")
    if rest["tolerance"] is None:
        rest["tolerance"] = find_tolerance(mode)
    ground = as_ground(rest.pop("elevation"), mode)
    rest["around_buildings"] = as_bool(rest["around_buildings"], "around_buildings")
    options = StreetOptions(**{**rest, "mode": mode})
    recipe = adapt_recipe(_make_recipe(options), mode, bidirectional, strong)
    options = options._replace(mode=mode, strong=recipe.strong and not recipe.bidirectional)
    return _make_graph(streets_of, area, name, options, recipe, ground)


def _make_recipe(options: StreetOptions) -> GraphRecipe:
    return make_recipe(
        *(options.resolution, options.tolerance, options.bidirectional),
        *(options.retain_all, options.simplify, options.osm_type),
    )._replace(around_buildings=options.around_buildings)


def _make_graph(
    streets_of: Callable[..., RoadNetwork],
    place: "Location | BaseGeometry",
    name: str,
    options: StreetOptions,
    recipe: GraphRecipe,
    ground: ElevationSource | None = None,
) -> "nx.DiGraph[int]":
    _check_filter(options.custom_filter)
    # Servers take their time before they answer: show the request at once.
    with show_progress(1.0 if options.offline else 0.0) as show:
        network = streets_of(place, name, options, show)
        show(f"Joining {len(network.sources)} streets")
        joined = consolidate(network, recipe.tolerance)
        if not len(joined.sources):
            raise PlaceError(f"All of {name} is within the tolerance of {recipe.tolerance} m. Lower it.")
        return cut(joined, recipe, show, ground)


def _check_filter(custom_filter: object) -> None:
    filters: list[Any] = custom_filter if isinstance(custom_filter, list) else [custom_filter]
    if custom_filter is None:
        return
    if not all(isinstance(one, str) for one in filters):
        raise BadType(f"custom_filter must be text or a list of texts, not {shown(custom_filter)}.")
    if not filters or not all(one.strip().startswith("[") and one.strip().endswith("]") for one in filters):
        raise BadValue(
            f"""custom_filter must look like '["highway"~"primary|secondary"]', not {shown(custom_filter)}."""
        )


def _make_circle(lat: float, lon: float, radius_m: float) -> FloatArray:
    latitude = as_float(lat, "lat")
    longitude = as_float(lon, "lon")
    radius = as_float(radius_m, "radius_m")
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise BadValue(f"lat={latitude}, lon={longitude} is not a position: they are degrees up to 90 and 180.")
    if not 0.0 < radius <= _MOST_RADIUS_M:
        raise BadValue(f"radius_m must be more than 0 and at most {_MOST_RADIUS_M:.0f} m, not {radius}.")
    centre = np.array([[longitude, latitude]])
    crs = find_utm_crs(centre)
    turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    rim = project(centre, WGS84, crs) + radius * np.column_stack((np.cos(turn), np.sin(turn)))
    return project(rim, crs, WGS84)
