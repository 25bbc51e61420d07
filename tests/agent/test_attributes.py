"""Attributes that programs set on agents: they are the agent's, and change no class."""

import copy

import pytest

import gamms
from gamms.agent import AerialAgent, Agent, BaseAgent
from gamms.readonly import ReadOnly

CLASSES = (BaseAgent, Agent, AerialAgent)


def context(seed=1):
    ctx = gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    return ctx


def test_attributes_change_no_class_and_no_agent_of_another_context():
    before = [dir(kind) for kind in CLASSES]
    with context() as ctx, context() as other:
        anna, kite = (
            ctx.agent.create_agent("anna", start_node_id=0, meta={}),
            ctx.agent.create_agent("kite", start_node_id=0, type=1, speed=1.0),
        )
        strangers = [other.agent.create_agent("bert", start_node_id=0, other={})]
        for agent in (anna, kite):
            for number in range(100):
                setattr(agent, f"list_{number}", [number])
        assert [dir(kind) for kind in CLASSES] == before
        for stranger in strangers:
            assert not any(name.startswith("list_") or name == "meta" for name in dir(stranger))
            assert not hasattr(stranger, "list_1")
        assert anna.list_7 == kite.list_7 == [7]
        assert {"meta", "list_7"} <= {*dir(anna), *vars(anna)}
        assert isinstance(anna, Agent)
        assert isinstance(kite, AerialAgent)
        assert repr(anna).startswith("Agent('anna'")


@pytest.mark.parametrize("number", range(2), ids=["in a context", "in a later one"])
def test_strategies_see_read_only_copies_in_contexts_and_their_copies(number):
    refused = []
    with context() as ctx:
        anna = ctx.agent.create_agent("anna", start_node_id=0, meta={"hp": 3})
        anna.later = 3
        anna.later = [0]

        def meddle(state):
            for change in (lambda: anna.meta.update(hp=0), lambda: anna.later.append(1)):
                try:
                    change()
                except (ReadOnly, AttributeError) as error:
                    refused.append(type(error))
            state["action"] = 0

        anna.register_strategy(meddle)
        for twin in (ctx, copy.deepcopy(ctx), ctx.game.fork(0).ctx):
            twin.game.step()
            there = twin.agent.get_agent("anna")
            assert (there.meta, there.later) == ({"hp": 3}, [0])
    assert len(refused) == 4  # the deep copy has a list of its own


def test_an_attribute_goes_with_snapshots_and_forks_and_may_be_deleted():
    with context() as ctx:
        anna = ctx.agent.create_agent("anna", start_node_id=0, meta={"hp": 3})
        before = ctx.game.snapshot()
        anna.meta["hp"] = 1
        anna.route = [1, 2]
        fork = ctx.game.fork(0).ctx.agent.get_agent("anna")
        fork.route.append(3)
        fork.only_here = {}
        assert (anna.route, fork.meta) == ([1, 2], {"hp": 1})
        assert "only_here" not in dir(anna)
        ctx.game.restore(before)
        assert anna.meta == {"hp": 3}
        with pytest.raises(AttributeError, match="route"):
            _ = anna.route
        del anna.meta
        assert not hasattr(anna, "meta")
        anna.meta = 3
        assert anna.meta == 3
