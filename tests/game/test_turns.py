"""Turns: all observe the same world, decide, and move at once; rules follow."""

import numpy as np
import pytest

from gamms.errors import GammsError
from gamms.game import IllegalAction


def test_two_agents_change_places_because_both_move_at_once(ctx, play):
    a, b = play("a", 0, 1), play("b", 1, 0)
    assert ctx.game.step()
    assert (a.current_node_id, b.current_node_id) == (1, 0)
    assert (a.prev_node_id, b.prev_node_id) == (0, 1)
    assert ctx.game.turn == 1


def test_everybody_sees_the_world_as_it_was_before_anybody_moved(ctx, play, everything):
    a, b = everything(ctx, play("a", 0, 1)), everything(ctx, play("b", 1, 5))
    ctx.game.step()
    assert a.seen[0]["sensor"]["AGENT"][1] == {"b": 1}
    assert b.seen[0]["sensor"]["AGENT"][1] == {"a": 0}
    ctx.game.step()
    assert b.seen[1]["sensor"]["AGENT"][1] == {"a": 1}


def test_outside_the_engine_a_state_keeps_its_two_keys(ctx, play):
    agent = play("a", 0, 1)
    ctx.game.step()
    assert list(agent.get_state()) == ["curr_pos", "sensor"]


def test_the_papers_loop_and_the_engine_may_take_turns(ctx, play):
    agent = play("a", 0, 1)
    ctx.game.step()
    agent.get_state()["action"] = 2
    agent.set_state()
    ctx.game.step()
    assert (agent.current_node_id, agent.seen[1]["curr_pos"]) == (2, 2)


def test_a_strategy_that_sets_no_action_is_an_error(ctx):
    ctx.agent.create_agent("a", start_node_id=0, strategy=lambda state: None)
    assert (
        "state['action'] was not set (what is returned does not count); legal are [0, 1, 4]"
        in ctx.game.run(1).errors[0]["message"]
    )


def test_an_illegal_action_may_raise_instead(ctx, play):
    ctx.game.on_illegal = "raise"
    agent = play("a", 0, 5)
    with pytest.raises(IllegalAction, match="Agent 'a' in turn 0: Node 5 is not next to node 0") as caught:
        ctx.game.step()
    assert isinstance(caught.value, ValueError)
    assert (agent.current_node_id, ctx.game.turn) == (0, 0)


def test_numpy_integers_dicts_and_lists_of_one_node_are_moves(ctx, play):
    agents = [play("a", 0, np.int64(1)), play("b", 0, {"node_id": 1, "orientation": (0, 2)}), play("c", 0, [0, 1])]
    ctx.game.step()
    assert [agent.current_node_id for agent in agents] == [1, 1, 1]
    assert agents[1].orientation == (0.0, 1.0)


def test_an_error_in_a_strategy_reaches_the_caller_with_the_agents_name(ctx):
    def broken(state):
        raise ZeroDivisionError("of its own")

    ctx.agent.create_agent("a", start_node_id=0, strategy=broken)
    with pytest.raises(ZeroDivisionError, match="of its own") as caught:
        ctx.game.step()
    assert caught.value.__notes__ == ["In the strategy of agent 'a', in turn 0."]


def test_an_error_may_mean_staying_instead_and_is_counted(ctx, play):
    def broken(state):
        if state["turn"] == 1:
            raise ZeroDivisionError("of its own")
        state["action"] = state["legal"][1]

    ctx.game.on_error = "stay"
    agent = ctx.agent.create_agent("a", start_node_id=0, strategy=broken)
    other = play("b", 5, 6, 7)
    result = ctx.game.run(2)
    assert (agent.current_node_id, other.current_node_id) == (1, 7)
    assert result.agents["a"]["errors"] == 1
    assert result.errors == [{"turn": 1, "agent": "a", "kind": "error", "message": "ZeroDivisionError: of its own"}]


def test_a_strategy_that_takes_too_long_stays_and_is_counted(ctx, play):
    ctx.game.time_budget = 1e-9
    agent = play("a", 0, 1)
    result = ctx.game.run(1)
    assert (agent.current_node_id, result.agents["a"]["overruns"]) == (0, 1)


