"""Real road networks from OpenStreetMap, cut into pieces for agents to step along.

    G = gamms.osm.graph_from_xml("city.osm", resolution=10.0)
    ctx.graph.attach_networkx_graph(G)

`create_osm_graph("Kluuvi, Helsinki")` asks OpenStreetMap's servers: `places.py` has such functions; `overpass.py`
writes their queries and reads their answers, `servers.py` sends and caches them, and `settings.py` names the servers.
`gamms.osm.helsinki(ctx)` uses the map that comes with the package, and needs no optional library.

Read `load.py` first: it names the steps. `reader.py` reads roads, footprints and lines from the elements of a map,
which come from a file (`osmium_reader.py`) or from answers of a server (`overpass.py`); `geojson.py` reads other files.
`objects.py` decides which objects count and reads their tags, `speeds.py` reads speed limits.
`network.py` holds roads as columns, `modes.py` decides who may use them, and `areas.py` adds lines across squares.
`mode_union.py` joins the roads of several modes. `topology.py` simplifies, merges and cuts roads, and
`networkx_bridge.py` makes the graph; `fidelity.py` compares it with the map. `buildings.py` makes obstacles of maps;
`footprints.py` decides which things are walls, and `walls.py` makes their faces.
`scenery.py` makes the drawn background, `elevation.py` adds heights.
May import: `gamms.typing` and below, never another engine. To read another kind of map, make a `RoadNetwork` of it;
everything after that is the same.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.osm import settings
from gamms.osm.buildings import (
    WallOptions,
    extract_osm_polygon_faces,
    faces_of_features,
    obstacle_from_file,
    obstacle_from_osm,
    obstacle_from_xml,
)
from gamms.osm.constants import BARRIER_HEIGHTS, HEIGHT_ESTIMATES_TYPES, OSM_OBSTACLE_TAGS, wall_estimates
from gamms.osm.elevation import Elevation, add_elevation
from gamms.osm.fidelity import Report, report
from gamms.osm.geojson import is_geojson
from gamms.osm.load import (
    FileOptions,
    consolidate,
    graph_from_file,
    graph_from_geojson,
    graph_from_xml,
    helsinki,
    process_osm_graph,
    resample_columns,
)
from gamms.osm.modes import Access, Mode, modes
from gamms.osm.network import OSMType
from gamms.osm.places import (
    PlaceOptions,
    create_osm_graph,
    get_network_type,
    graph_from_bbox,
    graph_from_place,
    graph_from_point,
    graph_from_polygon,
)
from gamms.osm.scenery import scenery_from_file, scenery_from_osm

__all__ = [
    "BARRIER_HEIGHTS",
    "HEIGHT_ESTIMATES_TYPES",
    "OSM_OBSTACLE_TAGS",
    "Access",
    "Elevation",
    "FileOptions",
    "Mode",
    "OSMType",
    "PlaceOptions",
    "Report",
    "WallOptions",
    "add_elevation",
    "consolidate",
    "create_osm_graph",
    "extract_osm_polygon_faces",
    "faces_of_features",
    "get_network_type",
    "graph_from_bbox",
    "graph_from_file",
    "graph_from_geojson",
    "graph_from_place",
    "graph_from_point",
    "graph_from_polygon",
    "graph_from_xml",
    "helsinki",
    "is_geojson",
    "modes",
    "obstacle_from_file",
    "obstacle_from_osm",
    "obstacle_from_xml",
    "process_osm_graph",
    "report",
    "resample_columns",
    "scenery_from_file",
    "scenery_from_osm",
    "settings",
    "wall_estimates",
]

_suggest_names(__name__, __all__)
