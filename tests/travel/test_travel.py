"""Agents that travel by metres: they may be anywhere on an edge."""

import pickle
import re
from contextlib import nullcontext
from copy import deepcopy
from math import inf

import pytest

import gamms
from gamms.errors import NoPath
from gamms.rules import Conflicts, contacts
from gamms.sensor import SensorType


def road(*xs, speed_unit="metres", one_way=(), **game):
    """A context with a straight road through these points of the x axis; some of its parts lead one way only."""
    ctx = gamms.create_context(
        seed=1, logger_config={"level": "CRITICAL"}, game={"speed_unit": speed_unit, "on_illegal": "raise", **game}
    )
    ctx.graph.add_nodes(range(len(xs)), xs, [0.0] * len(xs))
    ends = [(i, i + 1) for i in range(len(xs) - 1)]
    ends += [(b, a) for a, b in ends if (a, b) not in one_way]
    ctx.graph.add_edges(
        range(len(ends)), [a for a, _ in ends], [b for _, b in ends], [abs(xs[a] - xs[b]) for a, b in ends]
    )
    return ctx


def agent(ctx, name, node, *actions, **more):
    """An agent that does these things, the last one for ever."""
    seen = []

    def strategy(state):
        seen.append({key: state.get(key) for key in ("curr_pos", "edge", "offset_m", "xy", "legal", "blocked", "time")})
        state["action"] = actions[min(len(seen), len(actions)) - 1]

    one = ctx.agent.create_agent(name, start_node_id=node, strategy=strategy, **more)
    one.seen = seen
    return one


def x_of(one):
    return one.xy[0]


# -- where agents are -------------------------------------------------------------------------------------------------


def test_an_agent_on_an_edge_knows_the_edge_how_far_it_is_and_where():
    ctx = road(0, 90)
    anna = agent(ctx, "anna", 0, 1, speed=10.0)
    ctx.game.run(3)
    assert anna.current_node_id == 0
    assert (anna.edge, anna.offset_m, anna.xy) == ((0, 1, 0), pytest.approx(30.0), (pytest.approx(30.0), 0.0))
    assert anna.seen[2] == {
        "curr_pos": 0,
        "edge": (0, 1, 0),
        "offset_m": pytest.approx(20.0),
        "xy": (pytest.approx(20.0), 0.0),
        "legal": (0, 1),
        "blocked": None,
        "time": None,
    }
    assert anna.orientation == (1.0, 0.0)


def test_it_follows_the_bends_of_its_edge():
    ctx = road(0, 90)
    ctx.graph.graph.update_edge(
        {"id": 0, "source": 0, "target": 1, "length": 150.0, "linestring": [(0, 0), (0, 30), (90, 30), (90, 0)]}
    )
    anna = agent(ctx, "anna", 0, 1, speed=50.0)
    ctx.game.run(1)
    assert anna.xy == (pytest.approx(20.0), pytest.approx(30.0))
    assert anna.orientation == (1.0, 0.0)
    ctx.game.run(1)
    assert anna.xy == (pytest.approx(70.0), pytest.approx(30.0))


def test_none_stops_where_it_is_and_the_last_node_passed_turns_round():
    ctx = road(0, 90)
    anna = agent(ctx, "anna", 0, 1, 1, None, 0, [1], speed=10.0)
    places = []
    for _ in range(5):
        ctx.game.step()
        places.append(x_of(anna))
    assert places == pytest.approx([10, 20, 20, 10, 20])
    assert anna.edge == (0, 1, 0)


def test_on_the_way_back_it_looks_back():
    ctx = road(0, 90)
    anna = agent(ctx, "anna", 0, 1, 0, speed=10.0)
    ctx.game.run(1)
    anna.speed = 4.0
    ctx.game.run(1)
    assert anna.orientation == (-1.0, 0.0)
    assert x_of(anna) == pytest.approx(6.0)


