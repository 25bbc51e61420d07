"""Games of a batch in which other roads are closed: what forms get that ask for what differs, and for what does not."""

import numpy as np
import pytest
from batch_scenes import assert_as_alone, assert_as_shown, scene
from random_players import FirstOnly

import gamms
from gamms.errors import UnknownName
from gamms.game.movement.roads import DifferingRoads
from gamms.scenario import Scenario

SEEDS = [161, 162, 163, 163]


def dig(ctx):
    """Close some roads at random, others in each game, and open one of them later."""
    if ctx.game.turn % 3 == 1:
        draw, edges = ctx.stream("dig", ctx.game.turn), [*ctx.graph.graph.get_edges()]
        ctx.graph.close_roads([edges[int(draw.integers(len(edges)))] for _ in range(6)])
    if ctx.game.turn % 3 == 0 and ctx.graph.closed_roads:
        ctx.graph.open_roads(ctx.graph.closed_roads[1:2])


def check(scenario, strategies=None, rules=(dig,), phase="after", closed=(), turns=0, seeds=SEEDS, *, stays=False):
    """Check that games in which other roads are closed are those that are played alone.

    The first of the rules is one of the phase; the games begin after some turns, with closed edges. `stays` says
    whether the core plays all of them.
    """
    with scenario.build(seed=1, strategies=strategies) as ctx:
        ctx.graph.close_roads(closed)
        for rule in rules:
            ctx.game.add(rule, phase=phase if rule is rules[0] else "after")
        for _ in range(turns):
            ctx.game.step()
        with ctx.game.batch(seeds=seeds) as games, ctx.game.fork(0).ctx as alone:
            while not games.is_over.all():
                games.step()
            assert_as_alone(games, alone)
            assert games.is_in_arrays or not stays
            return [games.result(number) for number in range(len(seeds))]


def count_legal(view):
    """Go to the last legal node, or one that is drawn, by how many there are next to others in sight."""
    near = view.seen_nodes("next").mask.sum(axis=-1)
    far = view.routes().distances(view.node, np.full_like(view.node, 12))
    return (view.draw.below(view.counts) * (near % 3 > 0) + np.minimum(far, 1).astype(np.int64)) % view.counts


@gamms.array_rule
def audit(turn):
    """Note what an array rule finds of the events and the roads of its games."""
    for new in turn.new_events("audit"):
        turn.add_score(f"new {new.kind}", new.games, 1)
    turn.add_score("legal", np.arange(len(turn.games)), turn.streets.counts[turn.node].sum(axis=1).astype(float))


@pytest.mark.parametrize(
    ("settings", "phase"), [({}, "before"), ({"order": [["blue"], ["red"]]}, "after"), ({"legal": "any"}, "before")]
)
@pytest.mark.parametrize(
    "red",
    [
        "gamms.strategies:random_walk",
        {"function": "gamms.strategies:patrol", "with": {"nodes": [0, 12, 20]}},
        {"function": "gamms.strategies:random_waypoints", "with": {"pause": 1}},
        "gamms.strategies:chase",
        "gamms.strategies:flee",
        gamms.array_strategy(count_legal),
        lambda state: state.update(action=state["legal"][state["turn"] % len(state["legal"])]),
    ],
)
def test_games_in_which_a_rule_closes_roads_stay_in_the_core(red, settings, phase):
    kinds = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}, "next": {"type": "NEIGHBOR"}}
    team = {"count": 3, "sensors": ["near", "next"]}
    is_called = callable(red)
    blue = "gamms.strategies:random_walk" if is_called or "legal" in settings else "gamms.strategies:chase"
    teams = {"red": team if is_called else team | {"strategy": red}, "blue": team | {"strategy": blue}}
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "respawn"}}
    scenario = scene([tag], teams=teams, sensors=kinds, settings=settings, conflicts={"capacity": 1}, max_turns=12)
    rules = (dig, *([audit] if is_called and "order" not in settings else []))
    check(scenario, {"red": red} if is_called else None, rules=rules, phase=phase, closed=[3, 9], stays=True)


def undermine(ctx):
    """Close or remove the edge that an agent is on, or its next one, and open what was closed."""
    draw, graph = ctx.stream("undermine", ctx.game.turn), ctx.graph
    on = [agent.edge[2] for agent in ctx.game.agents if agent.edge is not None]
    edges = on or [*graph.graph.get_edges()]
    chosen = edges[int(draw.integers(len(edges)))]
    if draw.random() < 0.2:
        graph.graph.remove_edge(chosen)
    else:
        graph.close_roads([chosen])
    if draw.random() < 0.5:
        graph.open_roads(graph.closed_roads[::2])


