"""Reads saved maps (`.gamms`) and visibility tables without GAMMS, as docs/save-format.md describes them."""

import importlib.util
import struct
import tempfile
import zlib
from hashlib import sha256
from itertools import accumulate
from math import prod
from pathlib import Path

from msgspec.msgpack import Ext, decode


def read_file(data, kind=(b"GAMMSMAP", 2)):
    """Return the dict in a .gamms file, each array a flat list."""
    magic, version, _, crc = struct.unpack_from("<8sIII", data)
    if (magic, version) != kind or zlib.crc32(data[20:]) != crc:
        raise ValueError(f"not a file of kind {kind}, or damaged")
    return opened(decode(unpacked(data[20:]))[0])


def unpacked(data):
    """Return packed bytes."""
    begin = next(at for at, byte in enumerate(data) if byte < 128) + 1
    return zlib.decompressobj(-15).decompress(data[begin:])


def opened(item):
    """Return an item of MessagePack as a plain value."""
    if not isinstance(item, Ext):
        return item
    if item.code == 5:
        return item.data
    if item.code == 6:
        return int.from_bytes(item.data, "big", signed=True)
    if item.code == 7:
        return item.data.decode("utf-8", "surrogatepass")
    items = [opened(one) for one in decode(item.data)]
    if item.code == 2:
        return dict(zip(items[::2], items[1::2], strict=True))
    return {0: tuple, 1: list, 3: set, 4: frozenset, 8: numbers}[item.code](items)


def numbers(array):
    """Return the numbers of an array: its dtype, its bytes, and the lengths of its dimensions."""
    dtype, planes, *shape = array
    letter, width = {"int64": ("q", 8), "int32": ("i", 4), "float64": ("d", 8)}[dtype]
    return regrouped(planes, letter, width)[: prod(shape)]


def regrouped(planes, letter, width):
    """Return numbers whose first bytes come first, then the second bytes, …; integers are written as differences."""
    count, items = len(planes) // width, bytearray(len(planes))
    for byte in range(width):  # back to whole items
        items[byte::width] = planes[byte * count : (byte + 1) * count]
    found = struct.unpack(f"<{count}{letter}", items)
    if letter == "d":
        return list(found)
    half = 1 << 8 * width - 1
    return [(number + half) % (2 * half) - half for number in accumulate(found)]


def attributes(columns):
    """Return row -> name -> value of the nodes or edges."""
    found = {}
    for name, (rows, codes, values) in columns.items():
        for row, code in zip(rows, codes, strict=True):
            found.setdefault(row, {})[name] = values[code]
    return found


def main():
    """Read the map of Helsinki and a visibility table, and compare both with GAMMS."""
    path = Path(importlib.util.find_spec("gamms").origin).parent / "data" / "helsinki.gamms"
    columns = read_file(path.read_bytes())
    tags = attributes(columns["edge_attributes"])
    print(columns["crs"], columns["attribution"])
    print(
        len(columns["node_ids"]), "nodes,", len(columns["edge_ids"]), "edges,", len(columns["bend_rows"]), "polylines"
    )
    print(tags[0])

    import gamms

    with gamms.create_context() as ctx:
        ctx.graph.load(path)
        graph = ctx.graph.columns()
        names = ("node_ids", "xy", "edge_ids", "sources", "targets", "lengths")
        is_same = [columns[name] == getattr(graph, name).ravel().tolist() for name in names]
        points = iter(columns["bend_points"])
        for row, size in zip(columns["bend_rows"], columns["bend_sizes"], strict=True):
            is_same.append([next(points) for _ in range(2 * size)] == graph.polylines[row].ravel().tolist())
        is_same += [tags[row] == ctx.graph.edge_attributes(edge_id) for row, edge_id in enumerate(columns["edge_ids"])]
        print("GAMMS reads the same:", all(is_same))

    with gamms.create_context() as ctx, tempfile.TemporaryDirectory() as folder:
        ctx.graph.add_nodes([7, 5, 6], [0.0, 3.0, 6.0], [0.0, 0.0, 0.0])
        ctx.graph.visibility(radius=4.0, path=Path(folder, "three.sight"))
        table = read_file(Path(folder, "three.sight").read_bytes(), (b"GAMMSEYE", 3))
    radius, height = table["radius"], table["observer_height"]
    print(radius, height, table["counts"], table["rows"])
    of_nodes = sha256(struct.pack("<Q3qQ6d", 3, 7, 5, 6, 3, 0.0, 0.0, 3.0, 0.0, 6.0, 0.0)).digest()
    of_faces = sha256(struct.pack("<Q", 0)).digest()
    key = sha256(b"gamms sight 2" + of_nodes + of_faces + struct.pack("<dd", radius, height)).digest()
    print("its key follows from nodes, faces, radius and height:", table["key"] == key)


if __name__ == "__main__":
    main()
