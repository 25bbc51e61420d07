"""The save format: one file that holds a graph completely, and that a stranger can open without fear.

Layout: 8 bytes `GAMMSMAP`; three little-endian uint32: format version, size and CRC-32 of the header; the header,
JSON in UTF-8; then the columns, one after the other. The header names each column with its dtype, shape, stored
size and CRC-32. A stored column is zlib over its bytes, all first bytes of the items, then all second bytes, and so
on; columns of integers are differences from the item before. Nothing in a file is ever evaluated or imported.
"""

import json
import os
import zlib
from collections.abc import Iterable
from itertools import count
from math import prod
from struct import Struct
from typing import Any

import numpy as np

from gamms.arguments import as_path
from gamms.errors import BadFile, BadValue, GammsError, MissingFolder
from gamms.folders import write_whole
from gamms.graph import plain, records
from gamms.graph.contents import Contents, checked_columns
from gamms.graph.obstacles import checked_face
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.limits import Allowance
from gamms.typing.graph_engine import ObsFace

MAGIC = b"GAMMSMAP"
VERSION = 1

_HEAD = Struct("<8sIII")
_MOST_HEADER = 1 << 21  # more than 10,000 attributes, each of which takes three columns
_DTYPES: dict[str, np.dtype[Any]] = {"int64": np.dtype("<i8"), "float64": np.dtype("<f8"), "uint8": np.dtype("u1")}
_GRAPH = ("node_ids", "xy", "edge_ids", "sources", "targets", "lengths")
_OTHERS = ("bend_rows", "bend_sizes", "bend_points", "face_ids", "face_types", "face_corners")


def save(path: str | os.PathLike[str], contents: Contents) -> None:
    """Write a graph; the file appears complete or not at all.

    Raises:
        BadValue: an attribute is no plain data.
        MissingFolder (FileNotFoundError), OSError: the file cannot be written.
    """
    data = encode(contents)
    target = as_path(path, "path")
    if not target.parent.is_dir():
        raise MissingFolder(target.name, target.parent)
    write_whole(target, data)


def save_beside(path: str, contents: Contents) -> str:
    """Write a graph that cannot be written to `path` into a new file next to it; returns the path of that."""
    for number in count(1):
        beside = f"{path}.unsaved-{number}.gamms"
        try:
            with open(beside, "xb") as made:  # noqa: PTH123 - text, as databases have it
                made.write(encode(contents))
        except FileExistsError:
            continue
        return beside
    raise AssertionError


def load(path: str | os.PathLike[str]) -> Contents:
    """Read a graph.

    Raises:
        BadFile (ValueError): the file is damaged, foreign, too new or absurdly large.
        OSError: it cannot be read.
    """
    data = as_path(path, "path").read_bytes()
    try:
        return decode(data)
    except BadFile as error:
        raise type(error)(f"{path} is not a graph that GAMMS can load: {error}.") from error


def encode(contents: Contents) -> bytes:
    """A graph as the bytes of a file; the same graph gives the same bytes."""
    columns = _columns_of(contents)
    stored = [_pack(array) for array in columns.values()]
    header = {
        "crs": contents.columns.crs,
        "attribution": contents.attribution,
        "columns": [
            [name, array.dtype.name, list(array.shape), len(blob), zlib.crc32(blob)]
            for (name, array), blob in zip(columns.items(), stored, strict=True)
        ],
    }
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode("utf-8", "surrogatepass")
    if len(text) > _MOST_HEADER:
        raise BadValue(f"A graph cannot be saved whose attribution and names of attributes take {len(text)} bytes.")
    return b"".join([_HEAD.pack(MAGIC, VERSION, len(text), zlib.crc32(text)), text, *stored])


def decode(data: bytes) -> Contents:
    """The graph in the bytes of a file.

    Raises:
        BadFile: see `load`.
    """
    header, position = _read_header(data)
    try:
        allowance = Allowance(len(data), "it")
        columns = _unpack_all(data, position, header["columns"], allowance)
        attributes = _attributes_of(columns, plain.Texts(allowance))
        crs, attribution = (records.as_text(header[key], key) for key in ("crs", "attribution"))
        return _contents_of(columns, attributes, crs, attribution)
    except BadFile:
        raise
    except (KeyError, ValueError, TypeError, OverflowError, IndexError, GammsError) as error:
        raise BadFile(f"its contents are damaged ({error})") from error


