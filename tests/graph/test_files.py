"""Saved files: complete, the same for the same graph, written whole or not at all, and safe to open."""

import copy
import datetime as dt
import decimal
import enum
import json
import math
import random
import struct
import tracemalloc
import zipfile
import zlib

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms import limits
from gamms.errors import BadFile, BadValue
from gamms.graph import Engine, Graph, map_file
from gamms.graph.map_file import SavedMap
from gamms.graph.obstacles import check_face
from gamms.graph.store import GraphStore
from gamms.ir import packed_bytes, packing
from gamms.limits import MemoryBudget

HEAD = struct.Struct("<8sIII")
UNSAVABLE = [{1, object}, object(), np.array([None]), Graph, 1j]


@pytest.fixture
def saved(ctx, fill, tmp_path):
    """The path of a file with one of everything in it."""
    fill(ctx)
    ctx.graph.save(tmp_path / "map.gamms")
    return tmp_path / "map.gamms"


CLOSED = {
    99: {
        "id": 99,
        "source": 1,
        "target": 2,
        "length": 3.5,
        "linestring": np.array([[0.0, 0.0], [1.0, 2.0]]),
        "name": "x",
    }
}


# -- there and back ---------------------------------------------------------------------------------------------


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
        check_face(id, *draw(st.tuples(corner, corner, corner, corner)), draw(ids))
        for id in draw(st.sets(ids, max_size=3))
    ]
    graph.crs, graph.attribution = draw(st.none() | st.text()), draw(st.none() | st.text())
    return SavedMap(graph.columns(), faces, graph.attribution, None, CLOSED)


@given(contents=contents())
@settings(max_examples=16)
def test_decoding_undoes_encoding(contents):
    data = map_file.encode(contents)
    back = map_file.decode(data)
    for name in ("node_ids", "xy", "edge_ids", "sources", "targets", "lengths", "offsets", "out_edges"):
        one, other = getattr(back.columns, name), getattr(contents.columns, name)
        assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
    assert {row: polyline.tolist() for row, polyline in back.columns.polylines.items()} == {
        row: polyline.tolist() for row, polyline in contents.columns.polylines.items()
    }
    assert back.columns.node_attributes == contents.columns.node_attributes
    assert back.columns.edge_attributes == contents.columns.edge_attributes
    assert (back.columns.crs, back.attribution, back.faces) == (
        contents.columns.crs,
        contents.attribution,
        contents.faces,
    )
    assert map_file.encode(back) == data


def test_the_same_graph_gives_the_same_bytes(ctx, fill, saved, open_ctx, tmp_path):
    with open_ctx(Engine.SQLITE) as other:
        fill(other)
        other.graph.graph.add_node({"id": 1000, "x": 0.0, "y": 0.0, "gone": 1})
        other.graph.graph.remove_node(1000)
        other.graph.save(tmp_path / "other.gamms")
    assert saved.read_bytes() == (tmp_path / "other.gamms").read_bytes()


def test_an_attribute_that_no_node_has_any_more_does_not_spoil_the_file(ctx, graph, tmp_path):
    graph.add_node({"id": 1, "x": 0.0, "y": 0.0, "name": "a"})
    graph.remove_node(1)
    ctx.graph.save(tmp_path / "map")
    ctx.graph.load(tmp_path / "map")
    assert list(graph.get_nodes()) == []


# -- written whole or not at all --------------------------------------------------------------------------------


class Color(enum.StrEnum):
    RED = "red"


class Level(enum.IntEnum):
    HIGH = 3


def nested(depth):
    value = 5
    for _ in range(depth):
        value = [value]
    return value


EXOTIC = [
    *(1 << 63, -(1 << 64), 10**4000, 10**5000, 1 << 20_000, math.inf, -0.0, 5e-324, True, None),
    *(Color.RED, Level.HIGH, "\ud800", "\ud83d\ude00", "a\udc80", "\u2028\0\n", b"\0\xff", bytearray(b"a"), range(3)),
    *(
        np.int8(3),
        np.uint64(2**64 - 1),
        np.float16(0.1),
        np.float64(0.1),
        np.bool_(True),
        np.str_("a"),
        np.bytes_(b"a"),
    ),
    *(np.longdouble("0.1"), np.complex64(1j), np.datetime64("2020", "ns"), np.timedelta64(1, "ns"), np.void(b"ab")),
    *(1j, {1}, frozenset({1}), object(), Graph, decimal.Decimal(1), dt.date(2020, 1, 1), np.arange(3)),
    *(nested(60), nested(90), nested(101), nested(300), nested(2000), (), ((),), {}, {(): {}}, {(1, ("a", b"b")): 1}),
    *({1: "a", "1": "b"}, {None: 1, False: 2, 1.5: 3}, {frozenset({1}): 1}, {"dict": [[1, 2]]}, {"tuple": 1}),
    *([1, 1.0, True], (1, [2, (3, {"a": b"c"})]), {"\ud800": "\udfff"}, {math.inf: 1}, "", [""], "x" * 100_000),
]


