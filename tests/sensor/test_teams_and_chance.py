"""Whom of those in view a sensor reports: by team, and by chance."""

from math import inf

import pytest

import gamms
from gamms.agent import AgentType
from gamms.sensor import SensorType

KINDS = ["AGENT", "AGENT_RANGE", "AGENT_ARC", "OCCLUDED_AGENT"]
FLYING = ["AERIAL_AGENT", "OCCLUDED_AERIAL_AGENT"]


@pytest.fixture
def crowd(ctx):
    for name, team, node in (
        ("r1", "red", 0),
        ("r2", "red", 1),
        ("b1", "blue", 2),
        ("g1", ("green", 1), 3),
        ("n", None, 4),
    ):
        ctx.agent.create_agent(name, start_node_id=node, team=team)
    return ctx


def seen(ctx, kind, **given):
    place = {"at": (0.0, 0.0, 5.0)} if kind in FLYING else {}
    sensor = ctx.sensor.create_sensor(f"s{len(ctx.sensor.sensors)}", SensorType[kind], **place, **given)
    sensor.sense(0)
    return list(sensor.data)


@pytest.mark.parametrize("kind", KINDS + FLYING)
def test_a_change_of_team_counts_at_once(crowd, kind):
    assert seen(crowd, kind, team="red") == ["r1", "r2"]
    crowd.agent.get_agent("r2").team = "blue"
    assert seen(crowd, kind, team="red") == ["r1"]


def test_the_filter_may_be_changed_later(crowd):
    sensor = crowd.sensor.create_sensor("s", SensorType.AGENT)
    sensor.notice.team = "blue"
    sensor.sense(0)
    assert sensor.data == {"b1": 2}


@pytest.mark.parametrize("kind", KINDS + FLYING)
def test_chance_follows_from_the_seed_alone(kind):
    def game(seed, extra=()):
        with gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"}) as ctx:
            ctx.graph.add_nodes(range(30), range(30), [0] * 30)
            for i in range(30):
                ctx.agent.create_agent(f"a{i}", start_node_id=i)
            for name in extra:
                ctx.agent.create_agent(name, start_node_id=0)
            place = {"at": (0.0, 0.0, 5.0)} if kind in FLYING else {}
            sensor = ctx.sensor.create_sensor("s", SensorType[kind], sensor_range=inf, detection=0.5, **place)
            looks = []
            for _ in range(4):
                sensor.sense(0)
                looks.append([name for name in sensor.data if name not in extra])
            return looks

    looks = game(7)
    assert game(7) == looks
    assert game(7, extra=["late"]) == looks  # who else is there changes no draw
    assert game(8) != looks
    assert len({tuple(look) for look in looks}) == 4  # every look draws again
    assert 30 < sum(map(len, looks)) < 90


def test_a_function_of_distances_gives_the_probability(crowd):
    assert seen(crowd, "AGENT_RANGE", detection=lambda distances: (distances < 0.5).astype(float)) == ["r1"]


def test_never_and_always_are_exact(crowd):
    assert seen(crowd, "AGENT", detection=0) == []
    assert seen(crowd, "AGENT", detection=1.0) == ["r1", "r2", "b1", "g1", "n"]


@pytest.mark.parametrize(
    ("detection", "error"),
    [
        (1.5, ValueError),
        (-0.1, ValueError),
        (float("nan"), ValueError),
        ([(0, 1), (0, 0.5)], ValueError),
        ([(0, 2)], ValueError),
        ([], ValueError),
        ("often", TypeError),
        ([1, 2], TypeError),
        (object(), TypeError),
    ],
)
def test_an_impossible_probability_is_refused(ctx, detection, error):
    with pytest.raises(error, match="detection of 's'"):
        ctx.sensor.create_sensor("s", SensorType.AGENT, detection=detection)
    assert ctx.sensor.sensors == {}


def test_a_function_that_gives_no_probabilities_is_named(crowd):
    for wrong in (lambda d: d + 2.0, lambda d: 0.5, lambda d: d * float("nan")):
        with pytest.raises(ValueError, match="must give a probability from 0 to 1 for each of 5 distances"):
            seen(crowd, "AGENT", detection=wrong)


def test_misspelt_words_are_hinted_at(ctx, heard):
    ctx.sensor.create_sensor("s", SensorType.AGENT, detecton=0.5, exclud="red")
    assert heard == [
        "Sensor 's': AGENT ignores detecton=. Did you mean 'detection'?",
        "Sensor 's': AGENT ignores exclud=. Did you mean 'exclude'?",
    ]


def test_a_drone_counts_by_its_team(ctx):
    ctx.agent.create_agent("d", type=AgentType.AERIAL, start_node_id=0, speed=1, team="red")
    assert seen(ctx, "AGENT", team="red") == ["d"]
