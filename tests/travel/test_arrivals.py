"""What agents that are asked at arrivals see: all others where they are at that time."""

from bisect import bisect_right
from itertools import pairwise
from math import dist, inf

import pytest

import gamms
from gamms.sensor import SensorType

SIZE, RANGE = 5, 45.0


def town(**game):
    """A small town with bent and one-way streets."""
    settings = {"speed_unit": "metres", "decide": "arrival", **game}
    ctx = gamms.create_context(seed=3, logger_config={"level": "CRITICAL"}, game=settings)
    xy = [(31.0 * (i % SIZE) + i % 7, 27.0 * (i // SIZE) + i % 4) for i in range(SIZE * SIZE)]
    ctx.graph.add_nodes(range(len(xy)), [x for x, _ in xy], [y for _, y in xy])
    pairs = [(i, j) for i in range(len(xy)) for j in (i + 1, i + SIZE) if j < len(xy) and (j % SIZE or j != i + 1)]
    for i, j in pairs:
        bend = ((xy[i][0] + xy[j][0]) / 2 + (i + j) % 5, (xy[i][1] + xy[j][1]) / 2 - (i * j) % 3)
        line = [xy[i], bend, xy[j]] if (i + j) % 2 else [xy[i], xy[j]]
        length = sum(map(dist, line, line[1:]))
        for source, target, points in ((i, j, line), (j, i, line[::-1])):
            if source < target or (i * j) % 9 != 4:
                ends = {"id": source * 100 + target, "source": source, "target": target}
                ctx.graph.graph.add_edge({**ends, "length": length, "linestring": points})
    return ctx


def place(ctx, move, time):
    """Where an agent is at a time of the turn by its legs, and the node it has passed last, and whether it is on it."""
    node = move.path[bisect_right(ctx.game.tracks([ctx.agent.get_agent(move.agent)])[0].times, time) - 1]
    for leg in move.legs:
        if leg.since <= time < leg.until and 0.0 < leg.share_at(time) < 1.0:
            points = ctx.graph.graph.get_edge(leg.edge).points
            corners = list(zip(points[::2], points[1::2], strict=True))
            left = leg.share_at(time) * sum(map(dist, corners, corners[1:]))
            for (x0, y0), (x1, y1) in pairwise(corners):
                length = dist((x0, y0), (x1, y1))
                if left <= length:
                    return (x0 + left / length * (x1 - x0), y0 + left / length * (y1 - y0)), node, False
                left -= length
    there = ctx.graph.graph.get_node(node)
    return (there.x, there.y), node, True


@pytest.mark.parametrize("kind", [SensorType.AGENT_RANGE, SensorType.OCCLUDED_AGENT, SensorType.AGENT])
def test_all_are_seen_where_their_legs_say_at_the_time_of_an_arrival(kind):
    ctx, looks = town(), []

    def walk(state):
        others = {one.name: (one.xy, one.current_node_id, one.edge is None) for one in agents}
        looks.append((state["time"], state["name"], state["xy"], dict(state["sensor"]["eyes"][1]), others))
        state["action"] = None if state["draw"].below(8) == 0 else state["legal"][state["draw"].below(3)]

    agents = []
    for i in range(10):
        args = {} if kind == SensorType.AGENT else {"sensor_range": RANGE}
        ctx.sensor.create_sensor(f"eyes {i}", kind, **args)
        speed = [None, inf, 0.0][i] if i < 3 else 20.0 + 3.7 * i
        node, name = 3 * i % (SIZE * SIZE), f"agent {i}"
        agents.append(
            ctx.agent.create_agent(
                name, start_node_id=node, speed=speed, sensors={"eyes": f"eyes {i}"}, team=i % 2, strategy=walk
            )
        )
    compared = 0
    for _ in range(4):
        ctx.game.step()
        moves = ctx.game.moves
        for time, name, xy, seen, others in looks:
            if time == 0.0:
                continue
            assert list(seen) == [one.name for one in agents if one.name in seen]  # in the order of their creation
            assert place(ctx, moves[name], time)[0] == pytest.approx(xy)
            for other, (at, node, is_on_node) in others.items():
                expected = place(ctx, moves[other], time)
                assert at == pytest.approx(expected[0], abs=1e-6)
                assert (node, is_on_node) == expected[1:]
                is_in_range = kind == SensorType.AGENT or dist(at, xy) <= RANGE
                assert (other in seen) == (is_in_range and other != name)
                assert seen.get(other, node) == node
                compared += 1
        looks.clear()
    assert compared > 150


def test_agents_that_are_asked_on_their_way_cover_speed_times_time():
    ctx, asked = town(), {}

    def walk(state):
        asked[state["name"]] = asked.get(state["name"], 0) + 1
        state["action"] = state["legal"][1]

    for i in range(6):
        ctx.agent.create_agent(f"agent {i}", start_node_id=4 * i, speed=33.0 + i, strategy=walk)
    for _ in range(3):
        ctx.game.step()
        for name, move in ctx.game.moves.items():
            lengths = [abs(leg.end - leg.begin) * ctx.graph.graph.get_edge(leg.edge).length for leg in move.legs]
            assert sum(lengths) == pytest.approx(33.0 + int(name[-1]), rel=1e-9)
    assert min(asked.values()) > 3


def test_a_plan_gets_the_states_of_the_agents_of_its_team_that_arrive():
    ctx, asked = town(), []

    def plan(states):
        asked.append((next(iter(states.values()))["time"], tuple(states)))
        for state in states.values():
            state["action"] = state["legal"][-1]

    for name, node, speed in (("ann", 0, 40.0), ("bob", 12, 9.0), ("cis", 24, 40.0)):
        ctx.agent.create_agent(name, start_node_id=node, speed=speed, team="red")
    ctx.game.command("red", plan)
    ctx.game.step()
    assert asked[0] == (0.0, ("ann", "bob", "cis"))
    assert len(asked) > 2
    assert all(0.0 < time < 1.0 and "bob" not in names for time, names in asked[1:])


def test_a_returning_agent_stops_and_decides_again_where_the_other_direction_is_closed():
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game={"speed_unit": "metres"})
    ctx.graph.add_nodes([0, 1], [0.0, 100.0], [0.0, 0.0])
    ctx.graph.add_edges([0, 1], [0, 1], [1, 0], [100.0, 100.0])

    def turn_round(state):
        state["action"] = 0 if state["turn"] == 2 else 1

    agent = ctx.agent.create_agent("a", start_node_id=0, speed=30.0, strategy=turn_round)
    ctx.game.run(3)
    assert agent.xy == (30.0, 0.0)
    ctx.game.decide = "arrival"
    ctx.graph.close_roads([1])
    ctx.game.run(2)
    assert agent.xy == (90.0, 0.0)
