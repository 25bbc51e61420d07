"""Sensors that report agents where they are not: noisy places, false alarms, and reports of earlier turns."""

from math import inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms import kernels
from gamms.agent import AgentType
from gamms.errors import BadType, BadValue
from gamms.graph import Engine
from gamms.sensor import SensorType
from gamms.sensor.sighting_errors import LookDraws, PossibleFalseAlarms

KINDS = ["AGENT", "AGENT_RANGE", "AGENT_ARC", "OCCLUDED_AGENT"]
FLYING = ["AERIAL_AGENT", "OCCLUDED_AERIAL_AGENT"]
SIZE = 20


def field(names, *, seed=4, engine=Engine.MEMORY, node=210):
    """Return a grid of 20 x 20 nodes one apart, with agents on one of them, all of team "blue"."""
    ctx = gamms.create_context(seed=seed, graph_engine=engine, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(SIZE, SIZE, 1.0))
    for name in names:
        ctx.agent.create_agent(name, start_node_id=node, team="blue")
    return ctx


def watch(ctx, kind="AGENT_RANGE", **given):
    place = {"at": (10.0, 10.0, 9.0)} if kind in FLYING else {"at": (9.5, 9.5)}
    return ctx.sensor.create_sensor("s", SensorType[kind], **{"sensor_range": inf, **place, **given})


def looks(sensor, number):
    found = []
    for _ in range(number):
        sensor.sense()
        found.append(sensor.data)
    return found


def xy(ctx, nodes):
    return ctx.graph.graph.positions(list(nodes))


# -- noise ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", FLYING)
def test_the_errors_of_places_are_gaussian_along_each_axis(kind):
    with field([f"a{i}" for i in range(1000)]) as ctx:
        report = looks(watch(ctx, kind, position_noise_m=2.5), 1)[0]
        x, y = xy(ctx, [210])[0]
        errors = (np.array([place for _, place in report.values()]) - (x, y, 0.0)) / 2.5
        assert {kind for kind, _ in report.values()} == {AgentType.BASIC}
        assert np.abs(errors.mean(axis=0)).max() < 0.1
        assert np.abs(errors.std(axis=0) - 1.0).max() < 0.08
        assert np.abs(np.corrcoef(errors.T) - np.eye(3)).max() < 0.1
        assert abs((np.abs(errors) < 1.0).mean() - 0.683) < 0.03
        assert np.abs(errors).max() > 2.5


def test_little_noise_leaves_the_node_as_it_is():
    with field(["anna", "bert"]) as ctx:
        assert looks(watch(ctx, position_noise_m=0.01), 1) == [{"anna": 210, "bert": 210}]


@pytest.mark.parametrize("kind", KINDS + FLYING)
def test_no_noise_no_false_alarms_and_no_delay_are_the_sensor_without(kind):
    with field(["anna", "bert"]) as ctx:
        plain = looks(watch(ctx, kind), 1)
        ctx.sensor.get_sensor("s").notice.position_noise_m = 0.0
        ctx.sensor.get_sensor("s").notice.false_alarm_rate = 0
        ctx.sensor.get_sensor("s").notice.delay_turns = 0
        assert looks(ctx.sensor.get_sensor("s"), 1) == plain


# -- false alarms -----------------------------------------------------------------------------------------------


def test_a_false_alarm_bears_the_name_of_an_agent_that_is_looked_for_and_not_noticed():
    with field(["anna", "bert"]) as ctx:
        ctx.agent.create_agent("rita", start_node_id=0, team="red")
        ctx.agent.create_agent("dora", start_node_id=0, team="blue").alive = False
        ctx.agent.create_agent("owen", start_node_id=0, team="blue")
        sensor = ctx.sensor.create_sensor("s", "AGENT_RANGE", sensor_range=3.0, team="blue", false_alarm_rate=5.0)
        ctx.agent.get_agent("owen").register_sensor("s", sensor)
        ctx.agent.get_agent("anna").current_node_id = 0
        reports = []
        for _ in range(50):
            sensor.sense(0)
            reports.append(sensor.data)
        assert {name for report in reports for name in report} == {"anna", "bert"}
        assert {report["anna"] for report in reports} == {0}  # who is noticed is where it is
        assert len({report["bert"] for report in reports if "bert" in report}) > 3


