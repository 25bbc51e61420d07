"""Saved files: complete, the same for the same graph, written whole or not at all, and safe to open."""

import json
import random
import struct
import tracemalloc
import zipfile
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadFile, BadValue
from gamms.graph import Engine, Graph, file
from gamms.graph.contents import Contents
from gamms.graph.obstacles import checked_face

HEAD = struct.Struct("<8sIII")
UNSAVABLE = [{1, 2}, object(), np.zeros(2), Graph, 1j]


@pytest.fixture
def saved(ctx, fill, tmp_path):
    """The path of a file with one of everything in it."""
    fill(ctx)
    ctx.graph.save(tmp_path / "map.gamms")
    return tmp_path / "map.gamms"


def contents_of(graph):
    return Contents(graph.columns(), [], graph.attribution)


# -- there and back ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reader", Engine)
def test_a_file_holds_everything(any_ctx, fill, everything, open_ctx, tmp_path, reader):
    graph = fill(any_ctx)
    graph.remove_node(40)
    any_ctx.graph.save(str(tmp_path / "map.gamms"))
    with open_ctx(reader) as other:
        other.graph.graph.add_node({"id": 999, "x": 0.0, "y": 0.0})
        loaded = other.graph.load(str(tmp_path / "map.gamms"))
        assert loaded is other.graph.graph
        assert everything(other) == everything(any_ctx)
        loaded.add_node({"id": 999, "x": 0.0, "y": 0.0})
        loaded.update_edge({"id": 2, "target": 999})
        assert list(loaded.get_neighbors(1)) == [2, 999]


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text() | st.integers() | st.tuples(st.integers()), inner, max_size=3)
    ),
    max_leaves=6,
)
attributes = st.dictionaries(st.text(st.characters(codec=None), max_size=6), plain, max_size=3)
coordinate = st.floats(allow_nan=False, allow_infinity=False)
ids = st.integers(-(2**63), 2**63 - 1)


@st.composite
def contents(draw):
    graph = Graph()
    nodes = draw(st.lists(ids, unique=True, max_size=6))
    for id in nodes:
        graph.add_node(draw(attributes) | {"id": id, "x": draw(coordinate), "y": draw(coordinate)})
    for id in draw(st.lists(ids, unique=True, max_size=5)) if nodes else ():
        line = draw(st.none() | st.lists(st.tuples(coordinate, coordinate), min_size=2, max_size=4))
        edge = {"id": id, "source": draw(st.sampled_from(nodes)), "target": draw(st.sampled_from(nodes))}
        graph.add_edge(draw(attributes) | edge | {"length": abs(draw(coordinate)), "linestring": line})
    if nodes and draw(st.booleans()):
        graph.remove_node(draw(st.sampled_from(nodes)))
    corner = st.tuples(coordinate, coordinate, coordinate)
    faces = [
        checked_face(id, *draw(st.tuples(corner, corner, corner, corner)), draw(ids))
        for id in draw(st.sets(ids, max_size=3))
    ]
    graph.crs, graph.attribution = draw(st.none() | st.text()), draw(st.none() | st.text())
    return Contents(graph.columns(), faces, graph.attribution)


@given(contents=contents())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_decoding_undoes_encoding(contents):
    data = file.encode(contents)
    back = file.decode(data)
    for name in ("node_ids", "xy", "edge_ids", "sources", "targets", "lengths", "offsets", "out_edges"):
        one, other = getattr(back.columns, name), getattr(contents.columns, name)
        assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
    assert {row: bend.tolist() for row, bend in back.columns.bends.items()} == {
        row: bend.tolist() for row, bend in contents.columns.bends.items()
    }
    assert back.columns.node_attributes == contents.columns.node_attributes
    assert back.columns.edge_attributes == contents.columns.edge_attributes
    assert (back.columns.crs, back.attribution, back.faces) == (
        contents.columns.crs,
        contents.attribution,
        contents.faces,
    )
    assert file.encode(back) == data


