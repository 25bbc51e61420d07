"""The states of `random` and `numpy.random` that a game lends to strategies which draw from them."""

import random
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from threading import Lock, active_count
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.random.mtrand import get_bit_generator, set_bit_generator

from gamms.typing.context import HostContext


class _State(NamedTuple):
    """A state of `random`."""

    value: tuple[Any, ...]  # as `random.getstate` returns it
    words: bytes | None  # those of its value, as they are in memory; None: not known


class PythonRandom:
    """The state of `random`, which is made into a tuple only where it is not that of the last time.

    Args:
        reads_memory: whether its words are read where they can be found, else it is always made.
    """

    # NOTE: `random.getstate` makes 625 integers, 8 to 18 us; to read and compare their memory takes 0.3 us (decision
    # 0074; benchmarks: turns of 10 agents with a seed).

    def __init__(self, *, reads_memory: bool = True) -> None:
        self._reads_memory = reads_memory
        self._generator: Any = None  # whose memory `_words` is
        self._words: Any = None
        self._last: _State | None = None  # that was returned, or gone to, last

    def state(self) -> _State:
        """Return the state."""
        generator: Any = getattr(random.getstate, "__self__", None)
        last = self._last
        if generator is not self._generator:
            self._generator, self._words = generator, _words_of(generator) if self._reads_memory else None
        if self._words is None:
            return _State(random.getstate(), None)
        words = bytes(self._words)
        if last is not None and words == last.words and generator.gauss_next is last.value[2]:
            return last
        value = random.getstate()
        is_its_own = bytes(self._words) == words  # no other thread has drawn meanwhile
        self._last = last = _State(value, words if is_its_own else None)
        return last

    def go_to(self, state: _State) -> None:
        """Restore a state."""
        random.setstate(state.value)
        self._last = state


def _words_of(generator: object) -> Any:
    """Return the memory in which CPython has the place and the 624 words of a generator; None if it is not there.

    The generator has to outlive what is returned.
    """
    if sys.implementation.name != "cpython" or type(generator) is not random.Random:
        return None
    try:
        from ctypes import c_uint32
    except ImportError:  # a Python that was built without
        return None
    words, begin = c_uint32 * 625, object.__basicsize__
    if begin + 4 * 625 > random.Random.__basicsize__:  # what lies behind may not be readable
        return None
    other = random.Random(1)  # noqa: S311 - of the same class, for its layout
    for _ in range(3):
        *state, place = other.getstate()[1]
        if [*words.from_address(id(other) + begin)] != [place, *state]:
            return None
        other.random()
    return words.from_address(id(generator) + begin)


class GlobalRandom:
    """Lend a game states of its own for `random` and `numpy.random`, from which programs for 1.0.0 draw.

    Attributes:
        is_lent: whether they are lent now.
    """

    def __init__(self) -> None:
        self._state: _State | None = None  # of `random` in the game; None before the first draw
        self._bits: np.random.BitGenerator | None = None  # of `numpy.random` in the game
        self.is_lent = False
        self._is_shared = False  # whether a snapshot holds the generator, too: it is copied before the next draw
        self._spare: np.random.BitGenerator | None = None  # that nothing holds any more

    def snapshot(self) -> tuple[Any, Any]:
        """Return both streams as they are between two turns, for `restore`."""
        self._is_shared = True
        return self._state, self._bits

    def restore(self, streams: tuple[Any, Any]) -> None:
        """Restore both streams."""
        self.forget()
        self._state, self._bits = streams
        self._is_shared = True

    def forget(self) -> None:
        """Start both streams again from the seed of the context."""
        if not (self._is_shared or self.is_lent or self._bits is None):
            self._spare = self._bits
        self._state = self._bits = None

    @contextmanager
    def of(self, ctx: HostContext) -> Iterator[None]:
        """Lend the game's generators for the block, if the context has a seed; afterwards both are as before."""
        if self.is_lent or not ctx.is_seeded:
            yield
            return
        # NOTE: the generator of NumPy is exchanged, not copied: `step` does this in every turn (benchmarks, turns).
        # Exchanging it drops the normal number that NumPy may have drawn ahead, so that only then its state is read.
        with _EXCHANGE:
            numpy_state = np.random.get_state(legacy=False) if _has_drawn_ahead() else None  # noqa: NPY002 - as above
            found = _Found(_PYTHON.state(), get_bit_generator(), numpy_state)
            _FOUND.append(found)
        self.is_lent = True
        try:
            with _EXCHANGE:
                self._begin(ctx)
            yield
        finally:
            self.is_lent = False
            with _EXCHANGE:
                self._state = _PYTHON.state()
                found.give_back()

    def begin_turn(self) -> None:
        """Drop the normal number that NumPy has drawn ahead, so that turns one by one are as those of a run.

        To be called while they are lent.
        """
        if self._bits is not None:
            set_bit_generator(self._bits)

    def _begin(self, ctx: HostContext) -> None:
        if self._state is not None and self._bits is not None:
            if self._is_shared:
                # NOTE: here and not in `snapshot`: it takes 60 us, and a search restores more often than it plays.
                self._bits = deepcopy(self._bits)
            _PYTHON.go_to(self._state)
            set_bit_generator(self._bits)
            self._is_shared = False
            return
        stream = ctx.stream("game", "global")
        random.seed(int(stream.integers(2**62)))
        # NOTE: making one takes 84 us, which is more than three turns of ten agents (benchmarks: turns).
        self._bits, self._spare, self._is_shared = self._spare or np.random.MT19937(), None, False
        set_bit_generator(self._bits)
        np.random.seed(int(stream.integers(2**32)))  # noqa: NPY002 - what programs for 1.0.0 draw from


class _Found:
    """What a game has found in `random` and `numpy.random` when they were lent to it."""

    def __init__(self, state: _State, bits: np.random.BitGenerator, numpy_state: dict[str, Any] | None) -> None:
        self._streams = state, bits, numpy_state

    def give_back(self) -> None:
        """Restore it; where a game of another thread has begun later and goes on, that one will."""
        place = _FOUND.index(self)
        del _FOUND[place]
        if place < len(_FOUND):
            _FOUND[place]._streams = self._streams
            return
        state, bits, numpy_state = self._streams
        _PYTHON.go_to(state)
        set_bit_generator(bits)
        if numpy_state is not None:
            np.random.set_state(numpy_state)  # noqa: NPY002 - what programs for 1.0.0 draw from


_EXCHANGE = Lock()  # held while they are exchanged: games may be played in several threads
_PYTHON = PythonRandom()
_FOUND: list[_Found] = []  # by the games that they are lent to, in the order in which these have begun


def _has_drawn_ahead() -> bool:
    """Return whether `numpy.random` keeps a normal number that it has drawn ahead."""
    # NOTE: NumPy says so only together with the state of its bit generator, whose 624 words take 60 us to copy; here it
    # asks one that has none (decision 0063).
    numpy_random: Any = np.random.get_state.__self__  # type: ignore[attr-defined]
    if not hasattr(numpy_random, "_bit_generator") or active_count() > 1:  # other threads may draw from it
        return bool(numpy_random.get_state(legacy=False)["has_gauss"])
    bits = numpy_random._bit_generator
    numpy_random._bit_generator = SimpleNamespace(state={"bit_generator": "none"})
    try:
        return bool(numpy_random.get_state(legacy=False)["has_gauss"])
    finally:
        numpy_random._bit_generator = bits
