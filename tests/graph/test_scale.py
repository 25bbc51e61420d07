"""Large grids: built from arrays, they answer, and stay small."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gamms.graph import Graph
from gamms.graph.tables import RowIndex

GRID = '''
def grid(graph, columns, rows):
    """A grid of unit blocks with two-way streets; node `row * columns + column`."""
    import numpy as np

    ids = np.arange(columns * rows)
    graph.add_nodes(ids, ids % columns, ids // columns)
    east, north = ids[ids % columns < columns - 1], ids[ids // columns < rows - 1]
    sources = np.concatenate([east, east + 1, north, north + columns])
    targets = np.concatenate([east + 1, east, north + columns, north])
    graph.add_edges(np.arange(len(sources)), sources, targets)
    return len(sources)
'''
exec(GRID)  # the programs that are measured below build theirs the same way


@pytest.fixture(scope="module")
def large():
    graph = Graph()
    grid(graph, 300, 300)  # noqa: F821 - see GRID
    return graph


def test_everything_is_seen_from_anywhere(large):
    nodes, edges = large.within(0, math.inf)
    assert (len(nodes), len(edges)) == (90_000, 358_800)
    assert large.neighborhoods[89_999] == (89_999, 89_998, 89_699)


def test_ids_in_a_row_take_no_memory():
    index = RowIndex()
    index.extend(np.arange(5, 1_000_005), 0, "a node")
    for row in range(1_000_000, 1_001_000):
        index.add(row + 5, row)
    assert not index._others
    assert (index.find_row(5), index.find_row(1_001_004), index.find_row(4), index.find_row(1_001_005)) == (
        0,
        1_000_999,
        -1,
        -1,
    )


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="asks Linux for the peak of a process")
def test_a_grid_of_200_000_nodes_stays_small():
    # Not getrusage: what it tells of a child includes the memory of the process that started it.
    script = f"""{GRID}
from pathlib import Path
from gamms.graph import Graph

def print_peak():
    peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    print(int(peak.split()[1]) // 1024)

graph = Graph()
assert grid(graph, 500, 400) == 798_200
list(graph.get_nodes(50.0, 100.0, 100.0)), graph.columns()
print_peak()
graph.within(0, 100.0)
print_peak()
"""
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    asked_for_ids, sensed = map(int, ran.stdout.split())
    assert asked_for_ids < 170
    assert sensed < 200