@pytest.mark.parametrize("value", EXOTIC, ids=lambda value: type(value).__name__)
def test_a_value_is_refused_or_comes_back_equal(open_ctx, tmp_path, value):
    ends = set()
    for engine in Engine:
        path = tmp_path / engine.name
        with open_ctx(engine, **({"graph_path": path} if engine is Engine.SQLITE else {})) as ctx:
            graph = ctx.graph.graph
            graph.add_nodes([1, 2], [0, 1], [0, 0])
            graph.add_edge({"id": 1, "source": 1, "target": 2, "length": 1})
            try:
                graph.update_node({"id": 1, "value": value})
                graph.update_edge({"id": 1, "value": value})
                ctx.graph.save(None if engine is Engine.SQLITE else path)
            except BadValue as error:
                ends.add(str(error))
                graph.update_node({"id": 1, "value": 0})
                graph.update_edge({"id": 1, "value": 0})
                continue
        with open_ctx(engine, **({"graph_path": path} if engine is Engine.SQLITE else {})) as ctx:
            if engine is Engine.MEMORY:
                ctx.graph.load(path)
            for found in (ctx.graph.node_attributes(1)["value"], ctx.graph.edge_attributes(1)["value"]):
                assert np.all(found == value)
                assert math.copysign(1.0, found) == math.copysign(1.0, value) if type(value) is float else True
                assert json.dumps(ordered(found)) == json.dumps(ordered(value))  # 1 is not True there
            ends.add("equal")
    assert len(ends) == 1


def ordered(value):
    """A value with every container as tagged lists, and plain numbers."""
    value = value.item() if isinstance(value, np.generic) else value
    if isinstance(value, np.ndarray):
        return [value.dtype.name, *value.shape, value.tolist()]
    if isinstance(value, set | frozenset):
        return [type(value).__name__, sorted(map(repr, value))]
    if type(value) is int and value.bit_length() > 10_000:
        return hex(value)
    if isinstance(value, dict):
        return ["dict", [[ordered(key), ordered(one)] for key, one in value.items()]]
    if isinstance(value, list | tuple):
        return [type(value).__name__, [ordered(one) for one in value]]
    return value.hex() if isinstance(value, bytes) else value


def test_no_caller_shares_a_value_with_the_graph(any_ctx):
    graph, networkx = any_ctx.graph.graph, nx.DiGraph()
    networkx.add_node(2, x=0, y=0, tags=(tags := [["a"]]))
    graph.attach_networkx_graph(networkx)
    given = {"id": 1, "x": 0, "y": 0, "tags": tags, "more": {"a": [1]}, "some": {1}}
    expected = copy.deepcopy(given)
    graph.add_node(given)
    for change in (tags[0], graph.node_attributes(1)["tags"], graph.node_attributes(1)["more"]["a"]):
        change.append("b")
    given["some"].add(2)
    graph.to_networkx().nodes[2]["tags"].clear()
    assert {"id": 1, "x": 0, "y": 0, **graph.node_attributes(1)} == expected
    assert graph.node_attributes(2) == {"tags": [["a"]]}


def test_names_that_are_one_as_text_are_not_attached(any_ctx):
    graph = nx.DiGraph()
    graph.add_node(1, **{"x": 0, "1": "a"})
    graph.nodes[1][1] = "b"
    with pytest.raises(BadValue, match="two of its attributes have the name '1'"):
        any_ctx.graph.attach_networkx_graph(graph)
    assert len(any_ctx.graph.graph) == 0


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
            map_file.decode(data[:size])
    with pytest.raises(BadFile, match="extra bytes at its end"):
        map_file.decode(data + b"\0")


def test_no_flipped_byte_does_harm(saved):
    data, rng = saved.read_bytes(), random.Random(0)
    for _ in range(700):
        damaged = bytearray(data)
        for _ in range(rng.choice((1, 1, 3, 20))):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        _end_well(bytes(damaged))