def test_a_refused_move_blocks_one_that_goes_and_none_that_stays():
    def rule(ctx):
        """Refuse all moves."""

    rule.check = lambda ctx: [ctx.game.refuse(name, "the road is closed") for name in ("anna", "ben")]
    with road(0, 90) as ctx:
        anna, ben = agent(ctx, "anna", 0, 1, speed=10.0), agent(ctx, "ben", 1, 1, speed=10.0)
        ctx.game.add(rule)
        ctx.game.run(2)
        assert [one.seen[1]["blocked"] for one in (anna, ben)] == ["the road is closed", None]
        assert [count["blocked"] for count in ctx.game.result().agents.values()] == [2, 0]


def test_no_agent_turns_round_on_a_one_way_road():
    ctx = road(0, 90, 180, one_way={(0, 1)})
    anna = agent(ctx, "anna", 0, 1, 0, speed=10.0)
    ctx.game.run(1)
    with pytest.raises(ValueError, match=r"Agent 'anna' in turn 1: .* one-way road"):
        ctx.game.run(1)
    assert anna.seen[-1]["legal"] == (1, 2)
    assert x_of(anna) == pytest.approx(10.0)


def test_a_node_that_no_way_leads_to_from_a_one_way_road_is_said_to_have_none():
    ctx = road(0, 90, one_way={(0, 1)})
    ctx.graph.graph.add_node({"id": 2, "x": 0.0, "y": 50.0})
    agent(ctx, "anna", 0, 1, 2, speed=10.0)
    ctx.game.run(1)
    with pytest.raises(ValueError, match=re.escape(str(NoPath(1, 2)))):
        ctx.game.run(1)


def test_an_agent_goes_on_where_both_ways_to_its_target_are_as_long():
    ctx = road(0, 10)
    ctx.graph.add_nodes([2], [5.0], [8.0])
    ctx.graph.add_edges(range(2, 6), [0, 2, 1, 2], [2, 0, 2, 1], [10.0] * 4)
    anna = agent(ctx, "anna", 0, 1, 2, speed=5.0)
    ctx.game.run(2)
    assert anna.current_node_id == 1


def test_an_agent_without_a_speed_goes_one_edge_a_turn():
    ctx = road(0, 90, 100)
    anna = agent(ctx, "anna", 0, 1, 2)
    ctx.game.run(2)
    assert (anna.current_node_id, anna.edge) == (2, None)
    with pytest.raises(ValueError, match="Node 0 is not next to node 2"):
        agent(ctx, "bert", 2, 0)
        ctx.game.run(1)


def test_an_endless_speed_arrives_in_one_turn_wherever_it_goes():
    ctx = road(0, 90, 100)
    anna = agent(ctx, "anna", 0, 2, speed=inf)
    ctx.game.run(1)
    assert anna.current_node_id == 2
    assert ctx.game.tracks([anna])[0].times == (0.0, pytest.approx(0.9), pytest.approx(1.0))


def test_the_weight_decides_which_way_is_gone():
    ctx = road(0, 90, weight="danger")
    ctx.graph.graph.add_node({"id": 2, "x": 45.0, "y": 60.0})
    ctx.graph.add_edges([10, 11], [0, 2], [2, 1], [75.0, 75.0])
    for edge, source, target, danger in ((0, 0, 1, 9.0), (10, 0, 2, 1.0), (11, 2, 1, 1.0)):
        length = ctx.graph.graph.get_edge(edge).length
        ctx.graph.graph.update_edge(
            {"id": edge, "source": source, "target": target, "length": length, "danger": danger}
        )
    anna = agent(ctx, "anna", 0, 1, speed=15.0)
    ctx.game.run(1)
    assert anna.edge == (0, 2, 10)


# -- who is where for rules -------------------------------------------------------------------------------------------


