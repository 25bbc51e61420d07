"""Conflicts in games of the turn engine, and lots that are drawn again in every turn."""

import random
from collections import Counter

import pytest

import gamms
from gamms.rules import Conflicts, at_random

SIZE = 5


def quiet(**keywords):
    return gamms.create_context(logger_config={"level": "CRITICAL"}, **keywords)


def grid(ctx):
    """Nodes in a square, with edges both ways."""
    ctx.graph.add_nodes(range(SIZE**2), [n % SIZE for n in range(SIZE**2)], [n // SIZE for n in range(SIZE**2)])
    right = [(n, n + 1) for n in range(SIZE**2) if n % SIZE < SIZE - 1]
    ways = [*right, *((n, n + SIZE) for n in range(SIZE * (SIZE - 1)))]
    ways += [(end, start) for start, end in ways]
    ctx.graph.add_edges(range(len(ways)), *zip(*ways, strict=True))


def wander(state):
    state["action"] = state["rng"].choice(state["legal"])


def go(node):
    return lambda state: state.update(action=node)


@pytest.fixture
def ctx():
    with quiet(seed=11) as ctx:
        grid(ctx)
        yield ctx


def rivals(ctx, names="ab", target=6):
    """Agents beside one node, who all want to go there."""
    for name, node in zip(names, (1, 5, 7, 11), strict=False):
        ctx.agent.create_agent(name, start_node_id=node, strategy=go(target))


def drawn(seed, names="ab", bystanders=(), turns=1):
    """Who won in each turn, where all rivals begin again after each; bystanders have a contest of their own."""
    with quiet(seed=seed) as ctx:
        grid(ctx)
        for name in bystanders:
            ctx.agent.create_agent(name, start_node_id=24, strategy=go(23))
        rivals(ctx, names)
        ctx.game.conflicts = Conflicts(resolve=at_random())
        places = {name: ctx.agent.get_agent(name).current_node_id for name in names}
        winners = []
        for _ in range(turns):
            ctx.game.step()
            winners += [name for name in names if ctx.agent.get_agent(name).current_node_id == 6]
            for name, node in places.items():
                ctx.agent.get_agent(name).current_node_id = node
        return "".join(winners)


def test_conflicts_are_drawn_by_lot_unless_something_else_is_asked_for(ctx):
    rivals(ctx)
    moves = {name: gamms.typing.game.Move(name, None, start, 6, (start, 6)) for name, start in (("a", 1), ("b", 5))}
    drawn_by_lot = Conflicts(resolve=at_random())
    for turn in range(10):
        ctx.game.turn = turn
        assert Conflicts().resolve(moves, ctx) == drawn_by_lot.resolve(moves, ctx)


def test_draws_do_not_depend_on_who_else_is_there():
    assert drawn(3, turns=12) == drawn(3, bystanders=("aa", "zoe"), turns=12)


def test_draws_favour_no_agent():
    won = Counter(drawn(1, names="abcd", turns=400))
    assert all(70 <= won[name] <= 130 for name in "abcd")


@pytest.mark.parametrize("allow_swaps", [True, False])
def test_on_a_crowded_grid_no_two_ever_share_a_node_in_whatever_order_they_were_created(allow_swaps):
    def played(order):
        with quiet(seed=4) as ctx:
            grid(ctx)
            for number in order:
                ctx.agent.create_agent(f"{number:02}", start_node_id=number, strategy=wander)
            ctx.game.conflicts = Conflicts(allow_swaps=allow_swaps)
            for _ in range(25):
                before = {agent.name: agent.current_node_id for agent in ctx.game.agents}
                ctx.game.step()
                after = {agent.name: agent.current_node_id for agent in ctx.game.agents}
                assert len(set(after.values())) == len(after)
                ways = {(before[name], after[name]) for name in after if before[name] != after[name]}
                assert allow_swaps or not any((end, start) in ways for start, end in ways)
                yield after

    order = list(range(14))
    played_in_order = list(played(order))
    random.Random(2).shuffle(order)
    assert list(played(order)) == played_in_order
    assert played_in_order[0] != played_in_order[-1]


def test_a_reset_game_draws_the_same_numbers(ctx):
    for number in range(14):
        ctx.agent.create_agent(f"{number:02}", start_node_id=number, strategy=wander)
    ctx.game.conflicts = Conflicts()

    def where():
        ctx.game.run(10)
        return [agent.current_node_id for agent in ctx.game.agents]

    first = where()
    ctx.game.reset()
    assert where() == first
    ctx.game.reset(seed=12)
    assert where() != first


def test_an_error_of_a_resolver_names_the_turn(ctx):
    def refuse(contest, ctx):
        raise ZeroDivisionError

    for name, start in (("a", 0), ("b", 2)):
        ctx.agent.create_agent(name, start_node_id=start, strategy=go(1))
    ctx.game.conflicts = Conflicts(resolve=refuse)
    with pytest.raises(ZeroDivisionError) as caught:
        ctx.game.step()
    assert "in turn 0" in caught.value.__notes__[0]
