"""What every store answers, whatever it is made of."""

import math
from enum import IntEnum

import numpy as np
import pytest
from shapely.geometry import LineString

from gamms.errors import GammsError
from gamms.typing import StoreType

SCHEMA = {"id": int, "x": float, "tag": str, "open": bool, "raw": bytes, "path": tuple, "extra": dict}
ROW = {
    "id": 1,
    "x": 2.5,
    "tag": "a",
    "open": True,
    "raw": b"\x00\xff",
    "path": ((0.0, 1), [2, (3,)]),
    "extra": {"k": {1, 2}, (1, "a"): None},
}


@pytest.fixture
def nodes(store):
    store.create_map("nodes", SCHEMA, "id")
    store.insert_data("nodes", ROW)
    return store


def test_a_row_shares_nothing_with_the_caller(store):
    store.create_map("m", {"id": int, "path": list}, "id")
    given = {"id": 1, "path": [[1]]}
    store.insert_data("m", given)
    given["path"][0].append(2)
    store.get_data("m", 1)["path"][0].append(3)
    assert store.get_data("m", 1) == {"id": 1, "path": [[1]]}


def test_the_callers_dict_is_not_changed(nodes):
    given = {"id": 1, "tag": "b"}
    nodes.update_data("nodes", given)
    assert given == {"id": 1, "tag": "b"}
    assert nodes.get_data("nodes", 1) == ROW | {"tag": "b"}


def test_an_update_of_the_key_alone_changes_nothing(nodes):
    nodes.update_data("nodes", {"id": 1})
    assert nodes.get_data("nodes", 1) == ROW


def test_keys_are_those_of_the_moment_of_the_call(nodes):
    keys = nodes.query_keys("nodes")
    nodes.delete_data("nodes", 1)
    assert next(keys) == 1


def test_maps_are_listed_in_the_order_of_their_creation(store):
    for name in ("b", "a", "c"):
        store.create_map(name, {"id": int}, "id")
    store.delete_map("a")
    assert store.list_maps() == ["b", "c"]
    store.create_map("a", {"other": str}, "other")
    assert store.list_maps() == ["b", "c", "a"]


@pytest.mark.parametrize(
    ("python_type", "value", "back"),
    [
        (float, 3, 3.0),
        (float, np.float32(0.5), 0.5),
        (float, math.inf, math.inf),
        (int, np.int64(4), 4),
        (bool, np.bool_(False), False),
        (str, "", ""),
        (str, "nul \0 and ☃ and 😀", "nul \0 and ☃ and 😀"),
        (bytes, b"", b""),
        (list, [1, (2.0, None), {"a": b"b"}], [1, (2.0, None), {"a": b"b"}]),
        (set, {1, "a", (2, 3), frozenset({4})}, {1, "a", (2, 3), frozenset({4})}),
        (frozenset, frozenset({"a"}), frozenset({"a"})),
        (dict, {frozenset({1}): (), (1, (2,)): [()]}, {frozenset({1}): (), (1, (2,)): [()]}),
        (StoreType, StoreType.DATABASE, StoreType.DATABASE),
        (StoreType, 2, StoreType.DATABASE),
        (LineString, ((0, 0), (1, 1)), LineString([(0, 0), (1, 1)])),
        (tuple, (2**64, "\udc00"), (2**64, "\udc00")),
        (tuple, None, None),
        (int, None, None),
    ],
)
def test_a_value_of_the_fields_type_survives(rows_of, store, python_type, value, back):
    store.create_map("m", {"id": str, "value": python_type}, "id")
    store.insert_data("m", {"id": "k", "value": value})
    assert store.get_data("m", "k")["value"] == back
    assert type(store.get_data("m", "k")["value"]) is type(back)
    assert rows_of(store, "m") == [{"id": "k", "value": back}]


def test_an_array_within_a_value_survives(store):
    store.create_map("m", {"id": int, "path": list}, "id")
    store.insert_data("m", {"id": 1, "path": [np.arange(3.0)]})
    assert np.array_equal(store.get_data("m", 1)["path"], [np.arange(3.0)])


def test_both_zeros_are_one_key_and_nan_is_none(store):
    store.create_map("m", {"x": float}, "x")
    store.insert_data("m", {"x": -0.0})
    assert store.get_data("m", 0) == {"x": 0.0}
    for bad in (0.0, math.nan, None):
        with pytest.raises((KeyError, ValueError)):
            store.insert_data("m", {"x": bad})


class Colour(IntEnum):
    RED = 1


LOOP: list = []
LOOP.append(LOOP)