def test_the_same_graph_gives_the_same_bytes(ctx, fill, saved, open_ctx, tmp_path):
    with open_ctx(Engine.SQLITE) as other:
        fill(other)
        other.graph.graph.add_node({"id": 1000, "x": 0.0, "y": 0.0, "gone": 1})
        other.graph.graph.remove_node(1000)
        other.graph.save(tmp_path / "other.gamms")
    assert saved.read_bytes() == (tmp_path / "other.gamms").read_bytes()


def test_an_attribute_that_nobody_has_any_more_does_not_spoil_the_file(ctx, graph, tmp_path):
    graph.add_node({"id": 1, "x": 0.0, "y": 0.0, "name": "a"})
    graph.remove_node(1)
    ctx.graph.save(tmp_path / "map")
    ctx.graph.load(tmp_path / "map")
    assert list(graph.get_nodes()) == []


def test_a_file_replaces_graph_and_obstacles(ctx, graph, saved, everything):
    before = everything(ctx)
    graph.add_node({"id": 77, "x": 0.0, "y": 0.0})
    ctx.graph.add_obstacle_face(78, *[(0, 0, 0)] * 4, 0)
    graph.crs = None
    ctx.graph.load(saved)
    assert everything(ctx) == before


# -- written whole or not at all --------------------------------------------------------------------------------


def test_saving_leaves_one_file(ctx, saved):
    ctx.graph.save(saved)
    assert [path.name for path in saved.parent.iterdir()] == ["map.gamms"]


@pytest.mark.parametrize("value", UNSAVABLE, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("of", ["node", "edge"])
def test_an_attribute_that_cannot_be_saved_is_named_and_the_old_file_stays(ctx, graph, saved, value, of):
    before = saved.read_bytes()
    update = graph.update_node if of == "node" else graph.update_edge
    update({"id": 1, "fine": 1, "awkward": value})
    with pytest.raises(BadValue, match=f"{of.capitalize()} attribute 'awkward' cannot be saved"):
        ctx.graph.save(saved)
    assert saved.read_bytes() == before
    assert [path.name for path in saved.parent.iterdir()] == ["map.gamms"]


def test_an_attribute_that_is_nested_too_deeply_is_named(ctx, graph, tmp_path):
    deep = []
    for _ in range(100_000):
        deep = [deep]
    graph.add_node({"id": 1, "x": 0.0, "y": 0.0, "deep": deep})
    with pytest.raises(BadValue, match="'deep'"):
        ctx.graph.save(tmp_path / "map")


def test_a_place_that_cannot_be_written_is_an_os_error(ctx, fill, tmp_path):
    fill(ctx)
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "folder", tmp_path / "nowhere" / "map"):
        with pytest.raises(OSError, match=str(tmp_path)):
            ctx.graph.save(path)
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def test_a_graph_in_memory_is_saved_to_a_path(ctx):
    with pytest.raises(BadValue, match="needs a path"):
        ctx.graph.save()


# -- safe to open -----------------------------------------------------------------------------------------------


def test_a_file_that_was_cut_off_is_named(saved):
    data = saved.read_bytes()
    for size in [*range(0, len(data), 64), len(data) - 1]:
        with pytest.raises(BadFile):
            file.decode(data[:size])
    with pytest.raises(BadFile, match="behind its end"):
        file.decode(data + b"\0")


def test_no_flipped_byte_does_harm(saved):
    data, rng = saved.read_bytes(), random.Random(0)
    for _ in range(700):
        damaged = bytearray(data)
        for _ in range(rng.choice((1, 1, 3, 20))):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        _end_well(bytes(damaged))


def test_no_forged_header_does_harm(saved):
    """Checksums are no protection against somebody who writes them."""
    data, rng = saved.read_bytes(), random.Random(1)
    for _ in range(800):
        header, body = _header_of(data), data[HEAD.size + HEAD.unpack_from(data)[2] :]
        for _ in range(rng.choice((1, 1, 2))):
            _disturb(header, rng)
        _end_well(_file_of(header, body))


