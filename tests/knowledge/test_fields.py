"""The fields of sensors in recordings: what is written is read, and nothing else is taken for a field."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.knowledge.fields import FieldTable, SensorField

PLACES = st.integers(0, 5) | st.tuples(st.sampled_from([0.0, 2.5]), st.sampled_from([-1.0, 4.0]))
FIELDS = st.builds(SensorField, PLACES, st.sampled_from([0.0, 9.5]), st.sampled_from([b"", b"\x80"]))
GOOD = (0, 5.0, b"")


def read(number=1, first=0, new=None, looks=1, kind=np.uint8):
    """Read an event with one new field, whose looks have this number; each argument may be damaged."""
    columns = {"fields": np.full(looks, number, kind), "first_field": first, "new_fields": new}
    return FieldTable().read(columns, 1)


@given(st.lists(st.lists(FIELDS | st.none(), min_size=1, max_size=4), max_size=4), st.sampled_from([0, 254]))
def test_the_fields_that_are_written_are_read(turns, begin):
    written = FieldTable()
    known = FieldTable()
    for turn, fields in enumerate(turns, begin):
        assert known.read(written.write(fields, turn), len(fields)) == fields


def test_a_field_is_recorded_once():
    table = FieldTable()
    field = SensorField(0, 5.0, b"")
    other = SensorField(1, 5.0, b"")
    assert table.write([field, field], 0)["new_fields"] == [GOOD]
    assert table.write([other, field], 1)["new_fields"] == [(1, 5.0, b"")]
    assert table.write([field], 2)["new_fields"] == []
    assert table.write([field], 256)["new_fields"] == [GOOD]  # readers may begin here


def test_a_copy_of_a_table_writes_on_by_itself():
    table = FieldTable()
    table.write([SensorField(0, 5.0, b"")], 0)
    table.copy().write([SensorField(1, 5.0, b"")], 1)
    assert table.write([SensorField(2, 5.0, b"")], 1)["first_field"] == 1


@pytest.mark.parametrize(
    "new",
    [
        (GOOD,),
        [[*GOOD]],
        [GOOD, [*GOOD]],
        {GOOD: 1},
        "abc",
        [5],
        [GOOD[:2]],
        [(*GOOD, 1)],
        [("0", 5.0, b"")],
        [(True, 5.0, b"")],
        [(None, 5.0, b"")],
        [((0.0,), 5.0, b"")],
        [((0.0, 1), 5.0, b"")],
        [((0.0, 1.0, 2.0), 5.0, b"")],
        [([0.0, 1.0], 5.0, b"")],
        [((0.0, float("nan")), 5.0, b"")],
        [((float("inf"), 0.0), 5.0, b"")],
        [(0, 5, b"")],
        [(0, -1.0, b"")],
        [(0, float("nan"), b"")],
        [(0, float("inf"), b"")],
        [(0, 5.0, "")],
        [(0, 5.0, None)],
    ],
)
def test_a_damaged_field_is_refused(new):
    assert read(new=[GOOD]) == [SensorField(*GOOD)]
    with pytest.raises(TypeError, match=r"field|argument"):
        read(new=new)


@pytest.mark.parametrize(
    ("damage", "kind"),
    [
        ({"number": 2}, ValueError),
        ({"first": -1, "number": 0}, ValueError),
        ({"first": True}, ValueError),
        ({"first": 0.0}, ValueError),
        ({"looks": 2}, TypeError),
        ({"looks": 0}, TypeError),
        ({"kind": np.int64}, TypeError),
        ({"kind": np.float64}, TypeError),
        ({"kind": object}, TypeError),
    ],
)
def test_damaged_numbers_of_fields_are_refused(damage, kind):
    with pytest.raises(kind, match="field"):
        read(**{"new": [GOOD], **damage})


def test_no_field_is_known_longer_than_its_numbers():
    table = FieldTable()
    one = np.ones(1, np.uint8)
    table.read({"fields": 2 * one, "first_field": 0, "new_fields": [GOOD, GOOD]}, 1)
    table.read({"fields": one, "first_field": 0, "new_fields": [GOOD]}, 1)  # numbers begin again
    assert table.read({"fields": 2 * one, "first_field": 2, "new_fields": []}, 1) == [None]


def test_a_field_that_was_written_before_the_first_read_is_unknown():
    assert read(number=1, first=3, new=[GOOD]) == [None]
    assert read(number=4, first=3, new=[GOOD]) == [SensorField(*GOOD)]
    assert read(number=0, first=0, new=[]) == [None]
