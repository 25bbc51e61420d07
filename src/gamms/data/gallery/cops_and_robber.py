"""A honeycomb, cops that move together, and a robber that stays where it has most nodes to itself."""

from itertools import product

import networkx as nx

from gamms.visual.legend import LegendRow, LegendRows


def honeycomb(rows, columns, spacing):
    """Return a honeycomb whose sides are `spacing` metres long."""
    graph = nx.hexagonal_lattice_graph(rows, columns)
    for node, (x, y) in nx.get_node_attributes(graph, "pos").items():
        graph.nodes[node].clear()
        graph.nodes[node].update(x=spacing * x, y=spacing * y)
    return nx.convert_node_labels_to_integers(graph)


def moves_between(ctx):
    """Return the number of moves between all pairs of nodes."""
    nodes = ctx.graph.columns().node_ids
    return ctx.graph.routes.distances(nodes, nodes, weight=None)


def room(moves, robber, cops):
    """Return which nodes the robber reaches before all cops."""
    return moves[robber] < moves[list(cops)].min(axis=0)


def corner(ctx):
    """Make the cops' plan: the moves after which the robber has the least room, and then the nearest to it."""
    moves = moves_between(ctx)

    def plan(states):
        (first, *_) = states.values()
        robber = first["sensor"]["sees_all"][1]["robber"]

        def value(cops):
            return room(moves, robber, cops).sum(), sum(moves[cop, robber] for cop in cops), cops

        best = min(product(*(state["legal"] for state in states.values())), key=value)
        for state, node in zip(states.values(), best, strict=True):
            state["action"] = node

    return plan


def evade(ctx):
    """Make the robber's strategy: move where it has the most room, and cannot be caught at once."""
    moves = moves_between(ctx)

    def strategy(state):
        cops = list(state["sensor"]["sees_all"][1].values())

        def value(node):
            nearest = moves[cops, node].min()
            return nearest > 1, room(moves, node, cops).sum(), nearest, state["draw"].random()

        state["action"] = max(state["legal"], key=value)

    return strategy


def marks(ctx):
    """Change nothing: this rule is there for its drawer."""


def draw(ctx, _):
    """Mark the nodes that the robber reaches before all cops."""
    cops = [cop.current_node_id for cop in ctx.agent.teams["cops"]]
    free = room(moves_between(ctx), ctx.agent.get_agent("robber").current_node_id, cops)
    if free.any():
        ctx.visual.drawing.render_circles(ctx.graph.columns().xy[free], 3.0, (230, 140, 0))


draw.legend = LegendRows("", (LegendRow((230, 140, 0), "robber is first"),))
marks.drawer = draw