# -- columns <-> bytes ------------------------------------------------------------------------------------------


def _read_header(data: bytes) -> tuple[dict[str, Any], int]:
    if len(data) < _HEAD.size or not data.startswith(MAGIC):
        raise BadFile("it does not begin like one")
    _, version, size, crc = _HEAD.unpack_from(data)
    if version > VERSION:
        raise BadFile(f"it has format version {version}, this GAMMS reads up to {VERSION}; install a newer one")
    text = data[_HEAD.size : _HEAD.size + size]
    if size > _MOST_HEADER or len(text) < size or zlib.crc32(text) != crc:
        raise BadFile("its header is damaged or cut off")
    try:
        header = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadFile(f"its header is damaged ({error})") from error
    if not isinstance(header, dict):
        raise BadFile("its header is damaged")
    return header, _HEAD.size + size


def _pack(array: np.ndarray[Any, Any]) -> bytes:
    flat = array.reshape(-1)
    if array.dtype.kind == "i":
        flat = np.diff(flat, prepend=flat.dtype.type(0))
    size = array.dtype.itemsize
    flat = np.ascontiguousarray(flat.astype(array.dtype.newbyteorder("<")))
    return zlib.compress(flat.view(np.uint8).reshape(-1, size).T.tobytes(), 9)


def _unpack_all(
    data: bytes, position: int, entries: list[Any], allowance: Allowance
) -> dict[str, np.ndarray[Any, Any]]:
    columns = {}
    for name, dtype_name, shape, size, crc in entries:
        dtype = _DTYPES[dtype_name]
        if not all(isinstance(n, int) and 0 <= n < 2**40 for n in (*shape, size)) or len(shape) > 2:
            raise BadFile(f"column {name!r} has an impossible size")
        raw = dtype.itemsize * prod(shape)
        if not raw and ":" in name:
            raise BadFile(f"the column {name!r} is empty")  # an attribute without values is not written
        allowance.charge(raw)
        blob = data[position : position + size]
        if len(blob) < size or zlib.crc32(blob) != crc:
            raise BadFile(f"column {name!r} is damaged or cut off")
        columns[str(name)] = _unpack(blob, dtype, tuple(shape), raw)
        position += size
    if position != len(data):
        raise BadFile("there is something behind its end")
    return columns


def _unpack(blob: bytes, dtype: np.dtype[Any], shape: tuple[int, ...], raw: int) -> np.ndarray[Any, Any]:
    inflate = zlib.decompressobj()
    try:
        data = inflate.decompress(blob, raw + 1)
    except zlib.error as error:
        raise BadFile(f"a column is damaged ({error})") from error
    if len(data) != raw:
        raise BadFile("a column has another size than it says")
    flat = np.frombuffer(data, np.uint8).reshape(dtype.itemsize, -1).T.copy().view(dtype).reshape(-1)
    flat = flat.astype(dtype.newbyteorder("="))
    return (np.cumsum(flat, dtype=flat.dtype) if dtype.kind == "i" else flat).reshape(shape)


# -- contents <-> columns ---------------------------------------------------------------------------------------


def _columns_of(contents: Contents) -> dict[str, np.ndarray[Any, Any]]:
    graph, faces = contents.columns, contents.faces
    columns: dict[str, np.ndarray[Any, Any]] = {name: getattr(graph, name) for name in _GRAPH}
    rows = sorted(graph.bends)
    bends = [graph.bends[row] for row in rows]
    columns["bend_rows"] = np.array(rows, np.int64)
    columns["bend_sizes"] = np.array([len(bend) for bend in bends], np.int64)
    columns["bend_points"] = np.concatenate([np.zeros((0, 2)), *bends])
    columns["face_ids"] = np.array([face.id for face in faces], np.int64)
    columns["face_types"] = np.array([face.type for face in faces], np.int64)
    columns["face_corners"] = np.array([face[1:5] for face in faces], np.float64).reshape(-1, 12)
    columns.update(_attribute_columns(graph))
    return columns


