"""Reports that may be wrong or late mislead no belief; what a sensor has not shown counts as far as it is sure."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms import belief
from gamms.sensor import SensorType

ERRORS = st.fixed_dictionaries(
    {},
    optional={
        "position_noise_m": st.sampled_from([4.0, 20.0]),
        "false_alarm_rate": st.sampled_from([0.3, 2.0]),
        "delay_turns": st.integers(1, 3),
        "detection": st.just(0.5),
    },
)


def watched(ctx, start, errors, strategy, kind=SensorType.AGENT_RANGE, reach=15.0):
    place = {"at": (10.0, 0.0, 3.0)} if kind is SensorType.AERIAL_AGENT else {"at": 2}
    eyes = ctx.sensor.create_sensor("eyes", kind, sensor_range=reach, team="blue", **place, **errors)
    flies = {"type": 1, "speed": 1.0} if kind is SensorType.AERIAL_AGENT else {}
    ctx.agent.create_agent("watcher", start_node_id=0, team="red", sensors={"e": eyes}, strategy=strategy, **flies)
    for name in ("prey", "other"):
        ctx.agent.create_agent(name, start_node_id=start, team="blue", strategy=gamms.strategies.random_walk)


@settings(max_examples=12)
@given(
    errors=ERRORS,
    start=st.integers(0, 8),
    seed=st.integers(0, 1000),
    kind=st.sampled_from([SensorType.AGENT_RANGE, SensorType.AERIAL_AGENT]),
)
def test_the_node_on_which_an_agent_is_is_never_ruled_out(errors, start, seed, kind):
    with gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(9, 1, 5.0))

        def watch(state):
            known = belief.observe(ctx, state)
            node = ctx.agent.get_agent("prey").current_node_id
            assert node in known.reachable("prey")
            assert known.probability("prey").get(node, 0.0) > 0.0
            state["action"] = state["curr_pos"]

        watched(ctx, start, errors, watch, kind)
        result = ctx.game.run(5)
        assert result.errors == []


def believed_after_one_look(make_ctx, start, **errors):
    """Return what is believed of prey, and whether it was shown, by a sensor that covers nodes 1, 2 and 3 of five."""
    found = {}

    def watch(state):
        found["reachable"] = set(belief.observe(ctx, state).reachable("prey"))
        found["probable"] = belief.believed(ctx, state).probability("prey")
        found["shown"] = "prey" in state["sensor"]["e"][1]
        state["action"] = state["curr_pos"]

    ctx = make_ctx()
    watched(ctx, start, errors, watch, reach=10.0)
    ctx.game.run(1)
    return found


@pytest.mark.parametrize("errors", [{"position_noise_m": 30.0}, {"false_alarm_rate": 1e-9}])
def test_a_sensor_with_errors_that_shows_no_agent_rules_its_nodes_out(make_ctx, errors):
    found = believed_after_one_look(make_ctx, 4, **errors)
    assert found == {"reachable": {0, 4}, "probable": {0: 0.5, 4: 0.5}, "shown": False}


@pytest.mark.parametrize(("start", "errors"), [(2, {"position_noise_m": 30.0}), (4, {"false_alarm_rate": 20.0})])
def test_a_place_that_may_be_wrong_says_nothing(make_ctx, start, errors):
    found = believed_after_one_look(make_ctx, start, **errors)
    assert found["shown"]
    assert found["reachable"] == {0, 1, 2, 3, 4}
    assert found["probable"] == pytest.approx(dict.fromkeys(range(5), 0.2))


def test_a_late_sensor_says_nothing_of_this_moment(make_ctx):
    found = believed_after_one_look(make_ctx, 4, delay_turns=1)
    assert not found["shown"]
    assert found["reachable"] == {0, 1, 2, 3, 4}
