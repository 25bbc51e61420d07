"""The global random generators, lent to a game: the paper's own listing draws from them."""

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random.mtrand import get_bit_generator, set_bit_generator

from gamms.progress import progress

if TYPE_CHECKING:
    from gamms.game.game import Game


class GlobalChance:
    """What `random` and `numpy.random` draw while a game is played: each has a state that belongs to the game."""

    def __init__(self) -> None:
        self._state: Any = None  # of `random` in the game, where its draws have come to; None before the first
        self._bits: np.random.BitGenerator | None = None  # of `numpy.random` in the game
        self._is_lent = False

    def forget(self) -> None:
        """Begin again with the seed of the context."""
        self._state = self._bits = None

    @contextmanager
    def of(self, ctx: Any) -> Iterator[None]:
        """Lend the game's generators for the block, if the context has a seed; afterwards both are as before."""
        if self._is_lent or not ctx.is_seeded:
            yield
            return
        # NOTE: the generator of NumPy is exchanged, not copied: `step` does this in every turn (benchmarks, turns).
        state, bits = random.getstate(), get_bit_generator()
        numpy_state = np.random.get_state(legacy=False)  # noqa: NPY002 - for the normal number that it may keep
        self._is_lent = True
        try:
            self._begin(ctx)
            yield
        finally:
            self._is_lent = False
            self._state = random.getstate()
            random.setstate(state)
            set_bit_generator(bits)
            if numpy_state["has_gauss"]:
                np.random.set_state(numpy_state)  # noqa: NPY002 - as above

    def begin_turn(self) -> None:
        """Drop the normal number that NumPy has drawn ahead, so that turns one by one are as those of a run."""
        if self._is_lent and self._bits is not None:
            set_bit_generator(self._bits)

    def _begin(self, ctx: Any) -> None:
        if self._bits is not None:
            random.setstate(self._state)
            set_bit_generator(self._bits)
            return
        stream = ctx.stream("game", "global")
        random.seed(int(stream.integers(2**62)))
        self._bits = np.random.MT19937()
        set_bit_generator(self._bits)
        np.random.seed(int(stream.integers(2**32)))  # noqa: NPY002 - what programs for 1.0.0 draw from


@contextmanager
def shown(game: "Game", last: int | None, *, is_shown: bool) -> Iterator[Callable[[], None]]:
    """How far a game is, on one line of stderr."""
    if not is_shown:
        yield _say_nothing
        return
    of = "" if last is None else f" of {last}"
    with progress() as say:
        yield lambda: say(f"turn {game.turn}{of}")


def _say_nothing() -> None:
    pass
