"""A block of games: columns by agent, team and game, room for more of them, copies of rows; loops over agents."""

from array import array
from copy import deepcopy

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.core.block import INT64, Block, BlockColumn, RecordTable, gather, move_rows, stop_moves

COLUMNS = (
    BlockColumn("node", INT64, 0),
    BlockColumn("alive", "?", True),
    BlockColumn("since", "d", -1.0, "agent", 2),
    BlockColumn("score", "d", 0.5, "team"),
    BlockColumn("map", INT64, 3, "game"),
    BlockColumn("scratch", INT64, 9, is_copied=False),
)


def shown(block, game=0):
    """Name -> the rows in use of a column in a game."""
    return {one.name: block.get_row(one.name, game).tolist() for one in COLUMNS}


def test_new_rows_have_the_initial_numbers_in_every_game():
    block = Block(COLUMNS, games=2)
    assert (block.add(2), block.add(1, "team"), block.add(1)) == (0, 0, 2)
    for game in range(2):
        assert shown(block, game) == {
            "node": [0, 0, 0],
            "alive": [True, True, True],
            "since": [-1.0] * 6,
            "score": [0.5],
            "map": [3],
            "scratch": [9, 9, 9],
        }


def test_booleans_are_those_of_python():
    block = Block(COLUMNS)
    block.add(1)
    assert block.get_row("alive")[0] is True


def test_the_rows_of_a_game_are_its_own():
    block = Block(COLUMNS, games=3)
    block.add(2)
    block.get_row("node", 2)[1] = 7
    assert [block.get_row("node", game).tolist() for game in range(3)] == [[0, 0], [0, 0], [0, 7]]


def test_the_memory_is_moved_seldom_as_agents_come_one_by_one():
    block, moves = Block(COLUMNS), 0
    for _ in range(1000):
        before = block.memory
        block.add(1)
        moves += block.memory is not before
    assert moves < 20


def test_a_copy_of_a_game_leaves_out_values_that_are_not_copied():
    block = Block(COLUMNS, games=2)
    block.add(2)
    block.add(2, "team")
    for name, place, value in (("node", 1, 5), ("since", 3, 2.5), ("score", 1, 4.0), ("map", 0, 8), ("scratch", 0, 1)):
        block.get_row(name, 0)[place] = value
    before = shown(block)
    block.copy_row(0, 1)
    assert shown(block, 1) == {**before, "scratch": [9, 9]}
    block.get_row("node", 1)[0] = 6
    assert shown(block) == before


def test_a_block_of_another_size_takes_a_game_with_its_size():
    few, many = Block(COLUMNS), Block(COLUMNS)
    few.add(1)
    many.add(3)
    many.get_row("node")[2] = 4
    few.copy_row(0, 0, many)
    assert shown(few) == shown(many)
    many.close_up([0, 1])
    few.copy_row(0, 0, many)
    assert few.get_row("node").tolist() == [4]
    small = Block(COLUMNS)
    small.add(1)
    few.copy_row(0, 0, small)
    assert shown(few) == shown(small)
    assert few.add(3) == 1
    assert few.get_row("node").tolist() == [0, 0, 0, 0]


def test_there_is_no_column_of_another_name():
    with pytest.raises(KeyError, match="mass"):
        Block(COLUMNS).get_row("mass")


def test_rows_that_are_free_have_initial_numbers_again():
    block = Block(COLUMNS)
    block.add(3)
    block.get_row("node")[:] = array(INT64, [4, 5, 6])
    block.close_up([0])
    block.add(1)
    assert block.get_row("node").tolist() == [5, 6, 0]


def test_a_block_can_be_copied_with_all_its_games():
    block = Block(COLUMNS, games=2)
    block.add(2)
    block.get_row("node", 1)[1] = 7
    twin = deepcopy(block)
    block.get_row("node", 1)[0] = 6
    assert twin.get_row("node", 1).tolist() == [0, 7]
    assert twin.add(1) == 2


