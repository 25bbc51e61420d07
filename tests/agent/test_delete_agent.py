"""Agents that leave the world, and loops over those that are left."""

import pytest


@pytest.fixture
def team(ctx):
    return [ctx.agent.create_agent(name, start_node_id=node) for node, name in enumerate("abcd")]


def names(ctx):
    return [agent.name for agent in ctx.agent.create_iter()]


def test_agents_come_in_the_order_of_their_creation(ctx, team):
    ctx.agent.delete_agent("b")
    ctx.agent.create_agent("b", start_node_id=0)
    assert names(ctx) == ["a", "c", "d", "b"]
    assert list(ctx.agent.agents) == names(ctx)
    assert all(agent is ctx.agent.get_agent(agent.name) for agent in ctx.agent.create_iter())


def test_a_loop_may_delete_the_agent_it_is_at(ctx, team):
    for agent in ctx.agent.create_iter():
        ctx.agent.delete_agent(agent.name)
    assert names(ctx) == []


def test_create_iter_can_be_asked_for_the_next_agent(ctx, team):
    everybody = ctx.agent.create_iter()
    assert [next(everybody).name for _ in team] == ["a", "b", "c", "d"]
    with pytest.raises(StopIteration):
        next(everybody)


def test_deleting_an_unknown_agent_only_warns(ctx, anna, heard):
    ctx.agent.delete_agent("ana")
    assert names(ctx) == ["anna"]
    assert heard == ["Unknown agent 'ana'. Did you mean 'anna'? Nothing is deleted."]


def test_a_deleted_agent_stays_usable_and_touches_no_other(ctx, anna, team):
    anna.orientation, anna.team, anna.prev_node_id = (0, 1), "red", 3
    ctx.agent.delete_agent("anna")
    assert (anna.name, anna.current_node_id, anna.prev_node_id, anna.team) == ("anna", 4, 3, "red")
    assert anna.orientation == (0.0, 1.0)
    anna.register_strategy(lambda state: state.update(action=state["sensor"]["near"][1][1]))
    anna.step()
    assert (anna.current_node_id, anna.prev_node_id) == (5, 4)
    assert ctx.agent.positions.names == ["a", "b", "c", "d"]
    assert ctx.agent.positions.node_ids.tolist() == [0, 1, 2, 3]
    with pytest.raises(KeyError):
        ctx.agent.get_agent("anna")


def test_deleting_an_agent_leaves_the_sensor_that_another_one_carries_by_now(ctx, anna):
    near = ctx.sensor.get_sensor("near")
    berta = ctx.agent.create_agent("berta", start_node_id=0, sensors=["near"])
    assert near._owner == "berta"
    ctx.agent.delete_agent("anna")
    assert near._owner == "berta"
    anna.deregister_sensor("near")
    assert near._owner == "berta"
    berta.deregister_sensor("near")
    assert near._owner is None


def test_a_name_can_be_used_again_and_the_two_agents_are_strangers(ctx, anna):
    ctx.agent.delete_agent("anna")
    second = ctx.agent.create_agent("anna", start_node_id=0, team="blue")
    anna.current_node_id = 8
    assert (second.current_node_id, second.team, anna.current_node_id, anna.team) == (0, "blue", 8, None)
    assert ctx.agent.get_agent("anna") is second
