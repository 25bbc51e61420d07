"""The generators of `random` and `numpy.random` while a whole game is played."""

import random
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from gamms.typing.context import HostContext


def global_state() -> tuple[object, ...]:
    """Return the states of both generators, equal to those of another moment if nothing was drawn since."""
    numpy = np.random.get_state(legacy=False)["state"]  # noqa: NPY002 - as below
    return random.getstate(), numpy["pos"], numpy["key"].tobytes()


@contextmanager
def seeded_for_run(ctx: HostContext, turn: int) -> Iterator[None]:
    """Seed `random` and `numpy.random` for the block, from the seed of a context; afterwards they are as before.

    Strategies of programs for 1.0.0 draw from them. They belong to the process: games in several threads draw from
    each other's, and each draw changes those of all other agents.

    Args:
        ctx: the context; nothing is seeded where its seed was not given by the caller.
        turn: the first turn that is played in the block.
    """
    if not ctx.is_seeded:
        yield
        return
    python, numpy = random.getstate(), np.random.get_state(legacy=False)  # noqa: NPY002 - what those programs draw from
    stream = ctx.stream("game", "global", turn)
    random.seed(int(stream.integers(2**62)))
    np.random.seed(int(stream.integers(2**32)))  # noqa: NPY002 - as above
    try:
        yield
    finally:
        random.setstate(python)
        np.random.set_state(numpy)  # noqa: NPY002 - as above
