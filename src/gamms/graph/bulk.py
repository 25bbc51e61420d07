"""Many nodes or edges at once: the arrays that callers pass, checked."""

from typing import Any

import numpy as np

from gamms.errors import BadValue
from gamms.graph import records
from gamms.graph.tables import NodeTable
from gamms.ir.graph import FloatArray, IntArray


def checked_nodes(ids: Any, x: Any, y: Any) -> tuple[IntArray, FloatArray]:
    """Ids (nodes,) and coordinates (nodes, 2).

    Raises:
        BadValue, BadType: they are none.
    """
    ids = records.id_array(ids, "ids")
    return ids, np.column_stack([records.number_array(x, len(ids), "x"), records.number_array(y, len(ids), "y")])


def checked_edges(nodes: NodeTable, ids: Any, sources: Any, targets: Any, lengths: Any) -> dict[str, Any]:
    """Ids, node rows of both ends, and lengths, (edges,) each.

    Raises:
        UnknownName (KeyError): an end is no node.
        BadValue, BadType: they are none.
    """
    ids = records.id_array(ids, "ids")
    ends = [records.id_array(end, name) for end, name in ((sources, "sources"), (targets, "targets"))]
    for name, end in zip(("sources", "targets"), ends, strict=True):
        if len(end) != len(ids):
            raise BadValue(f"{name} must have shape ({len(ids)},) like the ids, not {end.shape}.")
    source_rows, target_rows = (nodes.index.rows(end, "node") for end in ends)
    if lengths is None:
        xy = nodes.array("xy")
        lengths = np.hypot(*(xy[target_rows] - xy[source_rows]).T)
    lengths = records.number_array(lengths, len(ids), "lengths")
    if len(lengths) and float(lengths.min()) < 0.0:
        raise BadValue(f"lengths must not be negative; the least is {float(lengths.min())}.")
    return {"ids": ids, "sources": source_rows, "targets": target_rows, "lengths": lengths}
