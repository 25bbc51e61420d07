"""Plain rules and collectors in batches: they are called in the context of their game, with the same results."""

import functools

import numpy as np
import pytest
from batch_scenes import WALK, assert_as_alone, check_games, plain, scene

import gamms
from gamms.errors import BadValue
from gamms.rules import tag

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
OUT = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
BACK = {"rule": "respawn", "with": {"after": 2}}
PAID = {"rule": "payoff", "with": {"table": {"bonus": {"agent": 0.5}, "tag": {"agent": 1}}}}
FLAGS = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}}}


def storm(ctx):
    """Close roads, others in games of other seeds, and open some of them later."""
    if ctx.game.turn in (2, 5):
        near = [edge for edge in [*ctx.graph.graph.get_edges()] if edge % 7 in (ctx.seed % 2, ctx.game.turn)]
        ctx.graph.close_roads(near[:9])
    if ctx.game.turn == 7:
        ctx.graph.open_roads(ctx.graph.closed_roads[:5])
    if ctx.game.turn == 8 and ctx.seed % 2:
        ctx.graph.graph.remove_edge(next(ctx.graph.graph.get_edges()))


SEEING = {
    "near": {"type": "AGENT_RANGE", "sensor_range": 25.0},
    "map": {"type": "RANGE", "sensor_range": 12.0},
    "next": {"type": "NEIGHBOR"},
}


