"""A town between rivers, a saboteur that closes bridges ahead of couriers, and the rule that closes and opens them."""

from itertools import accumulate, pairwise
from math import inf

import networkx as nx


def town(rows, banks, bridges):
    """Return a grid of streets with rivers between some of its columns, and bridges at some rows."""
    graph = nx.grid_2d_graph(sum(banks), rows)
    for x, y in graph:
        rivers = sum(x >= column for column in accumulate(banks))
        graph.nodes[x, y].update(x=10 * x + 20 * rivers, y=10 * y)
    for column, open_rows in zip(accumulate(banks), bridges, strict=False):
        graph.remove_edges_from(((column - 1, y), (column, y)) for y in range(rows) if y not in open_rows)
    return nx.convert_node_labels_to_integers(graph, ordering="sorted")


def sabotage(ctx, goal, pause):
    """Make the saboteur's strategy: go to the nearest bridge on a courier's way, and close it ahead of the courier."""

    def next_bridge(courier):
        """Return the ends of the next bridge on the way of a courier, and the courier's distance from it."""
        path = ctx.graph.shortest_path(courier, goal) if ctx.graph.distance(courier, goal) < inf else []
        bridges = [(a, b) for a, b in pairwise(path) if ctx.graph.distance(a, b) > 20]
        return [(ctx.graph.distance(courier, a), a, b) for a, b in bridges[:1]]

    def strategy(state):
        here = state["curr_pos"]
        found = [one for node in state["sensor"]["sees_couriers"][1].values() for one in next_bridge(node)]
        choices = [(ctx.graph.distance(here, end), far, end, a + b - end) for far, a, b in found for end in (a, b)]
        way, far, end, other = min(choices, default=(0, 0, here, here))
        is_ready = state["turn"] >= state["memory"].get("ready", 0)
        state["action"] = {"node_id": ctx.graph.shortest_path(here, end)[:2][-1] if way < inf else here}
        if way == 0 and other != here and far <= 20 and is_ready:
            state["action"]["do"] = {"close": other}
            state["memory"]["ready"] = state["turn"] + pause + 1

    return strategy


def barricades(ctx, turns):
    """Close the roads that are sabotaged, and open them again after some turns."""
    closed = ctx.game.data.setdefault("closed", {})
    for turn in [turn for turn in closed if turn + turns <= ctx.game.turn]:
        ctx.graph.open_roads(closed.pop(turn))
    for deed in ctx.game.performed("close"):
        ends = {deed.at, deed.values["toward"]}
        edges = [edge for edge in map(ctx.graph.get_edge, ctx.graph.get_edges()) if {edge.source, edge.target} == ends]
        closed.setdefault(ctx.game.turn, []).extend(ctx.graph.close_roads([edge.id for edge in edges]))
