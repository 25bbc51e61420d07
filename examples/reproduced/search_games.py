"""Search for a hider who does not move, on a circle and on a star: all ways to hide against all ways to search.

The value is half the length of the circle, and the length of the star, as of any tree (Gal, Search games with mobile
and immobile hider, SIAM Journal on Control and Optimization 17, 1979). A search is an order in which nodes are found,
each by the shortest way through those found before. All are played, against a hider on each node.
"""

import networkx as nx

import gamms
from gamms.experiment import Table
from gamms.solve import matrix_game


def find_searches(graph, walk):
    """Return all walks that continue a walk through unknown nodes beside known ones until all are known."""
    known = set(walk)
    if len(known) == len(graph):
        return [walk]
    found = []
    for node in sorted(nx.node_boundary(graph, known)):
        way = nx.shortest_path(graph.subgraph({*known, node}), walk[-1], node)
        found += find_searches(graph, walk + way[1:])
    return found


def find_value(graph):
    """Return the value of the game in turns, and the number of searches."""
    nx.set_node_attributes(graph, {node: {"x": float(node), "y": 0.0} for node in graph})
    searches = find_searches(graph, [0])
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(graph)
        searcher = ctx.agent.create_agent("searcher", start_node_id=0, team="searchers")
        for node in range(1, len(graph)):
            ctx.agent.create_agent(f"hider_{node}", start_node_id=node, team="hiders", strategy=gamms.strategies.stay)
        ctx.game.add(gamms.rules.tag("searchers", "hiders", then="eliminate"))
        turns = []
        for walk in searches:
            ctx.game.reset()
            searcher.register_strategy(gamms.strategies.follow_path(ctx, walk[1:]))
            found = {event["node"]: event["turn"] for event in ctx.game.run(len(walk)).events}
            turns.append([-found[node] for node in range(1, len(graph))])
    return -matrix_game(turns)[0], len(searches)


rows = []
star = nx.Graph([(0, 1), (1, 2), (0, 3), (3, 4), (0, 5), (5, 6)])
for name, graph, expected in (("circle of 8 edges", nx.cycle_graph(8), 8 / 2), ("star of 6 edges", star, 6)):
    ours, count = find_value(graph)
    rows.append({"result": f"turns to find a hider, {name} ({count} searches)", "expected": expected, "ours": ours})
    rows[-1]["agrees"] = abs(ours - expected) < 1e-9
if __name__ == "__main__":
    print(Table.of(rows))