@given(data=st.data())
def test_rows_that_come_and_go_are_those_of_lists(data):
    block = Block(COLUMNS, games=2)
    model = [[], []]
    for step in range(data.draw(st.integers(1, 8))):
        if model[0] and data.draw(st.booleans()):
            gone = sorted(data.draw(st.sets(st.integers(0, len(model[0]) - 1))))
            block.close_up(gone)
            model = [[one for row, one in enumerate(rows) if row not in gone] for rows in model]
        else:
            count = data.draw(st.integers(0, 5))
            first = block.add(count)
            assert first == len(model[0])
            for game, rows in enumerate(model):
                for row in range(first, first + count):
                    block.get_row("node", game)[row] = 100 * step + row - game
                    block.get_row("since", game)[2 * row : 2 * row + 2] = array("d", [row, game])
                rows += [(100 * step + row - game, [row, game]) for row in range(first, first + count)]
        for game, rows in enumerate(model):
            assert block.get_row("node", game).tolist() == [node for node, _ in rows]
            assert block.get_row("since", game).tolist() == [number for _, pair in rows for number in pair]


def numbers(values, code="q"):
    return memoryview(array(code, values))


NODES = st.integers(-(2**63), 2**63 - 1) | st.integers(0, 3)


@given(before=st.lists(st.tuples(NODES, NODES), min_size=1, max_size=8), data=st.data())
def test_one_that_stays_keeps_its_previous_node(before, data):
    rows = data.draw(st.lists(st.integers(0, len(before) - 1), unique=True))
    ends = [data.draw(NODES | st.just(before[row][0])) for row in rows]
    node, previous = (numbers(column) for column in zip(*before, strict=True))
    moved = move_rows(node, previous, numbers(rows), numbers(ends))
    expected = [*before]
    for row, end in zip(rows, ends, strict=True):
        if end != before[row][0]:
            expected[row] = end, before[row][0]
    assert [*zip(node, previous, strict=True)] == expected
    assert moved == sum(end != before[row][0] for row, end in zip(rows, ends, strict=True))
    out = numbers([0] * len(rows))
    gather(node, numbers(rows), out)
    assert out.tolist() == ends


@pytest.mark.parametrize("row", [-1, 2, -(2**63), 2**63 - 1])
def test_a_row_that_there_is_not_is_refused(row):
    node, rows = numbers([1, 2]), numbers([0, row])
    with pytest.raises(IndexError, match=str(row)):
        gather(node, rows, numbers([0, 0]))
    with pytest.raises(IndexError, match=str(row)):
        move_rows(node, numbers([1, 2]), rows, numbers([1, 1]))
    assert node.tolist() == [1, 2]


def test_agents_that_are_stopped_stay_where_they_start_and_are_counted_unless_they_would_stay():
    counts, ends = numbers([4, 5, 6], "i"), numbers([1, 7, -3])
    stopped, nodes = numbers([0, 0]), numbers([0, 0])
    assert stop_moves(numbers([1, 2, 3]), ends, counts, numbers([0, 2]), stopped, nodes) == 1
    assert (stopped[0], nodes[0]) == (2, -3)
    assert ends.tolist() == [1, 7, 3]
    assert counts.tolist() == [4, 5, 7]


WORDS = st.sampled_from([0, 1, 2**32, 2**63, 2**64 - 1])


@given(st.integers(1, 3).flatmap(lambda words: st.lists(st.lists(st.tuples(*[WORDS] * words), max_size=9), min_size=1)))
def test_equal_records_have_equal_numbers_in_the_order_in_which_they_were_first_added(parts):
    width = max([len(row) for part in parts for row in part], default=1)
    table = RecordTable(width)
    records = array("Q", bytes(8 * width))
    table.take_memory(memoryview(records), memoryview(array("q", bytes(16))))
    number_of = {}
    for part in parts:
        room = 1
        while room < table.count + len(part):
            room *= 2
        records = array("Q", [*records[: table.count * width], *[0] * ((room - table.count) * width)])
        table.take_memory(memoryview(records), memoryview(array("q", bytes(16 * room))))
        numbers = array("q", bytes(8 * len(part)))
        table.add(memoryview(array("Q", [word for row in part for word in row])), memoryview(numbers))
        assert numbers.tolist() == [number_of.setdefault(row, len(number_of)) for row in part]
    assert table.count == len(number_of)
