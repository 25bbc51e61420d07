"""The file format of saved maps: one file that holds a complete graph and is safe to open.

Layout: 8 bytes `GAMMSMAP`; three little-endian uint32: format version, size and CRC-32 of the rest; then a dict of
arrays and plain values, packed by `ir/packing.py`. Nothing in a file is ever evaluated or imported.
"""

import os
import zlib
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from itertools import count
from pathlib import Path
from struct import Struct
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_path, as_target, refuse_suffix
from gamms.errors import BadFile, BadValue, GammsError, MissingFile, WriteConflict
from gamms.folders import write_whole
from gamms.graph import records
from gamms.graph.obstacles import Obstacles, check_face
from gamms.graph.store import GraphStore
from gamms.graph.tables import RowIndex
from gamms.ir import packing
from gamms.ir.geometry import read_points
from gamms.ir.graph import ClosedEdges, CodedValues, FloatArray, GraphColumns, IntArray, Polylines
from gamms.ir.obstacles import ObstacleColumns
from gamms.ir.packing import Array
from gamms.ir.scenery import Scenery, make_empty_scenery
from gamms.limits import MemoryBudget
from gamms.plain import Plain, describe_flaw, is_plain
from gamms.text import shown
from gamms.typing.graph_engine import ObsFace
from gamms.typing.map_storage import LeftOut
from gamms.typing.memory_engine import IPathLike, Row, Schema

MAGIC = b"GAMMSMAP"
VERSION = 2  # version 1 was used by development versions; it is not supported
_SCENERIES: dict[str | None, Path] = {"helsinki": Path(__file__).parent.parent / "data" / "helsinki.gamms"}
_HEAD = Struct("<8sIII")
_GRAPH = ("node_ids", "xy", "edge_ids", "sources", "targets", "lengths")
_OTHERS = ("bend_rows", "bend_sizes", "bend_points", "face_ids", "face_types", "face_corners")
_SIMPLE = {str, int, bool, bytes, type(None)}  # types whose equal values are interchangeable
_Attributes = dict[str, CodedValues]  # by name


class SavedMap(NamedTuple):
    """A graph, its obstacles, and the authors of the data."""

    columns: GraphColumns
    faces: list[ObsFace]
    attribution: str | None
    scenery: str | Scenery | None
    closed: ClosedEdges


def select_savable(contents: SavedMap) -> tuple[SavedMap, LeftOut]:
    """Return the columns without attributes that are not plain data, and the names of these attributes."""
    columns = contents.columns
    left_out = LeftOut()
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
    closed = {
        id: {key: value for key, value in edge.items() if is_plain(value)} for id, edge in contents.closed.items()
    }
    for id, edge in contents.closed.items():
        for name in edge.keys() - closed[id].keys():
            left_out.setdefault(("edge", name), []).append(id)
    return contents._replace(columns=columns, closed=closed), left_out


def encode_attribute(value: Plain, kind: str, name: str) -> bytes:
    """Return an attribute value as bytes; equal values give equal bytes.

    Args:
        value: the value to save.
        kind: "Node" or "Edge", for the message.
        name: name of the attribute.

    Raises:
        BadValue: not a plain value.
    """
    if flaw := describe_flaw(value):
        raise BadValue(
            f"{kind} attribute {name!r} cannot be saved: {shown(value)} (it{flaw}). Only None, bool, int, float, str, "
            f"bytes, arrays of numbers, and list, tuple, set and dict of these can be saved; convert it, or remove the "
            f"attribute before saving."
        )
    return packing.to_bytes(value, f"{kind} attribute {name!r}")


def check_columns(
    arrays: dict[str, Array],
    polylines: Polylines,
    attributes: tuple[_Attributes, _Attributes],
    crs: str | None,
) -> GraphColumns:
    """Check untrusted arrays from a file, and return them as columns.

    Args:
        arrays: `node_ids`, `xy`, `edge_ids`, `sources` and `targets` (node rows), `lengths`.
        polylines: polylines by edge row.
        attributes: attributes of nodes and of edges, name -> row -> value.
        crs: the coordinate reference system.

    Raises:
        BadFile: the arrays do not describe a valid graph.
    """
    nodes = len(arrays["node_ids"])
    edges = len(arrays["edge_ids"])
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
            raise BadFile(f"an id occurs twice: {error}") from error
    _check_rows(arrays["sources"], nodes, "source")
    _check_rows(arrays["targets"], nodes, "target")
    _check_rows(polylines.rows, edges, "polyline")
    for values in (arrays["xy"], arrays["lengths"], polylines.points):
        if not np.isfinite(values).all():
            raise BadFile("a coordinate or length is not finite")
    if edges and float(arrays["lengths"].min()) < 0.0:
        raise BadFile("a length is negative")
    for rows, most in zip(attributes, (nodes, edges), strict=True):
        for name, by_row in rows.items():
            _check_rows(by_row.rows, most, f"attribute {name!r}")
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
    if len(rows) and not 0 <= int(rows.min()) <= int(rows.max()) < count:
        raise BadFile(f"a {what} belongs to a row that does not exist")