def test_no_forged_state_does_harm(saved):
    """Checksums are no protection against an attacker who writes them."""
    data, rng = saved.read_bytes(), random.Random(1)
    for _ in range(400):
        state = _state_of(data)
        for _ in range(rng.choice((1, 1, 2))):
            _disturb(state, rng)
        _end_well(_file_of(state))


def test_no_forged_value_does_harm(saved):
    data, rng = packing.to_bytes(_state_of(saved.read_bytes()), "It"), random.Random(3)
    for _ in range(400):
        damaged = bytearray(data)
        for _ in range(rng.choice((1, 1, 3))):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        _end_well(_sealed(packed_bytes.pack_bytes(bytes(damaged))))


def test_no_forged_column_does_harm(saved):
    data, rng = saved.read_bytes(), random.Random(2)
    for _ in range(400):
        state = _state_of(data)
        holder, name = rng.choice(_arrays_in(state))
        column = holder[name]
        kind = rng.randrange(4)
        if kind == 0 and column.size:
            column.reshape(-1)[rng.randrange(column.size)] = rng.choice((0, 1, 2, 9, 34, 91, 123, 255))
        elif kind == 1:
            holder[name] = column[: rng.randrange(len(column) + 1)]
        elif kind == 2:
            holder[name] = np.concatenate([column, column])
        else:
            holder[name] = rng.choice([column.reshape(-1, 1), column.reshape(-1), column.reshape(1, -1)])
        _end_well(_file_of(state))


@pytest.mark.parametrize(
    "name", ["node_ids", "edge_ids", "xy", "sources", "lengths", "bend_rows", "bend_sizes", "face_ids"]
)
def test_a_column_of_another_shape_is_named(ctx, saved, everything, name):
    data, before = saved.read_bytes(), everything(ctx)
    state = _state_of(data)
    for shape in [(-1, 1), (1, -1)]:
        saved.write_bytes(_file_of(state | {name: state[name].reshape(shape)}))
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


def test_an_unreadable_map_is_an_os_error(ctx, tmp_path):
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
    struct.pack_into("<I", data, 8, map_file.VERSION + 1)
    with pytest.raises(BadFile, match=f"format version {map_file.VERSION + 1}.*install a newer GAMMS"):
        map_file.decode(bytes(data))