@pytest.mark.parametrize(
    ("phase", "settings"),
    [
        ("before", {"speed_unit": "metres"}),
        ("deeds", {"speed_unit": "metres", "decide": "arrival"}),
        ("before", {"order": [["red"], ["blue"]]}),
    ],
)
def test_actions_are_given_on_the_roads_that_are_open_in_each_game(phase, settings):
    speed = {"speed": 7.0 if settings.get("speed_unit") else 2.5}
    teams = {name: {"count": 2, "strategy": "gamms.strategies:random_walk", **speed} for name in ("red", "blue")}
    with scene(teams=teams, settings={**settings, "on_illegal": "stay"}).build(seed=1) as ctx:
        ctx.game.add(undermine, phase=phase)
        with ctx.game.batch(seeds=range(6)) as games:
            shown = games.context(3)
            while not games.is_over.all():
                view = games.observe("red")
                legal = [shown.game.observation(name)["legal"] for name in ("red_0", "red_1")]
                counts = view.counts[3].tolist()
                assert [view["legal"][3, i, :count].tolist() for i, count in enumerate(counts)] == list(
                    map(list, legal)
                )
                games.step({"red": (view.turn[:, None] * 5) % view.counts}, on_illegal="stay")
            assert_as_shown(games)
            assert games.is_in_arrays


def test_agents_are_stopped_once_whose_roads_deeds_have_closed_and_who_give_way():
    with scene(side=3, settings={"speed_unit": "metres"}).build(seed=1) as ctx:
        ctx.game.conflicts = FirstOnly()
        ctx.game.add(dig, phase="deeds")
        with ctx.game.batch(seeds=SEEDS) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)


def test_an_observer_asks_for_routes_of_games_with_the_same_roads():
    with scene().build(seed=1) as ctx:
        ctx.game.add(dig)
        with ctx.game.batch(seeds=SEEDS) as games:
            for _ in range(3):
                games.step()
            view = games.observe("red")
            with pytest.raises(DifferingRoads, match=r"view\.in_games"):
                view.routes().distances(view.node, view.node[:, ::-1])
            with pytest.raises(DifferingRoads, match=r"streets\.counts differs"):
                _ = view.streets.counts
            for places in ([0], [1], [2, 3]):
                part = view.in_games(np.array(places))
                assert part.routes().distances(part.node, part.node[:, ::-1]).shape == part.node.shape


@pytest.mark.parametrize(("edges", "is_open"), [([999], False), ([5], True)])
def test_roads_that_are_not_there_are_refused(edges, is_open):
    def wrong(ctx):
        (ctx.graph.open_roads if is_open else ctx.graph.close_roads)(edges)

    with scene().build(seed=1) as ctx:
        ctx.game.add(wrong)
        with ctx.game.batch(2) as games, pytest.raises(UnknownName, match=str(edges[-1])):
            games.run()


def test_a_deed_names_an_edge_that_is_open_in_its_game():
    def change(ctx):
        if ctx.game.turn == 1:
            (ctx.graph.open_roads if ctx.seed == 1 else ctx.graph.close_roads)([2 - ctx.seed])

    deeds = {"deeds": {"mark": {"road": "edge"}}}
    teams = {"red": {"count": 1, "strategy": "gamms.strategies:stay"}}
    scenario = Scenario(map={"grid": {"width": 3, "height": 3}}, teams=teams, settings=deeds)
    with scenario.build(seed=1) as ctx:
        ctx.graph.close_roads([1])
        ctx.game.add(change)
        games = ctx.game.batch(seeds=[1, 2])

        def mark(*roads):
            games.step({"red": {"deeds": {"mark": (True, {"road": np.array(roads)[:, None]})}}})

        def refuses(*roads):
            with pytest.raises(UnknownName, match="edge as 'road' of the deed 'mark'"):
                mark(*roads)
            return True

        assert refuses(2, 1)
        mark(2, 2)
        assert refuses(2, 0)
        mark(1, 2)
        assert [[deed["road"] for deed in games.result(game).deeds] for game in (0, 1)] == [[2, 1], [2, 2]]
        assert not games.detached


def test_a_form_names_an_edge_that_is_open_in_its_game():
    def close(ctx):
        if ctx.seed == 2 and ctx.game.turn == 1:
            ctx.graph.close_roads([0])

    @gamms.array_strategy
    def mark(view):
        view.do("mark", True, road=0)
        return view.node * 0

    deeds = {"deeds": {"mark": {"road": "edge"}}}
    teams = {"red": {"count": 1}}
    scenario = Scenario(map={"grid": {"width": 3, "height": 3}}, teams=teams, settings=deeds)
    with scenario.build(seed=2, strategies={"red": mark}) as ctx:
        ctx.game.add(close)
        games = ctx.game.batch(seeds=[1, 2])
        for play in (games.step, ctx.game.step):
            play()
            with pytest.raises(UnknownName, match="Unknown edge as 'road' of the deed 'mark': 0"):
                play()


def test_an_array_rule_that_closes_a_road_that_is_not_there_is_refused():
    @gamms.array_rule
    def wrong(turn):
        turn.close_roads([0, 1], [999])

    with scene().build(seed=1) as ctx:
        ctx.game.add(wrong)
        with ctx.game.batch(2) as games, pytest.raises(UnknownName, match="999"):
            games.run()