def test_no_forged_column_does_harm(saved):
    data, rng = saved.read_bytes(), random.Random(2)
    for _ in range(800):
        header, columns = _header_of(data), file._unpack_all(data, _body_of(data), _header_of(data)["columns"])
        name = rng.choice(list(columns))
        column = columns[name]
        kind = rng.randrange(4)
        if kind == 0 and column.size:
            column.reshape(-1)[rng.randrange(column.size)] = rng.choice((0, 1, 2, 9, 34, 91, 123, 255))
        elif kind == 1:
            columns[name] = column[: rng.randrange(len(column) + 1)]
        elif kind == 2:
            columns[name] = np.concatenate([column, column])
        else:
            columns[name] = rng.choice([column.reshape(-1, 1), column.reshape(-1), column.reshape(1, -1)])
        _end_well(_pack(header, columns))


@pytest.mark.parametrize(
    "name", ["node_ids", "edge_ids", "xy", "sources", "lengths", "bend_rows", "bend_sizes", "face_ids"]
)
def test_a_column_of_another_shape_is_named(ctx, saved, everything, name):
    data, before = saved.read_bytes(), everything(ctx)
    columns = file._unpack_all(data, _body_of(data), _header_of(data)["columns"])
    for shape in [(-1, 1), (1, -1)]:
        saved.write_bytes(_pack(_header_of(data), columns | {name: columns[name].reshape(shape)}))
        with pytest.raises(BadFile):
            ctx.graph.load(saved)
        assert everything(ctx) == before


