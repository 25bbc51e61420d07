"""Cop numbers of named graphs, by `gamms.solve.cop_number`, by an enumeration with another algorithm, and by theorems.

The enumeration: a node is safe for a robber if after each move of the cops a step leads to a node that is safe then.
Cops win if some formation leaves no safe node (Clarke and MacGillivray, Discrete Mathematics 312, 2012). The theorems:
Nowakowski and Winkler, Discrete Mathematics 43, 1983; Aigner and Fromme, Discrete Applied Mathematics 8, 1984.
"""

import networkx as nx
import numpy as np

from gamms.experiment import Table
from gamms.solve import cop_number

NAMES = "Petersen Heawood Dodecahedral Icosahedral Octahedral Cubical Frucht Pappus Desargues Moebius_Kantor Tutte"
GRAPHS = {name: getattr(nx, f"{name.lower()}_graph")() for name in NAMES.split()}
GRAPHS |= {"McGee": nx.LCF_graph(24, [12, 7, -7], 8), "Tutte-Coxeter": nx.LCF_graph(30, [-13, -9, 7, -7, 9, 13], 5)}
GRAPHS |= {"path": nx.path_graph(9), "tree": nx.balanced_tree(2, 3), "wheel": nx.wheel_graph(9)}
GRAPHS |= {"cycle": nx.cycle_graph(9), "grid": nx.convert_node_labels_to_integers(nx.grid_2d_graph(5, 6))}


def do_cops_win(graph, cops):
    """Return whether some formation of the cops leaves no safe node."""
    near = nx.to_numpy_array(graph, nodelist=range(len(graph)), dtype=np.float32) + np.eye(len(graph), dtype=np.float32)
    *places, robber = np.indices((len(graph),) * (cops + 1), np.int8)
    is_free = np.all([place != robber for place in places], axis=0)  # by the nodes of the cops, then of the robber
    before, is_safe = None, is_free
    while not np.array_equal(before, is_safe):
        before, is_safe = is_safe, is_free & (is_safe.astype(np.float32) @ near > 0)
        for cop in range(cops):
            is_safe = np.stack([is_safe.compress(near[node], cop).all(cop) for node in range(len(graph))], cop)
    return not is_safe.any(-1).all()


def find_bounds(graph):
    """Return bounds of the cop number by the theorems of Nowakowski and Winkler, and of Aigner and Fromme."""
    near = {node: {node, *graph[node]} for node in graph}
    while (corner := next((a for a in near for b in near if a != b and near[a] <= near[b]), None)) is not None:
        near = {node: around - {corner} for node, around in near.items() if node != corner}
    least = min(degree for _, degree in graph.degree) if nx.girth(graph) >= 5 else 1
    return (1, 1) if len(near) == 1 else (max(2, least), 3 if nx.is_planar(graph) else len(graph))


rows = []
for name, graph in GRAPHS.items():
    expected, ours = next(cops for cops in range(1, 5) if do_cops_win(graph, cops)), cop_number(graph)
    low, high = find_bounds(graph)
    rows.append({"result": f"cop number, {name}", "expected": expected, "ours": ours})
    rows[-1] |= {"agrees": low <= expected == ours <= high}
if __name__ == "__main__":
    print(Table.of(rows))
