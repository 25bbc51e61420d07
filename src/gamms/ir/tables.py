"""Rows of plain values as columns."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Rows = Sequence[Mapping[str, Any]] | Mapping[str, Sequence[Any]]


def table_of(rows: Rows) -> dict[str, "np.ndarray[Any, Any]"]:
    """Columns of equal length: integers, floats, bools and texts as such, anything else, or None, as objects."""
    if isinstance(rows, Mapping):
        return {name: _column(list(values)) for name, values in rows.items()}
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _column([row.get(name) for row in rows]) for name in names}


def _column(values: list[Any]) -> "np.ndarray[Any, Any]":
    kinds = {type(value) for value in values}
    for kind, dtype in ((bool, np.bool_), (int, np.int64), (str, np.str_)):
        if kinds == {kind}:
            return _made(values, dtype)
    if kinds and kinds <= {int, float}:
        return _made(values, np.float64)
    column = np.empty(len(values), object)
    for place, value in enumerate(values):  # not at once: lists of equal length would become a matrix
        column[place] = value
    return column


def _made(values: list[Any], dtype: Any) -> "np.ndarray[Any, Any]":
    try:
        return np.array(values, dtype)
    except OverflowError:  # an integer beyond 64 bits
        return np.array(values, object)