def save(path: str | os.PathLike[str], contents: SavedMap) -> None:
    """Write a graph to a file; the file appears complete or not at all.

    Raises:
        BadValue: an attribute is not plain data, or the suffix is that of another kind of file.
            MissingFolder (FileNotFoundError), OSError: the file cannot be written.
    """
    file = as_target(path)
    refuse_suffix(file, "A saved graph", ".gamms")
    write_whole(file, encode(contents), through_links=True)


def save_beside(path: str, contents: SavedMap) -> str:
    """Write a graph to a new file next to `path`, which cannot be written; return the path of the new file."""
    for number in count(1):
        beside = f"{path}.unsaved-{number}.gamms"
        try:
            with open(beside, "xb") as made:  # noqa: PTH123 - text, as databases have it
                made.write(encode(contents))
        except FileExistsError:
            continue
        return beside
    raise AssertionError


def load(path: str | os.PathLike[str]) -> SavedMap:
    """Read a graph.

    Raises:
        BadFile (ValueError): the file is damaged, foreign, too new or absurdly large.
        OSError: the file cannot be read.
    """
    file = as_path(path, "path")
    if not file.exists():
        raise MissingFile("a map", file)
    data = file.read_bytes()
    try:
        return decode(data)
    except BadFile as error:
        raise type(error)(f"{path} is not a graph that GAMMS can load: {error}.") from error


@lru_cache(maxsize=4)
def load_scenery(name: str | None) -> Scenery:
    """Return a base map included in GAMMS by name; an empty one for unknown names."""
    if name not in _SCENERIES:
        return make_empty_scenery()
    contents = load(_SCENERIES[name])
    buildings = Obstacles()
    buildings.replace(contents.faces)
    base = contents.scenery if isinstance(contents.scenery, Scenery) else make_empty_scenery()
    return replace(base, buildings=buildings.columns())


def encode(contents: SavedMap) -> bytes:
    """Return a graph as the bytes of a file; the same graph gives the same bytes.

    Raises:
        BadValue: an attribute is not plain data.
    """
    graph = contents.columns
    state = {
        "crs": graph.crs,
        "attribution": contents.attribution,
        **_write_scenery(contents.scenery),
        **({"closed": _list_closed(contents.closed)} if contents.closed else {}),
        **_list_arrays(contents),
        "node_attributes": _make_columns(graph.node_attributes, "Node"),
        "edge_attributes": _make_columns(graph.edge_attributes, "Edge"),
    }
    return frame_file(state, MAGIC, VERSION)


def decode(data: bytes) -> SavedMap:
    """Return the graph in the bytes of a file.

    Raises:
        BadFile: see `load`.
    """
    with report_damage():
        state = unframe_file(data, MAGIC, VERSION)
        arrays, others = ({name: _read_array(state, name) for name in names} for names in (_GRAPH, _OTHERS))
        attributes = _read_attributes(state["node_attributes"]), _read_attributes(state["edge_attributes"])
        crs, attribution = (records.as_text(state[key], key) for key in ("crs", "attribution"))
        graph = check_columns(arrays, _read_polylines(others), attributes, crs)
        closed = _read_closed(state.get("closed", []))
        return SavedMap(graph, list(_read_faces(others)), attribution, _read_scenery(state), closed)


# -- files of columns and plain values ----------------------------------------------------------------------------


def frame_file(state: dict[str, Plain], magic: bytes, version: int) -> bytes:
    """Return a dict of arrays and plain values as the bytes of a file that begins with `magic`."""
    body = packing.pack(state, "A file")
    return _HEAD.pack(magic, version, len(body), zlib.crc32(body)) + body