def test_in_an_order_of_play_agents_stand_on_their_edges_before_and_after_their_part():
    with road(0, 90, order=[["first"], ["second"], ["third"]]) as ctx:
        for team in ("first", "second", "third"):
            agent(ctx, team, 0, 1, speed=9.0, team=team)
        ctx.game.run(2)
        legs = {name: [leg[3:7] for leg in move.legs] for name, move in ctx.game.moves.items()}
        goes = {"first": (0.0, 1 / 3), "second": (1 / 3, 2 / 3), "third": (2 / 3, 1.0)}
        for name, (since, until) in goes.items():
            stands = (0.1, 0.1, 0.0, since), (0.2, 0.2, until, 1.0)
            expected = [stands[0], (0.1, 0.2, since, until), stands[1]]
            assert legs[name] == [pytest.approx(leg) for leg in expected if leg[2] < leg[3]]


@pytest.mark.parametrize("is_batch", [False, True])
def test_one_that_stands_on_an_edge_is_met_by_one_that_comes_along_it(is_batch):
    def stop_after_two_turns(state):
        state["action"] = 1 if state["turn"] < 2 else None

    def come(state):
        state["action"] = 0

    ctx = road(0, 90)
    ctx.agent.create_agent("anna", start_node_id=0, strategy=stop_after_two_turns, speed=10.0, team="a")
    ctx.agent.create_agent("bert", start_node_id=1, strategy=come, speed=20.0, team="b")
    ctx.game.add(lambda ctx: [ctx.game.emit("met", after=one.time) for one in contacts(ctx, "a", "b")])
    with ctx.game.batch(1) if is_batch else nullcontext(ctx.game) as games:
        for _ in range(5):
            games.step()
        result = games.result(0) if is_batch else games.result()
    assert [(event["turn"], event["after"]) for event in result.events] == [(4, pytest.approx(0.5))]


def test_those_who_use_one_street_one_after_the_other_do_not_meet():
    ctx, met = road(0, 30, 60), []
    ctx.graph.add_nodes([3], [30], [50])
    ctx.graph.add_edges([8], [3], [1], [50])
    anna = agent(ctx, "anna", 0, 2, speed=60.0, team="a")
    bert = agent(ctx, "bert", 3, 0, speed=80.0, team="b")  # at node 1 after 5/8 of the turn, and anna after 1/2
    ctx.game.add(lambda ctx: met.extend(contacts(ctx, "a", "b")))
    ctx.game.step()
    assert (x_of(anna), x_of(bert), met) == (60.0, 0.0, [])


@pytest.mark.parametrize("is_bent", [False, True])
@pytest.mark.parametrize("unit", ["metres", "euclid"])
def test_contacts_and_prices_are_the_same_where_a_rule_has_closed_the_road_since(unit, is_bent):
    ctx, met = road(0, 90), []
    if is_bent:
        for id, source in ((0, 0), (1, 1)):
            bent = {"length": 90.0, "linestring": [(90 * source, 0), (45, 0), (90 - 90 * source, 0)]}
            ctx.graph.graph.update_edge({"id": id, "source": source, "target": 1 - source, **bent})
    agent(ctx, "anna", 0, 1, speed=10.0, team="a")
    agent(ctx, "bert", 1, 0, speed=10.0, team="b")
    ctx.game.add(
        lambda ctx: ctx.graph.close_roads(inside=[(-1, -9), (99, -9), (99, 9)]) if ctx.game.turn == 4 else None
    )
    ctx.game.add(lambda ctx: met.extend((one.time, one.a_xy) for one in contacts(ctx, "a", "b", **{unit: 15.0})))
    ctx.game.add(gamms.rules.resource("fuel", start=100, per_metre=1.0))
    ctx.game.run(4)
    assert met == [(pytest.approx(0.75), (pytest.approx(37.5), 0.0))]
    assert ctx.graph.closed_roads
    assert ctx.game.observation("anna")["facts"]["fuel"] == pytest.approx(60.0)


