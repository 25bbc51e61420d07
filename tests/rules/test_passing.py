"""Meeting on the way: when and where agents meet within a turn, by hand and against a tiny simulator."""

from fractions import Fraction
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.agent import AgentType
from gamms.rules import capture_flag, contacts, tag
from gamms.strategies import goto


def open_road(*agents, nodes=10, unit="edges"):
    """A game on a road of nodes ten metres apart: agents `(name, team, start, speed, target)`."""
    ctx = gamms.create_context(seed=5, logger_config={"level": "CRITICAL"}, game={"speed_unit": unit})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(1, nodes))
    for name, team, start, speed, target in agents:
        ctx.agent.create_agent(name, start_node_id=start, team=team, speed=speed, strategy=goto(ctx, target))
    return ctx


def met(ctx, a="red", b="blue", **more):
    """Who meets whom after one more turn: name, name, time, where the one was and where the other."""
    ctx.game.step()
    return [(one.a, one.b, one.time, one.a_node, one.b_node) for one in contacts(ctx, a, b, **more)]


# -- by hand ----------------------------------------------------------------------------------------------------


def test_draws_decide_who_is_met_of_those_that_are_met_at_once():
    firsts = set()
    for seed in range(20):
        ctx = open_road(("r", "red", 0, 2, 2), ("b", "blue", 1, None, 1), ("c", "blue", 1, None, 1))
        ctx.reseed(seed)
        firsts.add(met(ctx)[0][1])
    assert firsts == {"b", "c"}


def test_who_was_put_elsewhere_is_there_at_the_end_of_the_turn():
    ctx = open_road(("r", "red", 0, 4, 4), ("b", "blue", 2, None, 2), ("c", "blue", 0, None, 0))
    ctx.game.step()
    ctx.game.respawn("r")
    assert [(one.b, one.time) for one in contacts(ctx, "red", "blue")] == [("c", 1.0)]


@pytest.mark.parametrize(("unit", "speed"), [("edges", 4), ("metres", 40.0)])
@pytest.mark.parametrize("place", ["respawn", "node", "snapshot"])
def test_an_agent_that_is_put_where_its_own_path_ends_has_not_come_there_by_it(unit, speed, place):
    ctx = open_road(("r", "red", 0, speed, 4), ("b", "blue", 2, None, 2), ("c", "blue", 0, None, 0), unit=unit)
    ctx.agent.get_agent("r").strategy = lambda state: state.update(action=[0, 1, 2, 1, 0])
    ctx.game.step()
    assert [one.time for one in contacts(ctx, "red", "blue")] == [0.5, 1.0]
    if place == "node":
        ctx.agent.get_agent("r").current_node_id = 0
    else:
        ctx.game.respawn("r")
    if place == "snapshot":
        here = ctx.game.snapshot()
        ctx.game.step()
        ctx.game.restore(here)
    assert [(one.b, one.time) for one in contacts(ctx, "red", "blue")] == [("c", 1.0)]
    assert [(one.b, one.time) for one in contacts(ctx.game.fork(5).ctx, "red", "blue")] == [("c", 1.0)]
    assert [one[2] for one in met(ctx)] == [0.5, 1.0]  # until it moves again


def test_a_flyer_that_is_put_where_it_flew_to_has_not_gone_along_an_edge():
    ctx = open_road(("r", "red", 1, None, 0))
    ctx.agent.create_agent("b", type=AgentType.AERIAL, team="blue", start_node_id=0, speed=10.0)
    ctx.agent.get_agent("b").strategy = lambda state: state.update(action=(10.0, 0.0, 0.0))
    ctx.game.step()
    ctx.agent.get_agent("b").position = ctx.agent.get_agent("b").position
    assert contacts(ctx, "red", "blue", air=True) == []


@pytest.mark.parametrize("unit", ["edges", "metres"])
def test_a_runner_that_is_tagged_on_its_way_home_captures_no_flag_in_that_turn(unit):
    ctx = open_road(
        ("runner", "red", 0, {"edges": 4, "metres": 40.0}[unit], 9), ("guard", "blue", 1, None, 1), unit=unit
    )
    ctx.agent.get_agent("runner").strategy = lambda state: state.update(action=[0, 1, 2, 1, 0])
    ctx.game.add(tag("blue", "red"))
    ctx.game.add(capture_flag({"blue": 2, "red": 0}))
    assert [event["kind"] for event in ctx.game.run(1).events] == ["tag", "respawned"]


