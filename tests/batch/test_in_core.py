"""Batches of which every part is in the core: the same games as one by one and alone, with any number of threads."""

import json
import re
from pathlib import Path
from random import Random

import numpy as np
import pytest
from batch_scenes import WALK, beyond_core, plain, scene

import gamms
from gamms import strategies
from gamms.errors import BadType, BadValue, TooLarge, UnknownName
from gamms.game import batch as batch_games
from gamms.game.strategy_specs import strategy_spec_of
from gamms.rules.in_core import FORMS
from gamms.scenario import Scenario

MAPS = Path(__file__).parents[1] / "reference"
TEAMS = ("red", "blue", "green")
STAY = "gamms.strategies:stay"
GAMES = 6


def remember_blocked(state):
    """Go to the first legal node by why the last action was not done."""
    known = state["memory"].setdefault("blocked", [])
    known.append(state["blocked"])
    state["action"] = state["legal"][len("".join(filter(None, known))) % len(state["legal"])]


def is_in_core(games):
    return games.is_in_arrays


def random_scenario(number, units=("edges", "edges", "metres", "metres_per_second"), *, has_speeds=True):
    """Return a random scenario that the core can play."""
    rng = Random(number)
    given = {"generator": {"function": "maps:streets", "with": {"number": number % 12}}}
    base = Scenario(folder=MAPS, map=given, teams={"red": {"count": 1}})
    nodes = base.columns().node_ids.tolist()
    names = list(TEAMS[: rng.randint(2, 3)])
    teams = {}
    for team in names:
        agents = [
            {"name": f"{rng.choice('abcxyz')}{i}{team}", "node": rng.choice(nodes)} for i in range(rng.randint(1, 4))
        ]
        teams[team] = {"agents": agents, "strategy": rng.choice([WALK, WALK, WALK, WALK, STAY])}
    unit = rng.choice(units)
    if has_speeds and (unit != "edges" or rng.random() < 0.5):
        for team in teams:
            teams[team] |= random_travel(rng, nodes, SPEEDS["edges" if unit == "edges" else "metres"])
    rules = random_rules(rng, names, nodes, by_metres=unit != "edges")
    changes = {"teams": teams, "rules": rules, "max_turns": rng.choice([9, 30])}
    if rng.random() < 0.6:
        changes["conflicts"] = random_conflicts(rng, names, nodes)
    settings = {"team_memory": False} if rng.random() < 0.3 else {}
    if unit == "edges" and not any("speed" in team for team in teams.values()) and rng.random() < 0.5:
        order = rng.sample(names, len(names))
        settings["order"] = [order[:1], order[1:]] if rng.random() < 0.5 else [[team] for team in order]
    if has_speeds and rng.random() < 0.15 and all(team["strategy"] in (WALK, STAY) for team in teams.values()):
        settings["legal"] = "any"
    if unit != "edges":
        settings |= {"speed_unit": unit} | ({"turn_seconds": 2.5} if unit != "metres" else {})
    return base.replace(**changes, settings=settings) if settings else base.replace(**changes)


SPEEDS = {
    "edges": [0.3, 1, 2, 2.7, 5, float("inf")],
    "metres": [1e-9, 0.5, 3.0, 12.5, 40.0, 1000.0, float("inf")],
}


def random_travel(rng, nodes, speeds):
    """Return one of some speeds of a team, and perhaps a strategy that goes far."""
    if rng.random() < 0.15:
        return {}
    travel = {"speed": rng.choice(speeds)}
    if rng.random() < 0.5:
        given = {"nodes": rng.choice([None, rng.sample(nodes, 3)]), "pause": rng.choice([0, 0, 2])}
        travel["strategy"] = {"function": "gamms.strategies:random_waypoints", "with": given}
    return travel


