"""The rows of the agents: columns that are written one by one and read as arrays."""

import copy
import pickle
import sys
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.core.agents import NodeNumbers, number_nodes
from gamms.ir.agents import AgentBlock, list_speeds, read_vector
from gamms.ir.columns import Selection
from gamms.ir.journal import Journal
from gamms.ir.positions import Positions
from gamms.ir.progress import Motion, Progress
from gamms.ir.schema import BY_ROW, VECTORS
from gamms.strategies import random_walk
from gamms.typing import IAgentEngine


@pytest.fixture
def columns():
    columns = AgentBlock()
    for row in range(20):
        assert columns.add(f"a{row}", 100 + row, row % 2) == row
    return columns


@pytest.fixture
def positions(columns):
    return Positions(columns)


def remove_all_but(columns, *kept):
    """Leave some agents, whose rows are closed up."""
    for name in set(columns.names).difference(kept):
        columns.remove(columns.find_row(name))
    columns.close_up()


def test_nodes_are_handed_out_as_an_array_that_cannot_be_written_to(positions):
    nodes = positions.node_ids
    assert nodes.dtype == np.int64
    assert nodes.tolist() == list(range(100, 120))
    with pytest.raises(ValueError, match="read-only"):
        nodes[0] = 7


@pytest.mark.parametrize("rows", [[3], [0, 19], list(range(20))], ids=["one", "few", "all"])
def test_an_array_that_was_handed_out_never_changes(columns, positions, rows):
    before, version = positions.node_ids, positions.version
    for row in rows:
        columns.move(row, 7)
    after, later = positions.node_ids, positions.version
    assert before.tolist() == list(range(100, 120))
    assert after.tolist() == [7 if row in rows else 100 + row for row in range(20)]
    assert later != version


def test_an_array_is_not_made_again_when_no_agent_has_moved(positions):
    nodes, version = positions.node_ids, positions.version
    assert positions.node_ids is nodes
    assert positions.version == version


def test_columns_are_empty_once_all_are_removed(columns, positions):
    remove_all_but(columns)
    assert positions.node_ids.tolist() == []
    assert columns.add("new", 1) == 0


def test_every_subscriber_reads_its_own_log_of_changes(columns):
    one, other = columns.subscribe(), columns.subscribe()
    assert (one.take(), other.take()) == (None, None)
    columns.move(3, 7)
    assert (one.take(), one.take()) == ({3}, set())
    columns.set(4, "teams", "red")
    assert (one.take(), other.take()) == ({4}, {3, 4})
    remove_all_but(columns, "a1", "a0")
    assert (one.take(), one.take(), other.take()) == (None, set(), None)


def test_an_agent_that_is_not_alive_is_not_among_the_living(columns, positions):
    columns.set(2, "alive", value=False)
    assert (2 in positions.living, list(positions.inactive), positions.nodes[2]) == (False, [2], 102)
    columns.set(2, "alive", value=True)
    assert 2 in positions.living


def read(columns):
    """Name -> the values of a column as a list."""
    lists = {name: [*getattr(columns, name)] for name in BY_ROW if name not in ("speed", "progress", *VECTORS)}
    rows = range(len(columns))
    progress = [columns.get_progress(row) for row in rows]
    lists |= {name: [read_vector(columns, name, row) for row in rows] for name in VECTORS}
    return lists | {"speed": list_speeds(columns.games), "progress": progress}


def test_many_agents_move_like_one_after_the_other(columns):
    columns.move_all(Selection([3, 1]), [7, 101])
    nodes = [columns.get_node(row) for row in range(4)]
    assert (nodes, [columns.get_previous_node(row) for row in range(4)]) == ([100, 101, 102, 7], [100, 101, 102, 103])


