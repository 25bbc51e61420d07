"""Seed the global generators of `random` and `numpy.random` during a game."""

import random
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from gamms.typing.context import HostContext


def global_state() -> tuple[object, ...]:
    """Return the states of both generators; the result is equal to an earlier one if nothing was drawn since."""
    numpy = np.random.get_state(legacy=False)["state"]  # noqa: NPY002 - as below
    return random.getstate(), numpy["pos"], numpy["key"].tobytes()


@contextmanager
def seeded_for_run(ctx: HostContext, turn: int) -> Iterator[None]:
    """Seed `random` and `numpy.random` from the seed of a context within the block, and restore them afterwards.

    Strategies written for 1.0.0 draw from these generators. They belong to the process: games in several threads share
    them, and each draw changes the draws of all agents.

    Args:
        ctx: the context; if its seed was not given by the caller, nothing is seeded.
        turn: the first turn of the block.
    """
    if not ctx.is_seeded:
        yield
        return
    python = random.getstate()
    numpy = np.random.get_state(legacy=False)  # noqa: NPY002 - what those programs draw from
    stream = ctx.stream("game", "global", turn)
    random.seed(int(stream.integers(2**62)))
    np.random.seed(int(stream.integers(2**32)))  # noqa: NPY002 - as above
    try:
        yield
    finally:
        random.setstate(python)
        np.random.set_state(numpy)  # noqa: NPY002 - as above