@given(seen=st.sets(st.integers(0, 11)), count=st.integers(0, 14), size=st.integers(1, 12), turn=st.integers(0, 9))
def test_false_alarms_go_to_the_highest_lots_of_those_that_are_not_seen(seen, count, size, turn):
    look, names = LookDraws(5, "s", "a3", turn, 1), [f"a{i}" for i in range(size)]
    among = PossibleFalseAlarms(names, kernels.compute_name_keys(names))
    found = look.draw_false_alarms(count, among, {f"a{i}" for i in seen}, np.array([7, 8, 9]))
    left = [name for name in names if name != "a3" and int(name[1:]) not in seen]
    for i in range(min(count, len(left))):
        purpose = kernels.compute_purpose_key(5, "false alarm", "s", "a3", i)
        left.remove(max(left, key=lambda name: kernels.draw_bits(purpose, kernels.compute_name_key(name), turn, 1)))
        assert [*found][i] not in left
    assert len(found) == min(count, len(found) + len(left))
    assert {*found.values()} <= {7, 8, 9}


# -- what draws follow from -------------------------------------------------------------------------------------


ERRORS = st.fixed_dictionaries(
    {},
    optional={
        "position_noise_m": st.sampled_from([0.5, 3.0]),
        "detection": st.just(0.6),
        "delay_turns": st.just(1),
        "false_alarm_rate": st.sampled_from([0.5, 3.0]),
    },
)


def reports_of(kind, errors, names, engine=Engine.MEMORY, seed=4):
    """Return what a sensor of a game reports of some agents, in three looks of each of three turns."""
    found = []
    with field(names, engine=engine, seed=seed) as ctx:
        sensor = watch(ctx, kind, **errors)
        ctx.game.add(lambda ctx: found.extend(looks(sensor, 3)))
        ctx.game.run(3)
    return found


@settings(max_examples=8)
@given(kind=st.sampled_from(KINDS + FLYING), errors=ERRORS, seed=st.integers(0, 5))
def test_both_engines_and_every_order_of_creation_report_the_same(kind, errors, seed):
    names = ["anna", "bert", "cleo", "dora"]
    first = reports_of(kind, errors, names, seed=seed)
    assert reports_of(kind, errors, names, seed=seed) == first
    assert reports_of(kind, errors, names[::-1], seed=seed) == first
    assert reports_of(kind, errors, names, Engine.SQLITE, seed=seed) == first


@settings(max_examples=8)
@given(kind=st.sampled_from(KINDS + FLYING), errors=ERRORS)
def test_one_more_agent_changes_the_report_of_no_other_but_whose_false_alarm_it_takes(kind, errors):
    names = ["anna", "bert", "cleo", "dora"]
    before, after = reports_of(kind, errors, names), reports_of(kind, errors, [*names, "late"])
    for one, other in zip(before, after, strict=True):
        rest = {name: place for name, place in other.items() if name != "late"}
        if "false_alarm_rate" not in errors:
            assert rest == one
        elif "detection" not in errors:
            assert rest == one  # all are noticed
        else:
            assert rest.items() <= one.items() or len(other) >= len(one)
            assert set(one.values()) <= set(other.values()) or "position_noise_m" in errors


def test_turns_looks_sensors_owners_and_agents_have_errors_of_their_own():
    with field([f"a{i}" for i in range(50)]) as ctx:
        ctx.sensor.create_sensor("t", "AERIAL_AGENT", sensor_range=inf, at=(10.0, 10.0, 9.0), position_noise_m=1.0)
        found = []

        @ctx.game.add
        def look(ctx):
            for name in ("s", "t"):
                reports = looks(ctx.sensor.get_sensor(name), 2)
                found.extend([place[0] for _, place in report.values()] for report in reports)

        watch(ctx, "AERIAL_AGENT", position_noise_m=1.0)
        ctx.game.run(2)
        assert len(found) == 8
        assert np.abs(np.corrcoef(found) - np.eye(8)).max() < 0.5
        assert len({round(x, 9) for report in found for x in report}) == 400


