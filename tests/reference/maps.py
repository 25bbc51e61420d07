"""Small random maps, as scenarios name them."""

from random import Random

import networkx as nx

LENGTHS = (0.5, 1.0, 2.0, 4.0)  # and speeds are such that all times and places are exact


def streets(number):
    """Return a map of 6 to 12 nodes with streets in both directions or one, without parallel edges."""
    rng = Random(number)
    nodes = rng.sample(range(40), rng.randint(6, 12))
    graph = nx.MultiDiGraph()
    for node in nodes:
        graph.add_node(node, x=float(rng.randrange(6)), y=float(rng.randrange(6)))
    pairs = [(rng.choice(nodes[:i]), nodes[i]) for i in range(1, len(nodes))]
    pairs += [tuple(rng.sample(nodes, 2)) for _ in range(len(nodes) // 2)]
    for start, end in pairs:
        if graph.has_edge(start, end) or graph.has_edge(end, start):
            continue
        length = rng.choice(LENGTHS)
        graph.add_edge(start, end, length=length)
        if rng.random() < 0.85:
            graph.add_edge(end, start, length=length)
    return graph
