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