def unframe_file(data: bytes, magic: bytes, version: int) -> dict[str, Plain]:
    """Return the contents of a file framed by `frame_file`.

    Raises:
        BadFile: the bytes are not such a file.
    """
    if len(data) < _HEAD.size or not data.startswith(magic):
        raise BadFile("it does not begin with the right bytes")
    _, found, size, crc = _HEAD.unpack_from(data)
    if found > version:
        raise BadFile(f"it has format version {found}, but this GAMMS reads version {version}; install a newer GAMMS")
    if found < version:
        raise BadFile(f"it has format version {found}, which was never released; save it again")
    if len(data) > _HEAD.size + size:
        raise BadFile("it has extra bytes at its end")
    body = data[_HEAD.size :]
    if len(body) < size or zlib.crc32(body) != crc:
        raise BadFile("it is damaged or cut off")
    state: dict[str, Plain] = packing.unpack(body, packing.Decoder(MemoryBudget(len(data), "it")))
    return state


@contextmanager
def report_damage() -> Iterator[None]:
    """Turn errors about the contents of a file into `BadFile`."""
    try:
        yield
    except BadFile:
        raise
    except (KeyError, ValueError, TypeError, OverflowError, IndexError, AttributeError, GammsError) as error:
        raise BadFile(f"its contents are damaged ({error})") from error


# -- contents <-> columns ---------------------------------------------------------------------------------------


def _list_arrays(contents: SavedMap) -> dict[str, Array]:
    graph = contents.columns
    faces = contents.faces
    rows, sizes, points = _list_bends(graph.polylines)
    return {
        **{name: getattr(graph, name) for name in _GRAPH},
        "bend_rows": rows,
        "bend_sizes": sizes,
        "bend_points": points,
        "face_ids": np.array([face.id for face in faces], np.int64),
        "face_types": np.array([face.type for face in faces], np.int64),
        "face_corners": np.array([face[1:5] for face in faces], np.float64).reshape(-1, 12),
    }