def random_rules(rng, teams, nodes, *, by_metres):
    """Return random rules that the core knows."""
    rules = []
    land = {node: rng.choice(teams) for node in nodes if rng.random() < 0.8}
    territory = rng.choice([None, land, "territory"])
    if territory == "territory":
        rules.append({"rule": "gamms.rules.territory:published", "with": {"nodes": land}})
    for _ in range(rng.choice([0, 1, 1, 2])):
        taggers, tagged = rng.sample(teams, 2)
        tag = {"taggers": taggers, "tagged": tagged, "mutual": rng.random() < 0.3, "passing": rng.random() < 0.8}
        tag |= {"then": rng.choice(["respawn", "eliminate"]), "score": rng.choice([0, 1, 2, 2.5])}
        tag["crossing"] = rng.choice([None, True, False])
        tag |= rng.choice([{}, {}, {"hops": rng.choice([0, 1, 2.5])}, {"metres": rng.choice([0.5, 3.0])}])
        if not by_metres and not {"hops", "metres"} & {*tag}:
            tag |= rng.choice([{}, {"euclid": rng.choice([1, 2.5])}])
        if territory is not None and rng.random() < 0.5:
            tag["territory"] = territory
        rules.append({"rule": "tag", "with": tag})
    for key in rng.choice([[], ["flags"], ["flags"], ["flags", "others"]]):
        flags = {team: rng.choice(nodes) for team in rng.sample(teams, rng.randint(1, len(teams)))}
        with_ = {"flags": flags, "goal": rng.choice([None, 1, 3]), "key": key, "passing": rng.random() < 0.8}
        with_ |= {"announce": rng.random() < 0.5, "score": rng.choice([1, 1.5, 0])}
        if territory is not None and rng.random() < 0.6:
            with_["territory"] = territory
        rules.append({"rule": "capture_flag", "with": with_})
    if rng.random() < 0.3:
        goals = {team: rng.sample(nodes, rng.randint(1, 3)) for team in rng.sample(teams, rng.randint(1, len(teams)))}
        reach = {"team": goals, "score": rng.choice([0, 1, 2.5]), "passing": rng.random() < 0.6}
        if len(goals) == 1:
            ((team, goal),) = goals.items()
            reach |= {"team": team, "nodes": goal} | winner_of(rng, teams)
        rules.append({"rule": "reach", "with": reach})
    if rng.random() < 0.3:
        arrive = {"team": rng.choice(teams), "nodes": rng.sample(nodes, 2), "passing": rng.random() < 0.6}
        rules.append({"rule": "arrive", "with": arrive | {"score": rng.choice([0, 1, 0.5])}})
    if rng.random() < 0.4:
        given = {"after": rng.randint(1, 3), "times": rng.choice([None, 1, 2]), "teams": rng.choice([None, teams[0]])}
        rules.append({"rule": "respawn", "with": given})
    if rng.random() < 0.2:
        rules.append("last_team")
    if rng.random() < 0.3:
        rules.append({"rule": "none_left", "with": {"team": rng.choice(teams)} | winner_of(rng, teams)})
    if rng.random() < 0.6:
        rules.append({"rule": "time_limit", "with": {"turns": rng.randint(2, 20)} | winner_of(rng, teams)})
    rng.shuffle(rules)
    return rules


def winner_of(rng, teams):
    return rng.choice([{}, {}, {"winner": None}, {"winner": teams[0]}])


def random_conflicts(rng, teams, nodes):
    by_node = {node: rng.choice([0, 1, 2]) for node in rng.sample(nodes, 4)}
    return {
        "capacity": rng.choice([1, 1, 2, None, by_node]),
        "among": rng.choice(["all", "all", "team"]),
        "allow_swaps": rng.random() < 0.6,
        "resolve": rng.choice(["at_random", "at_random", "nobody", {"by_priority": rng.sample(teams, len(teams))}]),
    }


def text_of(games):
    """Return all that is told of the games of a batch, as text: the order of its entries counts, too."""
    results = [games.result(number).to_dict() for number in range(len(games))]
    for one in results:
        del one["timings"], one["provenance"]["scenario"]
    table = {name: column.tolist() for name, column in games.table().items() if name[:6] != "score."}
    scores = {str(key): [numbers.tolist(), str(numbers.dtype)] for key, numbers in games.scores.items() if any(numbers)}
    told = [results, table, dict(sorted(scores.items())), games.turn.tolist(), games.is_over.tolist()]
    return json.dumps(told, default=str)


def play_by_steps(games, others, rng, teams):
    """Play some turns of both, of which actions for some teams are given."""
    for _ in range(rng.randint(1, 12)):
        acting = rng.sample(teams, rng.randint(0, len(teams)))
        given = {}
        for team in acting:
            view = games.observe(team)
            given[team] = np.array([[rng.randrange(n) for n in row] for row in view.counts.tolist()], np.int64)
        games.step(given)
        others.step(given)


def random_strategy(rng, nodes, kinds, depth=2):
    """Return what makes a random strategy, of some kinds, that the core plays by steps."""
    kind = rng.choice(kinds)
    otherwise = rng.choice([strategies.stay, strategies.random_walk])
    goes_on = depth and rng.random() < 0.5
    after = random_strategy(rng, nodes, kinds, depth - 1) if goes_on else lambda ctx: otherwise
    is_first = rng.random() < 0.3
    chance = rng.choice([None, None, 0.0, 0.4, 1.0])
    some, pause, repeat = rng.choices(nodes, k=rng.randint(1, 4)), rng.choice([0, 2]), rng.random() < 0.5
    waypoints = rng.choice([None, some])

    def make(ctx):
        then = after(ctx)
        made = {
            "goto": lambda rest: strategies.goto(ctx, some[0], rest),
            "follow_path": lambda rest: strategies.follow_path(ctx, some, repeat, rest),
            "patrol": lambda rest: strategies.patrol(ctx, some, rest),
            "random_waypoints": lambda rest: strategies.random_waypoints(ctx, waypoints, pause, rest),
            "chase": lambda rest: strategies.chase(ctx, rest),
            "flee": lambda rest: strategies.flee(ctx, rest),
        }[kind]
        if chance is not None:
            return strategies.first(strategies.mix(chance, made(None), then), then)
        return strategies.first(made(None), then) if is_first else made(then)

    return make


