"""Agents that fly: where they are, how they are turned, what they sense and do."""

from math import hypot, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.agent import AerialAgent, AgentType
from gamms.errors import GammsError
from gamms.sensor import ISensor, SensorType

HALF = sqrt(0.5)


@pytest.fixture
def kite(ctx):
    """An agent above the middle, with a sensor."""
    return ctx.agent.create_agent("kite", type=AgentType.AERIAL, start_node_id=4, speed=1.0, sensors=["near"])


def where(agent):
    return (agent.position, agent.prev_position, agent.quat, agent.current_node_id, agent.prev_node_id)


def act(agent, action):
    agent.get_state()["action"] = action
    agent.set_state()


# -- creating ---------------------------------------------------------------------------------------------------


def test_a_flyer_starts_on_the_ground_with_nothing_else(ctx):
    agent = ctx.agent.create_agent("kite", type=AgentType.AERIAL, start_node_id=np.int64(5), speed=2)
    assert where(agent) == ((2.0, 1.0, 0.0), (2.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0), 5, 5)
    assert (agent.name, agent.type, agent.state, agent.strategy, agent.team, agent.speed) == (
        "kite",
        AgentType.AERIAL,
        {},
        None,
        None,
        2.0,
    )
    assert agent.orientation == (1.0, 0.0)
    assert isinstance(agent, AerialAgent)
    assert isinstance(agent, gamms.typing.IAerialAgent)
    assert ctx.agent.get_agent("kite") is agent
    assert repr(agent) == "AerialAgent('kite', position=(2.0, 1.0, 0.0))"


@pytest.mark.parametrize("key", ["type", "agent_type"])
@pytest.mark.parametrize("kind", [AgentType.AERIAL, 1, "AERIAL", "aerial"])
def test_the_kind_can_be_said_in_several_ways(ctx, key, kind):
    agent = ctx.agent.create_agent("kite", start_node_id=0, speed=1, **{key: kind})
    assert agent.type is AgentType.AERIAL


def test_a_flyer_may_start_in_the_air_and_turned(ctx):
    agent = ctx.agent.create_agent("kite", type=1, start_node_id=0, speed=1, position=[2, 2, 9], quat=(0, 0, 0, 2))
    assert where(agent) == ((2.0, 2.0, 9.0), (2.0, 2.0, 9.0), (0.0, 0.0, 0.0, 1.0), 8, 0)
    turned = ctx.agent.create_agent("hawk", type=1, start_node_id=0, speed=1, orientation=(0, 3))
    assert turned.orientation == pytest.approx((0.0, 1.0))
    assert turned.quat == pytest.approx((HALF, 0.0, 0.0, HALF))


def test_a_misspelt_keyword_is_warned_about(ctx, heard):
    ctx.agent.create_agent("kite", type=1, start_node_id=0, speed=1, positon=(0, 0, 0), quatt=None)
    assert [warning.split("?")[0] for warning in heard] == [
        "Agent 'kite': Unknown keyword 'positon'. Did you mean 'position'",
        "Agent 'kite': Unknown keyword 'quatt'. Did you mean 'quat'",
    ]


@pytest.mark.parametrize("attribute", ["name", "type", "state", "speed", "prev_position"])
def test_the_identity_of_a_flying_agent_cannot_be_assigned(kite, attribute):
    with pytest.raises(AttributeError):
        setattr(kite, attribute, 1)


# -- where it is ------------------------------------------------------------------------------------------------


def test_setting_the_position_remembers_the_one_before(kite):
    kite.position = (2, 1, 5)
    assert where(kite) == ((2.0, 1.0, 5.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0), 5, 4)
    kite.position = [2.0, 1.0, 5.0]
    assert where(kite) == ((2.0, 1.0, 5.0), (2.0, 1.0, 5.0), (1.0, 0.0, 0.0, 0.0), 5, 5)


def test_setting_the_node_keeps_the_height(kite):
    kite.position = (0.2, 0.1, 7.5)
    kite.current_node_id = 8
    assert where(kite) == ((2.0, 2.0, 7.5), (0.2, 0.1, 7.5), (1.0, 0.0, 0.0, 0.0), 8, 0)