def test_an_agent_without_a_strategy_stays(ctx):
    agent = ctx.agent.create_agent("a", start_node_id=0)
    assert ctx.game.run(2).errors == []
    assert agent.current_node_id == 0


def test_a_rule_may_prepare_when_it_is_added_and_is_not_if_that_fails(ctx):
    def prepare(ctx):
        ctx.game.publish(flag=ctx.graph.graph.get_node(99 if "flag" in ctx.game.facts else 3).id)

    def rule(ctx):
        ctx.game.emit("called")

    rule.prepare = prepare
    ctx.game.add(rule)
    assert ctx.game.facts["flag"] == 3
    with pytest.raises(KeyError):
        ctx.game.add(rule)
    ctx.game.step()
    assert len(ctx.game.events) == 1


def test_a_game_that_no_rule_has_ended_says_why_it_went_no_further(ctx, play):
    play("a", *range(9))
    assert (ctx.game.result().reason, ctx.game.result().truncated) == ("unfinished", True)
    assert ctx.game.run(2).reason == "max_turns"
    ctx.game.step()
    assert ctx.game.result().reason == "unfinished"
    ctx.game.max_turns = 3
    assert ctx.game.result().reason == "max_turns"
    ctx.game.max_turns = None
    ctx.terminate()
    assert ctx.game.result().reason == "closed"


@pytest.mark.parametrize("winner", [None, "red"])
def test_a_context_that_ends_after_the_last_turn_closes_no_game(ctx, play, winner):
    play("a", *range(9))
    if winner:
        ctx.game.add(lambda ctx: ctx.game.turn == 3 and ctx.game.end("home", winner=winner))
    ctx.visual.after_turn.append(lambda: ctx.game.turn == 3 and ctx.terminate())
    assert ctx.game.run(3).reason == ("home" if winner else "max_turns")


def test_time_that_is_up_truncates_and_more_turns_may_follow(ctx, play):
    play("a", 0, 1, 2, 3)
    result = ctx.game.run(2)
    assert (result.turns, result.reason, result.truncated) == (2, "max_turns", True)
    assert ctx.game.run(1).turns == 3
    assert ctx.game.run(0).turns == 3


def test_a_game_that_nothing_can_end_is_refused(ctx):
    with pytest.raises(ValueError, match=r"no rule that could end it: give run\(max_turns=…\)"):
        ctx.game.run()
    ctx.game.max_turns = 3
    assert ctx.game.run().turns == 3


def test_who_is_eliminated_is_neither_asked_nor_moved_nor_sensed(ctx, play, everything):
    gone, watcher = play("gone", 1, 2, 3), everything(ctx, play("watcher", 0))
    ctx.game.add(lambda ctx: ctx.game.turn == 1 and ctx.game.eliminate("gone"))
    result = ctx.game.run(3)
    assert (gone.alive, gone.current_node_id, len(gone.seen)) == (False, 2, 1)
    assert [state["sensor"]["AGENT"][1] for state in watcher.seen] == [{"gone": 1}, {}, {}]
    assert result.events == [{"turn": 1, "kind": "eliminated", "agent": "gone", "node": 2}]
    assert result.agents["gone"]["alive"] is False
    assert [agent.name for agent in ctx.game.agents] == ["watcher"]


def test_who_is_deleted_between_two_turns_is_asked_no_longer(ctx, play):
    gone, left = play("a", 0, 1), play("b", 1, 2, 3)
    ctx.game.step()
    ctx.agent.delete_agent("a")
    ctx.game.step()
    assert (left.current_node_id, len(gone.seen)) == (3, 1)
    assert ctx.game.agents == [left]


def test_after_the_end_of_the_context_a_step_does_nothing(ctx, play):
    play("a", 0, 1)
    ctx.terminate()
    assert ctx.game.step() is False
    with pytest.raises(GammsError):
        ctx.game.run(1)


def test_the_order_of_creation_changes_nothing(grid):
    def play(order):
        def wander(state):
            state["action"] = int(state["rng"].choice(state["legal"]))
            state["team_memory"].setdefault("seen", []).append(state["curr_pos"])

        with grid(seed=5) as ctx:
            for i in range(6)[::order]:
                ctx.agent.create_agent(f"a{i}", start_node_id=i, team=i % 2, strategy=wander)
            return ctx.game.run(20), ctx.game.team_memories

    assert play(1) == play(-1)
