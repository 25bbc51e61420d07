"""The map that comes with the package: streets and buildings of central Helsinki, © OpenStreetMap contributors."""

from pathlib import Path
from typing import TYPE_CHECKING

from gamms.arguments import as_context
from gamms.errors import BadValue
from gamms.osm.load import resample_columns
from gamms.typing import IContext

if TYPE_CHECKING:
    import networkx as nx

_FILE = Path(__file__).parent.parent / "data" / "helsinki.gamms"


def helsinki(
    ctx: IContext, resolution: float = 10.0, bidirectional: bool = True, buildings: bool = False
) -> "nx.DiGraph[int]":
    """Put the streets of central Helsinki into the empty graph of a context; returns them as a networkx graph, too.

    Args:
        ctx: the context.
        resolution: metres between nodes.
        bidirectional: let agents go against one-way streets.
        buildings: put the walls of the buildings among the obstacles.

    Raises:
        BadType: `ctx` is no context.
        BadValue: the context has a graph or obstacles already, or the resolution is impossible.
    """
    graph = as_context(ctx, "helsinki").graph.graph
    if [*graph.get_nodes(), *ctx.graph.get_obstacle_faces()]:
        raise BadValue("The context has a graph or obstacles already. Load the map into a new context.")
    try:
        ctx.graph.load(_FILE)
        walls = ctx.graph.obstacle_columns()
        streets = resample_columns(ctx.graph.columns(), resolution, bidirectional)
    finally:
        graph.clear()
        for face_id in ctx.graph.get_obstacle_faces():
            ctx.graph.remove_obstacle_face(face_id)
    ctx.graph.attach_networkx_graph(streets)
    if buildings:
        ctx.graph.add_obstacles(walls.corners, walls.ids, walls.types)
    return streets