@pytest.mark.parametrize(
    ("field", "value", "error"),
    [
        ("x", "1", TypeError),
        ("x", True, TypeError),
        ("x", 10**400, ValueError),
        ("x", 1j, TypeError),
        ("id", 1.0, TypeError),
        ("id", True, TypeError),
        ("id", 2**63, ValueError),
        ("id", None, ValueError),
        ("tag", 5, TypeError),
        ("tag", "\ud800", ValueError),
        ("open", 1, TypeError),
        ("raw", "a", TypeError),
        ("path", [1], TypeError),
        ("path", (object(),), TypeError),
        ("path", (LOOP,), ValueError),
        ("extra", {"a": LineString([(0, 0), (1, 1)])}, TypeError),
        ("colour", 7, TypeError),
        ("nothing", 7, ValueError),
    ],
)
def test_a_value_the_field_cannot_hold_changes_nothing(rows_of, store, field, value, error):
    store.create_map("m", SCHEMA | {"colour": Colour}, "id")
    row = ROW | {"colour": Colour.RED}
    store.insert_data("m", row)
    with pytest.raises(error) as caught:
        store.insert_data("m", row | {"id": 2} | {field: value})
    assert isinstance(caught.value, GammsError)
    assert field in str(caught.value)
    if field != "id":
        with pytest.raises(error):
            store.update_data("m", {"id": 1, "tag": "changed"} | {field: value})
    assert rows_of(store, "m") == [row]


@pytest.mark.parametrize("key", [2, "1", 1.0, True, None, [], 2**70, math.nan])
def test_a_key_that_is_not_there_is_a_key_error(nodes, key):
    for call in (
        lambda: nodes.get_data("nodes", key),
        lambda: nodes.delete_data("nodes", key),
        lambda: nodes.update_data("nodes", {"id": key, "x": 1.0}),
    ):
        with pytest.raises(KeyError, match="Unknown key"):
            call()


def test_a_key_that_is_there_is_a_key_error_on_insert(nodes):
    with pytest.raises(KeyError, match="update_data"):
        nodes.insert_data("nodes", ROW | {"x": 0.0})
    assert nodes.get_data("nodes", 1) == ROW


@pytest.mark.parametrize("name", ["node", "", 3, None, []])
def test_an_unknown_map_is_an_index_error_at_the_call(nodes, name):
    for call in (
        lambda: nodes.insert_data(name, ROW),
        lambda: nodes.get_data(name, 1),
        lambda: nodes.update_data(name, {}),
        lambda: nodes.delete_data(name, 1),
        lambda: nodes.query_keys(name),
    ):
        with pytest.raises(IndexError, match="Unknown map"):
            call()
    with pytest.raises(KeyError, match="Unknown map"):
        nodes.delete_map(name)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("nodes", {"id": int}, "id"), ValueError),
        (("", {"id": int}, "id"), ValueError),
        (("a\0b", {"id": int}, "id"), ValueError),
        (("\ud800", {"id": int}, "id"), ValueError),
        ((4, {"id": int}, "id"), TypeError),
        (("m", {}, "id"), TypeError),
        (("m", [("id", int)], "id"), TypeError),
        (("m", {1: int}, 1), TypeError),
        (("m", {"id": "int"}, "id"), TypeError),
        (("m", {"id": list[int]}, "id"), TypeError),
        (("m", {"id": int, "a": np.ndarray}, "id"), TypeError),
        (("m", {"id": int, "": int}, "id"), ValueError),
        (("m", {"id": int}, "key"), IndexError),
        (("m", {"id": tuple}, "id"), IndexError),
        (("m", {"id": Colour}, "id"), IndexError),
        (("m", {f"f{n}": int for n in range(1001)}, "f0"), ValueError),
    ],
)
def test_a_map_that_cannot_be_is_refused(nodes, arguments, error):
    with pytest.raises(error) as caught:
        nodes.create_map(*arguments)
    assert isinstance(caught.value, GammsError)
    assert nodes.list_maps() == ["nodes"]


def test_a_misspelt_field_is_named_with_the_right_one(nodes):
    with pytest.raises(ValueError, match="Did you mean 'extra'"):
        nodes.update_data("nodes", {"id": 1, "extras": {}})


def test_a_row_must_be_whole_and_name_its_key(nodes):
    with pytest.raises(ValueError, match="path"):
        nodes.insert_data("nodes", {name: value for name, value in ROW.items() if name != "path"})
    with pytest.raises(ValueError, match="id"):
        nodes.update_data("nodes", {"x": 1.0})
    for call in (nodes.insert_data, nodes.update_data):
        with pytest.raises(TypeError):
            call("nodes", [("id", 1)])


def test_a_closed_store_says_so(nodes):
    nodes.close()
    nodes.close()
    for call in (
        nodes.list_maps,
        lambda: nodes.create_map("m", {"id": int}, "id"),
        lambda: nodes.delete_map("nodes"),
        lambda: nodes.insert_data("nodes", ROW),
        lambda: nodes.get_data("nodes", 1),
        lambda: nodes.query_keys("nodes"),
    ):
        with pytest.raises(ValueError, match="The store 's' is closed"):
            call()
    assert nodes.name() == "s"
