"""Batches of which every part is in the core: with any number of threads, loaded, stopped and refused."""

import json
import re
import signal
from pathlib import Path

import pytest
from batch_scenes import WALK, assert_as_alone, assert_as_played, by_another_plan, plain, scene

import gamms
from gamms import strategies
from gamms.errors import BadType, BadValue, TooLarge, UnknownName
from gamms.game import batch_engine
from gamms.game.block.columns import play_in_threads
from gamms.game.plan import find_first_called
from gamms.game.strategy_specs import get_strategy_spec
from gamms.rules.in_core import FORMS


def remember_blocked(state):
    """Go to the first legal node by why the last action was not done."""
    known = state["memory"].setdefault("blocked", [])
    known.append(state["blocked"])
    state["action"] = state["legal"][len("".join(filter(None, known))) % len(state["legal"])]


def text_of(games):
    """Return all that is told of the games of a batch, as text: the order of its entries counts, too."""
    results = [games.result(number).to_dict() for number in range(len(games))]
    for one in results:
        del one["timings"], one["provenance"]["scenario"]
    table = {name: column.tolist() for name, column in games.table().items() if name[:6] != "score."}
    scores = {str(key): [numbers.tolist(), str(numbers.dtype)] for key, numbers in games.scores.items() if any(numbers)}
    told = [results, table, dict(sorted(scores.items())), games.turn.tolist(), games.is_over.tolist()]
    return json.dumps(told, default=str)


def names_in_docs(parts):
    """Return the names in the list of parts that docs/batches.md says are in the core."""
    page = (Path(__file__).parents[2] / "docs" / "batches.md").read_text(encoding="utf-8")
    listed = page.partition("## What the compiled core plays")[2].partition(f"* **{parts}**")[2]
    return set(re.findall(r"`(\w+)`", re.split(r"\n(?!  )", listed)[0]))


def test_the_docs_name_the_strategies_and_rules_that_are_in_the_core():
    with scene().build() as ctx:
        made = {
            **{name: getattr(strategies, name) for name in ("stay", "random_walk", "human", "unblock")},
            **{name: getattr(strategies, name)(ctx) for name in ("assign", "chase", "flee", "follow_belief")},
            **{name: getattr(strategies, name)(ctx) for name in ("intercept", "random_waypoints", "sweep")},
            **{name: getattr(strategies, name)(ctx, [3]) for name in ("follow_path", "patrol", "safest_exit")},
            "mix": strategies.mix(0.5, strategies.chase(ctx), strategies.stay),
            "first": strategies.first(strategies.chase(ctx, None), strategies.stay),
            "goto": strategies.goto(ctx, 3),
            "guard": strategies.guard(ctx, 3, 10.0),
            "pool": strategies.pool([strategies.chase, strategies.stay])(ctx),
        }
    assert {*made} == {*strategies.__all__}
    assert names_in_docs("strategies") == {name for name, one in made.items() if get_strategy_spec(one).core_steps}
    assert names_in_docs("rules") == set(FORMS)


ROAM = "gamms.strategies:random_waypoints"
GRID = scene([{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}])
BY_METRES = GRID.replace(
    teams={
        "red": {"count": 3, "strategy": WALK, "speed": 7.0},
        "blue": {"count": 3, "strategy": ROAM, "speed": 12.5},
    },
    settings={"speed_unit": "metres"},
)
BY_SPEED = GRID.replace(
    teams={"red": {"count": 3, "strategy": WALK, "speed": 2}, "blue": {"count": 3, "strategy": ROAM, "speed": 1.3}}
)
EVERY_RULE = [
    {"rule": "gamms.rules.territory:published", "with": {"nodes": {0: "red", 24: "blue"}}},
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate", "territory": "territory"}},
    {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}}},
    {"rule": "reach", "with": {"team": "red", "nodes": 12}},
    {"rule": "reach", "with": {"team": "blue", "nodes": "starts of red"}},
    {"rule": "arrive", "with": {"team": "blue", "nodes": [3, 4]}},
    {"rule": "respawn", "with": {"teams": "blue"}},
    {"rule": "none_left", "with": {"team": "red"}},
    "last_team",
    {"rule": "time_limit", "with": {"turns": 9}},
]