@pytest.mark.parametrize("mover", ["red", "blue"])
def test_an_agent_that_a_deed_puts_where_its_part_of_the_turn_ended_has_met_no_agent_on_its_way(mover):
    ctx = open_road(("r", "red", 0, 4, 9), ("b", "blue", 2, None, 2))
    ctx.agent.get_agent("r").strategy = lambda state: state.update(action=[0, 1, 2, 1, 0])
    ctx.game.order = [["red"], ["blue"]]
    parts = iter(["red", "blue"])

    def put(ctx):
        if next(parts) == mover:
            ctx.game.respawn("r")

    ctx.game.add(put, phase="deeds")
    ctx.game.step()
    assert bool(contacts(ctx, "red", "blue")) is (mover == "red")  # before it moves it is put where it begins


def test_with_a_distance_agents_are_compared_when_one_reaches_a_node():
    ctx = open_road(("r", "red", 0, 4, 8), ("b", "blue", 5, None, 6))
    assert met(ctx, hops=2) == [("r", "b", 0.75, 3, 5)]  # the other counts as on 5 until it is on 6
    ctx = open_road(("r", "red", 0, 2, 2), ("b", "blue", 3, None, 3), ("near", "blue", 1, None, 2))
    assert met(ctx, euclid=10.0) == [("r", "near", 0.5, 1, 1), ("r", "b", 1.0, 2, 3)]
    ctx = open_road(("r", "red", 5, None, 5), ("b", "blue", 3, None, 3), ("c", "blue", 2, None, 4))
    assert [one[:3] for one in met(ctx, metres=20)] == [("r", "b", 0.0), ("r", "c", 1.0)]  # earlier, if farther away


def test_an_endless_speed_takes_the_whole_turn():
    for unit in ("edges", "metres"):
        assert met(open_road(("r", "red", 0, inf, 4), ("b", "blue", 1, None, 1), unit=unit)) == [("r", "b", 0.25, 1, 1)]


# -- against a simulator; for games by metres see tests/travel --------------------------------------------------


class Walker:
    """An agent that walks along routes, in exact numbers."""

    def __init__(self, node, speed):
        self.node, self.speed, self.begun = node, speed, (None, Fraction(0))

    def go(self, route):
        """Walk for one turn; `places[time]` are then the nodes and edges it is at."""
        ahead, covered = self.begun
        done = covered if route and route[0] == ahead else Fraction(0)
        budget, path, far = self.speed + done, [self.node], [Fraction(0)]
        while len(path) <= len(route) and far[-1] + 1 <= budget:
            far.append(far[-1] + 1)
            path.append(route[len(path) - 1])
        more = route[len(path) - 1 :]
        self.begun = (more[0], budget - far[-1]) if more else (None, Fraction(0))
        self.path, self.node = path, path[-1]
        self.times = [Fraction(k, max(1, len(path) - 1)) for k in range(len(path))]

    def places(self, now):
        """The nodes and edges it is at, at a moment."""
        found = {
            ("edge", *self.path[k : k + 2])
            for k in range(len(self.path) - 1)
            if self.times[k] <= now <= self.times[k + 1]
        }
        found |= {("node", node) for node, time in list(zip(self.path, self.times, strict=True))[1:] if time == now}
        if now >= self.times[-1] and (len(self.path) == 1 or now > 0):
            found.add(("node", self.path[-1]))
        return found

    def passed(self, now):
        """The node that it has reached last."""
        return [node for node, time in zip(self.path, self.times, strict=True) if time <= now][-1]


def first_meeting(one, other):
    """The first moment, and where the one and the other are then; None if they do not meet."""
    for now in sorted({*one.times, *other.times}):
        here, there = one.places(now), other.places(now)
        nodes = [place[1] for place in here & there if place[0] == "node"]
        if nodes:
            return now, nodes[0], nodes[0]
        edges = [place for place in here if place[0] == "edge" and ("edge", place[2], place[1]) in there]
        if edges:
            return now, edges[0][1], edges[0][2]
    return None


