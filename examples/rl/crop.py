"""Maps of pursuits: the streets of Helsinki within a square, and districts of the city."""

import random
from itertools import islice

import networkx as nx

import gamms


def centre(side=600.0, resolution=60.0):
    """Return the largest strong part of the streets in a square of `side` metres around the middle of the map."""
    with gamms.create_context() as ctx:
        gamms.osm.helsinki(ctx, resolution=resolution)
        graph = ctx.graph.to_networkx()
    xs, ys = (sorted(graph.nodes[node][axis] for node in graph) for axis in "xy")
    x, y = xs[len(xs) // 2], ys[len(ys) // 2]
    inside = [
        node
        for node in graph
        if abs(graph.nodes[node]["x"] - x) <= side / 2 and abs(graph.nodes[node]["y"] - y) <= side / 2
    ]
    streets = graph.subgraph(inside)
    return nx.convert_node_labels_to_integers(
        streets.subgraph(max(nx.strongly_connected_components(streets), key=len)), ordering="sorted"
    )


def district(number, nodes=80, resolution=60.0):
    """Return a district of Helsinki, drawn by its number: the `nodes` nearest to some crossing, by road."""
    with gamms.create_context() as ctx:
        gamms.osm.helsinki(ctx, resolution=resolution)
        graph = ctx.graph.to_networkx()
    within = random.Random(number).choice(sorted(graph))
    near = islice(nx.bfs_tree(graph.to_undirected(as_view=True), within), nodes)
    streets = graph.subgraph(near)
    return nx.convert_node_labels_to_integers(
        streets.subgraph(max(nx.strongly_connected_components(streets), key=len)), ordering="sorted"
    )
