"""Capture times: in how many turns cops catch a robber under exact play, if the cops choose their nodes first.

Two cops need floor((m + n) / 2) - 1 on a grid of m rows and n columns (Mehrabian, The capture time of grids, Discrete
Mathematics 311, 2011), and one needs the radius of a tree (Bonato, Golovach, Hahn and Kratochvil, The capture time of
a graph, Discrete Mathematics 309, 2009). Each solution is also played, from its first positions.
"""

import networkx as nx

from gamms.experiment import Table
from gamms.graph import grid
from gamms.solve import pursuit

GRIDS = ((2, 5), (4, 4), (5, 8), (7, 9))
TREES = {
    "path of 12": nx.path_graph(12),
    "binary tree": nx.balanced_tree(2, 4),
    "ternary tree": nx.full_rary_tree(3, 20),
}

rows = []
for m, n in GRIDS:
    ours = pursuit(grid(m, n), pursuers=2).captures()
    rows.append({"result": f"turns of 2 cops, grid of {m} x {n}", "expected": (m + n) // 2 - 1, "ours": ours})
for name, tree in TREES.items():
    rows.append({"result": f"turns of 1 cop, {name}", "expected": nx.radius(tree), "ours": pursuit(tree).captures()})
for row in rows:
    row["agrees"] = row["ours"] == row["expected"]
if __name__ == "__main__":
    print(Table.of(rows))