def test_observations_where_roads_are_closed_are_true():
    red = {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": [*SEEING]}
    seeds = [1] * 4 + [2] * 5 + [4] * 2
    with scene(teams={"red": red}, sensors=SEEING).build(seed=1) as ctx:
        ctx.game.add(storm)
        with ctx.game.batch(seeds=seeds) as games, ctx.game.fork(0).ctx as alone:
            for _ in range(6):
                games.step()
            view = games.observe("red")
            vectors, legal, seen = view.vector(), view["legal"], view.seen_nodes("next").mask
            assert vectors.legal.shape[-1] == 5
            for number, seed in enumerate(seeds):
                alone.game.reset(seed=seed)
                alone.game.run(6)
                for agent in range(3):
                    state = alone.game.observation(f"red_{agent}")
                    assert [node for node in legal[number, agent] if node >= 0] == list(state["legal"])
                    assert vectors.legal[number, agent].sum() == view.counts[number, agent] == len(state["legal"])
                    assert np.flatnonzero(seen[number, agent]).tolist() == sorted(state["sensor"]["next"][1])
            last = view["legal"][np.arange(len(seeds))[:, None], np.arange(3), view.counts - 1]
            assert (view.action_to(last) == view.counts - 1).all()
            games.step({"red": view.counts - 1})
            assert (games.observe("red")["curr_pos"] == last).all()


def wall_in(ctx):
    """Close the roads that lead away from node 0, in turn 2 of games of odd seeds."""
    if ctx.game.turn == 2 and ctx.seed % 2:
        graph = ctx.graph.graph
        ctx.graph.close_roads([edge for edge in graph.get_edges() if graph.get_edge(edge).source == 0])


@pytest.mark.parametrize("seeds", [[1], [1, 3, 2, 4]])
def test_an_action_that_a_closed_road_makes_illegal_is_refused_before_any_game_is_played(seeds):
    with scene(red=1).build(seed=1) as ctx:
        ctx.agent.get_agent("red_0").current_node_id = 0
        ctx.game.add(wall_in, phase="before")
        with ctx.game.batch(seeds=seeds) as games, ctx.game.batch(seeds=seeds) as others:
            away = np.ones((len(seeds), 1), np.int64)
            for one in (games, others):
                one.step({"red": away * 0}), one.step({"red": away * 0})
            before = games.observe("blue").node
            for _ in range(2):
                with pytest.raises(BadValue, match="is not the number of a legal node: it has 1"):
                    games.step({"red": away})
                assert (games.turn == 2).all()
                assert (games.observe("blue").node == before).all()
            for one in (games, others):
                one.step({"red": away}, on_illegal="stay")
                one.run()
            for number in range(len(seeds)):
                assert plain(games.result(number)) == plain(others.result(number))


USES = {
    "memories": lambda ctx: len(ctx.game.memories),
    "states": lambda ctx: len(ctx.agent.get_agent("red_0").state),
    "observations": lambda ctx: len(ctx.game.observation("red_0")["legal"]),
    "counts": lambda ctx: len(ctx.game.counts),
    "flags": lambda ctx: sum(ctx.game.data["flags"]["captures"].values()),
    "facts": lambda ctx: len(ctx.game.facts_of("red_0")),
    "data": lambda ctx: ctx.game.data["plan"]["depth"],
}


@pytest.mark.parametrize("shares_memory", [True, False])
@pytest.mark.parametrize("use", USES)
def test_rules_use_all_that_a_game_has(use, shares_memory):
    def rule(ctx):
        ctx.game.scores[use] += USES[use](ctx)
        if ctx.game.turn == 3:
            ctx.game.publish(storm=ctx.seed)

    with scene([FLAGS], max_turns=8, settings={"team_memory": shares_memory}).build(seed=1) as ctx:
        ctx.game.publish(to="red_0", storm=3)
        ctx.game.data["plan"] = {"depth": 2}
        ctx.game.add(rule)
        check_games(ctx, seeds=[1, 2])


def add_hub(ctx):
    """Join a new node to all others in some games."""
    if ctx.game.turn == 2 and ctx.seed % 2:
        ctx.graph.add_nodes([100], [1.0], [1.0])
        ctx.graph.add_edges(range(1000, 1050), [*range(25), *[100] * 25], [*[100] * 25, *range(25)])


def test_games_in_which_agents_reach_new_nodes_are_played_and_recorded_and_not_observed(tmp_path):
    scenario = scene([{"rule": f"{__name__}:add_hub"}], max_turns=8, allow=[__name__])
    with scenario.batch(2) as games:
        games.step()
        games.run()
        assert plain(games.result(1)) == plain(scenario.play(seed=1, record=tmp_path / "alone.ggr"))
        games.record(1, tmp_path / "batch.ggr")
        assert (tmp_path / "batch.ggr").read_bytes() == (tmp_path / "alone.ggr").read_bytes()
        with pytest.raises(BadValue, match="Game 1 cannot be observed, nor be given actions: Unknown node 100"):
            games.observe("red")
        games.reset([1], seeds=[2])
        assert games.observe("red").turn.tolist() == [8, 0]


def test_errors_of_rules_name_the_rule_the_game_and_the_turn():
    def fall(ctx):
        if ctx.game.turn == 3 and ctx.seed == 6:
            raise ZeroDivisionError("fell")

    with scene([TAG]).build(seed=1) as ctx:
        ctx.game.add(fall)
        with ctx.game.batch(3, seed=5) as games, pytest.raises(ZeroDivisionError) as caught:
            games.run()
    notes = " ".join(caught.value.__notes__)
    assert "'fall' (phase 'after'), in turn 3" in notes
    assert "In game 1 of a batch, with the seed 6." in notes


def test_rules_that_remember_outside_of_the_game_are_refused():
    ends = []

    def remember(ctx):
        ends.append(ctx.game.turn)

    with scene([TAG]).build(seed=1) as ctx:
        ctx.game.add(remember)
        with ctx.game.batch(3) as games, pytest.raises(BadValue, match=r"'ends' of remember\(\) .* ctx\.game\.data"):
            games.run()


class Counting:
    """A conflict resolver that remembers how often it was asked."""

    def __init__(self):
        self.times = 0

    def resolve(self, moves, ctx):
        self.times += 1
        return set()


def test_checks_and_resolvers_that_remember_outside_of_the_game_are_refused():
    asked = []

    def rule(ctx):
        pass

    rule.check = lambda ctx: asked.append(ctx.game.turn)
    with scene([TAG]).build(seed=1) as ctx:
        ctx.game.add(rule)
        with ctx.game.batch(3) as games, pytest.raises(BadValue, match="'asked'"):
            games.run()
    with scene([TAG]).build(seed=1) as ctx:
        ctx.game.conflicts = Counting()
        with ctx.game.batch(3) as games, pytest.raises(BadValue, match="times"):
            games.run()


def test_a_collector_that_moves_an_agent_moves_it_in_batches_too():
    def collect(ctx):
        ctx.game.agents[0].current_node_id = 0

    with scene(max_turns=4).build(seed=1) as ctx:
        ctx.game.collect("none", collect, every=2)
        with ctx.game.batch(seeds=[1, 2]) as games, ctx.game.fork(0).ctx as alone:
            games.step()
            games.reset([0])
            games.run()
            assert_as_alone(games, alone)


def test_a_function_that_wraps_a_rule_is_called_alone_beside_other_such_rules_and_in_batches():
    def counted(rule):
        @functools.wraps(rule)
        def wrapper(ctx):
            ctx.game.scores["calls"] += 1
            rule(ctx)

        return wrapper

    ctx = scene([], max_turns=9).build(seed=3)
    ctx.game.add(counted(tag("red", "blue")))
    ctx.game.add(tag("blue", "red"))
    with ctx.game.batch(3) as games:
        games.run(warn=False)
        assert games.scores["calls"].tolist() == [9, 9, 9]
    ctx.game.run()
    assert ctx.game.scores["calls"] == 9
    assert "red" in ctx.game.scores


def forget_rounds(ctx):
    """Let agents that patrol begin anew, and write what rules in the core remember."""
    if ctx.game.turn % 3 == ctx.seed % 3:
        for memory in ctx.game.memories.values():
            memory.clear()
        ctx.game.data["flags"]["captures"]["red"] = ctx.game.turn + 1
        ctx.game.data["respawns"] = {}
    ctx.game.emit("known", flags=str(ctx.game.data["flags"]), rounds=str(ctx.game.memories))


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_a_rule_changes_what_rules_and_strategies_in_the_core_remember_as_alone(phase):
    rounds = {"function": "gamms.strategies:patrol", "with": {"nodes": [3, 21, 7]}}
    teams = {"red": {"count": 2, "strategy": rounds}, "blue": {"count": 2, "strategy": WALK}}
    flags = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}}
    with scene([TAG, "respawn", flags], teams=teams, max_turns=9).build(seed=1) as ctx:
        ctx.game.add(forget_rounds, phase=phase)
        with ctx.game.batch(seeds=range(4)) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.is_in_arrays
            assert_as_alone(games, alone)


