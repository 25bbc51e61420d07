"""The global random generators, lent to a game: the paper's own listing draws from them."""

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.progress import progress

if TYPE_CHECKING:
    from gamms.game.game import Game


class GlobalChance:
    """What `random` and `numpy.random` draw while a game is played."""

    def __init__(self) -> None:
        self._states: tuple[Any, Any] | None = None  # where the game's own draws have come to

    def forget(self) -> None:
        """Begin anew."""
        self._states = None

    @contextmanager
    def of(self, ctx: Any) -> Iterator[None]:
        """Seed both for the block, if the context has a seed of the caller's; afterwards they are as before."""
        if not ctx.is_seeded:
            yield
            return
        outside = random.getstate(), np.random.get_state()  # noqa: NPY002 - what programs for 1.0.0 draw from
        if self._states is None:
            stream = ctx.stream("game", "global")
            random.seed(int(stream.integers(2**62)))
            np.random.seed(int(stream.integers(2**32)))  # noqa: NPY002 - as above
        else:
            _set(self._states)
        try:
            yield
        finally:
            self._states = random.getstate(), np.random.get_state()  # noqa: NPY002 - as above
            _set(outside)


@contextmanager
def shown(game: "Game", last: int | None, *, is_shown: bool) -> Iterator[Callable[[], None]]:
    """How far a game is, on one line of stderr."""
    if not is_shown:
        yield _say_nothing
        return
    of = "" if last is None else f" of {last}"
    with progress() as say:
        yield lambda: say(f"turn {game.turn}{of}")


def _set(states: tuple[Any, Any]) -> None:
    random.setstate(states[0])
    np.random.set_state(states[1])  # noqa: NPY002 - as above


def _say_nothing() -> None:
    pass
