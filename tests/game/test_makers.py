"""Which functions are strategies, and which make them: told by annotations and by what they return."""

from functools import partial

import pytest

import gamms
from gamms.strategies import chase, goto
from gamms.typing import IContext


@pytest.fixture
def agent():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.add_nodes(range(4), [0, 1, 2, 3], [0, 0, 0, 0])
        ctx.graph.add_edges(range(3), [0, 1, 2], [1, 2, 3])
        yield ctx.agent.create_agent("ann", start_node_id=0, team="red")


def annotated(game: IContext):
    return goto(game, 3)


class Made:
    def __init__(self, where):
        self.where = where.agent

    def __call__(self, state):
        state["action"] = 1


in_arrays = gamms.array_strategy(lambda view: view.counts * 0)


MAKERS = {
    "a lambda": lambda c: goto(c, 3),
    "of array strategies": lambda c: [in_arrays(c)][0],
    "a partial": partial(goto, target=3),
    "annotated": annotated,
    "a class": Made,
    "of GAMMS": chase,
    "of a function with any parameter": lambda c: lambda s: s.update(action=1),
}


@pytest.mark.parametrize("maker", MAKERS.values(), ids=MAKERS.keys())
def test_a_function_that_returns_a_function_of_the_context_makes_strategies(agent, maker):
    agent.register_strategy(maker)
    assert agent.strategy is not maker
    agent._ctx.game.run(1)


def test_a_function_that_cannot_be_told_is_refused_at_once(agent):
    agent.strategy = lambda s: s.get("nothing")  # it fails with a context, as strategies do
    with pytest.raises(
        TypeError,
        match=r"Unknown node 9. There are: 0, 1, 2, 3. Name its first parameter state .*, and ctx if it makes one",
    ):
        agent.strategy = lambda c: goto(c, 9)
    with pytest.raises(TypeError, match="makes a strategy, but needs more than the context"):
        agent.strategy = goto
    with pytest.raises(TypeError, match="which is not a strategy"):
        agent.strategy = lambda ctx: ctx.seed


def test_nothing_changes_while_a_function_is_looked_at(agent):
    game = agent._ctx
    with pytest.raises(TypeError, match="IllegalMutation"):
        agent.strategy = lambda c: c.agent.create_agent("bob", start_node_id=0)
    assert list(game.agent.agents) == ["ann"]


def test_a_maker_of_plans_and_one_of_awaited_strategies_command_a_team(agent):
    game, asked = agent._ctx.game, []

    def plan(ctx):
        return lambda states: asked.append([*states])

    def awaited_one(ctx):
        async def strategy(state):
            asked.append(state["name"])

        return strategy

    for maker, found in ((awaited_one, "ann"),):
        game.command("red", maker)
        game.run(1)
        assert asked == [found]
    game.command("red", plan)
    game.run(1)
    assert asked[-1] == ["ann"]
