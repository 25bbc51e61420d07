"""Search: better actions than those of scripts, the same for the same seed, and in time."""

import gc
import subprocess
import sys
from itertools import count
from math import exp
from pathlib import Path

import pytest

import gamms
from gamms.errors import BadType, BadValue, UnknownName
from gamms.planning import mcts
from gamms.planning.mcts import _observe_state, _PairedTrials, _TreeNode
from gamms.planning.pace import SearchPace
from gamms.scenario import Scenario, load
from gamms.sensor import SensorType
from gamms.strategies import stay

DATA = Path(gamms.__file__).parent / "data" / "gallery"


def moves_of(ctx, turns):
    moves = []
    for _ in range(turns):
        ctx.game.step()
        moves.append({name: move.end for name, move in sorted(ctx.game.moves.items())})
    return moves


def test_rewards_that_come_later_count_less_and_a_value_stands_for_those_behind_the_end(line):
    line.game.remove("tag")
    line.agent.get_agent("bob").register_strategy(gamms.strategies.stay)
    search = mcts(60, depth=2, value=lambda model: model.ctx.agent.get_agent("ann").current_node_id)
    line.agent.get_agent("ann").register_strategy(search)
    line.game.run(4)
    assert line.agent.get_agent("ann").current_node_id == 4


def test_a_plan_searches_for_all_agents_of_its_team(tag):
    near = tag.replace(
        **{
            "sensors.eyes.sensor_range": 100,
            "teams.blue.agents.bob.node": 2,
            "teams.blue.agents.cat.node": 17,
            "max_turns": 6,
        }
    )
    stay = {"blue": gamms.strategies.stay}
    search = mcts(120, depth=3, opponents="gamms.strategies:stay")
    with near.build(strategies=stay) as ctx:
        ctx.game.command("red", search)
        assert ctx.game.run().scores["red"] == 2


@pytest.mark.parametrize("opponents", ["search", "gamms.strategies:flee"])
def test_the_same_seed_gives_the_same_actions(tag, opponents):
    def played(seed):
        with tag.build() as ctx:
            ctx.game.command("red", mcts(12, depth=4, opponents=opponents, seed=seed, value="closeness"))
            return moves_of(ctx, 4)

    assert played(1) == played(1)
    assert played(1) != played(2)


def test_two_processes_play_the_same(tmp_path, monkeypatch):
    code = f"""
from gamms.planning import mcts
from gamms.scenario import Scenario, load
with load({str(DATA / "grid_tag.yaml")!r}).build(5) as ctx:
    ctx.game.command("red", mcts(6, depth=5, rollout="gamms.strategies:chase"))
    ctx.record.start("game.ggr", overwrite=True)
    ctx.game.run(3)
"""
    environment = {"PYTHONHASHSEED": "1", "PYTHONPATH": ":".join(sys.path)}
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path, env=environment, capture_output=True)
    there = (tmp_path / "game.ggr").read_bytes()
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    assert (tmp_path / "game.ggr").read_bytes() == there


def test_a_scenario_file_names_it_for_agents_and_for_teams(tag):
    search = {
        "function": "gamms.planning:mcts",
        "with": {"iterations": 6, "depth": 3, "opponents": "gamms.strategies:flee"},
    }
    team = tag.to_dict()["teams"]["red"]
    plan = {key: value for key, value in team.items() if key != "strategy"} | {"plan": search}
    games = [tag.replace(**{"teams.red": one, "max_turns": 4}) for one in ({**team, "strategy": search}, plan)]
    results = [game.play() for game in games]
    assert [result.turns for result in results] == [4, 4]
    assert not any(result.errors for result in results)
    assert games[1].play() == results[1]
    with pytest.raises(gamms.scenario.ScenarioError, match="Unknown option 'dpth'"):
        games[0].replace(**{"teams.red.strategy.with.dpth": 3}).play()


def test_agents_that_are_searched_in_batches_play_as_in_games(tag):
    search = mcts(6, depth=3, opponents="gamms.strategies:flee")
    short = tag.replace(max_turns=3)
    alone = [short.play(seed, {"ann": search}) for seed in (1, 2)]
    with short.batch(seeds=[1, 2], strategies={"ann": search}) as games:
        games.run()
        assert [games.result(number) for number in range(2)] == alone