def test_an_edge_that_a_rule_has_removed_since_is_where_no_agents_meet():
    ctx, met = road(0, 90), []
    agent(ctx, "anna", 0, 1, speed=10.0, team="a")
    agent(ctx, "bert", 1, 0, speed=10.0, team="b")
    ctx.game.add(lambda ctx: [ctx.graph.graph.remove_edge(id) for id in list(ctx.graph.graph.get_edges())] and None)
    ctx.game.add(lambda ctx: met.extend(contacts(ctx, "a", "b", euclid=100.0)))
    ctx.game.add(gamms.rules.resource("fuel", start=100, per_metre=1.0))
    ctx.game.step()
    assert (met, ctx.game.observation("anna")["facts"]["fuel"]) == ([], pytest.approx(90.0))


def test_contacts_with_one_that_goes_round_a_bend_are_exact():
    ctx, met = road(0, 40), []
    bent = {"length": 60.0, "linestring": [(0, 0), (0, 10), (40, 10), (40, 0)]}
    ctx.graph.graph.update_edge({"id": 0, "source": 0, "target": 1, **bent})
    ctx.graph.graph.add_node({"id": 9, "x": 5.0, "y": 14.0})
    agent(ctx, "anna", 0, 1, speed=30.0, team="a")
    agent(ctx, "bert", 9, None, speed=30.0, team="b")
    ctx.game.add(lambda ctx: met.extend(one.time for one in contacts(ctx, "a", "b", euclid=5.0)))
    ctx.game.step()
    assert met == [pytest.approx(0.4)]  # 2 m behind the bend


def test_a_goal_is_reached_by_who_stands_on_its_node_and_not_by_who_is_on_the_way():
    ctx = road(0, 90, 180)
    agent(ctx, "anna", 1, 2, speed=10.0, team="a")
    ctx.game.add(gamms.rules.reach({"a": [1]}))
    ctx.game.run(3)
    assert ctx.game.over is None


def test_edges_have_a_capacity_of_their_own():
    conflicts = Conflicts(None, edge_capacity=1, resolve=gamms.rules.by_priority(["a", "b"]))
    ctx = road(0, 90, on_illegal="stay", conflicts=conflicts)
    anna = agent(ctx, "anna", 0, 1, speed=10.0, team="a")
    bert = agent(ctx, "bert", 0, 1, speed=10.0, team="b")
    back = agent(ctx, "back", 1, 0, speed=10.0, team="b")  # the other direction is an edge of its own
    ctx.game.run(3)
    assert [x_of(one) for one in (anna, bert, back)] == pytest.approx([30.0, 0.0, 60.0])
    assert bert.seen[1]["blocked"] == "in conflict with other agents on the way to edge 0"


def test_who_is_on_an_edge_that_closes_is_back_at_the_node_it_passed_last():
    ctx = road(0, 90)
    anna = agent(ctx, "anna", 0, 1, 1, None, speed=10.0)
    ctx.game.run(2)
    ctx.graph.graph.remove_edge(0)
    ctx.game.run(1)
    assert (anna.xy, anna.edge) == ((0.0, 0.0), None)
    assert anna.seen[2]["blocked"] == "the edge from node 0 to node 1 was closed"


@pytest.mark.parametrize(("phase", "turn"), [("before", 2), ("after", 3)])
def test_whoever_is_on_an_edge_that_closes_counts_as_blocked_once_in_this_turn(phase, turn):
    ctx = road(0, 90)
    on_edge = ctx.agent.create_agent("anna", start_node_id=0, speed=10.0)
    on_edge.register_strategy(lambda state: state.update(action=state["legal"][-1]))

    def close(ctx):
        if ctx.game.turn == turn:
            ctx.graph.close_roads(edges=[0])

    ctx.game.add(close, phase=phase)
    found = []
    with ctx.game.batch(seeds=[1]) as games:
        for _ in range(5):
            games.step()
            ctx.game.step()
            found.append((x_of(on_edge), ctx.game.result().agents["anna"]["blocked"]))
            assert games.result(0).agents == ctx.game.result().agents
            assert x_of(games.context(0).agent.get_agent("anna")) == x_of(on_edge)
    assert found[:2] == [(pytest.approx(10.0), 0), (pytest.approx(20.0), 0)]
    assert found[2:] == [(0.0, 1)] * 3