@gamms.array_rule
def pay_more(turn):
    """Pay what grows from turn to turn."""
    kept = turn.keep("paid", lambda games: {"times": np.zeros(games)})["times"]
    kept[turn.games] += 1
    turn.add_score("paid", np.arange(len(turn.games)), kept[turn.games])


@gamms.array_strategy
def go_on_counting(view):
    """Take one legal node after the other."""
    kept = view.keep("steps", lambda games: {"times": np.zeros(games, np.int64)})["times"]
    kept[view.games] += 1
    return kept[view.games][:, None] % view.counts


DROPS = {"clear": lambda ctx: ctx.game.data.clear(), "new": lambda ctx: setattr(ctx.game, "data", {"new": 1})}


@pytest.mark.parametrize("drop", DROPS)
@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_a_rule_drops_what_rules_and_array_functions_keep_as_alone(phase, drop):
    def act(ctx):
        if ctx.game.turn == 3 and ctx.seed != 1:
            DROPS[drop](ctx)
        ctx.game.emit("keys", known=sorted(map(str, {*ctx.game.data} & {"flags", "new"})))

    flags = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}}
    with scene([flags], max_turns=7).build(seed=1, strategies={"red": go_on_counting}) as ctx:
        ctx.game.add(pay_more)
        ctx.game.add(act, phase=phase)
        check_games(ctx, seeds=range(3))


def test_a_rule_writes_what_a_strategy_in_the_core_remembers_before_it_has_decided():
    def send(ctx):
        if ctx.game.turn == 0:
            ctx.game.memories.setdefault("red_0", {})["patrol [3, 21, 7]"] = 2

    rounds = {"function": "gamms.strategies:patrol", "with": {"nodes": [3, 21, 7]}}
    with scene([], teams={"red": {"count": 2, "strategy": rounds}}, max_turns=5).build(seed=1) as ctx:
        ctx.game.add(send, phase="before")
        check_games(ctx, seeds=range(2))


def test_a_memory_that_a_strategy_cannot_read_is_its_error_as_alone():
    def spoil(ctx):
        if ctx.game.turn == 2:
            ctx.game.memories["red_0"]["patrol [3, 21, 7]"] = "x"

    rounds = {"function": "gamms.strategies:patrol", "with": {"nodes": [3, 21, 7]}}
    with scene([], teams={"red": {"count": 2, "strategy": rounds}}, max_turns=5).build(seed=1) as ctx:
        ctx.game.add(spoil, phase="before")
        with ctx.game.batch(2) as games, pytest.raises(TypeError):
            games.run()
        with pytest.raises(TypeError):
            ctx.game.run()


@pytest.mark.parametrize("last", [5, 9, None])
def test_a_rule_changes_the_last_turn_for_later_runs_too(last):
    def change(ctx):
        if ctx.game.turn == 3 and ctx.seed:
            ctx.game.max_turns = last
        if ctx.game.turn == 11:
            ctx.game.end("enough")

    with scene([], max_turns=7).build(seed=1) as ctx:
        ctx.game.add(change, phase="before")
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run(4)
            games.run()
            alone.game.reset(seed=1)
            alone.game.run(4)
            result = alone.game.run()
            assert games.turn.tolist() == [7, result.turns]
            assert games.is_over.all()
            assert games.result(1).reason == result.reason
            games.reset()
            games.run(2)
            assert games.turn.tolist() == [2, 2]


def test_a_rule_that_holds_the_data_of_the_game_sees_what_rules_in_the_core_have_written():
    def recall(ctx):
        scout = ctx.agent.get_agent("red_0")
        if not hasattr(scout, "held"):
            scout.held = [ctx.game.data]
        ctx.game.emit("recalled", what=str(scout.held[0]))

    with scene([OUT, FLAGS], max_turns=12).build(seed=1) as ctx:
        ctx.game.add(recall)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.is_in_arrays
            assert_as_alone(games, alone)
            assert len({event["what"] for event in games.result(0).events if event["kind"] == "recalled"}) > 1
