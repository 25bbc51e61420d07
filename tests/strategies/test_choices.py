"""Strategies of strategies: the first that decides, one by chance, a person."""

import inspect

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType
from gamms.strategies import chase, first, flee, goto, human, mix, patrol, random_walk, stay


def says(action):
    return human(lambda _: action)


def action_of(strategy, **state):
    state = {"curr_pos": 5, "sensor": {}, **state}
    strategy(state)
    return state.get("action")


@given(st.lists(st.one_of(st.none(), st.integers(0, 9)), min_size=1))
def test_the_first_that_sets_an_action_decides(actions):
    expected = next((action for action in actions if action is not None), None)
    assert action_of(first(*map(says, actions))) == expected
    assert action_of(first(*map(says, actions)), action=99) == expected
    assert action_of(first(first(*map(says, actions)), stay)) == (5 if expected is None else expected)


def test_no_strategy_is_asked_after_the_first_that_decides():
    asked = []
    first(says(1), human(asked.append))({"curr_pos": 5, "sensor": {}})
    assert asked == []


def test_a_mix_asks_the_one_as_often_as_the_probability_says_and_draws_once_a_turn():
    rng, twin = np.random.default_rng(4), np.random.default_rng(4)
    mixed = mix(0.3, says("a"), says("b"))
    actions = [action_of(mixed, rng=rng) for _ in range(2000)]
    assert actions == ["a" if twin.random() < 0.3 else "b" for _ in range(2000)]
    assert {action_of(mix(1, says("a"), says("b")), rng=rng) for _ in range(50)} == {"a"}
    assert {action_of(mix(0, says("a"), says("b")), rng=rng) for _ in range(50)} == {"b"}


def test_a_person_is_shown_the_state_and_decides():
    seen = []
    assert action_of(human(lambda state: seen.append(state["curr_pos"]) or 6)) == 6
    assert seen == [5]
    assert action_of(human(lambda _: None)) is None
    assert action_of(human(lambda _: "nonsense")) == "nonsense"


def test_an_invalid_strategy_is_refused():
    for make in (lambda: first(stay, 3), lambda: mix(0.5, stay, 3), lambda: mix(0.5, 3, stay), lambda: human(3)):
        with pytest.raises(TypeError, match="must be a function of the state, not 3"):
            make()
    with pytest.raises(TypeError, match=r"goto makes such a function: call it, goto\(…\)"):
        mix(0.5, stay, goto)
    assert inspect.signature(stay).parameters["state"].default is inspect.Parameter.empty
    with pytest.raises(ValueError, match="at least one strategy"):
        first()
    for p in (-0.1, 1.5, float("nan")):
        with pytest.raises(ValueError, match="p of mix must be"):
            mix(p, stay, stay)
    with pytest.raises(KeyError, match=r"mix needs state\['rng'\]"):
        mix(0.5, stay, stay)({"curr_pos": 5, "sensor": {}})


def test_the_same_seed_gives_the_same_game(open_world):
    games = []
    for order in (1, -1):
        with open_world(seed=11) as world:
            hunt = first(chase(world.ctx, otherwise=None), mix(0.5, patrol(world.ctx, [0, 35]), random_walk))
            teams = {"cat": (0, hunt, 1), "dog": (30, hunt, 1), "mouse": (14, flee(world.ctx, random_walk), 2)}
            for name, (node, strategy, team) in list(teams.items())[::order]:
                world.add(name, node, strategy, sight=25.0, team=team)
            games.append(world.play(40))
    assert games[0] == games[1]


SHIPPED = [getattr(gamms.strategies, name) for name in gamms.strategies.__all__]
PLAIN = [one for one in SHIPPED if list(inspect.signature(one).parameters) == ["state"]]


@pytest.mark.parametrize("strategy", PLAIN)
def test_a_strategy_that_is_called_as_if_it_made_one_says_how_it_is_written(strategy):
    name = strategy.__name__
    with gamms.create_context() as ctx:
        for given in ((), (ctx,)):
            with pytest.raises(
                BadType, match=rf"{name} is a strategy, which games call.* Write strategy={name}, without"
            ):
                strategy(*given)
