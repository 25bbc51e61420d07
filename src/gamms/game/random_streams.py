"""Random numbers of a game: those of agents, which follow from the turn, and the global generators."""

import random
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import wraps
from threading import Lock, active_count
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.random import Generator, Philox
from numpy.random.mtrand import get_bit_generator, set_bit_generator

from gamms import kernels
from gamms.arguments import as_array, as_one_shape
from gamms.errors import BadValue
from gamms.ir.game_state import GameState
from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels.draws import BitArray
from gamms.text import shown
from gamms.typing.context import HostContext

T = TypeVar("T")
_DRAWN_AHEAD, _MOST_TURNS_AHEAD = 2048, 256  # numbers in a block of `DrawTable`, and turns
_NO_PLACE = 1 << 62  # in a `DrawTable`


class _Moment(NamedTuple):
    """A turn that stays as it is."""

    turn: int


class DrawTable:
    """The first draws of the agents of a game in this turn and in those that follow, worked out in blocks of turns.

    Args:
        seed: of the game.
        clock: its `turn` counts: the state of the game, or the moment at which a copy was made.

    Attributes:
        seed, clock: as given.
        turn: that to which `row` belongs.
        row: the first draws in that turn, of the agents in the order in which they were added before it.
    """

    # NOTE: 50 ns for each number; one by one they take 850 ns (benchmarks: turns).

    __slots__ = ("_begin", "_names", "_of_names", "_rows", "clock", "row", "seed", "turn")

    def __init__(self, seed: int, clock: GameState | _Moment) -> None:
        self.seed, self.clock = seed, clock
        self.turn, self.row = -1, list[int]()
        self._names: list[str] = []
        self._begin = 0  # the first turn of the block
        self._rows: BitArray = np.empty(
            (0, 0), np.uint64
        )  # the draws of each, as an array: lists would be searched for garbage
        self._of_names = 0  # how many agents those are of

    def __len__(self) -> int:
        return len(self._names)

    def add(self, name: str) -> int:
        """Add an agent; returns its place in the rows of later turns."""
        self._names.append(name)
        return len(self._names) - 1

    def begin_turn(self, turn: int) -> None:
        """Set `row` to the first draws in a turn."""
        at, count = turn - self._begin, len(self._names)
        if count and not (0 <= at < len(self._rows) and self._of_names == count):
            turns = max(1, min(_MOST_TURNS_AHEAD, _DRAWN_AHEAD // count))
            purpose = np.array([kernels.purpose_key(self.seed, "agent")], np.uint64)
            first = kernels.first_key_rows(purpose, kernels.name_keys(self._names))
            keys = kernels.later_key_rows(first, np.arange(turn, turn + turns)[:, None])
            self._begin, self._of_names, at = turn, count, 0
            self._rows = kernels.bits_at_rows(keys, 0)
        self.turn = turn
        if count:
            self.row = self._rows[at].tolist()


class Draws:
    """The keyed draws of one agent: `state["draw"]`.

    Draw number k of a turn follows from the seed, the agent's name, the turn and k alone (`kernels.draws`), so no other
    agent's draws change it. Each agent has draws of its own; what `choice` takes a fraction of a microsecond for takes
    NumPy's generators seven.

    Args:
        table: of the game.
        name: of the agent.
    """

    __slots__ = ("_clock", "_count", "_key", "_keyed_turn", "_name", "_place", "_table", "_turn")

    def __init__(self, table: DrawTable, name: str) -> None:
        self._table, self._clock, self._name = table, table.clock, name
        self._turn, self._count = -1, 0
        self._keyed_turn, self._key = -1, 0  # the key of a turn
        self._place = _NO_PLACE  # in the rows of the table, once it has drawn

    def __reduce__(self) -> tuple[Any, ...]:
        # A copy goes on by itself from here: the game stays where it is.
        return _draws_at, self._point

    def __eq__(self, other: object) -> bool:
        """Whether both draw the same from here."""
        if not isinstance(other, Draws):
            return NotImplemented
        return self._point == other._point

    __hash__ = None  # type: ignore[assignment] # what draws moves on

    @property
    def _point(self) -> tuple[int, str, int, int]:
        now = self._clock.turn
        return self._table.seed, self._name, now, self._count if now == self._turn else 0

    def mark(self) -> int | None:
        """Return how much was drawn in this turn, for `go_to`; None: nothing."""
        return self._count if self._turn == self._clock.turn else None

    def go_to(self, mark: int | None) -> None:
        """Go on from a mark of this turn."""
        self._turn = -1 if mark is None else self._clock.turn
        self._count = mark or 0

    def bits(self) -> int:
        """Return 64 random bits."""
        turn, table = self._clock.turn, self._table
        if turn == self._turn:
            count = self._count
            self._count = count + 1
            return kernels.bits_at(self._key_of(turn), count)
        self._turn, self._count = turn, 1
        if table.turn != turn:
            table.begin_turn(turn)
        if self._place < len(table.row):
            return table.row[self._place]
        if self._place == _NO_PLACE:
            self._place = table.add(self._name)
        return kernels.bits_at(self._key_of(turn), 0)

    def _key_of(self, turn: int) -> int:
        if self._keyed_turn != turn:
            first = kernels.first_key(kernels.purpose_key(self._table.seed, "agent"), kernels.name_key(self._name))
            self._keyed_turn, self._key = turn, kernels.later_key(first, turn)
        return self._key

    def random(self) -> float:
        """Return a number in [0, 1)."""
        return kernels.fraction(self.bits())

    def below(self, n: int) -> int:
        """Return an integer from 0 to `n - 1`, each as likely.

        Raises:
            BadValue: `n` is not between 1 and 2 ** 32.
        """
        if not 1 <= n <= 1 << 32:
            raise BadValue(f"state['draw'].below(n) needs 1 <= n <= 2 ** 32, not {shown(n)}.")
        # NOTE: `bits` for the first draw of a turn, and `kernels.below`, in line (benchmarks: 5 against 5 by reset).
        turn, table = self._clock.turn, self._table
        if self._turn != turn == table.turn:
            try:
                bits = table.row[self._place]
            except IndexError:  # it has not drawn in an earlier turn
                pass
            else:
                self._turn, self._count = turn, 1
                return (bits >> 32) * n >> 32
        return (self.bits() >> 32) * n >> 32

    def choice(self, options: Sequence[T]) -> T:
        """Return one of the options, each as likely.

        Raises:
            BadValue: there is none.
        """
        return options[self.below(len(options))]


class ArrayDraws:
    """Keyed draws of many agents at once: each call gives one number for each."""

    @abstractmethod
    def bits(self) -> BitArray:
        """Return 64 random bits for each."""

    def random(self) -> FloatArray:
        """Return a number in [0, 1) for each."""
        return kernels.fraction_many(self.bits())

    def below(self, n: IntArray | int) -> IntArray:
        """Return an integer from 0 to `n - 1` for each; `n` is one number, or one for each.

        Raises:
            BadValue: one of `n` is not between 1 and 2 ** 32.
        """
        bounds = as_array(n, "n of draw.below(n)", "integers")
        if bounds.size and not (bounds.min() >= 1 and bounds.max() <= 1 << 32):
            raise BadValue(f"draw.below(n) needs 1 <= n <= 2 ** 32, not {shown(n)}.")
        bits = self.bits()
        return kernels.below_many(*as_one_shape({"draw": bits, "n": bounds}) if bounds.ndim else (bits, bounds))


class TeamDraws(ArrayDraws):
    """The keyed draws of several agents: each call gives one number for each agent, (agents,).

    They are those that the agents get from their `state["draw"]` in the same turn, call by call.

    Args:
        first_keys: returns the keys of the agents (agents,); see `kernels.first_key_rows`.
        turn: the number of turns that were played.
    """

    def __init__(self, first_keys: Callable[[], BitArray], turn: int) -> None:
        self._first_keys, self._turn = first_keys, turn
        self._keys: BitArray | None = None  # of this turn
        self._count = 0

    def bits(self) -> BitArray:
        """Return 64 random bits for each agent."""
        if self._keys is None:
            self._keys = kernels.later_key_rows(self._first_keys(), np.array([self._turn]))
        self._count += 1
        return kernels.bits_at_rows(self._keys, self._count - 1)


def _draws_at(seed: int, name: str, turn: int, count: int) -> Draws:
    draws = Draws(DrawTable(seed, _Moment(turn)), name)
    draws.go_to(count or None)
    return draws


class TurnGenerator(Generator):
    """A NumPy generator whose draws follow from its key and the turn alone: `state["rng"]`.

    Args:
        seed: of the game.
        clock: the state of the game, whose `turn` counts.
        name: of the agent.
    """

    # NOTE: made when something is drawn, not with the agent: most agents never ask, and a Philox takes 15 us and
    # 1.7 kB (benchmarks: turns).

    def __init__(self, seed: int, clock: GameState, name: str) -> None:
        self._seed, self._clock, self._name = seed, clock, name
        self._turn = -1
        self._begin: Any = None

    def seek(self) -> None:
        """Begin the stream of this turn."""
        if self._begin is None:
            super().__init__(Philox(key=kernels.stream_key(self._seed, "agent", self._name)))
            self._begin = super().bit_generator.state
        self._turn = self._clock.turn
        self._begin["state"]["counter"][2] = self._turn
        super().bit_generator.state = self._begin

    def mark(self) -> Mapping[str, Any] | None:
        """Return the state in this turn, for `go_to`; None: nothing was drawn."""
        return super().bit_generator.state if self._turn == self._clock.turn else None

    def go_to(self, mark: Mapping[str, Any] | None) -> None:
        """Go on from a mark of this turn."""
        self._turn = -1
        if mark is not None:
            self.seek()
            super().bit_generator.state = mark

    @property
    def bit_generator(self) -> Any:
        """The Philox of this turn."""
        if self._turn != self._clock.turn:
            self.seek()
        return super().bit_generator

    def __reduce__(self) -> Any:
        # A copy is a generator of NumPy's that goes on from here.
        return Generator, (deepcopy(self.bit_generator),)


def _drawing(method: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(method)
    def draw(self: TurnGenerator, *args: object, **kwargs: object) -> Any:
        if self._turn != self._clock.turn:
            self.seek()
        return method(self, *args, **kwargs)

    return draw


for _name, _method in list(vars(Generator).items()):
    if not _name.startswith("_") and callable(_method):
        setattr(TurnGenerator, _name, _drawing(_method))


class GlobalRandom:
    """Lend a game states of its own for `random` and `numpy.random`, from which programs for 1.0.0 draw.

    Attributes:
        is_lent: whether they are lent now.
    """

    def __init__(self) -> None:
        self._state: Any = None  # of `random` in the game, where its draws have come to; None before the first
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
            found = _Found(random.getstate(), get_bit_generator(), numpy_state)
            _FOUND.append(found)
        self.is_lent = True
        try:
            with _EXCHANGE:
                self._begin(ctx)
            yield
        finally:
            self.is_lent = False
            with _EXCHANGE:
                self._state = random.getstate()
                found.give_back()

    def begin_turn(self) -> None:
        """Drop the normal number that NumPy has drawn ahead, so that turns one by one are as those of a run.

        To be called while they are lent.
        """
        if self._bits is not None:
            set_bit_generator(self._bits)

    def _begin(self, ctx: HostContext) -> None:
        if self._bits is not None:
            if self._is_shared:
                # NOTE: here and not in `snapshot`: it takes 60 us, and a search restores more often than it plays.
                self._bits = deepcopy(self._bits)
            random.setstate(self._state)
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

    def __init__(
        self, state: tuple[Any, ...], bits: np.random.BitGenerator, numpy_state: dict[str, Any] | None
    ) -> None:
        self._streams = state, bits, numpy_state

    def give_back(self) -> None:
        """Restore it; where a game of another thread has begun later and goes on, that one will."""
        place = _FOUND.index(self)
        del _FOUND[place]
        if place < len(_FOUND):
            _FOUND[place]._streams = self._streams
            return
        state, bits, numpy_state = self._streams
        random.setstate(state)
        set_bit_generator(bits)
        if numpy_state is not None:
            np.random.set_state(numpy_state)  # noqa: NPY002 - what programs for 1.0.0 draw from


_EXCHANGE = Lock()  # held while they are exchanged: games may be played in several threads
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