@given(data=st.data(), size=st.integers(1, 9))
def test_any_agents_move_at_once_as_one_after_the_other_but_for_those_that_stay(data, size):
    together, apart = AgentBlock(), AgentBlock()
    for block in (together, apart):
        block.add_all([f"a{row}" for row in range(size)], list(range(size)), None)
    log = together.subscribe()
    log.take()
    moving = data.draw(st.lists(st.permutations(range(size)).flatmap(some_of).map(Selection), min_size=1, max_size=3))
    for rows in [*moving, moving[0]]:
        nodes = data.draw(st.lists(st.integers(0, 9), min_size=len(rows.rows), max_size=len(rows.rows)))
        together.move_all(rows, nodes)
        for row, node in zip(rows.rows, nodes, strict=True):
            if apart.get_node(row) != node:
                apart.move(row, node)
        assert places_of(together) == places_of(apart)
        changed = log.take()
        assert changed is None or changed >= set(rows.rows)
    if size > 2:  # more rows than those that it was last used for
        together.add("late", 5)
        apart.add("late", 5)
        together.move_all(moving[0], [3] * len(moving[0].rows))
        for row in moving[0].rows:
            if apart.get_node(row) != 3:
                apart.move(row, 3)
        assert places_of(together) == places_of(apart)


def places_of(block):
    return [(block.get_node(row), block.get_previous_node(row)) for row in range(len(block))]


def some_of(rows):
    return st.integers(0, len(rows)).map(lambda number: list(rows[:number]))


ROWS, NODES, PARTS = st.integers(0, 5), st.integers(0, 9), st.integers(-3, 3).map(float)
VERBS = st.one_of(
    st.tuples(st.just("move"), ROWS, NODES),
    st.tuples(st.just("fly"), st.integers(3, 5), st.tuples(PARTS, PARTS, PARTS), NODES),
    st.tuples(st.just("set_rotation"), st.integers(3, 5), st.tuples(PARTS, PARTS, PARTS, PARTS)),
    st.tuples(st.just("set"), ROWS, st.just("heading"), st.sampled_from([(0.0, 1.0), None])),
    st.tuples(st.just("set"), ROWS, st.sampled_from(["node", "previous"]), NODES),
    st.tuples(st.just("set"), ROWS, st.just("alive"), st.booleans()),
    st.tuples(st.just("set"), ROWS, st.just("speed"), st.sampled_from([2, 2.5, None])),
    st.tuples(st.just("set"), ROWS, st.just("teams"), st.sampled_from(["red", None])),
    st.tuples(st.just("move_all"), st.permutations([0, 1, 2]).map(Selection), st.lists(NODES, min_size=3, max_size=3)),
)


@given(verbs=st.lists(VERBS, max_size=12), later=st.lists(VERBS, max_size=12))
def test_restored_columns_are_those_of_then_and_a_copy_goes_on_alone(verbs, later):
    block, twin = AgentBlock(), AgentBlock()
    for row in range(6):
        block.add(f"a{row}", row, None, (0.0, float(row), 1.0) if row > 2 else None, 1.0 if row > 2 else None)
    positions = Positions(block)
    for verb, *given_to_it in verbs:
        getattr(block, verb)(*given_to_it)
    before, nodes, placed = read(block), positions.node_ids.tolist(), block.placed.copy()
    values, structure = block.copy_values(), block.copy_structure()
    twin.take_all(values, structure)
    for verb, *given_to_it in later:
        getattr(block, verb)(*given_to_it)
    assert read(twin) == before
    block.restore(values, structure)
    assert (read(block), positions.node_ids.tolist(), block.placed) == (before, nodes, placed)
    assert block.inactive == {row for row, lives in enumerate(before["alive"]) if not lives}


MANY = 5000


def test_recordings_and_pictures_have_copies_of_where_all_members_went():
    block = AgentBlock(journal=Journal([f"a{i}" for i in range(MANY)]))
    block.add_all([f"a{i}" for i in range(MANY)], [0] * MANY, "red")
    block.has_teams = True
    positions = Positions(block)
    before = positions.get_noted()[1]
    ends = np.arange(1, MANY + 1)
    block.move_all(Selection(list(range(MANY))), ends.data)
    after, (_, moves) = positions.get_noted()[1], block.journal.log[-1]
    ends += 1
    block.move(7, 3)
    assert [*before] == [0] * MANY
    assert [*after] == moves[:, 1].tolist() == [*range(1, MANY + 1)]
    assert [*positions.get_noted()[1]] == [*range(1, 8), 3, *range(9, MANY + 1)]


def test_positions_by_the_default_of_the_contract_are_those_of_the_engine(ctx, anna):
    ctx.agent.create_agent("kite", start_node_id=2, type="AERIAL", speed=1.0, team="red", position=(1.0, 2.0, 3.0))
    ctx.agent.create_agent("bert", start_node_id=1, team="red")
    ctx.game.eliminate("bert")
    fast, slow = ctx.agent.positions, IAgentEngine.positions.fget(ctx.agent)
    assert (fast.names, fast.teams, fast.inactive) == (slow.names, slow.teams, slow.inactive)
    for column in ("node_ids", "flyers", "flyer_xyz"):
        assert getattr(fast, column).tolist() == getattr(slow, column).tolist()