def test_a_way_that_closes_before_agents_move_stops_those_that_were_to_go_it():
    ctx = road(0, 90, 180)
    agents = [agent(ctx, "anna", 0, 1, speed=10.0), agent(ctx, "bert", 2, 1, speed=10.0)]
    ctx.game.add(lambda ctx: ctx.graph.graph.remove_edge(0), phase="deeds")  # from node 0 to node 1
    ctx.game.step()
    assert [x_of(one) for one in agents] == [0.0, pytest.approx(170.0)]


def test_one_that_is_taken_out_of_the_game_stays_where_it_was():
    ctx = road(0, 90)
    anna = agent(ctx, "anna", 0, 1, speed=10.0)
    ctx.game.run(1)
    ctx.game.eliminate(anna)
    assert x_of(anna) == pytest.approx(10.0)
    ctx.game.respawn(anna)
    assert (anna.xy, anna.edge) == ((0.0, 0.0), None)


# -- sensors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [SensorType.AGENT_RANGE, SensorType.OCCLUDED_AGENT])
def test_sensors_measure_from_where_agents_are_to_where_agents_are(kind):
    ctx = road(0, 90, 180)
    ctx.sensor.create_sensor("eyes", kind, sensor_range=25.0)
    anna = agent(ctx, "anna", 0, 1, speed=10.0, sensors=["eyes"])
    agent(ctx, "bert", 1, 0, speed=10.0)
    found = []
    for _ in range(5):
        ctx.game.step()
        found.append(anna.sense()["eyes"][1])
    assert found == [{}, {}, {}, {"bert": 1}, {"bert": 1}]  # 70, 50, 30, 10 and 10 m apart


def seen_of_bert(kind, **more):
    """What a guard's sensor of a kind reports of bert, who is 35 m on his way from node 1 to node 2."""
    ctx = road(0, 90, 180)
    args = {} if kind == SensorType.AGENT else {"sensor_range": 500.0}
    ctx.sensor.create_sensor("eyes", kind, **args, **more)
    guard = agent(ctx, "guard", 0, None, speed=1.0, sensors=["eyes"])
    agent(ctx, "anna", 1, None, speed=1.0)
    agent(ctx, "bert", 1, 2, speed=35.0)
    ctx.game.run(1)
    return guard.sense()["eyes"][1], ctx.sensor.get_sensor("eyes").last_view()


AGENT_KINDS = [SensorType.AGENT, SensorType.AGENT_RANGE, SensorType.AGENT_ARC, SensorType.OCCLUDED_AGENT]


@pytest.mark.parametrize("kind", AGENT_KINDS)
def test_agent_sensors_say_where_on_an_edge_an_agent_is(kind):
    seen, view = seen_of_bert(kind)
    assert seen == {"anna": 1, "bert": 1}
    assert type(seen["anna"]) is int
    for bert in (seen["bert"], deepcopy(seen["bert"]), pickle.loads(pickle.dumps(seen["bert"]))):
        assert (bert, bert.edge) == (1, (1, 2, 1))
        assert (bert.offset_m, bert.xy) == (pytest.approx(35.0), (pytest.approx(125.0), 0.0))
    assert view.agents.tolist() == [[90.0, 0.0], [pytest.approx(125.0), 0.0]]


def test_reports_that_may_be_wrong_name_nodes_alone():
    seen, _ = seen_of_bert(SensorType.AGENT_RANGE, position_noise_m=1e-6)
    assert {name: type(node) for name, node in seen.items()} == {"anna": int, "bert": int}


def test_an_agent_can_go_to_the_node_that_a_sensor_reports():
    ctx = road(0, 90, 180)
    ctx.sensor.create_sensor("eyes", SensorType.AGENT)
    agent(ctx, "bert", 1, 2, speed=10.0)
    anna = ctx.agent.create_agent("anna", start_node_id=0, speed=95.0, sensors=["eyes"])
    anna.strategy = lambda state: state.update(action=state["sensor"]["eyes"][1]["bert"])
    ctx.game.run(2)
    assert (anna.current_node_id, type(anna.current_node_id)) == (1, int)