@pytest.mark.parametrize("honest", [True, False])
def test_a_decompression_bomb_is_not_unpacked(honest):
    deflate = zlib.compressobj(9, zlib.DEFLATED, -15)
    bomb = deflate.compress(bytes(40_000_000)) + deflate.flush()
    data = _sealed(packed_bytes.encode_varint(40_000_000 if honest else 10) + bomb)
    tracemalloc.start()
    with pytest.raises(BadFile), limits.allowing(1 << 24):
        map_file.decode(data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2_000_000


def test_a_file_of_an_older_version_says_so(saved):
    data = bytearray(saved.read_bytes())
    struct.pack_into("<I", data, 8, 1)
    with pytest.raises(BadFile, match="format version 1, which was never released"):
        map_file.decode(bytes(data))


def test_obstacle_faces_of_another_shape_are_refused(saved):
    state = _state_of(saved.read_bytes())
    state["face_ids"] = np.arange(2)
    state["face_types"] = np.zeros(2, np.int64)
    state["face_corners"] = np.zeros((3, 8))  # as many numbers as two faces have
    with pytest.raises(BadFile, match="the obstacle faces are damaged"):
        map_file.decode(_file_of(state))


# -- forging ----------------------------------------------------------------------------------------------------


def _end_well(data):
    """Whatever is in a file, it is a graph or a BadFile."""
    try:
        contents = map_file.decode(data)
    except BadFile:
        return
    store = GraphStore()
    store.replace(contents.columns, contents.attribution, contents.scenery, contents.closed)
    graph = Graph(store)
    assert [graph.get_node(id).id for id in graph.get_nodes()] == contents.columns.node_ids.tolist()
    for id in graph.get_edges():
        assert {graph.get_edge(id).source, graph.get_edge(id).target} <= set(graph.get_nodes())
    map_file.encode(contents)


def _state_of(data):
    return packing.unpack(data[HEAD.size :], packing.Decoder(MemoryBudget(len(data), "it")))


def _file_of(state):
    return _sealed(packing.pack(state, "It"))


def _sealed(body):
    return HEAD.pack(b"GAMMSMAP", map_file.VERSION, len(body), zlib.crc32(body)) + body


def _arrays_in(state):
    """Where arrays are: a dict or list, and a key in it."""
    holders = [state]
    for kind in ("node_attributes", "edge_attributes"):
        holders += state[kind].values()
    return [
        (holder, key)
        for holder in holders
        for key, value in (holder.items() if isinstance(holder, dict) else enumerate(holder))
        if isinstance(value, np.ndarray)
    ]


def _disturb(state, rng):
    strange = rng.choice([None, -1, 0, 2**70, 1.5, "", "xy", [], [1], {}, {1: 2}, True, (), {5}, np.zeros(3), b"a"])
    kind = rng.randrange(5)
    if kind == 0:
        state[rng.choice(list(state))] = strange
    elif kind == 1 and isinstance(state.get("node_attributes"), dict):
        state["node_attributes"]["a"] = strange
    elif kind == 2 and isinstance(state.get("edge_attributes"), dict) and state["edge_attributes"]:
        columns = rng.choice(list(state["edge_attributes"].values()))
        if isinstance(columns, list) and columns:
            columns[rng.randrange(len(columns))] = strange
    elif kind == 3 and isinstance(state.get("node_attributes"), dict):
        state["node_attributes"][1] = [np.zeros(1, np.int64), np.zeros(1, np.int64), [5]]
    else:
        state.pop(rng.choice(list(state)), None) if len(state) > 1 else None


def test_a_graph_so_regular_that_it_looks_like_a_bomb_can_be_loaded(ctx, tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "_FLOOR", 1 << 16)
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


def test_keys_that_were_made_to_have_one_hash_are_refused(saved):
    keys = [(2**61 - 1) * i + 5 for i in range(8, 60_008)]
    state = _state_of(saved.read_bytes())
    for count, rows in ((60_000, 1), (2_000, 30)):
        flats = [[one for key in keys[row * count : (row + 1) * count] for one in (key, 0)] for row in range(rows)]
        numbers = np.arange(rows)
        data = packing.to_bytes(state | {"node_attributes": {"a": [numbers, numbers, flats]}}, "It")
        for flat in flats:
            data = _as_dict(data, flat)
        data = _sealed(packed_bytes.pack_bytes(data))
        with pytest.raises(BadFile, match="made to have one hash"):
            map_file.decode(data)


def _as_dict(data, flat):
    """The same bytes, but a list of keys and values is a dict."""
    one = packing.to_bytes(flat, "It")[1:]
    code_at = {0xC7: 2, 0xC8: 3, 0xC9: 5}[one[0]]
    assert one in data
    return data.replace(one, one[:code_at] + b"\2" + one[code_at + 1 :])


def test_attributes_without_rows_are_refused(saved):
    state, none = _state_of(saved.read_bytes()), np.zeros(0, np.int64)
    for n in range(9000):
        state["node_attributes"][f"{n}"] = [none, none, []]
    with pytest.raises(BadFile, match="attribute '0' is damaged"):
        map_file.decode(_file_of(state))


def test_a_graph_may_have_any_number_of_names(ctx, tmp_path):
    names = {f"{n:0100}": n for n in range(8000)}
    ctx.graph.graph.add_node({"id": 1, "x": 0, "y": 0, **names})
    ctx.graph.save(tmp_path / "map")
    ctx.graph.load(tmp_path / "map")
    assert ctx.graph.node_attributes(1) == names


def test_a_symbolic_link_stays_one(ctx, tmp_path):
    (tmp_path / "there").mkdir()
    for name in ("there/a.gamms", "there/none.gamms"):
        link, target = tmp_path / name.replace("/", "-"), tmp_path / name
        ctx.graph.save(tmp_path / "there" / "a.gamms")
        link.symlink_to(target)
        ctx.graph.graph.add_nodes([len(ctx.graph.graph)], [0], [0])
        ctx.graph.save(link)
        assert link.is_symlink()
        assert target.read_bytes() == ctx.graph.storage.pack()
    assert sorted(path.name for path in (tmp_path / "there").iterdir()) == ["a.gamms", "none.gamms"]


def test_a_missing_folder_is_named_before_anything_is_written(ctx, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no folder .*missing.* Create it first"):
        ctx.graph.save(tmp_path / "missing" / "a.gamms")
    assert list(tmp_path.iterdir()) == []


def test_a_shared_list_is_not_copied_into_a_bomb(ctx, tmp_path):
    ctx.graph.add_nodes(range(300), np.zeros(300), np.zeros(300))
    long = [0] * 10_000
    for id in range(300):
        ctx.graph.graph.update_node({"id": id, "long": long})
    path = tmp_path / "bomb.gamms"
    ctx.graph.save(path)
    assert path.stat().st_size < 10_000
    tracemalloc.start()
    ctx.graph.load(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2_000_000
