"""What an edge costs whoever goes along it: its length, one step, or one of its attributes."""

from typing import Any

import numpy as np

from gamms.arguments import as_range
from gamms.errors import BadType, UnknownName, nearest
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.text import shown


def edge_weights(columns: GraphColumns, weight: str | None) -> FloatArray:
    """The weight of every edge.

    Args:
        columns: a graph.
        weight: "length", the name of an attribute (an edge without it counts 1), or None (every edge counts 1).

    Returns:
        (edges,) not negative; infinite where an edge is closed.

    Raises:
        BadType: `weight` is no name, or the attribute of an edge no number.
        BadValue: it is negative or NaN.
        UnknownName (KeyError): no edge has such an attribute, and the name looks like a misspelt one.
    """
    if weight is not None and not isinstance(weight, str):
        raise BadType(
            f"weight must be 'length', the name of an edge attribute, or None for steps, not {shown(weight)}."
        )
    if weight == "length":
        return columns.lengths
    known = ("length", *columns.edge_attributes)
    if weight is not None and weight not in known and nearest(weight, known):
        raise UnknownName("weight", weight, known)
    weights = np.ones(len(columns.edge_ids))
    given = {} if weight is None else columns.edge_attributes.get(weight, {})
    numbers = [_number(value, columns, row, weight) for row, value in given.items()]
    weights[list(given)] = numbers
    return weights


def _number(value: Any, columns: GraphColumns, row: int, weight: str | None) -> float:
    if type(value) is float and value >= 0.0:
        return value
    return as_range(value, f"The weight {weight!r} of edge {columns.edge_ids[row]}")
