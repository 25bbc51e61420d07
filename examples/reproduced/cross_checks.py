"""Values of all positions of pursuits, by a second algorithm: iteration of Bellman's equation by NumPy.

`gamms.solve.pursuit` works backward from captures and escapes, from a position to those before it. Here all positions
get the values of their best moves, with a discount of 1/2 per turn, until nothing changes. A position agrees if its
winner and its number of turns do.
"""

from itertools import product

import networkx as nx
import numpy as np

from gamms.experiment import Table
from gamms.solve import pursuit

GRID = nx.convert_node_labels_to_integers(nx.grid_2d_graph(4, 5))
ONE_WAY = nx.DiGraph([(node, (node + step) % 12) for node in range(12) for step in (1, 5)])
CASES = {  # the graph, the number of pursuers, exits, who moves first
    "2 pursuers, grid": (GRID, 2, [], "pursuers"),
    "2 pursuers, grid, the evader first": (GRID, 2, [], "evader"),
    "1 pursuer, Tutte graph, 2 exits": (nx.tutte_graph(), 1, [0, 30], "pursuers"),
    "2 pursuers, one-way roads, 1 exit": (ONE_WAY, 2, [6], "pursuers"),
    "3 pursuers, Petersen graph": (nx.petersen_graph(), 3, [], "pursuers"),
}


def find_values(graph, pursuers, exits, first):
    """Return the values, 1 / 2^turns, -1 / 2^turns or 0, by the nodes of the pursuers and of the evader."""
    ways = [[node, *graph[node]] for node in range(len(graph))]
    places = np.indices((len(graph),) * (pursuers + 1))
    is_met, is_out = (places[:-1] == places[-1]).any(axis=0), np.isin(places[-1], exits)

    def move(values, side):
        for axis in range(pursuers) if side == "pursuers" else ():
            values = np.stack([values.take(way, axis).max(axis) for way in ways], axis)
        return values if side == "pursuers" else np.stack([values[..., way].min(-1) for way in ways], -1)

    second = {"pursuers": "evader", "evader": "pursuers"}[first]
    before, values = None, np.zeros(is_met.shape)
    while not np.array_equal(before, values):
        before = values
        later = np.where(is_met, 1.0, np.where(is_out, -1.0, values)) / 2.0
        values = move(np.where(is_met, 0.5, move(later, second)), first)
    return np.where(is_met, 1.0, values)


rows = []
for name, case in CASES.items():
    graph, pursuers, exits, first = case
    solution = pursuit(graph, pursuers=pursuers, exits=exits, moves_first=first)
    values = find_values(*case)
    same = 0
    for position in product(range(len(graph)), repeat=pursuers + 1):
        start = {f"pursuer_{number}": node for number, node in enumerate(position[:-1])} | {"evader": position[-1]}
        turns = solution.captures(start) if solution.value_at(start) > 0 else solution.escapes(start)
        same += values[position] == solution.value_at(start) * (0.0 if turns is None else 0.5**turns)
    count = values.size
    rows.append({"result": f"equal positions, {name}", "expected": count, "ours": same, "agrees": same == count})
if __name__ == "__main__":
    print(Table.of(rows))