def first_nearness(one, other, hops, limit):
    """The same within so many edges."""
    moments = {*one.times[1:], *other.times[1:]} or {Fraction(0)}
    for now in sorted(moments):
        a, b = one.passed(now), other.passed(now)
        if min(hops[a][b], hops[b][a]) <= limit:
            return now, a, b
    return None


@st.composite
def games(draw):
    """A small graph of one-way edges with lengths, and agents that walk along routes on it."""
    size = draw(st.integers(2, 6))
    pairs = [(a, b) for a in range(size) for b in range(size) if a != b]
    edges = draw(st.lists(st.sampled_from(pairs), min_size=2, max_size=14, unique=True))
    edges += [(b, a) for a, b in edges if (b, a) not in edges and draw(st.booleans())]
    lengths = {edge: Fraction(draw(st.sampled_from([1, 2, 3, 5])), 2) for edge in edges}
    speeds = [Fraction(1, 2), Fraction(1), Fraction(3, 2), Fraction(2), Fraction(3)]

    def route(node):
        ways = []
        for _ in range(draw(st.integers(0, 5))):
            onward = [b for a, b in edges if a == node]
            if not onward:
                break
            ways.append(node := draw(st.sampled_from(onward)))
        return ways

    agents = [(draw(st.integers(0, size - 1)), draw(st.sampled_from(speeds))) for _ in range(draw(st.integers(2, 5)))]
    return size, lengths, agents, route


@given(game=games(), hops=st.sampled_from([None, None, 0, 1, 2]))
def test_contacts_and_tags_are_those_of_a_simulator(game, hops):
    size, lengths, agents, route = game
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.add_nodes(range(size), range(size), [0] * size)
        ends = list(zip(*lengths, strict=True))
        ctx.graph.add_edges(range(len(lengths)), *ends, list(map(float, lengths.values())))
        hops_of = [[ctx.graph.graph.distance(a, b, None) for b in range(size)] for a in range(size)]
        walkers, routes = {}, {}
        for i, (node, speed) in enumerate(agents):
            name = f"{'rb'[i % 2]}{i}"
            ctx.agent.create_agent(
                name,
                start_node_id=node,
                team="red" if i % 2 == 0 else "blue",
                speed=float(speed),
                strategy=lambda state: state.update(action=routes[state["name"]]),
            )
            walkers[name] = Walker(node, speed)
        ctx.game.add(tag("red", "blue", hops=hops, then=lambda *_: None))
        for _ in range(3):
            routes.update({name: route(walker.node) for name, walker in walkers.items()})
            for name, walker in walkers.items():
                walker.go(routes[name])
            ctx.game.step()
            assert {name: list(move.path) for name, move in ctx.game.moves.items()} == {
                name: walker.path for name, walker in walkers.items()
            }
            expected = {}
            for a in (name for name in walkers if name[0] == "r"):
                for b in (name for name in walkers if name[0] == "b"):
                    pair = walkers[a], walkers[b]
                    meeting = first_meeting(*pair) if hops is None else first_nearness(*pair, hops_of, hops)
                    if meeting:
                        expected[a, b] = (round(float(meeting[0]), 9), *meeting[1:])
            found = contacts(ctx, "red", "blue", hops=hops)
            assert {one[:2]: (round(one.time, 9), one.a_node, one.b_node) for one in found} == expected
            assert [one.time for one in found] == sorted(one.time for one in found)
            tags = {
                (one["agent"], one["other"]): one["node"] for one in ctx.game.events if one["turn"] == ctx.game.turn
            }
            assert all(expected[pair][2] == node for pair, node in tags.items())
            busy_since = {name: expected[pair][0] for pair in tags for name in pair}
            assert len(busy_since) == 2 * len(tags)
            for (a, b), (time, *_) in expected.items():  # each is tagged, or one of the two had met another before
                assert min(busy_since.get(a, inf), busy_since.get(b, inf)) <= time
