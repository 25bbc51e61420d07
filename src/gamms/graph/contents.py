"""All that a saved graph holds, checked: what files and databases are written from and read into."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import BadFile, BadValue, GammsError
from gamms.graph.tables import RowIndex
from gamms.ir import packing
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.plain import Plain, is_plain, why_not_plain
from gamms.text import shown
from gamms.typing.graph_engine import ObsFace


class Contents(NamedTuple):
    """A graph, its obstacles, and whom the data is by."""

    columns: GraphColumns
    faces: list[ObsFace]
    attribution: str | None


LeftOut = dict[tuple[str, str], list[int]]  # "node" or "edge", and the name of an attribute -> whose was left out


def savable(contents: Contents) -> tuple[Contents, LeftOut]:
    """Return the same without the attributes that are no plain data, and which these are."""
    columns, left_out = contents.columns, LeftOut()
    given = {"node": (columns.node_attributes, columns.node_ids), "edge": (columns.edge_attributes, columns.edge_ids)}
    kept: dict[str, dict[str, dict[int, Plain]]] = {"node": {}, "edge": {}}
    for kind, (attributes, ids) in given.items():
        for name, values in attributes.items():
            part = {row: value for row, value in values.items() if is_plain(value)}
            if len(part) < len(values):
                left_out[kind, name] = [int(ids[row]) for row in values if row not in part]
            if part:
                kept[kind][name] = part
    columns = replace(columns, node_attributes=kept["node"], edge_attributes=kept["edge"])
    return contents._replace(columns=columns), left_out


def attribute_bytes(value: Plain, kind: str, name: str) -> bytes:
    """Return the value of an attribute as bytes, the same bytes for the same value.

    Args:
        value: what is saved.
        kind: "Node" or "Edge", for the message.
        name: of the attribute.

    Raises:
        BadValue: it is no plain value.
    """
    if flaw := why_not_plain(value):
        raise BadValue(
            f"{kind} attribute {name!r} cannot be saved: {shown(value)} (it{flaw}). Only None, bool, int, float, "
            f"str, bytes, arrays of numbers, and list, tuple, set and dict of these can; convert it, or remove the "
            f"attribute before saving."
        )
    return packing.to_bytes(value, f"{kind} attribute {name!r}")


def checked_columns(
    arrays: dict[str, packing.Array],
    polylines: dict[int, FloatArray],
    attributes: tuple[dict[str, dict[int, Plain]], dict[str, dict[int, Plain]]],
    crs: str | None,
) -> GraphColumns:
    """Return columns from the arrays of a file, which may hold anything.

    Args:
        arrays: `node_ids`, `xy`, `edge_ids`, `sources` and `targets` (node rows), `lengths`.
        polylines: edge row -> (points, 2).
        attributes: of nodes and of edges, name -> row -> value.
        crs: the coordinate reference system.

    Raises:
        BadFile: they do not make a graph.
    """
    nodes, edges = len(arrays["node_ids"]), len(arrays["edge_ids"])
    for name, shape in (
        ("node_ids", (nodes,)),
        ("xy", (nodes, 2)),
        ("edge_ids", (edges,)),
        ("sources", (edges,)),
        ("targets", (edges,)),
        ("lengths", (edges,)),
    ):
        if arrays[name].shape != shape:
            raise BadFile(f"{name} has shape {arrays[name].shape} instead of {shape}")
    for ids, kind in ((arrays["node_ids"], "node"), (arrays["edge_ids"], "edge")):
        try:
            RowIndex().refuse_duplicates(ids, kind)
        except GammsError as error:
            raise BadFile(f"an id is there twice: {error}") from error
    _check_rows(arrays["sources"], nodes, "source")
    _check_rows(arrays["targets"], nodes, "target")
    _check_rows(np.array(list(polylines), np.int64), edges, "polyline")
    for values in (arrays["xy"], arrays["lengths"], *polylines.values()):
        if not np.isfinite(values).all():
            raise BadFile("a coordinate or length is not finite")
    if edges and float(arrays["lengths"].min()) < 0.0:
        raise BadFile("a length is negative")
    for rows, count in zip(attributes, (nodes, edges), strict=True):
        for name, by_row in rows.items():
            _check_rows(np.array(list(by_row), np.int64), count, f"attribute {name!r}")
    offsets, out_edges = kernels.group_rows(arrays["sources"], nodes)
    return GraphColumns(
        **arrays,
        offsets=offsets,
        out_edges=out_edges,
        polylines=polylines,
        node_attributes=attributes[0],
        edge_attributes=attributes[1],
        revision=0,
        crs=crs,
    )


def _check_rows(rows: IntArray, count: int, what: str) -> None:
    if len(rows) and not (int(rows.min()) >= 0 and int(rows.max()) < count):
        raise BadFile(f"a {what} belongs to a row that is not there")