def test_a_range_sensor_sees_the_nodes_around_its_place_on_the_edge():
    ctx = road(0, 90, 180)
    ctx.sensor.create_sensor("eyes", SensorType.RANGE, sensor_range=25.0)
    anna = agent(ctx, "anna", 0, 1, speed=35.0, sensors=["eyes"])
    ctx.game.run(1)
    assert list(anna.sense()["eyes"][1]["nodes"]) == []
    ctx.game.run(1)
    assert list(anna.sense()["eyes"][1]["nodes"]) == [1]


def test_a_wall_hides_who_is_behind_it_on_an_edge():
    ctx = road(0, 90)
    ctx.graph.graph.add_node({"id": 5, "x": 45.0, "y": 40.0})
    ctx.graph.add_obstacle_face(1, (44, 20, 0), (46, 20, 0), (44, 20, 9), (46, 20, 9), 1)
    ctx.sensor.create_sensor("eyes", SensorType.OCCLUDED_AGENT, sensor_range=500.0)
    agent(ctx, "anna", 0, 1, speed=15.0)
    guard = agent(ctx, "guard", 5, None, speed=1.0, sensors=["eyes"])
    seen = []
    for _ in range(5):
        ctx.game.step()
        seen.append(list(guard.sense()["eyes"][1]))
    assert seen == [["anna"], ["anna"], [], ["anna"], ["anna"]]


# -- decide at each arrival -------------------------------------------------------------------------------------------


def test_an_agent_is_asked_at_each_node_that_it_reaches_in_order_of_time():
    ctx = road(0, 9, 18, 27, decide="arrival")
    asked = []

    def walk(state):
        asked.append((state["turn"], round(state["time"], 6), state["name"]))
        state["action"] = min(state["curr_pos"] + 1, 3) if state["name"] == "anna" else 0

    ctx.agent.create_agent("anna", start_node_id=0, speed=20.0, strategy=walk)
    ctx.agent.create_agent("bert", start_node_id=1, speed=18.0, strategy=walk)
    ctx.game.run(2)
    assert asked == [
        (0, 0.0, "anna"),
        (0, 0.0, "bert"),
        (0, 0.45, "anna"),
        (0, 0.5, "bert"),
        (0, 0.9, "anna"),
        *asked[5:],
    ]
    assert [one for one in asked if one[0] == 1] == [(1, 0.0, "bert"), (1, 0.35, "anna")]


def test_at_an_arrival_others_are_seen_where_they_are_at_that_time():
    ctx = road(0, 10, 100, decide="arrival")
    ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=20.0)
    seen = []

    def walk(state):
        seen.append((state["time"], sorted(state["sensor"]["eyes"][1])))
        state["action"] = 1

    ctx.agent.create_agent("anna", start_node_id=0, speed=20.0, sensors=["eyes"], strategy=walk)
    agent(ctx, "bert", 2, 1, speed=160.0)
    ctx.game.run(1)
    assert seen == [(0.0, []), (0.5, ["bert"])]  # bert has come 80 m by then


def test_an_agent_without_a_speed_goes_one_edge_a_turn_also_where_agents_decide_at_arrivals():
    ctx = road(0, 1.9, 4.2, 7.1, decide="arrival")
    anna = agent(ctx, "anna", 0, 1, 2, 3)
    nodes = []
    for _ in range(3):
        ctx.game.step()
        nodes.append(anna.current_node_id)
    assert nodes == [1, 2, 3]
    assert [one["time"] for one in anna.seen] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("actions", "faces"),
    [
        ([{"node_id": 1, "orientation": (0.0, 1.0)}, 2], (0.0, 1.0)),
        ([1, {"node_id": 2, "orientation": (0.0, 1.0)}], (0.0, 1.0)),
        ([{"node_id": 1, "orientation": (0.0, 1.0)}, {"node_id": 2, "orientation": None}], (1.0, 0.0)),
        ([1, 2], (1.0, 0.0)),
    ],
)
def test_of_several_decisions_in_a_turn_the_last_that_names_an_orientation_counts(actions, faces):
    with road(0, 10, 20, decide="arrival") as ctx:
        anna = agent(ctx, "anna", 0, *actions, speed=20.0)
        ctx.game.run(1)
        assert (anna.current_node_id, anna.orientation) == (2, pytest.approx(faces))