FOREIGN = {
    "empty": b"",
    "text": b"id,x,y\n1,2,3\n",
    "PNG": b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(50),
    "SQLite": b"SQLite format 3\0" + bytes(100),
    "only our first word": b"GAMMSMAP",
    "our first word in lower case": b"gammsmap" + bytes(100),
    "zeros": bytes(1000),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_a_foreign_file_is_named_and_changes_nothing(any_ctx, fill, everything, tmp_path, name):
    fill(any_ctx)
    before, path = everything(any_ctx), tmp_path / "foreign.bin"
    path.write_bytes(FOREIGN[name])
    with pytest.raises(BadFile, match=r"foreign\.bin is not a graph that GAMMS can load"):
        any_ctx.graph.load(path)
    assert everything(any_ctx) == before


def test_an_archive_is_no_graph(ctx, tmp_path):
    with zipfile.ZipFile(tmp_path / "map.zip", "w") as archive:
        archive.writestr("map.gamms", b"GAMMSMAP")
    with pytest.raises(BadFile):
        ctx.graph.load(tmp_path / "map.zip")


def test_what_cannot_be_read_is_an_os_error(ctx, tmp_path):
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(OSError, match=str(tmp_path)):
            ctx.graph.load(path)


def test_a_damaged_file_changes_nothing(any_ctx, fill, everything, tmp_path):
    fill(any_ctx)
    any_ctx.graph.save(tmp_path / "map")
    data = bytearray((tmp_path / "map").read_bytes())
    data[-5] ^= 0xFF
    (tmp_path / "map").write_bytes(data)
    any_ctx.graph.graph.add_node({"id": 500, "x": 0.0, "y": 0.0})
    before, revision = everything(any_ctx), any_ctx.graph.graph.revision
    with pytest.raises(ValueError, match="damaged"):
        any_ctx.graph.load(tmp_path / "map")
    assert (everything(any_ctx), any_ctx.graph.graph.revision) == (before, revision)


def test_a_file_of_a_newer_version_says_so(saved):
    data = bytearray(saved.read_bytes())
    struct.pack_into("<I", data, 8, file.VERSION + 1)
    with pytest.raises(BadFile, match=f"format version {file.VERSION + 1}.*install a newer one"):
        file.decode(bytes(data))


@pytest.mark.parametrize("honest", [True, False])
def test_a_decompression_bomb_is_not_unpacked(saved, honest):
    header, bomb = _header_of(saved.read_bytes()), zlib.compress(bytes(40_000_000), 9)
    size = (5_000_000 if honest else 10) * 1000
    header["columns"] = [["node_ids", "int64", [size], len(bomb), zlib.crc32(bomb)]]
    data = _file_of(header, bomb)
    tracemalloc.start()
    with pytest.raises(BadFile):
        file.decode(data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2_000_000


def test_a_map_of_ours_is_read(ctx):
    from importlib.resources import as_file, files

    with as_file(files(gamms) / "data" / "helsinki.gamms") as path:
        ctx.graph.load(path)
    assert len(list(ctx.graph.graph.get_nodes())) > 100
    assert "OpenStreetMap" in ctx.graph.attribution


# -- forging ----------------------------------------------------------------------------------------------------


def _end_well(data):
    """Whatever is in a file, it is a graph or a BadFile."""
    try:
        contents = file.decode(data)
    except BadFile:
        return
    graph = Graph()
    graph.replace(contents.columns)
    assert [graph.get_node(id).id for id in graph.get_nodes()] == contents.columns.node_ids.tolist()
    for id in graph.get_edges():
        assert {graph.get_edge(id).source, graph.get_edge(id).target} <= set(graph.get_nodes())
    file.encode(contents)


def _header_of(data):
    return json.loads(data[HEAD.size : _body_of(data)])


def _body_of(data):
    return HEAD.size + HEAD.unpack_from(data)[2]


def _file_of(header, body):
    text = json.dumps(header).encode()
    return HEAD.pack(b"GAMMSMAP", 1, len(text), zlib.crc32(text)) + text + body


def _pack(header, columns):
    blobs = [file._pack(np.ascontiguousarray(column), level=9) for column in columns.values()]
    header["columns"] = [
        [name, column.dtype.name, list(column.shape), len(blob), zlib.crc32(blob)]
        for (name, column), blob in zip(columns.items(), blobs, strict=True)
    ]
    return _file_of(header, b"".join(blobs))


def _disturb(header, rng):
    strange = rng.choice([None, -1, 0, 1, 2**40, 2**70, 1.5, "", "int64", "xy", [], [1], [[]], {}, True, [0, 2**39]])
    kind = rng.randrange(4)
    if kind == 0:
        header[rng.choice(list(header))] = strange
    elif kind == 1 and isinstance(header.get("columns"), list) and header["columns"]:
        entry = rng.choice(header["columns"])
        if isinstance(entry, list) and entry:
            entry[rng.randrange(len(entry))] = strange
    elif kind == 2 and isinstance(header.get("columns"), list) and header["columns"]:
        header["columns"].append(rng.choice(header["columns"]))
    else:
        header.pop(rng.choice(list(header)), None) if len(header) > 1 else None


def test_a_graph_so_regular_that_it_looks_like_a_bomb_can_be_loaded(ctx, tmp_path, monkeypatch):
    monkeypatch.setattr(file, "_MOST_BYTES", 1 << 16)
    ctx.graph.add_nodes(range(50_000), np.zeros(50_000), np.zeros(50_000))
    ctx.graph.save(tmp_path / "regular.gamms")
    ctx.graph.load(tmp_path / "regular.gamms")
    assert len(ctx.graph.graph) == 50_000


def test_no_two_rows_share_a_list_after_loading(ctx, tmp_path):
    graph = ctx.graph.graph
    for id in (1, 2):
        graph.add_node({"id": id, "x": 0, "y": 0, "tags": ["a"]})
    ctx.graph.save(tmp_path / "a.gamms")
    ctx.graph.load(tmp_path / "a.gamms")
    graph.node_attributes(1)["tags"].append("b")
    assert graph.node_attributes(2)["tags"] == ["a"]


def test_a_missing_folder_is_named_before_anything_is_written(ctx, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no folder .*missing.* Create it first"):
        ctx.graph.save(tmp_path / "missing" / "a.gamms")
    assert list(tmp_path.iterdir()) == []


def test_a_shared_list_is_not_copied_into_a_bomb(ctx, tmp_path, monkeypatch):
    monkeypatch.setattr(file, "_MOST_BYTES", 1 << 20)
    ctx.graph.add_nodes(range(100), np.zeros(100), np.zeros(100))
    long = [0] * 10_000
    for id in range(100):
        ctx.graph.graph.update_node({"id": id, "long": long})
    contents = ctx.graph._contents()
    path = tmp_path / "bomb.gamms"
    path.write_bytes(file.encode(contents))
    assert path.stat().st_size < 10_000
    with pytest.raises(BadFile, match="'long' would take far more memory"):
        ctx.graph.load(path)
