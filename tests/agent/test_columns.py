"""The rows of the agents: columns that are written one by one and read as arrays."""

import numpy as np
import pytest

from gamms.ir.agents import AgentColumns


@pytest.fixture
def columns():
    columns = AgentColumns()
    for row in range(20):
        assert columns.append(f"a{row}", 100 + row, row % 2) == row
    return columns


def test_nodes_are_handed_out_as_an_array_that_cannot_be_written_to(columns):
    nodes, _ = columns.nodes()
    assert nodes.dtype == np.int64
    assert nodes.tolist() == list(range(100, 120))
    with pytest.raises(ValueError, match="read-only"):
        nodes[0] = 7


@pytest.mark.parametrize("rows", [[3], [0, 19], list(range(20))], ids=["one", "few", "all"])
def test_an_array_that_was_handed_out_never_changes(columns, rows):
    before, moves = columns.nodes()
    for row in rows:
        columns.node[row] = 7
        columns.touched.add(row)
    after, later = columns.nodes()
    assert before.tolist() == list(range(100, 120))
    assert after.tolist() == [7 if row in rows else 100 + row for row in range(20)]
    assert later != moves


def test_nothing_is_made_anew_when_nobody_moved(columns):
    nodes, moves = columns.nodes()
    again, same = columns.nodes()
    assert again is nodes
    assert same == moves


def test_keeping_some_rows_renumbers_them_in_the_order_given(columns):
    columns.previous[5], columns.heading[5] = 42, (0.0, 1.0)
    _, moves = columns.nodes()
    columns.keep([5, 2])
    nodes, later = columns.nodes()
    assert (columns.names, columns.teams, columns.node, columns.previous) == (
        ["a5", "a2"],
        [1, 0],
        [105, 102],
        [42, 102],
    )
    assert columns.heading == [(0.0, 1.0), None]
    assert nodes.tolist() == [105, 102]
    assert later != moves
    assert len(columns) == 2


def test_keeping_none_leaves_empty_columns(columns):
    columns.keep([])
    assert columns.nodes()[0].tolist() == []
    assert columns.append("new", 1, None) == 0


def test_a_row_can_be_copied_into_other_columns(columns):
    columns.previous[3], columns.heading[3] = 1, (1.0, 0.0)
    other = AgentColumns()
    assert other.copy_row(columns, 3) == 0
    assert (other.names, other.node, other.previous, other.heading, other.teams) == (
        ["a3"],
        [103],
        [1],
        [(1.0, 0.0)],
        [1],
    )
    assert other.nodes()[0].tolist() == [103]


def where(columns):
    """Node -> names, as `rows_at` has it."""
    rows_at = columns.rows_at()
    assert all(rows_at.values())
    return {node: sorted(columns.names[row] for row in rows) for node, rows in rows_at.items()}


def test_rows_are_found_by_the_node_they_stand_on(columns):
    columns.keep([0, 1, 2])
    assert where(columns) == {100: ["a0"], 101: ["a1"], 102: ["a2"]}
    for row in (0, 2):
        columns.node[row] = 101
        columns.touched.add(row)
    assert where(columns) == {101: ["a0", "a1", "a2"]}
    columns.node[1] = 7
    columns.touched.add(1)
    columns.append("new", 7, None)
    assert where(columns) == {101: ["a0", "a2"], 7: ["a1", "new"]}


def test_arrays_and_rows_by_node_do_not_take_changes_away_from_each_other(columns):
    columns.nodes(), columns.rows_at()
    columns.node[3] = 7
    columns.touched.add(3)
    assert where(columns)[7] == ["a3"]
    assert columns.nodes()[0][3] == 7
    columns.node[3] = 8
    columns.touched.add(3)
    assert columns.nodes()[0][3] == 8
    assert where(columns)[8] == ["a3"]


def test_keeping_some_rows_keeps_them_findable(columns):
    columns.rows_at()
    columns.keep([5, 2])
    assert where(columns) == {105: ["a5"], 102: ["a2"]}


def test_the_number_of_moves_changes_whoever_asks(columns):
    columns.rows_at()
    moves = columns.moves
    columns.rows_at()
    assert columns.nodes()[1] == columns.moves == moves
    columns.touched.add(0)
    columns.rows_at()
    assert columns.moves != moves
    assert columns.nodes()[1] == columns.moves


def test_flyers_have_places_and_those_on_the_ground_have_none(columns):
    assert columns.places()[0].tolist() == []
    assert columns.places()[1].shape == (0, 3)
    row = columns.append("kite", 100, None, position=(1.0, 2.0, 3.0), speed=2.0)
    assert (columns.kind[row], columns.previous_position[row], columns.quat[row], columns.speed[row]) == (
        1,
        (1.0, 2.0, 3.0),
        (1.0, 0.0, 0.0, 0.0),
        2.0,
    )
    assert (columns.kind[0], columns.position[0], columns.quat[0], columns.speed[0]) == (0, None, None, None)
    rows, places = columns.places()
    assert (rows.tolist(), places.tolist()) == ([20], [[1.0, 2.0, 3.0]])
    with pytest.raises(ValueError, match="read-only"):
        places[0] = 0.0
    columns.position[row] = (4.0, 5.0, 6.0)
    columns.touched.add(row)
    assert columns.places()[1].tolist() == [[4.0, 5.0, 6.0]]
    assert places.tolist() == [[1.0, 2.0, 3.0]]


def test_the_rows_of_flyers_follow_them(columns):
    for i in range(3):
        columns.append(f"kite{i}", 100, None, position=(float(i), 0.0, 0.0), speed=1.0)
    columns.places()
    columns.keep([0, 22, 3, 20])
    rows, places = columns.places()
    assert (rows.tolist(), places[:, 0].tolist()) == ([1, 3], [2.0, 0.0])
    other = AgentColumns()
    columns.quat[1], columns.previous_position[1] = (0.0, 1.0, 0.0, 0.0), (9.0, 9.0, 9.0)
    other.copy_row(columns, 1)
    assert (other.position, other.quat, other.previous_position, other.speed, other.kind) == (
        [(2.0, 0.0, 0.0)],
        [(0.0, 1.0, 0.0, 0.0)],
        [(9.0, 9.0, 9.0)],
        [1.0],
        [1],
    )
    assert other.places()[0].tolist() == [0]