def test_edges_of_no_length_end_in_a_wait():
    ctx = road(0, 0, decide="arrival", on_illegal="stay")

    def walk(state):
        state["action"] = 1 - state["curr_pos"]

    ctx.agent.create_agent("anna", start_node_id=0, speed=20.0, strategy=walk)
    result = ctx.game.run(1)
    assert "waits" in result.errors[0]["message"]
    assert {(leg.edge, leg.back) for leg in ctx.game.moves["anna"].legs} == {(0, 1), (1, 0)}


# -- records ----------------------------------------------------------------------------------------------------------


def test_a_recording_knows_where_on_edges_agents_were(tmp_path):
    ctx = road(0, 90)
    anna = agent(ctx, "anna", 1, 0, speed=10.0)
    ctx.record.start(tmp_path / "one")
    ctx.game.run(3)
    ctx.record.stop()
    with gamms.recorder.open(tmp_path / "one.ggr") as recording:
        state = recording.state(2)
        assert state.agents["edge_share"].tolist() == pytest.approx([20 / 90])
        assert state.xy().tolist() == [[pytest.approx(70.0), 0.0]]
        table = recording.table("travel")
        assert table["turn"].tolist() == [1, 2, 3]
        assert table["edge_share"].tolist() == pytest.approx([1 / 9, 2 / 9, 3 / 9])
        ends = [table[name].tolist() for name in ("edge_source", "edge_target", "edge")]
        assert ends == [[1] * 3, [0] * 3, [1] * 3]
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as other:
        list(other.record.replay(tmp_path / "one.ggr"))
        assert other.agent.get_agent("anna").xy == anna.xy
        assert other.agent.get_agent("anna").edge == anna.edge


def test_the_table_of_travel_has_no_rows_where_edges_are_counted(tmp_path):
    ctx = road(0, 90, speed_unit="edges")
    agent(ctx, "anna", 0, 1, speed=0.25)
    ctx.record.start(tmp_path / "one")
    ctx.game.run(3)
    ctx.record.stop()
    with gamms.recorder.open(tmp_path / "one.ggr") as recording:
        assert recording.table("travel")["turn"].tolist() == []


def test_a_snapshot_restores_where_on_edges_agents_are():
    ctx = road(0, 90)
    anna = agent(ctx, "anna", 0, 1, 1, 0, speed=10.0)
    ctx.game.run(2)
    before, place = ctx.game.snapshot(), anna.xy
    ctx.game.run(2)
    assert anna.xy != place
    ctx.game.restore(before)
    assert anna.xy == place


def test_attributes_of_programs_may_have_the_names_of_places():
    ctx = road(0, 90)
    anna = ctx.agent.create_agent("anna", start_node_id=0, xy="mine", edge=[7])
    anna.offset_m = 3
    assert (anna.xy, list(anna.edge), anna.offset_m) == ("mine", [7], 3)


@pytest.mark.parametrize(
    ("given", "unit"),
    [({"decide": "arrival"}, "metres"), ({"weight": "danger"}, "metres"), ({"turn_seconds": 2.0}, "metres_per_second")],
)
def test_settings_of_travel_are_refused_where_they_count_nothing(given, unit):
    ctx = road(0, 90, speed_unit="edges", **given)
    agent(ctx, "anna", 0, 1)
    with pytest.raises(
        ValueError, match=f"{next(iter(given))} = .* counts nothing .* set ctx.game.speed_unit = '{unit}'"
    ):
        ctx.game.step()


