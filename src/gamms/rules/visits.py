"""The positions of agents during a turn of one game: on nodes, and on edges in games by metres.

A turn is the time from 0 to 1.
"""

from gamms.context import Context
from gamms.errors import UnknownName
from gamms.ir.agents import Position
from gamms.typing.game import Leg, Track
from gamms.typing.graph_values import OSMEdge
from gamms.typing.on_edges import point_along


def at_end(track: Track) -> Track:
    """Return a track that keeps only the position at the end of the turn."""
    last = track.legs[-1]._replace(begin=track.legs[-1].end, since=1.0, until=1.0) if track.legs else None
    is_on_edge = last is not None and 0.0 < last.end < 1.0
    return Track(track.path[-1:], (1.0,), (last,) if last is not None and is_on_edge else ())


class TraveledEdges(dict[int, OSMEdge]):
    """A mapping id -> edge of the edges that agents move along, including edges that rules have closed since.

    Raises:
        UnknownName (KeyError): on access to an edge that was removed.
    """

    def __init__(self, ctx: Context) -> None:
        super().__init__()
        self._ctx = ctx
        self.graph = ctx.graph.graph

    def __missing__(self, id: int) -> OSMEdge:
        """Look up an edge."""
        try:
            found = self.graph.get_edge(id)
        except UnknownName:
            _, closed = self._ctx.graph.storage.roads()
            if id not in closed:
                raise
            edge = closed[id]
            line = edge.get("linestring")
            line = self.graph.positions([edge["source"], edge["target"]]) if line is None else line
            found = OSMEdge(id, edge["source"], edge["target"], edge["length"], line)
        self[id] = found
        return found

    def length_of(self, leg: Leg) -> float | None:
        """Return the length of the edge of a leg; None if the edge was removed."""
        try:
            return self[leg.edge].length
        except UnknownName:
            return None

    def xy_at(self, track: Track, time: float, node: int, at: Position | None) -> tuple[float, float] | None:
        """Return the map position of an agent; None if its edge or node was removed.

        Args:
            track: the moves of the agent.
            time: time within the turn.
            node: the last node that it passed.
            at: position of a flying agent, which is on no node.
        """
        try:
            if at is not None:
                return at[:2]
            for leg in track.legs:
                if leg.since <= time <= leg.until:
                    return point_along(self[leg.edge].points, leg.share_at(time))[:2]
            found = self.graph.get_node(node)
        except UnknownName:
            return None
        return found.x, found.y
