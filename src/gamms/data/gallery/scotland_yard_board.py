"""The city of Scotland Yard with its lines, and the rule that passes on tickets and says where Mr X can be."""

import networkx as nx
import numpy as np

from gamms.visual.legend import LegendRow, LegendRows

COLORS = {"taxi": (235, 180, 0), "bus": (60, 150, 60), "underground": (205, 50, 50)}


def city(stations, seed):
    """Return stations at random places; every third has buses and every twelfth is on the underground."""
    rng = np.random.default_rng(seed)
    xy = np.array([(500.0, 375.0)])
    while len(xy) < stations:
        place = rng.uniform((0, 0), (1000, 750))
        if np.hypot(*(xy - place).T).min() > 38:
            xy = np.vstack([xy, place])
    graph = nx.MultiGraph()
    graph.add_nodes_from((station, {"x": x, "y": y}) for station, (x, y) in enumerate(xy.tolist()))
    for ticket, step in (("taxi", 1), ("bus", 3), ("underground", 12)):
        for a, b in neighbors(xy[::step]):
            graph.add_edge(a * step, b * step, **{"ticket": ticket, ticket: True, "public": True})
    graph.add_edges_from((*ends, {"ticket": "black", "black": True}) for ends in sorted({*graph.edges()}))
    return graph


def neighbors(xy):
    """Return the pairs of places without another one in the circle between the two."""
    far = ((xy[:, None] - xy) ** 2).sum(axis=2)
    pairs = zip(*np.triu_indices(len(xy), 1), strict=True)
    return [(int(a), int(b)) for a, b in pairs if not np.any(far[a] + far[b] < far[a, b])]


def edges(ctx):
    """Return edge -> its ticket, source and target."""
    columns = ctx.graph.columns()
    ends = columns.node_ids[np.stack((columns.sources, columns.targets), axis=1)].tolist()
    return {id: (columns.edge_attributes["ticket"][i], *ends[i]) for i, id in enumerate(columns.edge_ids.tolist())}


def after(ways, stations, ticket):
    """Return the stations that are reached from some stations with a ticket."""
    return {target for used, source, target in ways.values() if used == ticket and source in stations}


def pass_on(ctx, turns):
    """Give Mr X the tickets of detectives, and publish his own, where he is in some turns, and where he can be."""
    ways = edges(ctx)
    mr_x = ctx.agent.get_agent("mr_x")
    used = {}
    for name, move in ctx.game.moves.items():
        for leg in move.legs:
            used[name] = ways[leg.edge][0]
            if move.team == "detectives":
                mine = f"mr_x_{used[name]}"
                amounts = ctx.game.data["resources"][mine]["amounts"]
                amounts["mr_x"] += 1
                ctx.game.publish(to=mr_x, **{mine: amounts["mr_x"]})
    detectives = {agent.current_node_id for agent in ctx.agent.teams["detectives"]}
    possible = set(ctx.game.facts["possible"]) - detectives
    if "mr_x" in used:
        possible = after(ways, possible, used["mr_x"]) - detectives
    if ctx.game.turn in turns:
        possible = {mr_x.current_node_id}
        ctx.game.emit("shown", agent="mr_x", node=min(possible))
    tickets = (*ctx.game.facts["tickets"], used.get("mr_x"))
    ctx.game.publish(possible=tuple(sorted(possible)), tickets=tickets)


def draw(ctx, _):
    """Draw the lines of buses and of the underground, and mark the stations where Mr X can be."""
    for ticket, width in (("taxi", 1), ("bus", 2), ("underground", 3)):
        ends = [end for used, *line in edges(ctx).values() if used == ticket for end in line]
        offsets = list(range(0, len(ends) + 1, 2))
        ctx.visual.drawing.render_lines(ctx.graph.positions(ends), offsets, COLORS[ticket], width)
    stations = ctx.graph.positions(list(ctx.game.facts["possible"]))
    ctx.visual.drawing.render_circles(stations, 9.0, (120, 60, 200), 2, in_pixels=True)


_LINES = [LegendRow(color, ticket, sign="line") for ticket, color in COLORS.items()]
draw.legend = LegendRows("", (*_LINES, LegendRow((120, 60, 200), "Mr X may be here", sign="ring")))
pass_on.drawer = draw