def _attribute_columns(graph: GraphColumns) -> dict[str, np.ndarray[Any, Any]]:
    columns: dict[str, np.ndarray[Any, Any]] = {}
    for kind, attributes in (("node", graph.node_attributes), ("edge", graph.edge_attributes)):
        for name, values in sorted(attributes.items()):
            rows = sorted(values)
            texts = [plain.to_text(values[row], f"{kind.capitalize()} attribute {name!r}") for row in rows]
            code_of = {text: code for code, text in enumerate(dict.fromkeys(texts))}
            prefix = f"{kind}:{name}"
            columns[f"{prefix}:rows"] = np.array(rows, np.int64)
            columns[f"{prefix}:codes"] = np.array([code_of[text] for text in texts], np.int64)
            columns[f"{prefix}:values"] = np.frombuffer("\n".join(code_of).encode("utf-8", "surrogatepass"), np.uint8)
    return columns


_Attributes = tuple[dict[str, dict[int, Any]], dict[str, dict[int, Any]]]  # of nodes, of edges


def _contents_of(
    columns: dict[str, np.ndarray[Any, Any]], attributes: _Attributes, crs: str | None, attribution: str | None
) -> Contents:
    arrays = {name: columns.pop(name) for name in _GRAPH}
    others = {name: columns.pop(name) for name in _OTHERS}
    for name, array in {**arrays, **others}.items():
        wanted = "f" if name in ("xy", "lengths", "bend_points", "face_corners") else "i"
        if array.dtype.kind != wanted:
            raise BadFile(f"column {name!r} has the wrong type")
    graph = checked_columns(arrays, _bends_of(others), attributes, crs)
    return Contents(graph, list(_faces_of(others)), attribution)


def _bends_of(columns: dict[str, np.ndarray[Any, Any]]) -> dict[int, FloatArray]:
    rows, sizes, points = (columns[name] for name in ("bend_rows", "bend_sizes", "bend_points"))
    if len(rows) != len(sizes) or len(np.unique(rows)) < len(rows) or (len(sizes) and int(sizes.min()) < 2):
        raise BadFile("the polylines are damaged")
    if points.ndim != 2 or points.shape[1] != 2 or (len(sizes) and int(sizes.max()) > len(points)):
        raise BadFile("the polylines are damaged")
    ends = np.cumsum(sizes)
    if (int(ends[-1]) if len(ends) else 0) != len(points):
        raise BadFile("the polylines are damaged")
    points.setflags(write=False)
    bends = zip(rows.tolist(), (ends - sizes).tolist(), ends.tolist(), strict=True)
    return {row: points[first:end] for row, first, end in bends}


def _faces_of(columns: dict[str, np.ndarray[Any, Any]]) -> Iterable[ObsFace]:
    corners = columns["face_corners"].reshape(-1, 4, 3).tolist()
    ids, types = columns["face_ids"].tolist(), columns["face_types"].tolist()
    if len(set(ids)) < len(ids):
        raise BadFile("an obstacle face is there twice")
    for id, type, (tr, tl, br, bl) in zip(ids, types, corners, strict=True):
        yield checked_face(id, tr, tl, br, bl, type)


def _attributes_of(columns: dict[str, np.ndarray[Any, Any]], texts: plain.Texts) -> _Attributes:
    """The attributes of nodes and of edges, taken out of the columns; rows of one text share its value."""
    found: dict[str, dict[str, dict[int, Any]]] = {"node": {}, "edge": {}}
    for key in [key for key in columns if key.endswith(":rows")]:
        kind, name = key.removesuffix(":rows").split(":", 1)
        rows, codes, text = (columns.pop(f"{kind}:{name}:{part}") for part in ("rows", "codes", "values"))
        lines = text.tobytes().decode("utf-8", "surrogatepass").split("\n")
        if len(rows) != len(codes) or (len(codes) and not 0 <= int(codes.min()) <= int(codes.max()) < len(lines)):
            raise BadFile(f"attribute {name!r} is damaged")
        values = [texts.read(line) for line in lines]
        found[kind][name] = dict(zip(rows.tolist(), (values[code] for code in codes.tolist()), strict=True))
    return found["node"], found["edge"]