@pytest.mark.parametrize("scenario", [GRID, BY_SPEED, BY_METRES], ids=["edges", "speed", "metres"])
def test_games_of_all_rules_in_the_docs_are_in_the_core(scenario):
    with scenario.replace(rules=EVERY_RULE, conflicts={"capacity": 2}).batch(2) as games:
        assert games.is_in_arrays
        games.run()
        assert games.detached == {}


@pytest.mark.parametrize("threads", [1, 2, 3, 5, 64])
@pytest.mark.parametrize("scenario", [GRID, BY_SPEED, BY_METRES], ids=["edges", "speed", "metres"])
def test_any_number_of_threads_plays_the_same_games(scenario, threads):
    with scenario.batch(5) as games, scenario.batch(5) as others:
        games.run(threads=threads)
        others.run()
        assert text_of(games) == text_of(others)


@pytest.mark.parametrize("threads", [0, -1, 1.5, "2", None, True])
def test_threads_are_a_number_from_1(threads):
    with GRID.batch(2) as games, pytest.raises((BadType, BadValue), match="threads"):
        games.run(threads=threads)


def test_games_that_are_elsewhere_are_played_with_threads_too():
    with by_another_plan(GRID).batch(2) as games, GRID.batch(2) as others:
        games.run(threads=2)
        others.run()
        assert plain(games.result(1)) == plain(others.result(1))


def test_a_deed_that_is_not_declared_is_refused():
    with GRID.batch(2) as games, pytest.raises(UnknownName, match="scan"):
        games.step({"red": {"deeds": {"scan": True}}})


@pytest.mark.parametrize("by", [None, remember_blocked], ids=["core", "function"])
def test_agents_on_an_edge_that_was_closed_go_on_from_its_first_node(by):
    with BY_METRES.build(seed=4) as ctx:
        ctx.game.step()
        on = next(agent for agent in ctx.game.agents if agent.edge is not None)
        ctx.graph.close_roads([on.edge[2]])
        on.strategy = by or on.strategy
        with ctx.game.batch(2, seed=2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.is_in_arrays
            assert_as_alone(games, alone)


def test_a_game_from_whose_map_the_node_of_an_agent_was_removed_cannot_go_on_in_a_batch():
    with GRID.build(seed=4) as ctx:
        for _ in range(3):
            ctx.game.step()
        starts = {ctx.game.start_node(one) for one in ctx.game.agents}
        passed = next(one.prev_node_id for one in ctx.game.agents if one.prev_node_id not in starts)
        ctx.graph.graph.remove_node(passed)
        with pytest.raises(BadValue, match=f"Node {passed}, where agent"):
            ctx.game.batch(1)


def test_an_error_in_a_later_part_of_a_turn_takes_back_the_moves_before_it():
    raises = [False]

    @gamms.array_strategy
    def watch(view):
        if raises[0]:
            raise ValueError("too late")
        return view.node * 0

    @gamms.array_strategy
    def go(view):
        return view.counts - 1

    scenario = GRID.replace(settings={"order": [["red"], ["blue"]]}, rules=[])
    with scenario.batch(3, strategies={"red": go, "blue": watch}) as games:
        games.step()
        before = games.observe("red").node
        raises[0] = True
        with pytest.raises(ValueError, match="too late"):
            games.step()
        assert games.is_in_arrays
        assert games.turn.tolist() == [1, 1, 1]
        assert (games.observe("red").node == before).all()
        raises[0] = False
        games.step()
        assert games.turn.tolist() == [2, 2, 2]


@pytest.mark.parametrize("scenario", [GRID, BY_METRES, GRID.replace(channels={"radio": {"range_m": 9.0}})])
@pytest.mark.parametrize("by_steps", [False, True])
@pytest.mark.parametrize("threads", [1, 2])
def test_games_go_on_where_ctrl_c_has_stopped_them(scenario, by_steps, threads, monkeypatch):
    """Ctrl-C is pressed when the core begins to play, in turns that are taken for long ones."""
    pressed = []

    def press(*args, **options):
        if len(pressed) < 3 and options["waits"]:
            pressed.append(games.turn.tolist())
            signal.raise_signal(signal.SIGINT)
        play_in_threads(*args, **options)

    monkeypatch.setattr(batch_engine, "play_in_threads", press)
    monkeypatch.setattr(batch_engine, "_LONG_S", 0.0)
    with scenario.batch(3) as games, scenario.batch(3) as others:
        for _ in range(3):
            with pytest.raises(KeyboardInterrupt):
                games.step(threads=threads) if by_steps else games.run(threads=threads)
            assert games.turn.tolist() == pressed[-1]
        others.run()
        games.run()
        assert text_of(games) == text_of(others)


def test_a_handler_of_ctrl_c_that_does_not_raise_lets_the_turn_be_played(monkeypatch):
    came = []
    before = signal.signal(signal.SIGINT, lambda *_: came.append(1))

    def press(*args, **options):
        if not came:
            signal.raise_signal(signal.SIGINT)
        play_in_threads(*args, **options)

    monkeypatch.setattr(batch_engine, "play_in_threads", press)
    try:
        with GRID.batch(3) as games:
            games.step()
            assert games.turn.tolist() == [1, 1, 1]
    finally:
        signal.signal(signal.SIGINT, before)
    assert came == [1]


def test_ctrl_c_stops_a_long_turn_of_plain_strategies():
    asked = []

    def walk(state):
        asked.append(state["name"])
        if len(asked) == 7:
            signal.raise_signal(signal.SIGINT)
        state["action"] = state["legal"][0]

    with GRID.batch(40, strategies={"red": walk}) as games, pytest.raises(KeyboardInterrupt):
        games.step()
    assert len(asked) < 12
    assert set(games.turn.tolist()) == {0}


@pytest.mark.parametrize("number", [-2, 6, 10**9, -(2**63)])
def test_numbers_of_agents_that_are_loaded_are_those_of_agents(number):
    rule = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}}
    with GRID.replace(rules=[rule]).batch(2) as games:
        games.step()
        columns = games.columns()
        carriers = columns[("capture_flag", "flags"), "carriers"]
        carriers[:] = 5
        games.load(columns, 1)
        games.step()
        carriers[1, 0] = number
        games.load(columns, 1)
        with pytest.raises(BadValue, match="from -1 to 5"):
            games.step()