def test_setting_the_previous_node_leaves_the_previous_position(kite):
    kite.prev_node_id = np.int64(7)
    assert (kite.prev_node_id, kite.prev_position, kite.position) == (7, (1.0, 1.0, 0.0), (1.0, 1.0, 0.0))


def test_the_node_is_the_nearest_one_also_after_the_graph_has_changed(ctx, kite):
    graph = ctx.graph.graph
    kite.position = (1.4, 1.0, 3.0)
    assert kite.current_node_id == 4
    graph.add_node({"id": 20, "x": 1.5, "y": 1.0})
    assert kite.current_node_id == 20
    assert ctx.agent.positions.node_ids.tolist() == [20]
    graph.update_node({"id": 20, "x": 9.0})
    assert ctx.agent.positions.node_ids.tolist() == [4]
    graph.remove_node(4)
    assert ctx.agent.positions.node_ids.tolist() == [5]
    assert kite.get_state()["sensor"]["near"][1][0] == 5
    kite.position = (0, 0, 0)
    assert kite.prev_node_id == 5


@pytest.mark.parametrize(
    ("attribute", "value", "error"),
    [
        ("position", (1, 2), ValueError),
        ("position", (1, 2, 3, 4), ValueError),
        ("position", (1, 2, float("nan")), ValueError),
        ("position", (1, float("inf"), 3), ValueError),
        ("position", np.zeros((3, 3)), ValueError),
        ("position", "xyz", TypeError),
        ("position", ("x", "y", "z"), TypeError),
        ("position", None, TypeError),
        ("position", 3.0, TypeError),
        ("position", {0, 1, 2}, TypeError),
        ("position", {0: 1, 1: 2, 2: 3}, TypeError),
        ("current_node_id", 99, KeyError),
        ("current_node_id", "4", TypeError),
        ("prev_node_id", 99, KeyError),
        ("prev_node_id", True, TypeError),
        ("quat", (1, 0, 0), ValueError),
        ("quat", (1, 0, 0, float("nan")), ValueError),
        ("quat", ("w", 0, 0, 0), TypeError),
        ("quat", None, TypeError),
        ("orientation", (0, 0), ValueError),
        ("orientation", (1, 0, 0), ValueError),
        ("orientation", ("x", 0), TypeError),
    ],
)
def test_a_bad_value_raises_and_changes_nothing(kite, attribute, value, error):
    kite.position = (0.2, 0.1, 7.5)
    before = where(kite)
    with pytest.raises(error) as caught:
        setattr(kite, attribute, value)
    assert isinstance(caught.value, GammsError)
    assert where(kite) == before


# -- how it is turned -------------------------------------------------------------------------------------------


#: What gamms 1.0.0 gives back, which divides by the root of the sum of the squares.
QUATS_OF_1_0_0 = [
    (
        (0.00040350102900222164, -0.0027019099996133823, 0.00032758901884285163, 0.0005607883266432493),
        (0.14369635682810003, -0.9622147045868338, 0.11666227632928888, 0.1997101214081855),
    ),
    (
        (0.2221587688942261, -0.09482586292488765, -0.2799903224349747, 0.49553452366055273),
        (0.3593054980168109, -0.1533653344978818, -0.4528385836090249, 0.8014460995377146),
    ),
    (
        (-96.23034340929118, 23.291362374996197, 49.048282340638565, -39.18838842085798),
        (-0.8208273583792688, 0.19867109244334807, 0.418372943505673, -0.3342698384626966),
    ),
]


@pytest.mark.parametrize(("given", "read"), QUATS_OF_1_0_0)
def test_a_turn_reads_back_with_the_bits_of_1_0_0(kite, given, read):
    kite.quat = given
    assert kite.quat == read
    kite.quat = np.array(given)
    assert kite.quat == read
    kite.quat = read
    assert kite.quat == read


