"""What a game may spend: calls, tokens and money; and what it has spent is in the result and in the game's data."""

import copy
import threading

import pytest
from loopback import completion, new_game, outcomes

PRICES = {"price_in": 2.0, "price_out": 10.0}


def test_a_model_of_ones_own_may_cost_nothing(strategy_of):
    with new_game(strategy_of(price_in=0.0, price_out=0.0)) as ctx:
        assert ctx.game.run(1).table("llm")["cost"].tolist() == [0.0]


@pytest.mark.parametrize(
    ("limit", "asked"), [({"max_calls": 3}, 3), ({"max_tokens": 2600}, 5), ({"max_cost": 0.0065, **PRICES}, 3)]
)
def test_when_a_limit_is_reached_the_fallback_plays(server, strategy_of, limit, asked):
    server.script = lambda _: completion({"move": 1}, tokens=(300, 100))
    with new_game(strategy_of(answer_tokens=100, **limit)) as ctx:
        result = ctx.game.run(8)
    (name,) = [key for key in limit if key.startswith("max")]
    assert outcomes(result) == ["answer"] * asked + [f"limit: {name}"] * (8 - asked)
    assert len(server.requests) == asked
    table = result.table("llm")
    assert table["input_tokens"].sum() + table["output_tokens"].sum() <= 2600
    assert table["cost"].sum() <= 0.0065


def test_agents_that_are_asked_together_stay_within_the_limit_together(server, strategy_of):
    server.script = lambda _: completion({"move": 1}, tokens=(300, 100))
    with new_game(strategy_of(answer_tokens=100, max_calls=5), [f"a{i}" for i in range(8)]) as ctx:
        result = ctx.game.run(1)
    assert sorted(outcomes(result)) == ["answer"] * 5 + ["limit: max_calls"] * 3


def test_strategies_of_equal_settings_share_their_limit(server, strategy_of):
    with new_game(None) as ctx:
        for name in ("bert", "cleo"):
            ctx.agent.create_agent(name, start_node_id=0, strategy=strategy_of(max_calls=3))
        result = ctx.game.run(2)
    assert outcomes(result).count("answer") == 3


def test_a_game_that_is_reset_may_spend_as_much_again(strategy_of):
    with new_game(strategy_of(max_calls=2)) as ctx:
        first = ctx.game.run(3)
        ctx.game.reset()
        assert ctx.game.run(3) == first


def test_a_game_that_goes_back_has_the_spending_of_that_turn(server, strategy_of):
    with new_game(strategy_of(max_calls=3)) as ctx:
        ctx.game.run(1)
        here = ctx.game.snapshot()
        assert outcomes(ctx.game.run(3))[1:] == ["answer", "answer", "limit: max_calls"]
        ctx.game.restore(here)
        assert outcomes(ctx.game.run(3))[1:] == ["answer", "answer", "limit: max_calls"]


def test_a_call_that_is_given_up_counts_with_all_it_may_have_taken(server, strategy_of):
    stopped = threading.Event()
    server.script = lambda _: stopped.wait(5) and {"move": 1}
    with new_game(strategy_of(seconds=0.1, answer_tokens=123)) as ctx:
        table = ctx.game.run(1).table("llm")
    stopped.set()
    assert table["output_tokens"] == [123]
    assert table["input_tokens"] > [500]


def test_a_fork_spends_its_own(server, strategy_of):
    with new_game(strategy_of(max_calls=2)) as ctx:
        ctx.game.run(1)
        ahead = ctx.game.fork(1)
        assert outcomes(ahead.run(3)) == ["answer", "answer", *["limit: max_calls"] * 2]
        assert outcomes(ctx.game.run(1)) == ["answer", "answer"]


def test_two_games_with_the_same_seed_are_equal(server, strategy_of, tmp_path):
    files = [tmp_path / "one.ggr", tmp_path / "two.ggr"]
    results = []
    for file in files:
        with new_game(strategy_of(**PRICES), ["anna", "bert"]) as ctx:
            ctx.record.start(file)
            results.append(ctx.game.run(3))
    assert results[0] == results[1]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_one_strategy_plays_one_game_at_a_time(strategy_of):
    strategy = strategy_of()
    with new_game(strategy) as ctx, new_game(strategy) as other:
        ctx.game.run(1)
        with pytest.raises(ValueError, match="already used in another context"):
            other.game.run(1)
    with new_game(strategy) as later:
        assert outcomes(later.game.run(1)) == ["answer"]


@pytest.mark.parametrize("planted", [5, {"x": 5}, {"calls": -100, "input_tokens": "many"}])
def test_totals_that_a_recording_has_made_up_lift_no_limit(server, strategy_of, planted):
    with new_game(strategy_of(max_calls=2)) as ctx:
        ctx.game.run(1)
        (name,) = ctx.game.data["llm"]
        ctx.game.data["llm"] = planted if planted == 5 else {name: planted}
        assert outcomes(ctx.game.run(4)).count("answer") == 3


def test_a_copy_of_the_context_spends_its_own(server, strategy_of):
    with new_game(strategy_of(max_calls=2)) as ctx:
        ctx.game.run(1)
        twin = copy.deepcopy(ctx)
        assert outcomes(twin.game.run(2)) == ["answer", "answer", "limit: max_calls"]
        assert outcomes(ctx.game.run(1)) == ["answer", "answer"]
        twin.terminate()
