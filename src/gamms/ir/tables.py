"""Rows of plain values as columns."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import GraphColumns
from gamms.ir.projection import WGS84, project_back_and_forth
from gamms.limits import refuse_above
from gamms.plugins import require_extra

if TYPE_CHECKING:
    import pandas as pd

_OF_EMPTY = 12  # bytes; 8 measured, and a list of one column at a time
# most characters of texts in an array that has more than this many times their lengths
_MOST_CHARACTERS = 1 << 18
_SHARE = 16

Column = np.ndarray[Any, Any]
Rows = Sequence[Mapping[str, Any]] | Mapping[str, Sequence[Any]]


def make_table(rows: Rows) -> dict[str, "np.ndarray[Any, Any]"]:
    """Return columns of equal length: arrays of integers, floats, bools or texts, otherwise of objects.

    Texts are also objects if one of them is so long that an array for all would be almost empty.

    Raises:
        TooLarge (ValueError): rows have so many different columns that their table does not fit in memory.
    """
    if isinstance(rows, Mapping):
        return {name: _make_column(list(values)) for name, values in rows.items()}
    names = dict.fromkeys(chain.from_iterable(rows))
    empty = len(names) * len(rows) - sum(map(len, rows))
    refuse_above(_OF_EMPTY * empty, f"A table of {len(rows):,} rows and {len(names):,} columns, most of it empty,")
    return {name: _make_column([row.get(name) for row in rows]) for name in names}


def add_latlon(table: Mapping[str, Column], streets: GraphColumns) -> dict[str, Column]:
    """Add latitude and longitude, `lat` and `lon`, of `x` and `y`, or of nodes in the column `node` or `at`.

    They are NaN for nodes that are not on the map.

    Raises:
        BadValue: the table has no such column, or the map has no CRS.
    """
    has_xy = all(name in table and table[name].dtype.kind in "if" for name in "xy")
    of_nodes = [name for name in ("node", "at") if name in table]
    if streets.crs is None or not (has_xy or of_nodes):
        why = "the map has no CRS" if streets.crs is None else f"it has no nodes, but {', '.join(table)}"
        raise BadValue(f"The table cannot have lat and lon: {why}.")
    if has_xy:
        xy = np.column_stack((table["x"], table["y"])).astype(np.float64)
    else:
        row_of = {node: row for row, node in enumerate(streets.node_ids.tolist())}
        rows = np.array(
            [row_of.get(node, -1) if isinstance(node, int) else -1 for node in table[of_nodes[0]].tolist()], np.int64
        )
        xy = np.append(streets.xy, [(np.nan, np.nan)], axis=0)[rows]
    known = np.isfinite(xy).all(axis=1)
    degrees = np.full(xy.shape, np.nan)
    degrees[known] = project_back_and_forth(xy[known], streets.crs, WGS84)
    return {**table, "lat": degrees[:, 1], "lon": degrees[:, 0]}


def make_frame(columns: Mapping[str, "np.ndarray[Any, Any]"]) -> "pd.DataFrame":
    """Return columns of equal length as a pandas data frame.

    Raises:
        MissingExtra (ImportError): pandas is not installed.
    """
    with require_extra("A table for pandas", "notebook"):
        import pandas as pd
    return pd.DataFrame(dict(columns))


def _make_column(values: list[Any]) -> "np.ndarray[Any, Any]":
    kinds = {type(value) for value in values}
    for kind, dtype in ((bool, np.bool_), (int, np.int64), (str, np.str_)):
        if kinds == {kind} and (kind is not str or _are_even(values)):
            return _make_array(values, dtype)
    if kinds and kinds <= {int, float}:
        return _make_array(values, np.float64)
    column = np.empty(len(values), object)
    for place, value in enumerate(values):  # one by one, because lists of equal length would become a matrix
        column[place] = value
    return column


def _are_even(texts: list[str]) -> bool:
    """Return whether the longest text is not much longer than the others."""
    lengths = list(map(len, texts))
    return max(lengths) * len(texts) <= _MOST_CHARACTERS + _SHARE * sum(lengths)


def _make_array(values: list[Any], dtype: type) -> "np.ndarray[Any, Any]":
    try:
        return np.array(values, dtype)
    except OverflowError:  # an integer beyond 64 bits
        return np.array(values, object)