def _list_bends(polylines: Mapping[int, FloatArray]) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the edge rows, ascending, the number of points of each polyline, and the points of all polylines."""
    if isinstance(polylines, Polylines):
        _, taken = kernels.expand_ranges(polylines.starts, polylines.ends)
        return polylines.rows, polylines.ends - polylines.starts, polylines.points[taken]
    rows = sorted(polylines)
    shapes = [polylines[row] for row in rows]
    sizes = [len(shape) for shape in shapes]
    return np.array(rows, np.int64), np.array(sizes, np.int64), np.concatenate([np.zeros((0, 2)), *shapes])


def _list_closed(closed: ClosedEdges) -> list[Plain]:
    for edge in closed.values():
        for name, value in edge.items():
            encode_attribute(value, "Edge", name)
    return [dict(edge) for edge in closed.values()]


def _read_closed(edges: Plain) -> ClosedEdges:
    if type(edges) is not list:
        raise BadFile("the closed edges are not a list")
    closed = {edge["id"]: edge for edge in map(_check_edge, edges)}
    if len(closed) < len(edges):
        raise BadFile("a closed edge occurs twice")
    return closed


def _check_edge(edge: Plain) -> dict[str, Any]:
    """Check a closed edge as far as possible without the graph; `open_roads` checks the rest."""
    for name in ("id", "source", "target"):
        if type(edge[name]) is not int:
            raise BadFile(f"the {name} of a closed edge is {shown(edge[name])}, which is not an integer")
        records.as_id(edge[name], "an edge or a node")
    if type(edge["length"]) not in (int, float):
        raise BadFile(f"the length of a closed edge is {shown(edge['length'])}, which is not a number")
    id = edge["id"]
    line = edge.get("linestring")
    records.as_length(edge["length"], id)
    if line is not None:
        if not isinstance(line, np.ndarray) or line.shape[1:] != (2,):
            raise BadFile(f"the linestring of closed edge {id} is not an array of points")
        edge["linestring"] = read_points(line, f"The linestring of edge {id}")
    return records.select_extras(edge, frozenset()) if type(edge) is dict else {}


def _read_array(state: dict[str, Plain], name: str) -> Array:
    array = state.get(name)
    is_float = name in ("xy", "lengths", "bend_points", "face_corners", "points")
    if not isinstance(array, np.ndarray) or array.dtype != (np.float64 if is_float else np.int64):
        raise BadFile(f"{name!r} is not an array of the right type")
    return array


def _make_columns(attributes: Mapping[str, Mapping[int, Plain]], kind: str) -> dict[str, list[Plain]]:
    """Return for each attribute the rows that have it, the index of the value of each row, and the distinct values."""
    columns: dict[str, list[Plain]] = {}
    for name, by_row in sorted(attributes.items()):
        rows, codes, values = _code_values(by_row)
        keys = _make_keys(values, kind, name)
        value_of = dict(zip(keys, values, strict=True))
        code_of = {key: code for code, key in enumerate(value_of)}
        columns[name] = [rows, np.array([code_of[key] for key in keys], np.int64)[codes], [*value_of.values()]]
    return columns


def _code_values(by_row: Mapping[int, Plain]) -> tuple[IntArray, IntArray, list[Plain]]:
    """Return the rows, ascending, the index of the value of each, and the distinct values by first appearance."""
    if isinstance(by_row, CodedValues):
        codes, firsts = kernels.number_by_appearance(by_row.codes)
        return by_row.rows, codes, [by_row.choices[code] for code in by_row.codes[firsts].tolist()]
    rows = sorted(by_row)
    return np.array(rows, np.int64), np.arange(len(rows)), [by_row[row] for row in rows]


def _make_keys(values: list[Plain], kind: str, name: str) -> Sequence[Hashable]:
    """Return keys that are equal if and only if the values have equal bytes."""
    # NOTE: a city has a million values of a few kinds, often one object for many edges (benchmarks: Files).
    kinds = set(map(type, values))
    if kinds == {float}:
        bits: list[int] = np.array(values, np.float64).view(np.int64).tolist()  # 0.0 and -0.0 differ
        return bits
    if len(kinds) == 1 and kinds <= _SIMPLE:
        return values
    objects = {id(value): value for value in values}
    written = {key: encode_attribute(value, kind, name) for key, value in objects.items()}
    return [written[id(value)] for value in values]


def _read_attributes(columns: Plain) -> _Attributes:
    """Return attributes by name; rows with equal values share one object."""
    found: _Attributes = {}
    for name, column in columns.items():
        if type(name) is not str or type(column) is not list or len(column) != 3:
            raise BadFile(f"attribute {name!r} is damaged")
        rows, codes, values = column
        if type(values) is not list or not len(rows) == len(codes) > 0:
            raise BadFile(f"attribute {name!r} is damaged")
        if any(one.ndim != 1 or one.dtype != np.int64 for one in (rows, codes)):
            raise BadFile(f"attribute {name!r} is damaged")
        if not 0 <= int(codes.min()) <= int(codes.max()) < len(values) or not _are_ascending(rows):
            raise BadFile(f"attribute {name!r} is damaged")
        found[name] = CodedValues(rows, codes, values)
    return found


def _read_polylines(columns: dict[str, Array]) -> Polylines:
    rows, sizes, points = (columns[name] for name in ("bend_rows", "bend_sizes", "bend_points"))
    if not rows.ndim == sizes.ndim == 1 or len(rows) != len(sizes) or not _are_ascending(rows):
        raise BadFile("the polylines are damaged")
    if points.ndim != 2 or points.shape[1] != 2 or (len(sizes) and not 2 <= sizes.min() <= sizes.max() <= len(points)):
        raise BadFile("the polylines are damaged")
    ends = np.cumsum(sizes)
    if (int(ends[-1]) if len(ends) else 0) != len(points):
        raise BadFile("the polylines are damaged")
    points.setflags(write=False)
    return Polylines(rows, ends - sizes, ends, points)


def _are_ascending(rows: IntArray) -> bool:
    return bool((rows[1:] > rows[:-1]).all())


def _read_faces(columns: dict[str, Array]) -> Iterable[ObsFace]:
    faces = columns["face_ids"].shape
    if len(faces) != 1 or columns["face_types"].shape != faces or columns["face_corners"].shape != (*faces, 12):
        raise BadFile("the obstacle faces are damaged")
    corners = columns["face_corners"].reshape(-1, 4, 3).tolist()
    ids = columns["face_ids"].tolist()
    types = columns["face_types"].tolist()
    if len(set(ids)) < len(ids):
        raise BadFile("an obstacle face occurs twice")
    for id, type, (tr, tl, br, bl) in zip(ids, types, corners, strict=True):
        yield check_face(id, tr, tl, br, bl, type)


def _write_scenery(scenery: str | Scenery | None) -> dict[str, Plain]:
    """Return the base map as a file stores it: its name, or its columns."""
    if not isinstance(scenery, Scenery):
        return {} if scenery is None else {"scenery": scenery}
    return {"base_map": pack_base_map(scenery)}


def pack_base_map(scenery: Scenery) -> dict[str, Plain]:
    """Return the columns of a base map, as stored in a file."""
    return {
        "kinds": scenery.kinds,
        "sizes": np.diff(scenery.offsets),
        "points": scenery.points,
        "face_types": scenery.buildings.types,
        "face_corners": scenery.buildings.corners.reshape(-1, 12),
    }


def _read_scenery(state: dict[str, Plain]) -> str | Scenery | None:
    name = records.as_text(state.get("scenery"), "scenery")
    if "base_map" not in state:
        return name
    if name is not None:
        raise BadFile("it has both a scenery by name and a base map")
    columns = state["base_map"]
    kinds, sizes, points, types, corners = (
        _read_array(columns, name) for name in ("kinds", "sizes", "points", "face_types", "face_corners")
    )
    if sizes.ndim != 1:
        raise BadFile("the scenery is damaged")
    if len(sizes) and not 0 <= int(sizes.min()) <= int(sizes.max()) <= len(points):
        raise BadFile("the scenery is damaged")
    offsets = np.concatenate(([0], np.cumsum(sizes)))
    if types.shape != (len(corners),) or corners.shape[1:] != (12,):
        raise BadFile("the scenery is damaged")
    buildings = ObstacleColumns(np.arange(len(types)), corners.reshape(-1, 4, 3), types)
    return Scenery(kinds, offsets, points, buildings)


# -- a map in a database file: the bytes of a saved map in one row of a store of `ctx.ictx.memory` ------------------


STORE = ".graph"  # the dot marks a store that does not belong to the program and is not listed
_MAP = "saved_map"
_KEY = 0
_SCHEMA: Schema = {"id": int, "saves": int, "map": bytes}


class InMemoryPath(IPathLike):
    """The path of a database in memory."""

    def as_str(self) -> str:
        """Return the path in the form that SQLite accepts."""
        return ":memory:"

    def exists(self) -> bool:
        """Return False: an in-memory database has no file."""
        return False


class MapDatabase:
    """Writes a map to a store and reads it back; counts saves, so that no program overwrites a map it has not read.

    Attributes:
        path: path of the file.
    """

    def __init__(self, store: Any) -> None:  # Any: a DATABASE store, which has more methods than `IStore`
        self._store = store
        self.path: str = store.path().as_str()
        self._saves = 0  # number of saves when the map was read
        if store.is_foreign:
            raise BadFile(f"{self.path} is a database, but not of a graph.")
        try:
            store.create_map(_MAP, _SCHEMA, "id")
        except GammsError as error:
            raise BadFile(f"{self.path} cannot be opened as a graph database: {error}") from error
        store.flush()

    def read(self) -> SavedMap:
        """Return the map that was written last, or an empty map.

        Raises:
            BadFile: the contents of the file are damaged.
        """
        try:
            row = self._read_row()
            contents = decode(row["map"]) if row["saves"] else SavedMap(GraphStore().columns(), [], None, None, {})
            self._saves = row["saves"]
        except (GammsError, TypeError) as error:
            kind = type(error) if isinstance(error, BadFile) else BadFile
            raise kind(f"{self.path} does not hold a graph that GAMMS can load: {error}") from error
        return contents

    def write(self, contents: SavedMap) -> None:
        """Replace the contents of the database.

        Raises:
            BadValue: an attribute is not a plain value; the database keeps its previous map.
            WriteConflict: another program has saved since the map was read; the database keeps that program's map.
            BadFile: the file cannot be written; it keeps its previous map.
        """
        data = encode(contents)
        with self._store.transaction():
            saves = self._read_row()["saves"]
            if saves != self._saves:
                raise WriteConflict(
                    f"Another program has saved to {self.path} since this context read it, and saving now would undo "
                    "that. Save this graph to another file with ctx.graph.save('mine.gamms'), or discard it and read "
                    "the database with ctx.graph.load()."
                )
            write = self._store.update_data if saves else self._store.insert_data
            write(_MAP, {"id": _KEY, "saves": saves + 1, "map": data})
        self._saves += 1

    def _read_row(self) -> Row:
        keys = list(self._store.query_keys(_MAP))  # in a truncated file, the key index may be missing
        if not keys:
            return {"id": _KEY, "saves": 0, "map": b""}
        row: Row = self._store.get_data(_MAP, _KEY)
        if not row["saves"] or row["map"] is None:
            raise BadFile(f"The row of the map in {self.path!r} is damaged.")
        return row