@given(quat=st.tuples(*[st.floats(-1e3, 1e3)] * 4))
def test_a_turn_is_divided_by_the_root_of_the_sum_of_its_squares(quat):
    total = 0.0
    for part in quat:
        total += part * part
    if total > 1e-250 and abs(total - 1.0) > 3e-9:
        assert gamms.kernels.normalize_quaternion(quat) == tuple(part / sqrt(total) for part in quat)


def test_the_orientation_is_the_yaw(kite):
    kite.quat = (HALF, 0.0, 0.0, HALF)
    assert kite.orientation == pytest.approx((0.0, 1.0))
    kite.quat = (HALF, 0.0, HALF, 0.0)
    assert kite.orientation == (0.0, 0.0)


def test_setting_the_orientation_turns_about_the_vertical_and_none_not_at_all(kite):
    kite.quat = (HALF, HALF, 0.0, 0.0)
    kite.orientation = (-2, 0)
    assert kite.orientation == pytest.approx((-1.0, 0.0))
    assert kite.quat == pytest.approx((0.0, 0.0, 0.0, 1.0))
    kite.orientation = None
    assert kite.quat == (1.0, 0.0, 0.0, 0.0)


# -- sensing and acting -----------------------------------------------------------------------------------------


def test_an_action_may_turn_and_move(kite):
    act(kite, {"quat": (0, 0, 0, 3)})
    assert where(kite) == ((1.0, 1.0, 0.0), (1.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0), 4, 4)
    act(kite, {"direction": (0, 9, 0), "quat": [1, 0, 0, 0]})
    assert where(kite) == ((1.0, 2.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0), 7, 4)


@pytest.mark.parametrize("action", [{}, {"node_id": 5}, {"direcshun": (1, 0, 0)}])
def test_a_dict_without_direction_and_turn_is_nothing_at_all(kite, action):
    act(kite, (1, 0, 0))
    before = where(kite)
    act(kite, action)
    assert where(kite) == before


@pytest.mark.parametrize(
    ("action", "error"),
    [
        ((), ValueError),
        ((1, 0), ValueError),
        ((1, 0, 0, 0), ValueError),
        ((float("nan"), 0, 0), ValueError),
        ((float("inf"), 0, 0), ValueError),
        (np.zeros(4), ValueError),
        (np.zeros((3, 1)), ValueError),
        (np.array(5.0), ValueError),
        (("n", "s", "e"), TypeError),
        ((True, False, False), TypeError),
        ([1, 0, 0], TypeError),
        (5, TypeError),
        ("up", TypeError),
        (None, TypeError),
        ({"direction": (1, 0)}, ValueError),
        ({"direction": "up!"}, TypeError),
        ({"direction": None}, TypeError),
        ({"direction": 1}, TypeError),
        ({"quat": (1, 0, 0)}, ValueError),
        ({"quat": None}, TypeError),
        ({"direction": (1, 0, 0), "quat": (1, 0)}, ValueError),
        ({"direction": (1, 0), "quat": (0, 1, 0, 0)}, ValueError),
    ],
)
def test_a_bad_action_raises_and_changes_nothing(kite, action, error):
    act(kite, (1, 0, 0))
    before = where(kite)
    with pytest.raises(error) as caught:
        act(kite, action)
    assert isinstance(caught.value, GammsError)
    assert where(kite) == before


def test_without_an_action_set_state_is_a_key_error(kite):
    with pytest.raises(KeyError, match="direction"):
        kite.set_state()
    with pytest.raises(AttributeError, match="'kite' has no strategy"):
        kite.step()


# -- sensors that ask who carries them --------------------------------------------------------------------------


class Camera(ISensor):
    """Only flyers can carry it."""

    sensor_id, type, data = "camera", SensorType.CUSTOM, None

    def __init__(self, ctx):
        self.ctx, self._owner = ctx, None

    def sense(self, node_id):
        self.data = self.ctx.agent.get_agent(self._owner).position

    def update(self, data):
        pass

    def set_owner(self, owner):
        if owner is not None and self.ctx.agent.get_agent(owner).type != AgentType.AERIAL:
            raise ValueError(f"{owner!r} does not fly.")
        self._owner = owner


