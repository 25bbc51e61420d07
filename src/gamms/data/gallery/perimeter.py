"""Rings and spokes, attackers that look for gaps, and defenders that are matched with attackers."""

from itertools import product
from math import cos, hypot, pi, sin

import networkx as nx


def rings(rings, spokes, spacing):
    """Return `rings` rings of `spokes` nodes around (0, 0), connected along rings and spokes."""
    graph = nx.cartesian_product(nx.path_graph(rings), nx.cycle_graph(spokes))
    for ring, spoke in graph:
        radius = spacing * (ring + 4)
        angle = 2 * pi * spoke / spokes
        graph.nodes[ring, spoke].update(x=radius * cos(angle), y=radius * sin(angle))
    return nx.convert_node_labels_to_integers(graph, ordering="sorted")


def inside(spokes):
    """Return the nodes of the innermost ring."""
    return list(range(spokes))


def storm(ctx, fear):
    """Make an attacker's strategy: move inward, if possible at least `fear` away from visible defenders."""
    columns = ctx.graph.columns()
    places = dict(zip(columns.node_ids.tolist(), columns.xy.tolist(), strict=True))

    def strategy(state):
        near = [places[node] for node in state["sensor"]["eyes"][1].values()]

        def cost(node):
            x, y = places[node]
            fears = sum(hypot(x - there_x, y - there_y) < fear for there_x, there_y in near)
            return hypot(x, y) + 12 * fears + 4 * state["draw"].random()

        state["action"] = min(state["legal"], key=cost)

    return strategy


def match(ctx):
    """Make the defenders' plan: match the nearest pairs first, and send each defender to its attacker."""
    columns = ctx.graph.columns()
    places = dict(zip(columns.node_ids.tolist(), columns.xy.tolist(), strict=True))

    def metres(node, other):
        return hypot(places[node][0] - places[other][0], places[node][1] - places[other][1])

    def plan(states):
        seen = {}
        for state in states.values():
            seen.update(state["sensor"]["radar"][1])
        here = {name: state["curr_pos"] for name, state in states.items()}
        pairs = [(metres(here[one], seen[other]), one, other) for one, other in product(here, seen)]
        goals = {}
        taken = set()
        for _, one, other in sorted(pairs):
            if one not in goals and other not in taken:
                goals[one] = seen[other]
                taken.add(other)
        for name, state in states.items():
            goal = goals.get(name, here[name])
            state["action"] = min(state["legal"], key=lambda node: (metres(node, goal), node))

    return plan
