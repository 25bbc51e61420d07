"""Trails in the hills, the strategy of the drones, and a rule that draws the searchers' belief."""

import networkx as nx
import numpy as np

from gamms import belief
from gamms.visual.legend import LegendRow, LegendRows


def trails(rows, columns, spacing, missing, seed):
    """Return winding trails in the form of a honeycomb, some of which are missing."""
    rng = np.random.default_rng(seed)
    graph = nx.hexagonal_lattice_graph(rows, columns)
    for node, place in nx.get_node_attributes(graph, "pos").items():
        x, y = spacing * (place + rng.uniform(-0.4, 0.4, 2))
        graph.nodes[node].clear()
        graph.nodes[node].update(x=x, y=y)
    ways = list(graph.edges)
    for number in rng.permutation(len(ways))[:missing]:
        graph.remove_edge(*ways[number])
        if not nx.has_path(graph, *ways[number]):
            graph.add_edge(*ways[number])
    return nx.convert_node_labels_to_integers(graph)


def fly(ctx, reach):
    """Make a drone's strategy: fly to the node with the most probability within `reach` metres per metre of way."""
    xy = ctx.graph.columns().xy
    in_view = np.hypot(*(xy[:, None] - xy).T) <= reach

    def strategy(state):
        chances = belief.observe(ctx, state).probabilities(["hiker"], belief.random_walk())[0]
        drones = {one.name: one.position for one in ctx.agent.teams["searchers"] if one.name.startswith("drone")}
        far = {name: np.hypot(*(xy - position[:2]).T) for name, position in drones.items()}
        own = far[state["name"]]
        is_mine = own <= np.min(list(far.values()), axis=0)
        best = xy[np.argmax(is_mine * (in_view @ chances) / (own + reach))]
        x, y, _ = state["curr_pos"]
        state["action"] = (best[0] - x, best[1] - y, 0.0)

    return strategy


def discs(ctx):
    """Change nothing: this rule is there for its drawer."""


def draw(ctx, _):
    """Draw discs whose areas are the probabilities that the hiker is there, as the robots believe."""
    chances = belief.belief_of(ctx, "robot_0").probability("hiker", belief.random_walk())
    for node, chance in chances.items():
        place = ctx.graph.get_node(node)
        if chance > 0.0005:
            ctx.visual.render_circle(place.x, place.y, 100 * chance**0.5, (230, 140, 0))


draw.legend = LegendRows("", (LegendRow((230, 140, 0), "chance of the hiker"),))
discs.drawer = draw
