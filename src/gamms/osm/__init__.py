"""Real road networks from OpenStreetMap, cut into pieces that agents can step along.

    G = gamms.osm.graph_from_xml("city.osm", resolution=10.0)
    ctx.graph.attach_networkx_graph(G)

`gamms.osm.helsinki(ctx)` does the same with the map that comes with the package, and needs no optional library.

Read `load.py` first: it names the steps. `osmium.py` reads the file, `ways.py` and `network.py` hold the
roads as columns, `consolidate.py` joins vertices, `resample.py` cuts them, `networkx.py` makes the graph.
May import: `gamms.typing` and below, never another room. To read another kind of map, make a `RoadNetwork` of it;
everything after that is the same.
"""

from enum import Enum
from typing import Any

from gamms.errors import NotYetAttribute
from gamms.osm.columns import network_of_columns
from gamms.osm.constants import HEIGHT_ESTIMATES_TYPES, OSM_OBSTACLE_TAGS
from gamms.osm.load import graph_from_xml, process_osm_graph, resample_columns
from gamms.osm.shipped import helsinki

__all__ = [
    "HEIGHT_ESTIMATES_TYPES",
    "OSM_OBSTACLE_TAGS",
    "OSMType",
    "graph_from_xml",
    "helsinki",
    "network_of_columns",
    "process_osm_graph",
    "resample_columns",
]

LATER = {
    "create_osm_graph": "loading places by name",
    "get_network_type": "loading places by name",
    "extract_osm_polygon_faces": "buildings as obstacles",
    "obstacle_from_osm": "buildings as obstacles",
    "obstacle_from_xml": "buildings as obstacles",
}


class OSMType(Enum):
    """Which ways of moving a network is for."""

    WALK = 0
    BIKE = 1
    DRIVE = 2


def __getattr__(name: str) -> Any:
    if name in LATER:
        raise NotYetAttribute(LATER[name])
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