def test_of_actions_that_bring_as_much_the_one_that_was_tried_less_is_tried_next():
    trials = _PairedTrials(4)
    assert [trials.choose_next() for action in (1, 2, 3) for _ in [trials.note(action, 1.0)]] == [2, 3, 1]
    for action in (1, 1, 2):
        trials.note(action, 1.0)
    assert trials.choose_next() == 3
    for action in (2, 3, 3):
        trials.note(action, 2.0 if action == 2 else 1.0)
    assert trials.choose_next() == 2  # all were tried thrice


def test_exp3_chooses_as_auer_cesa_bianchi_freund_and_schapire_have_it():
    node = _TreeNode()
    node.offer(["a", "b", "c"])
    node.weights = [0.0, 12.0, -3.0]
    shares = [exp(0.2 / 3 * gain) for gain in node.weights]
    assert node.compute_chances() == pytest.approx([0.8 * share / sum(shares) + 0.2 / 3 for share in shares])


@pytest.mark.parametrize(
    ("counts", "chance", "action"),
    [
        ((20, 20, 60), 0.1, 0),
        ((20, 20, 60), 0.3, 1),
        ((20, 20, 60), 0.5, 2),
        ((1, 1, 98), 0.01, 2),
        ((5, 5, 5), 0.9, 2),
    ],
)
def test_exp3_chooses_the_most_tried_action_most_often(counts, chance, action):
    node = _TreeNode()
    node.offer(["a", "b", "c"])
    node.counts = list(counts)
    assert node.draw_by_trials(chance) == action


def test_untried_actions_are_chosen_equally_often():
    node = _TreeNode()
    node.offer(["a", "b", "c"])
    assert [node.draw_by_trials(chance) for chance in (0.1, 0.5, 0.9)] == [0, 1, 2]


def test_opponents_that_search_make_no_action_certain():
    """Bob wins where he goes to the other side than ann: she has to be on each as often."""
    sides = []
    for seed in range(14):
        with gamms.create_context(seed=seed, logger_config={"level": "ERROR"}) as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 1))
            for name, team in (("ann", "red"), ("bob", "blue")):
                ctx.agent.create_agent(name, start_node_id=1, team=team)

            @ctx.game.add
            def match(ctx):
                ends = [ctx.agent.get_agent(name).current_node_id for name in ("ann", "bob")]
                ctx.game.scores["red"] += 1 if ends[0] == ends[1] else -1
                ctx.game.end("shown")

            sides_only = {"actions": lambda state: [node for node in state["legal"] if node != 1]}
            search = mcts(40, depth=1, seed=seed, selection="exp3", sample=_in_the_middle, **sides_only)
            ctx.agent.get_agent("ann").register_strategy(search)
            ctx.game.step()
            sides.append(ctx.agent.get_agent("ann").current_node_id)
    assert 2 <= sides.count(0) <= 12
    assert sides.count(1) == 0


def _in_the_middle(ctx, _):
    ctx.agent.get_agent("bob").current_node_id = 1


class Clock:
    """A clock that shows the time that the parts of a search say they took."""

    def __init__(self, monkeypatch):
        self.now, self.took = 0.0, []
        monkeypatch.setattr(sys.modules["gamms.planning.pace"], "perf_counter", lambda: self.now)

    def spend(self, what, seconds):
        self.now += seconds
        self.took.append(what)

    def searching(self, seconds, turn=lambda: 0.0, value=0.0, world=0.0, **options):
        """A search in which others take so long in a turn; what else it takes is for a value, and for a world."""

        def slow(state):
            if state["name"] == "bob":
                self.spend("turn", turn())
            state["action"] = state["curr_pos"]

        def worth(model):
            self.spend("value", value)
            return 0.0

        return mcts(
            seconds=seconds,
            rollout="stay",
            opponents=slow,
            value=worth,
            sample=lambda ctx, rng: self.spend("world", world),
            **options,
        )

    def decisions(self, scenario, search, turns):
        """Play, and return how long each decision took, and what was done in it."""
        found = []
        with scenario.build(strategies={"blue": gamms.strategies.stay}) as ctx:

            def decide(states):
                began, before = self.now, len(self.took)
                search(states)
                found.append((self.now - began, self.took[before:]))

            ctx.game.command("red", search)
            search.prepare(ctx)
            ctx.game.command("red", decide)
            ctx.game.run(turns)
        return found


