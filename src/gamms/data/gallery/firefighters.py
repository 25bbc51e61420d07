"""A forest, a fire that spreads from tree to tree, and firefighters that protect trees."""

import networkx as nx
import numpy as np

from gamms.visual.legend import LegendRow, LegendRows

BURNING = (255, 165, 0)
PROTECTED = (0, 150, 80)


def forest(rows, columns, seed):
    """Return a triangular lattice of trees with clearings."""
    rng = np.random.default_rng(seed)
    graph = nx.triangular_lattice_graph(rows, columns)
    graph.remove_nodes_from([node for node in sorted(graph) if rng.random() < 0.15])
    graph = graph.subgraph(max(nx.connected_components(graph), key=len)).copy()
    for _, values in sorted(graph.nodes.items()):
        x, y = values.pop("pos")
        values.update(x=x + rng.uniform(-0.2, 0.2), y=y + rng.uniform(-0.2, 0.2))
    return nx.convert_node_labels_to_integers(graph, ordering="sorted")


def steps(ctx, state):
    """Return how many times the fire must spread to reach each tree; protected trees are left out."""
    columns = ctx.graph.columns()
    ends = (columns.node_ids[rows].tolist() for rows in (columns.sources, columns.targets))
    trees = nx.Graph(zip(*ends, strict=True))
    trees.remove_nodes_from(state["protected"])
    return nx.multi_source_dijkstra_path_length(trees, set(state["burning"]), weight=lambda *_: 1)


def enclose(ctx, pace):
    """Make the plan: each firefighter goes to the next tree to burn that it reaches before the fire."""

    def plan(states):
        forest = next(iter(states.values()))["facts"]["forest"]
        left = {node: pace * count for node, count in steps(ctx, forest).items() if count > 0}
        for state in states.values():
            way = ctx.graph.distances(source=state["curr_pos"], weight=None)
            in_time = [node for node in sorted(left) if way[node] / 2 < left[node]]
            state["action"] = min(in_time, key=lambda node: (left[node], way[node]), default=state["curr_pos"])
            left.pop(state["action"], None)

    return plan


def fire(pace, most):
    """Make the rule: the fire spreads every `pace` turns; more than the share `most` of all trees must not burn."""

    def prepare(ctx):
        fires = {agent.current_node_id for agent in ctx.agent.teams["fires"]}
        ctx.game.data["forest"] = {"burning": sorted(fires), "protected": []}
        ctx.game.publish(forest=ctx.game.data["forest"])

    def fire(ctx):
        forest = ctx.game.data["forest"]
        burning = set(forest["burning"]) | {agent.current_node_id for agent in ctx.agent.teams["fires"]}
        protected = {agent.current_node_id for agent in ctx.agent.teams["firefighters"]} | set(forest["protected"])
        forest["protected"] = sorted(protected - burning)
        next_trees = [node for node, count in steps(ctx, forest).items() if count == 1]
        burning.update(next_trees if ctx.game.turn % pace == 0 else ())
        forest["burning"] = sorted(burning)
        ctx.game.scores["fires"] = len(burning)
        ctx.game.publish(forest=forest)
        if len(burning) > most * len(ctx.graph.columns().node_ids):
            ctx.game.end("the forest burns down", winner="fires")
        elif not next_trees:
            ctx.game.end("the fire is enclosed", winner="firefighters")

    def draw(ctx, _):
        for kind, color, width in (("burning", BURNING, 0), ("protected", PROTECTED, 3)):
            for node in ctx.game.data["forest"][kind]:
                at = ctx.graph.get_node(node)
                ctx.visual.render_circle(at.x, at.y, 0.4, color, width)

    draw.layer = 19
    draw.legend = LegendRows(
        "", (LegendRow(BURNING, "burning tree"), LegendRow(PROTECTED, "protected tree", sign="ring"))
    )
    fire.prepare = prepare
    fire.drawer = draw
    return fire
