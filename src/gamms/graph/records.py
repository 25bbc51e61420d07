"""Check nodes and edges passed by callers, one or many, and split them into columns and attributes."""

from collections.abc import Iterable, Mapping, Sequence
from math import inf, isfinite, isnan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gamms import arguments
from gamms.arguments import as_array, as_float, as_int
from gamms.errors import BadType, BadValue
from gamms.graph.tables import NodeTable, copy_value
from gamms.ir.geometry import read_points
from gamms.ir.graph import FloatArray, IntArray, as_node_id, label_hint
from gamms.text import shown

NODE_KEYS = frozenset(("id", "x", "y"))
EDGE_KEYS = frozenset(("id", "source", "target", "length", "linestring"))


def get_required(record: Mapping[str, Any], key: str, kind: str) -> Any:
    """Return `record[key]`.

    Raises:
        BadType: the record is not a dict.
        BadValue: the key is missing.
    """
    try:
        return record[key]
    except KeyError:
        raise BadValue(f"{kind} needs the key {key!r}; got only {', '.join(sorted(map(shown, record)))}.") from None
    except (TypeError, IndexError, ValueError):  # errors that lists and arrays raise
        raise BadType(f"{kind} must be given as a dict, not {shown(record)}.") from None


def as_id(value: object, kind: str, store: object = None) -> int:
    """Return an id as a plain int; for a node of a store, the error for a networkx label names its id."""
    if type(value) is int and -(2**63) <= value < 2**63:
        return value
    name = f"The id of {kind}"
    return as_int(value, name) if store is None else as_node_id(value, name, store)


def as_text(value: object, name: str) -> str | None:
    """Return `value` as plain Unicode text, or None."""
    return None if value is None else arguments.as_text(value, name, "a string or None")


def as_coordinate(value: object, axis: str, id: int) -> float:
    """Return a coordinate as a finite float."""
    return value if type(value) is float and isfinite(value) else as_float(value, f"{axis} of node {id}")


def as_length(value: object, id: int) -> float:
    """Return a length as a finite float that is not negative."""
    length = value if type(value) is float and isfinite(value) else as_float(value, f"The length of edge {id}")
    if length < 0.0:
        raise BadValue(f"The length of edge {id} must not be negative, not {length}.")
    return length


def check_polyline(linestring: object, id: int, ends: Sequence[float]) -> FloatArray | None:
    """Return the polyline (points, 2) of an edge; None if it is the straight line between `ends` (x0, y0, x1, y1).

    Raises:
        BadValue: not a valid polyline.
    """
    if linestring is None:
        return None
    points = read_points(linestring, f"The linestring of edge {id}")
    return None if len(points) == 2 and tuple(points.ravel().tolist()) == tuple(ends) else points


def select_extras(record: dict[str, Any], keys: frozenset[str]) -> dict[str, Any]:
    """Return the items of a record except `keys`: the caller's attributes.

    Raises:
        BadType: a key is not a string.
        BadValue: a value is nested too deeply, or contains itself.
    """
    given = {}
    for key, value in record.items():
        if key not in keys:
            if not isinstance(key, str):
                raise BadType(f"The name of an attribute must be a string, not {shown(key)}.")
            given[str.__str__(key)] = copy_value(value)
    return given


def check_ids(values: ArrayLike, name: str, store: object = None) -> IntArray:
    """Return ids as an array (ids,).

    Args:
        values: the ids.
        name: their name in messages.
        store: the store of which they are nodes, so that the error for a networkx label names its id.

    Raises:
        BadType: the values are not integers.
        BadValue: the array is not one-dimensional.
    """
    try:
        array = as_array(values, name, "integers")
    except BadType as error:
        given = [values] if isinstance(values, str) or not isinstance(values, Iterable) else values
        hints = () if store is None else filter(None, (label_hint(one, store) for one in given))
        raise BadType(f"{error}{next(iter(hints), '')}") from None
    if array.ndim != 1:
        raise BadValue(f"{name} must be one-dimensional, not of shape {array.shape}.")
    if array.dtype.kind == "u" and array.size and int(array.max()) >= 2**63:
        raise BadValue(f"{name} must fit into 64 bits, not {int(array.max())}.")
    return array.astype(np.int64)


def check_numbers(values: ArrayLike, count: int, name: str) -> FloatArray:
    """Return numbers as an array (count,) of finite floats.

    Raises:
        BadType: the values are not numbers.
        BadValue: the length differs from `count`, or a number is not finite.
    """
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:
        raise BadType(f"{name} must be an array of numbers: {error}.") from None
    if array.dtype.kind not in "iuf":
        raise BadType(f"{name} must be an array of numbers, not of {array.dtype}.")
    array = array.astype(np.float64, copy=False)
    if array.shape != (count,):
        raise BadValue(f"{name} must have shape ({count},) like the ids, not {array.shape}.")
    bad = np.flatnonzero(~np.isfinite(array))
    if len(bad):
        raise BadValue(f"{name} must be finite; at index {int(bad[0])} it is {array[bad[0]]}.")
    return array


def is_everywhere(d: float, x: float, y: float) -> bool:
    """Return whether a query covers the whole plane, because `d` is negative or infinite.

    Raises:
        BadType: an argument is not a number.
        BadValue: an argument is NaN, or a finite disc has a center that is not finite.
    """
    try:
        has_nan = isnan(d) | isnan(x) | isnan(y)
    except (TypeError, OverflowError):
        raise BadType(
            f"A place and a distance must be numbers, not d={shown(d)}, x={shown(x)}, y={shown(y)}."
        ) from None
    is_all = d < 0 or d == inf
    if has_nan or not (is_all or (isfinite(x) and isfinite(y))):
        raise BadValue(f"A place must be finite, and a distance a number, not d={d}, x={x}, y={y}.")
    return is_all


def check_edges(
    nodes: NodeTable, ids: ArrayLike, sources: ArrayLike, targets: ArrayLike, lengths: ArrayLike | None
) -> dict[str, Any]:
    """Return checked ids, node rows of both ends, and lengths, (edges,) each.

    Raises:
        UnknownName (KeyError): an end is not a node.
        BadValue, BadType: a value is invalid.
    """
    ids = check_ids(ids, "ids")
    ends = [check_ids(end, name) for end, name in ((sources, "sources"), (targets, "targets"))]
    for name, end in zip(("sources", "targets"), ends, strict=True):
        if len(end) != len(ids):
            raise BadValue(f"{name} must have shape ({len(ids)},) like the ids, not {end.shape}.")
    source_rows, target_rows = (nodes.index.find_rows(end, "node") for end in ends)
    if lengths is None:
        xy = nodes.get_array("xy")
        lengths = np.hypot(*(xy[target_rows] - xy[source_rows]).T)
    lengths = check_numbers(lengths, len(ids), "lengths")
    if len(lengths) and float(lengths.min()) < 0.0:
        raise BadValue(f"lengths must not be negative; the least is {float(lengths.min())}.")
    return {"ids": ids, "sources": source_rows, "targets": target_rows, "lengths": lengths}