@pytest.mark.parametrize(("turn_s", "value_s", "world_s"), [(0.1, 0.0, 0.0), (0.1, 0.7, 0.2), (1.5, 1.0, 0.01)])
def test_nothing_is_begun_that_would_end_late(tag, monkeypatch, turn_s, value_s, world_s):
    clock = Clock(monkeypatch)
    steps = count()
    search = clock.searching(5.0, lambda: turn_s * (1.0 + 0.2 * (next(steps) % 3)), value_s, world_s, depth=3)
    found = clock.decisions(tag, search, 6)
    assert max(seconds for seconds, _ in found) <= 5.0
    assert min(seconds for seconds, _ in found) > 1.0


def test_another_iteration_is_begun_only_if_a_whole_one_fits(tag, monkeypatch):
    clock = Clock(monkeypatch)
    found = clock.decisions(tag, clock.searching(11.0, lambda: 1.0, depth=4), 4)
    assert [what.count("turn") for _, what in found] == [8] * 4


def test_where_one_step_took_long_the_next_decisions_leave_more_time_for_a_while(tag, monkeypatch):
    clock = Clock(monkeypatch)
    steps = count()
    search = clock.searching(20.0, lambda: 5.0 if next(steps) == 30 else 0.5, depth=4)
    found = [seconds for seconds, _ in clock.decisions(tag, search, 12)]
    late = max(range(12), key=found.__getitem__)
    assert found[late + 1] < found[late]
    assert max(found) <= 1.1 * 20.0
    assert found[-1] >= 16.0


def test_where_a_model_takes_longer_than_the_budget_not_even_the_first_decision_makes_one(tag, monkeypatch):
    clock = Clock(monkeypatch)
    found = clock.decisions(tag, clock.searching(0.5, world=1.0), 3)
    assert found == [(0.0, [])] * 3


@pytest.mark.parametrize("options", [{"seconds": 60.0, "iterations": 2}, {"iterations": 2}])
def test_garbage_is_not_collected_while_a_decision_has_a_limit(tag, options):
    seen = []
    with tag.build() as ctx:
        ctx.game.command("red", mcts(depth=1, value=lambda _: seen.append(gc.isenabled()) or 0.0, **options))
        ctx.game.run(1)
    assert seen[-1] is ("seconds" not in options)
    assert gc.isenabled()


def test_a_search_without_time_follows_the_policies_only_if_all_its_agents_have_one():
    pace, game = SearchPace(), object()
    pace.follow(game, {"ann": gamms.strategies.stay, "bob": gamms.strategies.stay})
    assert pace.has_policies({"ann": {"fork": game}})
    assert not pace.has_policies({"ann": {"fork": game}, "cat": {"fork": game}})


def test_a_search_distinguishes_seen_positions_and_ignores_seen_parts_of_the_map():
    sensors = {"eyes": (SensorType.AGENT_RANGE, {"bob": 5, "ann": 4}), "map": (SensorType.NEIGHBOR, [3, 4])}
    assert _observe_state({"curr_pos": 3, "sensor": sensors}) == (3, ("ann", 4), ("bob", 5))


def test_without_time_for_an_iteration_the_policy_decides(tag):
    east = mcts(seconds=1e-9, rollout=lambda state: state.update(action=state["curr_pos"] + 1))
    with tag.build(strategies={"ann": east}) as ctx:
        ctx.game.step()
        assert ctx.game.moves["ann"].end == 1


def test_a_search_with_a_time_limit_follows_a_strategy_of_the_scenario(tag):
    chase, flee = ({"function": f"gamms.strategies:{name}"} for name in ("chase", "flee"))
    search = {"function": "gamms.planning:mcts", "with": {"seconds": 1e-9, "rollout": chase, "opponents": flee}}
    by_search, by_chase = (tag.replace(**{"teams.red.strategy": how}).play(1) for how in (search, chase))
    assert str(by_search.agents) == str(by_chase.agents)


def test_where_nothing_speaks_for_another_action_the_policy_is_followed(tag):
    north = mcts(20, depth=2, rollout=lambda state: state.update(action=state["curr_pos"] + 6))
    with tag.replace(rules=[]).build(strategies={"ann": north, "amy": gamms.strategies.stay}) as ctx:
        ctx.game.step()
        assert ctx.game.moves["ann"].end == 6


