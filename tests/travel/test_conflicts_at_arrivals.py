"""Conflicts where agents decide at arrivals are resolved when they arise; who loses stands where it was stopped."""

from collections import Counter

import pytest

import gamms
from gamms.errors import BadValue
from gamms.rules import Conflicts, by_priority

FIRST = by_priority(["a", "b"])


def road(*xs, conflicts, one_way=False):
    """A context with a straight road through these points of the x axis."""
    game = {"speed_unit": "metres", "decide": "arrival", "conflicts": conflicts}
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game=game)
    ctx.graph.add_nodes(range(len(xs)), xs, [0.0] * len(xs))
    ends = [(i, i + 1) for i in range(len(xs) - 1)]
    ends += [] if one_way else [(b, a) for a, b in ends]
    lengths = [abs(xs[a] - xs[b]) for a, b in ends]
    ctx.graph.add_edges(range(len(ends)), [a for a, _ in ends], [b for _, b in ends], lengths)
    return ctx


def agent(ctx, name, node, *actions, **more):
    """An agent that does these things, the last one for ever."""
    seen = []

    def strategy(state):
        seen.append((state["turn"], state["time"], state["curr_pos"], state["blocked"]))
        state["action"] = actions[min(len(seen), len(actions)) - 1]

    one = ctx.agent.create_agent(name, start_node_id=node, strategy=strategy, **more)
    one.seen = seen
    return one


def test_one_that_may_not_enter_an_edge_stands_at_the_end_of_the_one_it_came_by():
    ctx = road(0, 10, 30, 60, conflicts=Conflicts(None, edge_capacity=1))
    agent(ctx, "bert", 1, 2, 3, speed=8.0)  # on the edge from node 1 until turn 3
    anna = agent(ctx, "anna", 0, 3, speed=20.0)
    ctx.game.step()
    assert (anna.edge, anna.xy) == ((0, 1, 0), (pytest.approx(10.0), 0.0))
    assert anna.offset_m < 10.0
    ctx.game.step()
    assert anna.edge == (0, 1, 0)
    ctx.game.step()  # bert leaves the edge at 0.5
    ctx.game.step()
    assert anna.xy[0] == pytest.approx(30.0)
    why = "in conflict with other agents on the way to edge 1"
    asked = [(turn, round(time, 3), at) for turn, time, at, _ in anna.seen[:3]]
    assert asked == [(0, 0.0, 0), (0, 0.5, 1), (1, 0.0, 0)]
    assert [blocked for *_, blocked in anna.seen[:3]] == [None, None, why]


def test_one_that_stays_on_a_full_node_stands_just_before_it_and_enters_when_there_is_room():
    ctx = road(0, 10, 30, conflicts=Conflicts(1))
    agent(ctx, "bert", 1, None, None, 2, speed=8.0)
    anna = agent(ctx, "anna", 0, 1, speed=20.0)
    ctx.game.run(2)
    assert anna.xy == (pytest.approx(10.0), 0.0)
    assert anna.edge == (0, 1, 0)
    ctx.game.step()
    assert (anna.current_node_id, anna.edge) == (1, None)


def test_the_place_of_one_that_leaves_is_free_at_once():
    ctx = road(0, 10, 30, conflicts=Conflicts(1))
    agent(ctx, "bert", 1, 2, speed=8.0)
    anna = agent(ctx, "anna", 0, 1, 1, speed=20.0)
    ctx.game.step()
    assert (anna.current_node_id, anna.edge) == (1, None)


def test_a_full_node_may_be_passed():
    ctx = road(0, 10, 30, conflicts=Conflicts(1))
    agent(ctx, "bert", 1, None, speed=8.0)
    anna = agent(ctx, "anna", 0, 2, speed=20.0)
    ctx.game.step()
    assert (anna.edge, anna.xy[0]) == ((1, 2, 1), pytest.approx(20.0))


def test_of_those_that_arrive_at_one_time_the_resolver_chooses():
    ctx = road(0, 10, 20, conflicts=Conflicts(1, resolve=FIRST))
    bert = agent(ctx, "bert", 0, 1, speed=20.0, team="b")
    anna = agent(ctx, "anna", 2, 1, speed=20.0, team="a")
    ctx.game.step()
    assert (anna.current_node_id, anna.edge) == (1, None)
    assert bert.edge == (0, 1, 0)
    assert ctx.game.counts["bert"]["blocked"] == 1


def test_one_that_arrives_as_the_turn_ends_is_stopped_then():
    ctx = road(0, 10, 30, conflicts=Conflicts(1))
    agent(ctx, "bert", 1, None, speed=8.0)
    anna = agent(ctx, "anna", 0, 1, speed=10.0)
    ctx.game.run(2)
    assert anna.edge == (0, 1, 0)
    assert anna.seen[1][3] == "in conflict with other agents on the way to node 1"


def test_forbidden_exchanges_of_nodes_are_refused():
    ctx = road(0, 10, conflicts=Conflicts(1, allow_swaps=False))
    agent(ctx, "anna", 0, 1, speed=10.0)
    with pytest.raises(BadValue, match=r"allow_swaps=False\) counts nothing with ctx.game.decide = 'arrival'"):
        ctx.game.step()


def counted(ctx, time):
    """How many agents stand on each node and are on each edge at a time of the last turn, by their legs."""
    found = Counter()
    for move in ctx.game.moves.values():
        leg = next((leg for leg in move.legs if leg.since < time < leg.until), None)
        if leg is not None:
            found["edge", leg.edge] += 1
        else:
            (track,) = ctx.game.tracks([ctx.agent.get_agent(move.agent)])
            found["node", track.path[sum(when <= time for when in track.times) - 1]] += 1
    return found


@pytest.mark.parametrize("seed", range(8))
def test_no_place_ever_has_more_agents_than_it_takes(seed):
    on_node, on_edge = 1 + seed % 2, 1 + seed % 3
    conflicts = Conflicts(on_node, edge_capacity=on_edge)
    game = {"speed_unit": "metres", "decide": "arrival", "conflicts": conflicts}
    with gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"}, game=game) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 3))
        ctx.game.order = [[0], [1]] if seed >= 4 else None
        for i in range(10):
            speed, walk = [6.0, 13.7, 21.0, None][i % 4], gamms.strategies.random_walk
            ctx.agent.create_agent(f"a{i}", start_node_id=i, speed=speed, team=i % 2, strategy=walk)
        for _ in range(10):
            ctx.game.step()
            for k in range(20):
                for (kind, _), number in counted(ctx, (k + 0.4142) / 20).items():
                    assert number <= (on_node if kind == "node" else on_edge)
        assert on_node + on_edge > 3 or sum(one["blocked"] for one in ctx.game.counts.values()) > 0