def scenario_of_steps(number, *units):
    """Return a random scenario whose agents decide by steps, and their strategies."""
    rng = Random(number)
    scenario = random_scenario(number, *units)
    by_metres = scenario.to_dict().get("settings", {}).get("speed_unit", "edges") != "edges"
    teams = scenario.to_dict()["teams"]
    nodes = scenario.columns().node_ids.tolist()
    sensors = {
        "near": {"type": "AGENT_RANGE", "sensor_range": rng.choice([0.0, 5.0, 30.0]) or 1e-9},
        "far": {"type": "AGENT", "exclude": [rng.choice([*teams])]},
    }
    carried = {f"teams.{team}.sensors": rng.choice([[], ["near"], ["near", "far"]]) for team in teams}
    made = {}
    for team, known in teams.items():
        kinds = ["goto", "random_waypoints"]
        kinds += [] if "speed" in known else ["follow_path", "patrol"]
        kinds += [] if by_metres else ["chase", "flee"]
        made[team] = random_strategy(rng, nodes, kinds)
    return scenario.replace(sensors=sensors, **carried), made


def check(number, *, by_steps=False):
    """Compare the games of a random scenario, however they are played."""
    scenario, made = scenario_of_steps(number) if by_steps else (random_scenario(number), None)
    seeds, how = range(number, number + GAMES), {"strategies": made}
    teams = list(scenario.to_dict()["teams"])
    with scenario.batch(seeds=seeds, **how) as games, beyond_core(scenario).batch(seeds=seeds, **how) as others:
        assert is_in_core(games)
        assert not is_in_core(others)
        play_by_steps(games, others, Random(number), teams)
        assert text_of(games) == text_of(others)
        some, seed = [number % GAMES], [number + 99]
        for one in (games, others):
            one.reset(some, seeds=seed)
            one.run()
        assert text_of(games) == text_of(others)
        for one, threads in ((games, 3), (others, 1)):
            one.reset()
            one.run(threads=threads)
        assert text_of(games) == text_of(others)
        assert plain(games.result(0)) == plain(scenario.play(seed=games.seeds[0], **how))


@pytest.mark.parametrize("part", range(4))
def test_games_in_the_core_are_those_one_by_one(part):
    number_of_games = 40 if Path(gamms.core.turn.__file__).suffix != ".py" else 16
    for number in range(part, number_of_games, 4):
        check(number)


@pytest.mark.parametrize("part", range(4))
def test_agents_that_decide_by_steps_in_the_core_do_what_they_do_one_by_one(part):
    number_of_games = 40 if Path(gamms.core.turn.__file__).suffix != ".py" else 16
    for number in range(part, number_of_games, 4):
        check(number, by_steps=True)


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
        }
    assert {*made} == {*strategies.__all__}
    assert names_in_docs("strategies") == {name for name, one in made.items() if strategy_spec_of(one).core_steps}
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
        assert is_in_core(games)
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
    with beyond_core(GRID).batch(2) as games, GRID.batch(2) as others:
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
            assert is_in_core(games)
            for number, seed in enumerate(games.seeds):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


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
        assert is_in_core(games)
        assert games.turn.tolist() == [1, 1, 1]
        assert (games.observe("red").node == before).all()
        raises[0] = False
        games.step()
        assert games.turn.tolist() == [2, 2, 2]


def test_games_go_on_where_ctrl_c_has_stopped_them(monkeypatch):
    monkeypatch.setattr(batch_games, "_AT_ONCE_IN_CORE", 1)
    with GRID.batch(3) as games, GRID.batch(3) as others:
        played = games._engine.play
        turns = []

        def play(*given):
            turns.append(played(*given))
            if len(turns) == 4:
                raise KeyboardInterrupt
            return turns[-1]

        games._engine.play = play
        with pytest.raises(KeyboardInterrupt):
            games.run()
        assert games.turn.tolist() == [4, 4, 4]
        games.run()
        others.run()
        assert text_of(games) == text_of(others)


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
        assert games.slow is None
        assert is_in_core(others)
        assert "random_waypoints" in others.slow
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
            assert is_in_core(games)
            games.run()
            assert [one["moves"] for one in games.result(1).agents.values()] == [0, 0, 0]
            alone.game.reset(seed=1)
            assert plain(games.result(1)) == plain(alone.game.run())


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
        assert [plain(games.result(number)) for number in range(3)] == [
            plain(scenario.play(seed=number, strategies={"red": shuttle})) for number in range(3)
        ]


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
            games.run()
            alone.game.reset(seed=1)
            assert plain(games.result(1)) == plain(alone.game.run())
            assert (len(games.detached) > 0) == (length < 10.0)


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