@pytest.fixture
def camera(ctx):
    ctx.sensor.add_sensor(Camera(ctx))
    return ctx.sensor.get_sensor("camera")


def test_a_sensor_finds_its_owner_among_the_agents_from_the_beginning(ctx, camera):
    kite = ctx.agent.create_agent("kite", type=1, start_node_id=4, speed=1, sensors=["camera"])
    assert kite.get_state()["sensor"]["camera"][1] == (1.0, 1.0, 0.0)


def test_an_agent_whose_sensor_refuses_it_is_not_created(ctx, camera, anna):
    near = ctx.sensor.get_sensor("near")
    other = ctx.sensor.create_sensor("other", SensorType.NEIGHBOR)
    with pytest.raises(ValueError, match="'bert' does not fly"):
        ctx.agent.create_agent("bert", start_node_id=0, sensors=["near", "other", "camera"])
    assert list(ctx.agent.agents) == ctx.agent.positions.names == ["anna"]
    assert ctx.agent.positions.node_ids.tolist() == [4]
    assert (near._owner, other._owner, camera._owner) == ("anna", None, None)
    assert anna.get_state()["sensor"]["near"][1][0] == 4
    assert ctx.agent.create_agent("bert", start_node_id=0, sensors=["other"]).current_node_id == 0


def test_registering_a_sensor_that_refuses_changes_nothing(ctx, camera, anna):
    with pytest.raises(ValueError, match="'anna' does not fly"):
        anna.register_sensor("near", camera)
    assert anna._sensor_list == {"near": ctx.sensor.get_sensor("near")}
    assert anna.get_state() == {"curr_pos": 4, "sensor": {"near": (SensorType.NEIGHBOR, [4, 5, 3, 7, 1])}}
    assert ctx.sensor.get_sensor("near")._owner == "anna"


# -- coming, going, the end -------------------------------------------------------------------------------------


def test_after_the_end_a_flyer_rests(ctx, kite):
    kite.position = (2.0, 2.0, 5.0)
    state = kite.get_state()
    kite.position = (0.0, 0.1, 5.0)
    before = where(kite)
    ctx.terminate()
    assert kite.get_state() is state
    state["action"] = (1, 0, 0)
    kite.set_state()
    kite.step()
    kite.position, kite.quat, kite.orientation, kite.current_node_id = (9, 9, 9), (0, 1, 0, 0), (0, 1), 99
    assert where(kite) == before == ((0.0, 0.1, 5.0), (2.0, 2.0, 5.0), (1.0, 0.0, 0.0, 0.0), 0, 8)
    assert ctx.agent.positions.node_ids.tolist() == [0]


def test_after_the_end_a_flyer_that_never_looked_hands_out_where_it_is(ctx, kite):
    ctx.terminate()
    assert kite.get_state() == {
        "curr_pos": (1.0, 1.0, 0.0),
        "quat": (1.0, 0.0, 0.0, 0.0),
        "sensor": {"near": (SensorType.NEIGHBOR, [])},
    }


def test_a_verb_that_was_kept_does_nothing_after_the_end_either(ctx, kite, anna):
    moves = []
    for agent, action in ((kite, (1, 0, 0)), (anna, 5)):
        agent.get_state()["action"] = action
        moves.append(agent.set_state)
    ctx.terminate()
    for move in moves:
        move()
    assert (kite.position, anna.current_node_id) == ((1.0, 1.0, 0.0), 4)


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda quat: hypot(*quat) > 1e-3), st.floats(-9e-10, 9e-10))
def test_a_quaternion_of_length_1_to_nine_digits_reads_back_exactly(quat, error):
    length = hypot(*quat)
    quat = tuple(part / length * (1.0 + error) for part in quat)
    with gamms.create_context() as ctx:
        ctx.graph.add_nodes([0], [0.0], [0.0])
        kite = ctx.agent.create_agent("kite", type=AgentType.AERIAL, start_node_id=0, speed=1.0)
        kite.quat = quat
        camera = ctx.sensor.create_sensor("camera", SensorType.AERIAL, quat=quat)
        assert (kite.quat, camera.quat) == (quat, quat)
