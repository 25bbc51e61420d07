"""Worst idleness of patrols: robots on one cycle through all nodes, and robots that have a part each.

Robots at equal distances on a cycle leave each node alone for the time of its length over their number. A robot that
goes to and fro on a path leaves its ends alone for twice its time. So robots share the cycle around a fence, but stay
in their own towns if these are far apart (Chevaleyre, Theoretical analysis of the multi-agent patrolling problem, IAT
2004).
"""

import networkx as nx

import gamms
from gamms.experiment import Table

SPEED, SIDE, AWAY = 7.0, 10.0, 90.0  # metres per turn; metres between neighbors, and between towns
FENCE = nx.cycle_graph(24)
PARTS = [(0, 5), (6, 11), (12, 17), (18, 23)]
TOWNS = nx.disjoint_union(nx.cycle_graph(6), nx.cycle_graph(6))
nx.set_edge_attributes(FENCE, SIDE, "length")
nx.set_edge_attributes(TOWNS, SIDE, "length")
TOWNS.add_edge(0, 6, length=AWAY)


def play(graph, tours):
    """Return the longest time that a node is alone in 200 turns, if each robot repeats its tour from its first node."""
    nx.set_node_attributes(graph, {node: {"x": x, "y": y} for node, (x, y) in nx.circular_layout(graph).items()})
    with gamms.create_context(seed=1, game={"speed_unit": "metres"}) as ctx:
        ctx.graph.attach_networkx_graph(graph)
        for number, tour in enumerate(tours):
            walk = gamms.strategies.patrol(ctx, tour)
            ctx.agent.create_agent(f"robot_{number}", start_node_id=tour[0], team="robots", speed=SPEED, strategy=walk)
        ctx.game.add(gamms.rules.idleness())
        ctx.game.run(200)
        return float(gamms.rules.idleness_table(ctx)["worst"].max())


around = [[*range(first, 24), *range(first)] for first, _ in PARTS]
both = [[0, 1, 2, 3, 4, 5, 0, 6, 7, 8, 9, 10, 11, 6], [6, 7, 8, 9, 10, 11, 6, 0, 1, 2, 3, 4, 5, 0]]
CASES = {
    "a fence, 4 robots on its cycle": (24 * SIDE / 4, FENCE, around),
    "a fence, 4 robots on a part each": (2 * 5 * SIDE, FENCE, PARTS),
    "two towns, 2 robots on a cycle": ((12 * SIDE + 2 * AWAY) / 2, TOWNS, both),
    "two towns, 2 robots in a town each": (6 * SIDE, TOWNS, [range(6), range(6, 12)]),
}
rows = []
for name, (metres, graph, tours) in CASES.items():
    expected, ours = metres / SPEED, play(graph, tours)
    rows.append({"result": f"worst idleness, {name}", "expected": expected, "ours": ours})
    rows[-1]["agrees"] = abs(ours - expected) < 1e-9
if __name__ == "__main__":
    print(Table.of(rows))