@settings(max_examples=10)
@given(kind=st.sampled_from(KINDS + FLYING), errors=ERRORS, number=st.integers(0, 4))
def test_many_looks_report_what_single_ones_do(kind, errors, number):
    many, single = [], []

    def report_many(ctx):
        sensed = ctx.sensor.get_sensor("s").sense_many([0] * number)
        places = np.split(sensed.places, sensed.offsets[1:-1]) if number else []
        for look, places_of in enumerate(places):
            names = [sensed.names[row] for row in sensed[look]]
            many.append(dict(zip(names, places_of.tolist(), strict=True)))

    def report_each(ctx):
        for report in looks(ctx.sensor.get_sensor("s"), number):
            found = report.items()
            single.append({name: list(place[1]) if kind in FLYING else place for name, place in found})

    for rule in (report_many, report_each):
        with field(["anna", "bert", "cleo"]) as ctx:
            watch(ctx, kind, **errors)
            ctx.game.add(rule)
            ctx.game.run(3)
    assert many == single
    assert len(many) == 3 * number


def test_a_strategy_that_looks_does_not_change_later_reports():
    def play(strategy):
        with field(["anna", "bert"]) as ctx:
            sensor = watch(ctx, position_noise_m=2.0, false_alarm_rate=0.5, detection=0.5, delay_turns=1)
            anna = ctx.agent.get_agent("anna")
            anna.register_sensor("s", sensor)
            anna.register_strategy(lambda state: strategy(state, sensor, found))
            found = []
            ctx.game.run(6)
            return found

    def quiet(state, sensor, found):
        found.append(state["sensor"]["s"][1])
        state["action"] = state["curr_pos"]

    def curious(state, sensor, found):
        quiet(state, sensor, found)
        sensor.sense_many([0, 1, 2])

    assert play(curious) == play(quiet)


# -- delay ------------------------------------------------------------------------------------------------------


def test_without_a_game_a_delayed_sensor_says_what_to_do():
    with field(["anna"]) as ctx:
        sensor = watch(ctx, delay_turns=2)
        with pytest.raises(BadValue, match=r"'s' has delay_turns=2, but no turns are counted: play with ctx\.game"):
            sensor.sense()
        assert len(sensor.view_from(0, None).agents) == 0  # a picture may be drawn


def test_a_picture_of_a_possible_report_changes_nothing():
    def play(*, is_drawn):
        found = []
        with field(["anna"]) as ctx:
            sensor = watch(ctx, delay_turns=1, position_noise_m=3.0)

            @ctx.game.add
            def look(ctx):
                if is_drawn:
                    sensor.view_from(0, None)
                found.extend(looks(sensor, 1))
                if is_drawn:
                    view = sensor.view_from(0, None)
                    assert view.agents.tolist() == xy(ctx, found[-1].values()).tolist()
                    assert view.names == ()  # the agent is not where it was reported

            ctx.game.run(4)
        return found

    assert play(is_drawn=True) == play(is_drawn=False)


# -- what is given ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"position_noise_m": -1.0}, BadValue, "position_noise_m of 's' must not be negative"),
        ({"position_noise_m": inf}, BadValue, "position_noise_m of 's' must be finite"),
        ({"position_noise_m": float("nan")}, BadValue, "position_noise_m of 's'"),
        ({"position_noise_m": "much"}, BadType, "position_noise_m of 's' must be a number"),
        ({"false_alarm_rate": -0.1}, BadValue, "false_alarm_rate of 's' must not be negative"),
        (
            {"false_alarm_rate": 101},
            BadValue,
            "false_alarm_rate of 's' is a number of false alarms per look, at most 100",
        ),
        ({"false_alarm_rate": inf}, BadValue, "false_alarm_rate of 's'"),
        ({"delay_turns": -1}, BadValue, "delay_turns of 's' must not be negative"),
        ({"delay_turns": 1.5}, BadType, "delay_turns of 's'"),
    ],
)
def test_an_impossible_error_is_refused(given, error, message):
    with field([]) as ctx:
        with pytest.raises(error, match=message):
            watch(ctx, **given)
        assert ctx.sensor.sensors == {}


@pytest.mark.parametrize("kind", ["MAP", "RANGE", "NEIGHBOR", "AERIAL"])
def test_sensors_of_the_map_ignore_errors_and_warn(kind, caplog):
    with field([]) as ctx:
        ctx.logger.setLevel("WARNING")
        ctx.logger.propagate = True
        ctx.sensor.create_sensor("s", kind, position_noise_m=1.0, false_alarm_rate=1.0, delay_turns=1)
        for keyword in ("position_noise_m", "false_alarm_rate", "delay_turns"):
            assert f"{kind} ignores {keyword}=. These kinds take it: AGENT," in caplog.text
