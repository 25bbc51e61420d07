"""Randomness: one seed, and streams by name that other draws do not change."""

import subprocess
import sys

import numpy as np
import pytest

DRAWS = """
import gamms
ctx = gamms.create_context(logger_config={"level": "CRITICAL"}, seed=7)
names = [("context",), ("agent", "anna"), ("agent", 1), ("weather", -3, "x")]
print([ctx.rng.random(), *(ctx.stream(*name).random(2).tolist() for name in names), ctx.rng.integers(100)])
"""


def draws(ctx, *names):
    return ctx.stream(*names).integers(1 << 30, size=4).tolist()


def test_the_same_seed_gives_the_same_draws_in_any_process(capsys):
    exec(DRAWS, {})
    other = subprocess.check_output([sys.executable, "-c", DRAWS], env={"PYTHONHASHSEED": "4711"}, text=True)
    assert other == capsys.readouterr().out


def test_the_draws_of_a_seed_do_not_change_from_version_to_version(open_context):
    assert draws(open_context(seed=7), "agent", "anna") == [68372296, 692402616, 1028463068, 395768944]


def test_a_stream_is_independent_of_all_other_draws(open_context):
    first, second = open_context(seed=3), open_context(seed=3)
    first.rng.random(100)
    first.stream("agent", "berta").random(10)
    assert draws(first, "agent", "anna") == draws(second, "agent", "anna")
    assert second.rng.random() != first.rng.random()


def test_a_stream_begins_again_each_time_and_the_contexts_own_goes_on(open_context):
    ctx = open_context(seed=3)
    assert draws(ctx, "a") == draws(ctx, "a")
    assert ctx.rng is ctx.rng
    assert ctx.rng.random() != ctx.rng.random()


def test_other_names_and_other_seeds_give_other_draws(open_context):
    ctx = open_context(seed=3)
    names = [(), ("a",), ("b",), ("a", "b"), ("b", "a"), ("ab",), (1,), ("1",), (1, 2), (12,), ("a", 1), ("a, 1",)]
    assert len({tuple(draws(ctx, *name)) for name in names}) == len(names)
    assert draws(open_context(seed=4), "a") != draws(ctx, "a")


def test_numpys_names_and_numbers_are_those_of_python(open_context):
    ctx = open_context(seed=np.int64(3))
    assert (ctx.seed, type(ctx.seed)) == (3, int)
    assert draws(ctx, np.int64(5), np.str_("a")) == draws(open_context(seed=3), 5, "a")


@pytest.mark.parametrize("name", [object(), 1.5, True, None, ("a",), b"a"])
def test_a_name_that_may_differ_from_run_to_run_is_refused(open_context, name):
    with pytest.raises(TypeError, match="name of a stream"):
        open_context(seed=3).stream("agent", name)


def test_without_a_seed_every_context_has_its_own(open_context):
    first, second = open_context(), open_context()
    assert first.seed != second.seed
    assert first.rng.random() != second.rng.random()
    assert draws(open_context(seed=first.seed), "a") == draws(first, "a")


@pytest.mark.parametrize(
    ("seed", "error"), [(1.5, TypeError), ("1", TypeError), (True, TypeError), (2**64, ValueError)]
)
def test_a_bad_seed_is_refused(open_context, seed, error):
    with pytest.raises(error, match="seed"):
        open_context(seed=seed)


@pytest.mark.parametrize("seed", [0, -1, 2**62])
def test_any_integer_of_64_bits_is_a_seed(open_context, seed):
    assert open_context(seed=seed).seed == seed
