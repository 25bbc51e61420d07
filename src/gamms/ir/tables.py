"""Rows of plain values as columns."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.errors import MissingExtra
from gamms.limits import refuse_above

if TYPE_CHECKING:
    import pandas as pd

_OF_EMPTY = 64  # bytes
_MOST_CHARACTERS, _SHARE = 1 << 18, 16  # of texts in an array, if they are more than so many times their lengths

Rows = Sequence[Mapping[str, Any]] | Mapping[str, Sequence[Any]]


def table_of(rows: Rows) -> dict[str, "np.ndarray[Any, Any]"]:
    """Columns of equal length: integers, floats, bools and texts as such, anything else, or None, as objects.

    Texts are objects, too, where one of them is so long that an array for all would be almost empty.

    Raises:
        TooLarge (ValueError): rows have so many columns of their own that a table of them does not fit into memory.
    """
    if isinstance(rows, Mapping):
        return {name: _column(list(values)) for name, values in rows.items()}
    names = dict.fromkeys(name for row in rows for name in row)
    empty = len(names) * len(rows) - sum(map(len, rows))
    refuse_above(_OF_EMPTY * empty, f"A table of {len(rows):,} rows and {len(names):,} columns, most of it empty,")
    return {name: _column([row.get(name) for row in rows]) for name in names}


def frame_of(columns: Mapping[str, "np.ndarray[Any, Any]"]) -> "pd.DataFrame":
    """Return columns of equal length as a data frame of pandas.

    Raises:
        MissingExtra (ImportError): pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError:
        raise MissingExtra("A table for pandas", "notebook") from None
    return pd.DataFrame(dict(columns))


def _column(values: list[Any]) -> "np.ndarray[Any, Any]":
    kinds = {type(value) for value in values}
    for kind, dtype in ((bool, np.bool_), (int, np.int64), (str, np.str_)):
        if kinds == {kind} and (kind is not str or _are_even(values)):
            return _made(values, dtype)
    if kinds and kinds <= {int, float}:
        return _made(values, np.float64)
    column = np.empty(len(values), object)
    for place, value in enumerate(values):  # not at once: lists of equal length would become a matrix
        column[place] = value
    return column


def _are_even(texts: list[str]) -> bool:
    """Return whether the longest of these texts is not far longer than the others."""
    lengths = list(map(len, texts))
    return max(lengths) * len(texts) <= _MOST_CHARACTERS + _SHARE * sum(lengths)


def _made(values: list[Any], dtype: type) -> "np.ndarray[Any, Any]":
    try:
        return np.array(values, dtype)
    except OverflowError:  # an integer beyond 64 bits
        return np.array(values, object)
