"""What is taken back after an error in a batch, and alone, and what one game knows of another then: nothing."""

from contextlib import suppress

import numpy as np
import pytest
from batch_scenes import check_games, plain

import gamms
from gamms import rules
from gamms.strategies import stay


class Fault(Exception):
    """An error that a test plants."""


@pytest.fixture
def grid():
    with gamms.create_context(seed=1, game={"on_illegal": "stay"}, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        yield ctx


@pytest.fixture
def faults():
    """The seeds of games in which the planted error is raised, once each."""
    return set()


def publish_seed(ctx):
    ctx.game.publish(key=ctx.seed)


@pytest.mark.parametrize("num_games", [2, 8])
def test_after_an_error_agents_are_told_the_reasons_of_their_own_game_only(grid, faults, num_games):
    def decide(state):
        state["memory"][state["turn"]] = state["blocked"]
        seed = state["facts"]["key"]
        if state["turn"] == 2 and seed in faults:
            faults.remove(seed)
            raise Fault("planted")
        state["action"] = 15 if (seed, state["turn"]) == (6, 1) else state["curr_pos"]  # 15 is not next to it

    grid.agent.create_agent("red", start_node_id=0, team="red", strategy=decide)
    grid.game.add(publish_seed, phase="before")
    faults.add(6)
    with grid.game.batch(num_games, seed=5) as games:
        while games.turn.max() < 4:
            try:
                games.step()
            except Fault:
                games.step()
        told = [games.context(i).game.observation("red")["memory"][2] for i in range(num_games)]
    assert [i for i, why in enumerate(told) if why] == [1]


@pytest.mark.parametrize("leaves", [False, True])
@pytest.mark.parametrize("error", [KeyboardInterrupt, Fault])
def test_a_run_of_several_games_calls_all_rules_of_a_turn_in_which_one_has_raised(grid, faults, error, leaves):
    def first(ctx):
        if leaves and ctx.game.turn == 1:
            ctx.agent.create_agent("late", start_node_id=3, team="red", strategy=stay)
        if ctx.game.turn == 4 and ctx.seed in faults:
            faults.remove(ctx.seed)
            raise error("planted")

    def score(ctx):
        ctx.game.scores["red"] += 1

    grid.agent.create_agent("red", start_node_id=0, team="red", strategy=stay)
    for rule in (first, score, rules.time_limit(6)):
        grid.game.add(rule)
    faults.add(2)
    with grid.game.batch(3, seed=1) as games:
        with pytest.raises(error):
            games.run(warn=False)
        games.run(warn=False)
        assert games.scores["red"].tolist() == [6, 6, 6]


@pytest.mark.parametrize("how", ["alone", "step", "run", "fork"])
@pytest.mark.parametrize("place", ["strategy", "check", "deeds", "resolver"])
def test_what_a_team_has_shared_in_a_turn_that_is_taken_back_is_not_known(grid, faults, how, place):
    def fail(at, turn):
        if at == place and turn == 2 and faults:
            faults.clear()
            raise Fault(at)

    def share(state):
        shared = state["team_memory"].setdefault("turns", [])
        state["memory"][state["turn"]] = len(shared)
        shared.append(state["turn"])
        state["action"] = 1
        fail("strategy" if state["name"] == "b" else "", state["turn"])

    def act(ctx):
        fail("deeds", ctx.game.turn)

    act.check = lambda ctx: fail("check", ctx.game.turn)

    def resolve(contest, ctx):
        fail("resolver", ctx.game.turn)
        return []

    for name, node in (("a", 0), ("b", 2)):
        grid.agent.create_agent(name, start_node_id=node, team="red", strategy=share)
    grid.game.conflicts = rules.Conflicts(capacity=1, resolve=resolve)
    grid.game.add(act, phase="deeds")
    played = grid.game.batch(2, seed=1) if how in ("step", "run") else grid.game.fork(1) if how == "fork" else grid.game
    faults.add("planted")
    for _ in range(4 + 1):
        try:
            played.run(max_turns=1, warn=False) if how == "run" else played.step()
        except Fault:
            continue
    game = played.context(0).game if how in ("step", "run") else played
    assert list(game.observation("b")["memory"].values())[:4] == [0, 2, 4, 6]


@pytest.mark.parametrize("reserved", [{}, {"red": ["x"]}])
def test_the_result_names_an_agent_that_was_created_and_deleted_in_one_call(grid, reserved):
    def make_and_delete(ctx):
        if ctx.game.turn == 2:
            ctx.agent.create_agent("x", start_node_id=3, team="red", strategy=stay)
            ctx.agent.delete_agent("x")

    grid.agent.create_agent("r", start_node_id=0, team="red", strategy=stay)
    grid.game.add(make_and_delete)
    grid.game.max_turns = 4
    [result, _] = check_games(grid, 2, seed=1, most_agents=reserved)
    assert [*result.agents] == ["r", "x"]


@pytest.mark.parametrize("rule", [rules.arrive("red", 9), rules.tag("red", "blue", hops=1), rules.reach("red", 15)])
def test_an_agent_deleted_in_one_game_is_not_missed_in_others_that_leave(grid, rule):
    def leave(ctx):
        if ctx.game.turn == 2 and ctx.seed == 2:
            ctx.agent.delete_agent("blue_0")

    def come(ctx):
        if ctx.game.turn == 3 and ctx.seed in (0, 3):
            ctx.agent.create_agent("x" if ctx.seed else "aa", start_node_id=3, team="red", strategy=stay)

    for team, node in (("red", 5), ("blue", 0)):
        for i in range(2):
            grid.agent.create_agent(f"{team}_{i}", start_node_id=node + i, team=team, strategy=stay)
    grid.game.max_turns = 4
    grid.game.add(leave, phase="before")
    grid.game.add(come)
    grid.game.add(rule)
    results = check_games(grid, 4, seed=0)
    assert [plain(one)["turns"] > 0 for one in results] == [True] * 4


@pytest.mark.parametrize("num_games", [1, 2, 8])
@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_an_error_of_an_array_rule_takes_back_what_others_have_scored(grid, faults, phase, num_games):
    def score(turn):
        turn.add_score("points", np.arange(len(turn.games)), 1.0)
        turn.emit("scored", np.arange(len(turn.games)))

    def fail(turn):
        if faults and turn.turn[0] == 2:
            faults.clear()
            raise Fault("planted")

    grid.agent.create_agent("red", start_node_id=0, team="red", strategy=stay)
    grid.game.add(gamms.array_rule(score), phase=phase)
    grid.game.add(gamms.array_rule(fail), phase=phase)
    ends = []
    for fault in ([], [5]):
        faults.update(fault)
        with grid.game.batch(num_games, seed=5) as games:
            while games.turn.max() < 4:
                with suppress(Fault):
                    games.step()
            ends.append(
                [(result.scores, result.events, result.turns) for result in map(games.result, range(num_games))]
            )
    assert faults == set()
    assert ends[0] == ends[1]


@pytest.mark.parametrize("num_games", [1, 2, 8])
@pytest.mark.parametrize("phase", ["before", "deeds"])
def test_what_an_array_rule_keeps_stays_and_the_events_it_has_read_are_read_again(grid, faults, phase, num_games):
    def count(turn):
        calls = turn.keep("calls", lambda games: {"number": np.zeros(games)})["number"]
        calls[turn.games] += 1.0
        turn.emit("counted", np.arange(len(turn.games)))
        turn.add_score("calls", np.arange(len(turn.games)), calls[turn.games])
        turn.add_score("events", np.arange(len(turn.games)), len(turn.new_events("count")) / len(turn.games))

    def fail(turn):
        if faults and turn.turn[0] == 2:
            faults.clear()
            raise Fault("planted")

    def play(game):
        faults.add(5)
        while np.max(game.turn) < 4:
            with suppress(Fault):
                game.step()

    grid.agent.create_agent("red", start_node_id=0, team="red", strategy=stay)
    grid.game.add(gamms.array_rule(count), phase=phase)
    grid.game.add(gamms.array_rule(fail), phase=phase)
    with grid.game.batch(num_games, seed=5) as games:
        play(games)
        scores = games.result(0).scores
    play(grid.game)
    assert scores == grid.game.scores == {"calls": 1 + 2 + 4 + 5, "events": 4}