# -- numbers of nodes ---------------------------------------------------------------------------------------------


@given(ids=st.lists(st.integers(-(2**63), 2**63 - 1), unique=True, max_size=150), more=st.lists(st.integers(0, 200)))
def test_nodes_have_their_places_as_numbers_and_others_the_next_ones(ids, more):
    numbers = number_nodes(np.array(ids, np.int64).data)
    assert [numbers.number(id) for id in ids] == list(range(len(ids)))
    others = list(dict.fromkeys(id for id in more if id not in ids))
    assert [numbers.number(id) for id in others] == list(range(len(ids), len(ids) + len(others)))
    again = pickle.loads(pickle.dumps(numbers))
    assert [again.number(id) for id in ids + others] == list(range(again.count))
    assert copy.deepcopy(numbers) is numbers


def test_agents_share_the_numbers_of_their_map(ctx):
    ctx.agent.create_agent("anna", start_node_id=1, team="red")
    ctx.agent.create_agent("bert", start_node_id=3, team="blue")
    ctx.game.add(gamms.rules.tag("red", "blue"))
    ctx.game.step()
    assert ctx.agent.block.numbers is ctx.graph.graph.node_numbers
    assert ctx.game.fork(1).ctx.agent.block.numbers is ctx.agent.block.numbers


@pytest.mark.parametrize("ids", [range(6), [70, 20, 10**9, 3, 4, 5]], ids=["rows", "other ids"])
def test_the_numbers_of_edges_belong_to_the_map_and_are_never_used_again(ids):
    game = {"speed_unit": "metres", "conflicts": gamms.rules.Conflicts(edge_capacity=1)}
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game=game) as ctx:
        ctx.graph.add_nodes(range(4), [0.0, 100.0, 200.0, 300.0], [0.0] * 4)
        ctx.graph.add_edges(ids, [0, 1, 1, 2, 2, 3], [1, 0, 2, 1, 3, 2])
        ctx.game.add(gamms.rules.tag("red", "blue", euclid=5.0))
        for name, team, node in (("anna", "red", 0), ("bert", "blue", 3)):
            ctx.agent.create_agent(name, start_node_id=node, team=team, speed=30.0, strategy=random_walk)
        ctx.game.step()
        fork = ctx.game.fork(2)
        fork.step()
        numbers = ctx.graph.graph.edge_numbers
        assert ctx.agent.block.edge_numbers is fork.ctx.agent.block.edge_numbers is numbers
        ctx.graph.graph.remove_edge(ids[2])
        assert ctx.graph.graph.edge_numbers is numbers
        assert [numbers.number(id) for id in (*ids, 999)] == [*range(7)]
        ctx.graph.storage.put(other_map())
        assert ctx.graph.graph.edge_numbers is not numbers


def test_agents_stay_on_their_nodes_when_these_are_removed_or_the_map_is_replaced(ctx):
    ctx.agent.create_agent("anna", start_node_id=3)
    before = ctx.game.snapshot()
    ctx.graph.graph.remove_node(3)
    assert ctx.agent.get_agent("anna").current_node_id == 3
    ctx.graph.storage.put(other_map())
    assert ctx.agent.get_agent("anna").current_node_id == 3
    ctx.agent.create_agent("bert", start_node_id=1003)
    ctx.agent.get_agent("anna").current_node_id = 1004
    assert [one.current_node_id for one in ctx.agent.create_iter()] == [1004, 1003]
    ctx.game.restore(before)
    assert [one.current_node_id for one in ctx.agent.create_iter()] == [3]


def test_a_team_knows_its_nodes_after_a_reset_to_a_game_without_agents():
    ids = [10**9 + 7 * place for place in range(50)]
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    ctx.graph.add_nodes(ids, [float(place) for place in range(50)], [0.0] * 50)
    ctx.game.step()
    red = ctx.agent.create_team("red", ids[-3:])
    ctx.game.step()
    ctx.game.reset()
    assert red.node_ids.tolist() == [one.current_node_id for one in red.agents] == ids[-3:]
    ctx.agent.create_agent("new", start_node_id=ids[7])
    assert red.node_ids.tolist() == ids[-3:]