@pytest.mark.parametrize("name", ["grid_tag", "helsinki_pursuit"])
def test_it_plays_the_scenarios_that_come_with_gamms(name):
    with load(DATA / f"{name}.yaml").build(2) as ctx:
        ctx.game.command("red", mcts(4, depth=4, rollout="gamms.strategies:chase", opponents="gamms.strategies:flee"))
        result = ctx.game.run(3)
    assert result.turns == 3
    assert result.errors == []


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"iterations": 0}, BadValue, "iterations"),
        ({"iterations": "many"}, BadType, "iterations"),
        ({"seconds": 0}, BadValue, "seconds must be more than 0"),
        ({"depth": 0}, BadValue, "depth"),
        ({"selection": "ucb"}, BadValue, "Did you mean 'uct'"),
        ({"discount": 1.5}, BadValue, "discount"),
        ({"rollout": "chaise"}, BadValue, "rollout='chaise' is not a strategy"),
        ({"opponents": {"blue": 3}}, BadType, "opponents is a strategy"),
        ({"value": "closness"}, BadType, "value is a function of the model"),
        ({"value": 3}, BadType, "value is a function of the model"),
        ({"actions": 3}, BadType, "actions is a function of the state"),
        ({"confidence": -1}, BadValue, "confidence must not be negative"),
        ({"information": "all"}, BadValue, "information must be 'private' or 'full'"),
        ({"horizon": 3}, UnknownName, "Unknown option 'horizon'"),
        ({"seed": "x"}, BadType, "seed"),
    ],
)
def test_impossible_arguments_are_refused_when_it_is_made(arguments, error, words):
    with pytest.raises(error, match=words):
        mcts(**arguments)


def test_names_of_gamms_may_be_short(tag):
    with tag.build(strategies={"ann": mcts(3, depth=2, rollout="chase", opponents="flee", value="closeness")}) as ctx:
        assert ctx.game.run(1).errors == []


def test_a_value_that_is_no_number_is_refused(tag):
    with pytest.raises(BadType, match="The result of value\\(model\\)"):
        tag.play(strategies={"ann": mcts(3, depth=2, value=lambda model: None)})


@pytest.mark.parametrize(
    ("actions", "error", "words"),
    [([], BadValue, "no action for agent 'ann'"), (5, BadType, "The result of actions\\(state\\) must be a list")],
)
def test_a_function_of_actions_has_to_return_some(tag, actions, error, words):
    with pytest.raises(error, match=words):
        tag.play(strategies={"ann": mcts(3, depth=2, actions=lambda state: actions)})


def test_agents_that_fly_need_actions():
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        fly = {"type": "AERIAL", "speed": 10.0, "team": "red"}
        ctx.agent.create_agent("hawk", start_node_id=0, strategy=mcts(4), **fly)
        with pytest.raises(BadValue, match="Give actions="):
            ctx.game.step()
        east = [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)]
        search = mcts(
            20, depth=2, actions=lambda state: east, value=lambda model: model.ctx.agent.get_agent("hawk").position[0]
        )
        ctx.agent.get_agent("hawk").register_strategy(search)
        ctx.game.run(2)
        assert ctx.agent.get_agent("hawk").position[0] == 20.0


def test_it_beats_the_script_of_a_scenario_that_comes_with_gamms():
    small = load(DATA / "grid_tag.yaml").replace(**{"map.grid.width": 8, "map.grid.height": 8, "max_turns": 20})
    small = small.replace(**{"teams.blue.from.at_least": 30, "teams.red.strategy": "gamms.strategies:chase"})
    search = mcts(8, depth=5, rollout="intercept", opponents="flee", value="closeness")
    tags = {"script": 0.0, "search": 0.0}
    for seed in range(3):
        for by in tags:
            with small.build(seed) as ctx:
                if by == "search":
                    ctx.game.command("red", search)
                tags[by] += ctx.game.run().scores.get("red", 0)
    assert tags["search"] >= tags["script"] + 3


@pytest.mark.parametrize(("options", "kind"), [({"iterations": 4}, "searched"), ({"seconds": 1e-9}, "given_up")])
@pytest.mark.parametrize("selection", ["uct", "exp3"])
def test_a_result_counts_the_decisions_of_searches(options, kind, selection):
    scene = Scenario(
        map={"grid": {"width": 3, "height": 3}}, teams={"red": {"count": 2}, "blue": {"count": 1}}, max_turns=3, seed=1
    )
    search = mcts(**options, depth=2, selection=selection)
    result = scene.play(strategies={"red": search, "blue": stay})
    counts = {name: result.timings.get(name, 0) for name in ("searched", "given_up")}
    assert counts == {"searched": 0, "given_up": 0, kind: 6}
    assert scene.play(strategies={"red": stay, "blue": stay}).timings.keys() == result.timings.keys() - {kind}
