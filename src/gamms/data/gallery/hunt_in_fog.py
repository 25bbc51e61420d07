"""A maze of hedges, and a rule that draws the hunters' belief."""

import networkx as nx
import numpy as np

from gamms import belief
from gamms.visual.legend import LegendRow, LegendRows


def maze(width, height, gaps, seed):
    """Return a maze: a random spanning tree of a grid, with `gaps` more ways through its hedges."""
    rng = np.random.default_rng(seed)
    grid = nx.grid_2d_graph(width, height)
    for edge in grid.edges:
        grid.edges[edge]["weight"] = rng.random()
    tree = nx.minimum_spanning_tree(grid)
    hedges = [edge for edge in grid.edges if not tree.has_edge(*edge)]
    tree.add_edges_from(hedges[i] for i in rng.choice(len(hedges), gaps, replace=False))
    for edge in tree.edges:
        tree.edges[edge].clear()
    for x, y in tree:
        tree.nodes[x, y].update(x=10 * x, y=10 * y)
    return nx.convert_node_labels_to_integers(tree, ordering="sorted")


def fog(ctx):
    """Change nothing: this rule is there for its drawer."""


def draw(ctx, _):
    """Draw discs whose areas are the probabilities that a deer is there, as the hunters believe."""
    deer = [one.name for one in ctx.agent.teams["deer"] if one.alive]
    chances = belief.belief_of(ctx, "hunters_0").probabilities(deer, belief.random_walk()).sum(axis=0)
    for place, chance in zip(ctx.graph.columns().xy.tolist(), chances.tolist(), strict=True):
        if chance > 0.001:
            ctx.visual.render_circle(*place, 16 * chance**0.5, (230, 140, 0))


draw.legend = LegendRows("", (LegendRow((230, 140, 0), "chance of a deer"),))
fog.drawer = draw