def test_threads_number_nodes_of_a_map_that_they_share():
    numbers, found = NodeNumbers(), [{} for _ in range(4)]
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)

    def look_up(thread):
        for id in range(10**10, 10**10 + 700):
            found[thread][id] = numbers.number(id)

    try:
        threads = [threading.Thread(target=look_up, args=(thread,)) for thread in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(before)
    assert found[0] == found[1] == found[2] == found[3]
    assert sorted(found[0].values()) == list(range(700))


def other_map():
    ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
    for node in range(9):
        ctx.graph.graph.add_node({"id": 1000 + node, "x": float(node), "y": 0.0})
    for node in range(8):
        ctx.graph.graph.add_edge({"id": node, "source": 1000 + node, "target": 1001 + node, "length": 1.0})
    return ctx.graph.storage.get_contents()


# -- speeds -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [3, 3.0, 0, 0.5, float("inf"), None], ids=repr)
def test_a_speed_keeps_its_type_in_the_columns_and_in_their_copies(ctx, speed):
    anna = ctx.agent.create_agent("anna", start_node_id=1, speed=speed)
    ctx.agent.create_agent("bert", start_node_id=2)
    before = ctx.game.snapshot()
    read = [repr(one.ctx.agent.get_agent("anna").speed) for one in (ctx.game, ctx.game.fork(1))]
    anna.speed = 7 if isinstance(speed, float) else 7.5
    ctx.game.restore(before)
    ctx.agent.delete_agent("bert")
    assert {*read, repr(anna.speed)} == {repr(speed)}


def test_a_team_has_its_speeds_as_one_array(ctx):
    red = ctx.agent.create_team("red", [0, 1, 2])
    assert red["speed"].tolist() == [None] * 3
    red.set("speed", [1.0, 2.5, 0.5])
    assert (red["speed"].dtype, red["speed"].tolist()) == (np.float64, [1.0, 2.5, 0.5])
    for agent, speed in zip(red.agents, (1, 2, 3), strict=True):
        agent.speed = speed
    assert (red["speed"].dtype, red["speed"].tolist()) == (np.int64, [1, 2, 3])


# -- positions on edges -------------------------------------------------------------------------------------------


PROGRESS = st.none() | st.builds(
    Progress,
    *(st.integers(-(2**63), 2**63 - 1), st.integers(0, 5), st.floats(0.0, 1.0, exclude_min=True, exclude_max=True)),
    edge=st.integers(-(2**63), 2**63 - 1),
    motion=st.sampled_from(Motion),
)


@given(given_to_it=st.lists(PROGRESS, min_size=3, max_size=3), later=st.lists(PROGRESS, min_size=3, max_size=3))
def test_positions_on_edges_are_read_as_they_were_set(given_to_it, later):
    block, other = AgentBlock(), AgentBlock()
    for row, progress in enumerate(given_to_it):
        block.add(f"a{row}", row)
        block.set_progress(row, progress)
    moving = {row for row, progress in enumerate(given_to_it) if progress is not None and progress.motion}
    assert ([*map(block.get_progress, range(3))], block.travellers) == (given_to_it, moving)
    values = block.copy_values()
    for row, progress in enumerate(later):
        block.set_progress(row, progress)
    assert other.get_progress(other.take_over(block, 1)) == later[1]
    block.restore(values, None)
    assert ([*map(block.get_progress, range(3))], block.travellers) == (given_to_it, moving)
    block.remove(0)
    block.close_up()
    assert [*map(block.get_progress, range(2))] == given_to_it[1:]


def test_an_agent_keeps_its_position_on_an_edge_when_the_edge_is_removed_or_the_map_is_replaced(ctx):
    ctx.agent.create_agent("anna", start_node_id=1)
    block = ctx.agent.block
    place = Progress(1, 2, 0.25, min(ctx.graph.graph.get_edges()), Motion.STOPPED)
    block.set_progress(0, place)
    before = ctx.game.snapshot()
    ctx.graph.graph.remove_edge(place.edge)
    ctx.graph.storage.put(other_map())
    assert block.get_edge_position(0) == place
    block.set_progress(0, None)
    assert block.get_edge_position(0) is None
    ctx.game.restore(before)
    assert ctx.agent.block.get_edge_position(0) == place
