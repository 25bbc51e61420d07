"""Games with a seed are lent states of `random`, and programs find theirs as they have left it."""

import random
import sys
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.game import global_random
from gamms.game.global_random import PythonRandom

DRAWS = {
    "random": lambda rng: rng.random(),
    "gauss": lambda rng: rng.gauss(0.0, 1.0),
    "all words": lambda rng: rng.getrandbits(32 * 624),
    "sample": lambda rng: rng.sample(range(9), 9),
    "seed": lambda rng: rng.seed(5),
    "state": lambda rng: rng.setstate(random.Random(9).getstate()),
    "first place": lambda rng: rng.setstate((3, (*range(1, 625), 0), None)),
    "normal number": lambda rng: rng.setstate((*rng.getstate()[:2], 0.25)),
    "no normal number": lambda rng: rng.setstate((*rng.getstate()[:2], None)),
    "generator of its own": lambda rng: random.Random(3).random(),
}
SOME = st.lists(st.sampled_from([*DRAWS, "another game"]), max_size=3)


class Played:
    """A game of one agent that draws what `wanted` says, and from a generator that is not global the same."""

    def __init__(self, seed, wanted, *, another=None):
        self.ctx = gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"})
        self.ctx.graph.add_nodes([0], [0.0], [0.0])
        self.ctx.agent.create_agent("a", start_node_id=0, strategy=self.strategy)
        self.game, self.wanted, self.another = self.ctx.game, wanted, another
        self.expected, self.seen = random.Random(), []

    def strategy(self, state):
        if state["turn"] == 0:
            self.expected.setstate(random.getstate())
        self.seen += drawn_beside(self.expected, self.wanted[state["turn"]], self.another)
        state["action"] = 0


def drawn_beside(expected, names, another):
    """Return what is drawn from `random` and from another generator, and the states of both after that."""
    pairs = []
    for name in names:
        if name == "another game":
            if another is not None:
                another.game.step()
        else:
            pairs.append((DRAWS[name](random), DRAWS[name](expected)))
    return [*pairs, (random.getstate(), expected.getstate())]


@pytest.mark.parametrize("reads_memory", [True, False])
@given(turns=st.lists(st.tuples(SOME, SOME), max_size=5))
def test_what_programs_and_games_draw_in_turn_is_what_each_draws_alone(reads_memory, turns):
    program, seen = random.Random(), []
    program.setstate(random.getstate())
    with patch.object(global_random, "_PYTHON", PythonRandom(reads_memory=reads_memory)):
        another = Played(2, [["random"]] * 40)
        played = Played(1, [inside for _, inside in turns], another=another)
        for outside, _ in turns:
            seen += drawn_beside(program, outside, another)
            played.game.step()
            seen.append((random.getstate(), program.getstate()))
    for one, other in (*seen, *played.seen, *another.seen):
        assert one == other
    assert len(played.seen) >= len(turns)


@pytest.mark.skipif(sys.implementation.name != "cpython", reason="the memory of CPython's generator")
def test_a_state_is_made_only_where_it_is_not_that_of_the_last_time():
    generator = PythonRandom()
    random.seed(1)
    state = generator.state()
    assert generator.state() is state
    random.random()
    later = generator.state()
    assert later.value == random.getstate() != state.value
    generator.go_to(state)
    assert generator.state() is state
    assert random.getstate() == state.value


def test_a_generator_that_takes_the_place_of_the_global_one_counts(monkeypatch):
    generator = PythonRandom()
    generator.state()
    other = random.Random(4)
    monkeypatch.setattr(random, "getstate", other.getstate)
    assert generator.state().value == other.getstate()


@pytest.mark.parametrize("name", ["pypy", "graalpy"])
def test_the_memory_of_other_interpreters_is_not_read(monkeypatch, name):
    monkeypatch.setattr(sys.implementation, "name", name)
    generator = PythonRandom()
    random.seed(1)
    assert generator.state() == (random.getstate(), None)


def test_the_memory_of_generators_of_other_classes_is_not_read(monkeypatch):
    class Other(random.Random):
        pass

    other = Other(4)
    monkeypatch.setattr(random, "getstate", other.getstate)
    assert PythonRandom().state() == (other.getstate(), None)


def test_without_ctypes_the_state_is_made_each_time(monkeypatch):
    monkeypatch.setitem(sys.modules, "ctypes", None)
    random.seed(1)
    assert PythonRandom().state() == (random.getstate(), None)