@pytest.mark.parametrize("number", [-2, 25, 10**9, -(2**63)])
def test_waypoints_that_are_loaded_are_nodes(number):
    with BY_METRES.batch(2) as games:
        games.step()
        columns = games.columns()
        columns[("memory", "random_waypoints"), "target"][1, 2] = number
        games.load(columns, 1)
        with pytest.raises(BadValue, match="from -1 to 24"):
            games.step()


def test_strategies_by_metres_of_which_illegal_actions_are_raised_are_asked_game_by_game():
    scenario = BY_METRES.replace(**{"settings.on_illegal": "raise"})
    with BY_METRES.batch(2) as games, scenario.batch(2) as others:
        assert find_first_called(games.game, games.roster) is None
        assert others.is_in_arrays
        assert "random_waypoints" in find_first_called(others.game, others.roster)
        others.run()
        assert plain(others.result(1)) == plain(scenario.play(seed=1))


def test_what_agents_remember_is_checked_when_it_was_loaded():
    patrol = {"function": "gamms.strategies:patrol", "with": {"nodes": [3, 4]}}
    scenario = scene(teams={"red": {"count": 2, "strategy": patrol}})
    with scenario.batch(2) as games:
        games.step()
        columns = games.columns()
        next(values for name, values in columns.items() if "memory" in str(name))[1, 0] = 3
        games.load(columns, 1)
        with pytest.raises(BadValue, match="remember numbers from -1 to 2"):
            games.step()


def test_agents_by_metres_stay_on_a_map_without_edges():
    with gamms.create_context(game={"max_turns": 5}) as ctx:
        for number in range(3):
            ctx.graph.graph.add_node({"id": number, "x": number, "y": 0})
            ctx.agent.create_agent(f"a{number}", start_node_id=number, team="red", strategy=strategies.random_walk)
        ctx.game.speed_unit = "metres"
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            assert games.is_in_arrays
            games.run()
            assert [one["moves"] for one in games.result(1).agents.values()] == [0, 0, 0]
            assert_as_alone(games, alone)


