"""Stackelberg patrol: a guard draws one of several targets of different worth, and a raider knows the chances.

The best chances make all guarded targets equally attractive: a target of worth v is guarded with 1 - u / v, and u, what
the raider gets, makes these sum to 1 (Kiekintveld et al., Computing optimal randomized resource allocations for massive
security games, AAMAS 2009). The solver finds u. In games, the guard draws by this solution against each raid.
"""

from math import nan
from pathlib import Path

import networkx as nx

from gamms import experiment
from gamms.scenario import Scenario
from gamms.solve import solve

WORTH = {1: 10.0, 2: 8.0, 3: 5.0, 4: 2.0}


def town():
    """Return a place in the middle, node 0, with a road to each target."""
    graph = nx.star_graph(len(WORTH))
    nx.set_node_attributes(graph, {node: {"x": x, "y": y} for node, (x, y) in nx.circular_layout(graph).items()})
    return graph


def find_gain(turn):
    """Return what the raider gets in a turn: nothing if it is caught."""
    return WORTH.get(turn.after["raider"], 0.0)


def find_value():
    """Return u: a raider who draws among the k best targets gets k - 1 over the sum of 1 / v, and chooses k."""
    worths = sorted(WORTH.values(), reverse=True)
    return max((count - 1) / sum(1.0 / worth for worth in worths[:count]) for count in range(1, len(worths) + 1))


if __name__ == "__main__":
    raid = Scenario(
        folder=Path(__file__).parent,
        map={"generator": "stackelberg:town"},
        teams={team: {"agents": [{"name": team[:-1], "node": 0}]} for team in ("guards", "raiders")},
        rules=[{"rule": "tag", "with": {"taggers": "guards", "tagged": "raiders", "then": "eliminate"}}, "last_team"],
        max_turns=1,
    )
    solution, value = solve(raid, team="raiders", reward=find_gain), find_value()
    raids = {worth: {"function": "gamms.strategies:goto", "with": {"target": node}} for node, worth in WORTH.items()}
    vary = {"strategies.guards": {"solved": solution.strategy("guards")}, "strategies.raiders": raids}
    shares = experiment.run(raid, range(300), vary).summary(metrics=["wins.guards"], confidence=0.99)
    rows = [{"result": "worth of a raid", "expected": value, "ours": solution.value, "low": nan, "high": nan}]
    rows[-1]["agrees"] = abs(value - solution.value) < 1e-9
    for worth, ours, low, high in zip(WORTH.values(), shares["mean"], shares["low"], shares["high"], strict=True):
        expected = max(0.0, 1.0 - value / worth)
        rows.append({"result": f"raids caught at a worth of {worth:g}", "expected": expected, "ours": ours})
        rows[-1] |= {"low": low, "high": high, "agrees": low <= expected <= high}
    print(experiment.Table.of(rows))
