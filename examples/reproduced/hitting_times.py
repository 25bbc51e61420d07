"""Hitting times of random walks: how long a walker, who goes to a random neighbor or stays, needs to reach a node.

The mean from u to v is half the sum over all nodes w of d(w) (R(u, v) + R(v, w) - R(u, w)), where d(w) is the number of
legal nodes of w, its own included, and R the resistance between nodes if edges are resistors of 1 ohm (Tetali, Random
walks and the effective resistance of networks, Journal of Theoretical Probability 4, 1991).
"""

from pathlib import Path

import networkx as nx

from gamms import experiment
from gamms.scenario import Scenario

WALKS = {"cycle": (0, 4), "Petersen": (0, 7), "star": (1, 2), "lollipop": (1, 7)}


def town(name):
    """Return a graph with places for its nodes."""
    graph = {
        "cycle": nx.cycle_graph(8),
        "Petersen": nx.petersen_graph(),
        "star": nx.star_graph(5),
        "lollipop": nx.lollipop_graph(5, 3),
    }[name]
    nx.set_node_attributes(graph, {node: {"x": float(node), "y": float(node % 2)} for node in graph})
    return graph


def find_mean(graph, start, goal):
    """Return the expected number of turns from one node to another."""
    ohms = nx.resistance_distance(graph)
    way = (ohms[start][goal] + ohms[goal][node] - ohms[start][node] for node in graph)
    return sum((graph.degree[node] + 1) * part for node, part in zip(graph, way, strict=True)) / 2


if __name__ == "__main__":
    rows = []
    for name, (start, goal) in WALKS.items():
        walk = Scenario(
            folder=Path(__file__).parent,
            map={"generator": {"function": "hitting_times:town", "with": {"name": name}}},
            teams={"walkers": {"agents": [{"name": "w", "node": start}], "strategy": "gamms.strategies:random_walk"}},
            rules=[{"rule": "reach", "with": {"team": "walkers", "nodes": goal}}],
        )
        means = experiment.run(walk, range(300)).summary(metrics=["turns"], confidence=0.99)
        *_, ours, low, high = (column[0] for column in means.values())
        expected = find_mean(town(name), start, goal)
        rows.append({"result": f"turns of a random walk, {name} from {start} to {goal}", "expected": expected})
        rows[-1] |= {"ours": ours, "low": low, "high": high, "agrees": low <= expected <= high}
    print(experiment.Table.of(rows))