@pytest.mark.parametrize("unit", ["edges", "metres", "metres_per_second"])
def test_views_have_all_their_values_on_a_map_without_edges(unit):
    with gamms.create_context(seed=1, game={"speed_unit": unit}) as ctx:
        ctx.graph.add_nodes([0, 1], [0.0, 10.0], [0.0, 0.0])
        eyes = ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=100)
        for node, team in enumerate(("red", "blue")):
            speed = None if unit == "edges" else 3.0
            options = {"start_node_id": node, "team": team, "sensors": [eyes], "speed": speed}
            ctx.agent.create_agent(team, strategy=strategies.stay, **options)
        with ctx.game.batch(2) as games:
            for _ in range(2):
                view = games.observe("red")
                assert view["xy"].tolist() == [[[0.0, 0.0]]] * 2
                assert view["edge"].tolist() == [[[-1, -1, -1]]] * 2
                assert view["offset_m"].tolist() == [[0.0]] * 2
                assert view.vector().values.shape[:2] == (2, 1)
                assert view.enemies().nodes.tolist() == [1, 1]
                games.step()


@pytest.mark.parametrize("unit", ["edges", "metres"])
def test_ways_that_do_not_fit_into_memory_are_refused_by_the_core(unit):
    scenario = BY_METRES.replace(**{"settings.speed_unit": unit, "teams.red.speed": 1e9})
    with scenario.build() as ctx, gamms.limits.allowing("40K"), pytest.raises(TooLarge, match="may go along"):
        ctx.game.batch(2)


def test_an_agent_may_go_to_and_fro_on_a_short_edge_in_a_turn():
    def shuttle(state):
        """Go along an edge and back again as often as the turn lasts."""
        here, *near = state["legal"]
        state["action"] = [near[0], here] * 20 if near and state["edge"] is None else None

    teams = {"red": {"count": 2, "speed": 100.0}}
    scenario = scene(teams=teams, settings={"speed_unit": "metres"}, max_turns=4)
    with scenario.batch(3, strategies={"red": shuttle}) as games:
        games.run()
        assert_as_played(games, scenario, {"red": shuttle})


@pytest.mark.parametrize("length", [1.0, 50.0])
def test_an_agent_may_repeat_edges_that_are_shorter_than_others(length):
    def shuttle(state):
        here = state["curr_pos"]
        state["action"] = [1 - here, here] * 30 if here < 2 and state["edge"] is None else None

    with gamms.create_context(game={"max_turns": 3, "speed_unit": "metres"}) as ctx:
        ctx.graph.add_nodes(range(6), [0.0, length, *range(100, 500, 100)], [0.0] * 6)
        ends = [(0, 1), (1, 0), *((one, one + 1) for one in range(1, 5))]
        lengths = [length, length, 100.0, 100.0, 100.0, 100.0]
        ctx.graph.add_edges(range(6), *zip(*ends, strict=True), lengths)
        ctx.agent.create_agent("ann", start_node_id=0, team="red", speed=40.0, strategy=shuttle)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            if length < 10.0:
                with pytest.raises(
                    BadValue, match=r"'ann' chooses a route that repeats an edge.*go it in several turns"
                ):
                    games.run()
                return
            games.run()
            assert_as_alone(games, alone)


def test_agents_with_speeds_are_told_which_node_they_wanted_to_reach():
    def meet(state):
        state["memory"].setdefault("blocked", []).append(state["blocked"])
        state["action"] = 1

    def tell(ctx):
        for name, memory in ctx.game.memories.items():
            ctx.game.emit("told", agent=name, why=memory["blocked"][-1])

    teams = {"red": {"agents": [{"name": name, "node": node} for name, node in (("ann", 0), ("ben", 2))], "speed": 2}}
    scenario = scene(teams=teams, conflicts={"capacity": 1}, max_turns=2)
    with scenario.build(seed=1, strategies={"red": meet}) as ctx:
        ctx.game.add(tell)
        ctx.game.run()
        told = {event["why"] for event in ctx.game.events if event["turn"] == 2}
    assert told == {None, "in conflict with other agents on the way to node 1"}
