"""Real road networks from OpenStreetMap, cut into pieces that agents can step along.

    G = gamms.osm.graph_from_xml("city.osm", resolution=10.0)
    ctx.graph.attach_networkx_graph(G)

`create_osm_graph("Kluuvi, Helsinki")` asks OpenStreetMap's servers: `places.py`; `overpass.py` writes their queries and
reads their answers, `servers.py` sends and caches them, and `settings.py` names the servers.
`gamms.osm.helsinki(ctx)` does the same with the map that comes with the package, and needs no optional library.

Read `load.py` first: it names the steps. `osmium_reader.py` and `geojson.py` read files, `network.py` holds roads as
columns, `modes.py` says who may use them, `tags.py` what they keep, `areas.py` leads across squares, `topology.py`
simplifies, merges and cuts, `networkx_bridge.py` makes the graph; `fidelity.py` and `comparison.py` compare it.
`buildings.py` makes obstacles of maps; `footprints.py` says what is a wall and where, `walls.py` makes faces of that.
`scenery.py` makes what is only drawn, `elevation.py` puts roads on the ground.
May import: `gamms.typing` and below, never another engine. To read another kind of map, make a `RoadNetwork` of it;
everything after that is the same.
"""

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
