"""Street grids to play on, as networkx graphs that can be attached."""

from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.arguments import as_float, as_int
from gamms.errors import BadValue
from gamms.graph.networkx import digraph
from gamms.limits import refuse_above

if TYPE_CHECKING:
    import networkx as nx

_NODE_BYTES = 5_000  # with its edges, measured: 2,600 in networkx, and 2,200 as they are attached


def grid(n: int, m: int, spacing: float = 10.0) -> "nx.DiGraph[int]":
    """Make a grid of `n` rows of `m` nodes; neighbours in a row or column are joined both ways.

    Args:
        n: rows.
        m: nodes in each row.
        spacing: map units between neighbours.

    Returns:
        A networkx DiGraph: node `i * m + j` is at `x = j * spacing, y = i * spacing`; every edge has its `length`.

    Raises:
        BadValue (ValueError), BadType (TypeError): an impossible number.
        TooLarge (BadValue): it would take more memory than is allowed.
    """
    rows, columns, step = _side(n, "n"), _side(m, "m"), as_float(spacing, "spacing")
    if step <= 0.0:
        raise BadValue(f"spacing must be positive, not {step}.")
    refuse_above(rows * columns * _NODE_BYTES, f"A grid of {rows} x {columns} nodes")
    ids = np.arange(rows * columns).reshape(rows, columns)
    y, x = np.indices(ids.shape).astype(np.float64) * step
    starts = np.concatenate([ids[:, :-1].ravel(), ids[:-1].ravel()])
    ends = np.concatenate([ids[:, 1:].ravel(), ids[1:].ravel()])
    order = np.argsort(starts, kind="stable")  # node by node: the one to the right, then the one above
    pairs = np.column_stack([starts, ends])[order]
    both_ways = np.column_stack([pairs, pairs[:, ::-1]]).reshape(-1, 2)
    return digraph(x.ravel(), y.ravel(), both_ways, step)


def _side(value: Any, name: str) -> int:
    side = as_int(value, name)
    if side < 1:
        raise BadValue(f"{name} must be at least 1, not {side}.")
    return side
