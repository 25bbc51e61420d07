"""Who is near, in cells of a grid, against a comparison with all agents."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms import kernels
from gamms.core.agents import AgentColumns, NodeNumbers
from gamms.core.observe import list_seen
from gamms.core.sight import AgentPositions, AgentSearch, RangeSearch, SensorTable

LARGE = 1.7e308
COORDINATES = st.one_of(
    st.integers(-4, 4).map(float),
    st.floats(-100.0, 100.0),
    st.floats(-LARGE, LARGE),
    st.sampled_from([0.0, -0.0, 5e-324, 1e-160, -1e-150, 1e150, -1e150, LARGE, -LARGE]),
)
RADII = st.one_of(
    st.integers(0, 5).map(float), st.floats(0.0, LARGE), st.sampled_from([1e-200, 1e-150, 1e150, 1e200, math.inf])
)
NODES = st.lists(st.tuples(COORDINATES, COORDINATES), min_size=1, max_size=12)


def is_near(here, there, radius):
    """Compare squares, of numbers that are brought to a size at which these are neither zero nor infinite."""
    scale = 2.0**600 if radius <= 1e-150 else 2.0**-600 if radius >= 1e150 else 1.0
    dx, dy = ((a - b) * scale for a, b in zip(there, here, strict=True))
    return dx * dx + dy * dy <= radius * scale * (radius * scale)


def sight_of(at, nodes, radius):
    places = AgentPositions(at)
    places.fill([f"a{row}" for row in range(len(nodes))], list(nodes))
    return places, RangeSearch(places, radius, ())


@given(places=NODES, radius=RADII, data=st.data())
def test_those_within_the_radius_are_found_in_the_order_of_their_rows(places, radius, data):
    at = dict(enumerate(places))
    node = st.sampled_from(sorted(at))
    nodes = data.draw(st.lists(node, max_size=30))
    columns, sight = sight_of(at, nodes, radius)
    are_seen = [True] * len(nodes)
    for row, end, is_seen in data.draw(st.lists(st.tuples(st.integers(0, 29), node, st.booleans()), max_size=8)):
        here = data.draw(node)
        near = [i for i, one in enumerate(nodes) if are_seen[i] and is_near(at[here], at[one], radius)]
        assert sight.find_rows(*at[here]) == near
        assert list(sight.find_around_node(here, "a1").items()) == [(f"a{i}", nodes[i]) for i in near if i != 1]
        if row < len(nodes):
            columns.put(row, end, is_seen=is_seen)
            sight.move(row)
            nodes[row], are_seen[row] = end, is_seen


@given(nodes=st.lists(st.integers(0, 3), min_size=1, max_size=9), data=st.data())
def test_agents_that_went_to_other_nodes_are_found_there(nodes, data):
    at = {node: (float(node), 0.0) for node in range(4)}
    places, sight = sight_of(at, [0] * len(nodes), 0.5)
    columns = AgentColumns()
    columns.numbers = NodeNumbers(4)
    previous = np.zeros(len(nodes), np.int64).data
    on_nodes = np.full(len(nodes), np.nan).data
    columns.show(np.array(nodes, np.int64).data, previous, on_nodes, np.ones(len(nodes), np.bool_).data)
    assert places.follow(columns) == sum(node != 0 for node in nodes)
    here = data.draw(st.sampled_from(nodes))
    assert sight.find_around_node(here, "a0") == {f"a{i}": here for i, node in enumerate(nodes) if i and node == here}
    assert places.follow(columns) == 0


@given(radius=st.floats(1e-3, 1e3), far=st.floats(-1e9, 1e9), angle=st.floats(0.0, 6.3))
def test_the_rim_is_found_wherever_cells_begin(radius, far, angle):
    here = far, -far
    there = far + radius * math.cos(angle), -far + radius * math.sin(angle)
    _, sight = sight_of({0: here, 1: there}, [0, 1], radius)
    assert sight.find_rows(*here) == [0, 1][: 1 + is_near(here, there, radius)]


@given(
    places=st.lists(st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)), min_size=1, max_size=12),
    radius=st.floats(0.0, 80.0) | st.just(math.inf),
    angle=st.floats(-3.2, 3.2),
    fov=st.floats(0.0, 6.2),
)
def test_those_ahead_are_found_of_those_within_the_radius(places, radius, angle, fov):
    at = dict(enumerate(places))
    _, sight = sight_of(at, sorted(at), radius)
    heading = math.cos(angle), math.sin(angle)
    xy = np.array(places) - places[0]
    are_ahead = kernels.find_in_cone(*xy.T, heading, fov)
    near = sight.find_rows(*places[0])
    assert sight.find_rows_ahead(*places[0], *kernels.compute_cone(heading, fov)) == [
        row for row in near if are_ahead[row]
    ]


def test_many_agents_are_found_in_order_from_one_cell_and_from_many():
    at = {i: (float(i % 40), float(i // 40)) for i in range(1600)}
    nodes = [i * 7 % 1600 for i in range(1600)]
    for radius in (0.0, 1.0, 15.0, 100.0, math.inf):
        _, sight = sight_of(at, nodes, radius)
        near = [row for row, node in enumerate(nodes) if is_near(at[820], at[node], radius)]
        assert sight.find_rows(*at[820]) == near
        assert [*sight.find_around_node(820, "nobody")] == [f"a{row}" for row in near]


def test_agents_that_come_are_found_once_all_are_entered_again():
    places, sight = sight_of({0: (0.0, 0.0)}, [0], 1.0)
    assert sight.find_around_node(0, "") == {"a0": 0}
    places.fill([f"b{row}" for row in range(50)], [0] * 50)
    sight.is_built = False
    assert [*sight.find_around_node(0, "b7")] == [f"b{row}" for row in range(50) if row != 7]


def test_a_node_that_is_not_there_is_an_error():
    places, sight = sight_of({0: (0.0, 0.0)}, [0], 1.0)
    with pytest.raises(KeyError):
        sight.find_around_node(1, "")
    with pytest.raises(KeyError):
        places.fill(["a0"], [1])


def seen_in_a_batch(places, alive, radius):
    """The pairs of agents that see each other in a game of a batch, each with one sensor for agents of any team.

    The second look, at given positions, follows one at mirrored nodes, whose order it has to correct.
    """
    count = len(places)
    xy = np.array(places, np.float64)
    squares = memoryview(np.full(count, radius * radius))
    sensors = SensorTable(memoryview(np.arange(count + 1)), squares, memoryview(np.ones(count, np.uint8)), 1)
    search = AgentSearch(
        sensors,
        memoryview(np.arange(count)),
        memoryview(np.array(alive, np.uint8)),
        memoryview(np.zeros(count, np.int64)),
        memoryview(-xy.reshape(-1)),
        memoryview(np.arange(count)),
    )
    pairs = np.zeros((4, count * count), np.int64)
    looks = []
    for own in (np.zeros(0), xy.reshape(-1)):
        given = memoryview(np.zeros(1, np.int64)), memoryview(own), memoryview(np.arange(count))
        found = list_seen(search, *given, memoryview(np.ones(count, np.uint8)), memoryview(pairs.reshape(-1)))
        _, viewers, others, nodes = pairs[:, :found].tolist()
        assert others == nodes
        looks.append([*zip(viewers, others, strict=True)])
    assert looks[0] == looks[1] == sorted(looks[1])
    return {*looks[1]}


@given(
    agents=st.lists(
        st.tuples(st.integers(-4, 4).map(float), st.integers(-4, 4).map(float), st.booleans()), min_size=1, max_size=9
    ),
    radius=st.integers(1, 6).map(float) | st.just(math.inf),
)
def test_agents_of_a_batch_see_what_their_sensors_show_in_one_game(agents, radius):
    at = {row: (x, y) for row, (x, y, _) in enumerate(agents)}
    alive = [is_alive for *_, is_alive in agents]
    places, sight = sight_of(at, list(at), radius)
    for row, is_alive in enumerate(alive):
        places.put(row, row, is_seen=is_alive)
        sight.move(row)
    shown = {(row, other) for row in at for other in sight.find_around_node(row, f"a{row}").values()}
    assert seen_in_a_batch([*at.values()], alive, radius) == shown
