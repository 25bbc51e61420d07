"""A field of triangles, and the point at which the intruder and its guards aim."""

import networkx as nx

from gamms.strategies import goto
from gamms.visual.legend import LegendRow, LegendRows


def field(rows, columns, spacing):
    """Return a field of triangles whose sides are `spacing` metres long."""
    graph = nx.triangular_lattice_graph(rows, columns)
    for node, (x, y) in nx.get_node_attributes(graph, "pos").items():
        graph.nodes[node].clear()
        graph.nodes[node].update(x=spacing * x, y=spacing * y)
    return nx.convert_node_labels_to_integers(graph)


def free(ctx, intruder, guards):
    """Return the nodes that the intruder reaches before all guards."""
    its_way = ctx.graph.distances(source=intruder)
    their_way = ctx.graph.distances(source=guards)
    return [node for node in its_way if its_way[node] < their_way[node]]


def aim(ctx, intruder, guards):
    """Return the free node that is nearest to the target, and of these the one nearest to the intruder."""
    target = ctx.agent.get_agent("target").current_node_id
    to_target = ctx.graph.distances(target=target)
    its_way = ctx.graph.distances(source=intruder)
    nodes = free(ctx, intruder, guards)
    return min(nodes, key=lambda node: (to_target[node], its_way[node], node), default=intruder)


def intrude(ctx):
    """Make the intruder's strategy: go to the free node that is nearest to the target."""

    def target(state):
        _, guards = state["sensor"]["sees_guards"]
        return aim(ctx, state["curr_pos"], guards.values())

    return goto(ctx, target)


def guard(ctx):
    """Make a guard's strategy: go to the point at which the intruder aims."""

    def target(state):
        _, seen = state["sensor"]["sees_intruder"]
        return aim(ctx, seen["intruder_0"], [agent.current_node_id for agent in ctx.agent.teams["guards"]])

    return goto(ctx, target)


def marks(ctx):
    """Change nothing: this rule is there for its drawer."""


def draw(ctx, _):
    """Mark the nodes that the intruder reaches before all guards."""
    intruder = ctx.agent.get_agent("intruder_0").current_node_id
    nodes = free(ctx, intruder, [agent.current_node_id for agent in ctx.agent.teams["guards"]])
    if nodes:
        ctx.visual.drawing.render_circles(ctx.graph.positions(nodes), 3.0, (230, 140, 0))


draw.legend = LegendRows("", (LegendRow((230, 140, 0), "intruder is first"),))
marks.drawer = draw
