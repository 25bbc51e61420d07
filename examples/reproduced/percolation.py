"""Percolation: each road of a grid is open with a chance, and a walker in the west goes to the east if there is a way.

With n rows, n + 1 columns and the chance 1/2, there is one with 1/2: else closed roads cross its dual, such a grid, too
(Kesten, The critical probability of bond percolation on the square lattice equals 1/2, 1980; Grimmett, Percolation,
1999, 11.3). With 3 rows, all 2^13 sets of open roads are enumerated.
"""

from itertools import compress, product
from pathlib import Path

import networkx as nx
import numpy as np

from gamms import experiment
from gamms.graph import grid
from gamms.scenario import Scenario


def town(size):
    """Return a grid whose first column is the node 0, and whose last column is the node `size`."""
    columns = {node: node % (size + 1) for node in range(size * (size + 1)) if node % (size + 1) in (0, size)}
    graph = nx.relabel_nodes(grid(size, size + 1), columns)
    graph.remove_edges_from([(0, 0), (size, size)])
    return graph


def storm(ctx, chance):
    """Leave each road open with a chance, in both directions, before the first turn; end a game whose walker stays."""
    if ctx.game.turn == 0:
        edges = ctx.graph.columns()
        roads, numbers = np.unique(np.sort([edges.sources, edges.targets], axis=0), axis=1, return_inverse=True)
        ctx.graph.close_roads(edges.edge_ids[ctx.stream("storm").random(roads.shape[1])[numbers] >= chance])
    elif ctx.game.moves["walker"].start == ctx.game.moves["walker"].end:
        ctx.game.end("no way")


def find_share(size, chance):
    """Return the chance of a way from west to east."""
    roads = list(town(size).to_undirected().edges)
    share = 0.0
    for is_open in product((False, True), repeat=len(roads)):
        graph = nx.Graph([(0, 0), (size, size), *compress(roads, is_open)])
        share += nx.has_path(graph, 0, size) * np.prod(np.where(is_open, chance, 1.0 - chance))
    return float(share)


def build(size, chance):
    """Return the game of a walker who goes from west to east."""
    walk = {"function": "gamms.strategies:goto", "with": {"target": size}}
    return Scenario(
        folder=Path(__file__).parent,
        map={"generator": {"function": "percolation:town", "with": {"size": size}}},
        teams={"walkers": {"agents": [{"name": "walker", "node": 0, "strategy": walk}]}},
        rules=[
            {"rule": "percolation:storm", "phase": "before", "with": {"chance": chance}},
            {"rule": "reach", "with": {"team": "walkers", "nodes": size}},
        ],
    )


if __name__ == "__main__":
    rows = []
    for size, chance, expected in ((3, 0.4, find_share(3, 0.4)), (6, 0.5, 0.5)):
        shares = experiment.run(build(size, chance), range(300)).summary(metrics=["wins.walkers"], confidence=0.99)
        *_, ours, low, high = (column[0] for column in shares.values())
        rows.append({"result": f"crossed grids of {size} rows, chance {chance}", "expected": expected, "ours": ours})
        rows[-1] |= {"low": low, "high": high, "agrees": low <= expected <= high}
    print(experiment.Table.of(rows))