def test_a_scenario_file_can_travel(tmp_path):
    (tmp_path / "walk.yaml").write_text(
        """
map:
  grid: {width: 5, height: 1, spacing: 30}
settings: {speed_unit: metres_per_second, turn_seconds: 5.0, decide: arrival}
teams:
  walkers: {agents: [{name: anna, node: 0}], speed: 4.0, strategy: {function: gamms.strategies:goto, with: {target: 4}}}
conflicts: {capacity: null, edge_capacity: 1}
rules: [{rule: time_limit, with: {turns: 2}}]
"""
    )
    result = gamms.scenario.load(tmp_path / "walk.yaml").play()
    assert result.agents["anna"]["node"] == 1  # 40 m on


# -- pictures ---------------------------------------------------------------------------------------------------------


def test_frames_of_a_turn_follow_an_agent_along_its_edges():
    ctx = road(0, 25, 100)
    agent(ctx, "anna", 0, 2, speed=10.0)
    ctx.game.run(3)  # from 20 to 30 m, past the node at 25
    motion = ctx.visual.drawing.motion
    motion.begin_turn()
    shares = (0.0, 0.25, 0.5, 1.0)
    assert [motion.find_position("anna", share)[0] for share in shares] == pytest.approx([20.0, 22.5, 25.0, 30.0])
    ctx.game.respawn("anna")
    ctx.visual.simulate()
    motion.begin_turn()
    assert motion.find_position("anna", 0.0) == (0.0, 0.0)  # it did not go there


# -- strategies -------------------------------------------------------------------------------------------------------


def test_random_walkers_go_on_and_those_who_stay_stop_where_they_are():
    ctx = road(0, 90, 180, 270)
    walker = ctx.agent.create_agent("walker", start_node_id=1, speed=10.0, strategy=gamms.strategies.random_walk)
    passed = []
    for _ in range(60):
        ctx.game.step()
        passed.append(x_of(walker))
    assert {0.0, 90.0, 180.0} <= {round(x, 6) for x in passed}  # it never turns on the way
    ctx.game.run(2)
    at = x_of(walker)
    walker.strategy = gamms.strategies.stay
    ctx.game.run(3)
    assert x_of(walker) == at


def test_an_agent_whose_edge_is_gone_is_seen_on_its_node():
    ctx = road(0, 10, 20)
    agent(ctx, "bert", 0, 1, speed=4.0)
    eyes = ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=100.0)
    ctx.game.step()
    eyes.sense(2)
    assert (eyes.data["bert"], eyes.data["bert"].edge) == (0, (0, 1, 0))
    ctx.graph.graph.remove_edge(0)
    eyes.sense(2)
    assert (eyes.data["bert"], type(eyes.data["bert"])) == (0, int)


@pytest.mark.parametrize(("way_back", "ahead"), [(12.0, True), (10.5, False)])
def test_a_pursuer_on_an_edge_goes_on_or_turns_by_which_way_is_shorter(way_back, ahead):
    """From 1 m behind node 0, 9 m before node 1, to an agent 1 m behind node 2: 9 + 3 + 1 m ahead, 1 + … + 1 m back."""
    ctx = road(0, 10, 13, 33)
    ctx.graph.add_edges([10, 11], [0, 2], [2, 0], [way_back] * 2)
    ctx.sensor.create_sensor("eyes", SensorType.AGENT)
    hunt = gamms.strategies.chase(ctx)
    cat = ctx.agent.create_agent("cat", start_node_id=0, team="cats", speed=1.0, sensors=["eyes"])
    cat.strategy = lambda state: hunt(state) if state["turn"] else state.update(action=1)
    agent(ctx, "mouse", 2, 3, team="mice", speed=1.0)
    ctx.game.run(2)
    assert cat.offset_m == pytest.approx(2.0 if ahead else 0.0)
