"""Random streams of the agents of a game, which restart in each turn, and the global generators during a game."""

import random
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from copy import copy, deepcopy
from functools import wraps
from typing import Any, NamedTuple, NoReturn, Self, TypeVar

import numpy as np
from numpy.random import Generator, Philox

from gamms import kernels
from gamms.arguments import as_array, as_one_shape
from gamms.core.draws import TurnCounter, TurnStream
from gamms.errors import BadValue
from gamms.ir.game_state import GameState
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.readonly import ShallowCopyMixin, answer_names, copy_locked
from gamms.text import shown
from gamms.typing.context import HostContext

T = TypeVar("T")


class _FixedTurn(NamedTuple):
    """A constant turn, as the clock of copied draws."""

    turn: int


class DrawTable(TurnCounter):
    """The seed and the clock of all draws of the agents of a game.

    Args:
        seed: the seed of the game.
        clock: an object with the attribute `turn`: the state of the game, or the turn of a copy.
    """

    __slots__ = ()

    def __init__(self, seed: int, clock: GameState | _FixedTurn) -> None:
        super().__init__(clock, seed)

    def compute_first_key(self, name: str) -> int:
        """Return the key of the draws of an agent; see `kernels.compute_first_key`."""
        return kernels.compute_first_key(
            kernels.compute_purpose_key(self.seed, "agent"), kernels.compute_name_key(name)
        )


class _CopiedTable(DrawTable):
    """The key and the clock of a copy of one agent's draws, without the seed of the game.

    Args:
        first: the `compute_first_key` of the agent.
        turn: the turn of the copy.
    """

    __slots__ = ("_first",)

    def __init__(self, first: int, turn: int) -> None:
        super().__init__(0, _FixedTurn(turn))
        self._first = first

    def compute_first_key(self, name: str) -> int:  # noqa: ARG002 - there is one agent
        """Return the key that was given."""
        return self._first


class Draws(TurnStream):
    """The keyed draws of one agent: `state["draw"]`.

    Draw number k of a turn depends only on the seed, the agent's name, the turn and k (`kernels.draws`); draws of other
    agents do not change it.

    Args:
        table: the seed and the clock of the game.
        name: the name of the agent.
    """

    __slots__ = ("_name", "_table")

    def __init__(self, table: DrawTable, name: str) -> None:
        super().__init__(table)
        self._table = table
        self._name = name

    def __reduce__(self) -> tuple[Any, ...]:
        # A copy continues independently; it does not advance the draws of the game.
        return _make_draws, self._point

    def __eq__(self, other: object) -> bool:
        """Return whether both will draw the same numbers."""
        if not isinstance(other, Draws):
            return NotImplemented
        return self._point == other._point

    __hash__ = None  # type: ignore[assignment] # draws are mutable

    @property
    def _point(self) -> tuple[int, str, int, int]:
        return self.compute_first_key(), self._name, self._table.clock.turn, self.mark() or 0

    def __dir__(self) -> list[str]:
        """Return the names of the draws, for completion and hints."""
        return ["below", "choice", "random"]

    def compute_first_key(self) -> int:
        """Return the key of the draws for the current seed."""
        return self._table.compute_first_key(self._name)

    def refuse_bound(self, n: object) -> NoReturn:
        """Raise BadValue for an invalid argument of `below`, or for an empty one of `choice`."""
        if n == 0:
            raise BadValue(
                "state['draw'].choice was given an empty list, or below(n), which needs 1 <= n <= 2 ** 32, not 0: "
                "there is nothing to draw. Ask first whether there is any item, such as an enemy in sight."
            )
        raise BadValue(f"state['draw'].below(n) needs 1 <= n <= 2 ** 32, not {shown(n)}.")


answer_names(
    Draws,
    "state['draw']",
    "choices gauss integers normal permutation randint randrange sample shuffle uniform",
    "Write state['draw'].below(n) for an integer from 0 to n - 1, .random() for a number in [0, 1), or .choice(items); "
    "state['rng'], a generator of NumPy, has shuffle, permutation and normal.",
)


class ArrayDraws(ShallowCopyMixin):
    """The keyed draws of many agents, in one game or in several: each call returns one number per agent.

    They are equal to the draws of `state["draw"]` of each agent in the same turn of the same game, call by call.

    Args:
        first_keys: returns the keys of the agents; see `kernels.first_key_rows`.
        turns: the number of turns played, which broadcasts with the keys.
    """

    _not_pickled = (
        "Draws of many agents can neither be pickled nor copied deeply, because they belong to a view of games. Copy "
        "the numbers that they give."
    )

    def __init__(self, first_keys: Callable[[], BitArray], turns: IntArray) -> None:
        self._of = first_keys, turns
        self._keys: BitArray | None = None  # of this turn
        self._count: IntArray | int = 0  # the number of draws in this turn, for all agents or for each
        self._among: tuple[ArrayDraws, BoolArray] | None = None

    def random(self) -> FloatArray:
        """Return a number in [0, 1) for each agent."""
        return kernels.convert_to_fractions(self.bits())

    def below(self, n: IntArray | int) -> IntArray:
        """Return an integer from 0 to `n - 1` for each agent; `n` is one number, or one per agent.

        Raises:
            BadValue: an `n` is not between 1 and 2 ** 32.
        """
        bounds = as_array(n, "n of draw.below(n)", "integers")
        if bounds.size and not (bounds.min() >= 1 and bounds.max() <= 1 << 32):
            raise BadValue(f"draw.below(n) needs 1 <= n <= 2 ** 32, not {shown(n)}.")
        bits = self.bits()
        return kernels.convert_to_integers(
            *as_one_shape({"draw": bits, "n": bounds}) if bounds.ndim else (bits, bounds)
        )

    def after(self, count: IntArray) -> Self:
        """Return draws of agents that have drawn some numbers of times in this turn."""
        later = copy(self)
        later._count = count
        return later

    def only(self, asked: BoolArray) -> Self:
        """Return draws that count only for the agents in `asked`, (games, agents); for all others, nothing is drawn."""
        narrowed = copy(self)
        narrowed._among = self, asked
        return narrowed

    def go_to(self, count: IntArray) -> None:
        """Go on as if the agents had drawn some numbers of times in this turn."""
        if self._among is not None:
            self._among[0].go_to(count)
        else:
            self._count = count

    @property
    def count(self) -> IntArray | int:
        """The number of draws in this turn, for all agents or for each."""
        if self._among is not None:
            return self._among[0].count
        return copy_locked(self._count) if isinstance(self._count, np.ndarray) else self._count

    def bits(self) -> BitArray:
        """Return 64 random bits for each."""
        if self._among is not None:
            return self._among[0].bits_of(self._among[1])
        return self.bits_of(1)

    def bits_of(self, counted: BoolArray | int) -> BitArray:
        """Return 64 random bits for each agent, and advance the draws of the agents in `counted`."""
        if self._among is not None:
            return self._among[0].bits_of(counted)
        if self._keys is None:
            first_keys, turns = self._of
            self._keys = kernels.compute_turn_key_rows(first_keys(), turns)
        count = self._count
        self._count = self._count + counted
        return kernels.compute_bits_rows(self._keys, count)


def _make_draws(first: int, name: str, turn: int, count: int) -> Draws:
    draws = Draws(_CopiedTable(first, turn), name)
    draws.go_to(count or None)
    return draws


class TurnGenerator(Generator):
    """A NumPy generator that depends only on its key and the turn: `state["rng"]`.

    Args:
        table: the seed and the clock of the game.
        name: the name of the agent.
    """

    # NOTE: made when something is drawn, not with the agent: most agents never ask, and a Philox takes 15 us and
    # 1.7 kB (benchmarks: turns).

    def __init__(self, table: DrawTable, name: str) -> None:
        self._table = table
        self._name = name
        self._begun = -1  # `table.begun` at the last draw
        self._seed = -1  # `table.seed` at the last draw
        self._begin: Any = None  # the initial state of a turn with that seed

    def seek(self) -> None:
        """Start the stream of this turn."""
        table = self._table
        self._begun = table.catch_up()
        if self._begin is None or self._seed != table.seed:
            self._seed = table.seed
            super().__init__(Philox(key=kernels.stream_key(self._seed, "agent", self._name)))
            self._begin = super().bit_generator.state
        self._begin["state"]["counter"][2] = table.turn
        super().bit_generator.state = self._begin

    @property
    def _has_drawn(self) -> bool:
        """Whether it has been used in this turn."""
        return self._begun == self._table.begun and self._table.turn == self._table.clock.turn

    def mark(self) -> Mapping[str, Any] | None:
        """Return the state in this turn, for `go_to`; None: nothing was drawn."""
        return super().bit_generator.state if self._has_drawn else None

    def go_to(self, mark: Mapping[str, Any] | None) -> None:
        """Continue from a mark of this turn."""
        self._begun = -1
        if mark is not None:
            self.seek()
            super().bit_generator.state = mark

    @property
    def bit_generator(self) -> Any:
        """The Philox bit generator of this turn."""
        if not self._has_drawn:
            self.seek()
        return super().bit_generator

    def __reduce__(self) -> Any:
        # A copy is a plain NumPy generator that continues from here.
        return Generator, (deepcopy(self.bit_generator),)


def _make_drawing_method(method: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(method)
    def draw(self: TurnGenerator, *args: object, **kwargs: object) -> Any:
        if not self._has_drawn:
            self.seek()
        return method(self, *args, **kwargs)

    return draw


for _name, _method in list(vars(Generator).items()):
    if not _name.startswith("_") and callable(_method):
        setattr(TurnGenerator, _name, _make_drawing_method(_method))


def get_global_state() -> tuple[object, ...]:
    """Return the states of both generators; the result is equal to an earlier one if nothing was drawn since."""
    numpy = np.random.get_state(legacy=False)["state"]  # noqa: NPY002 - as below
    return random.getstate(), numpy["pos"], numpy["key"].tobytes()


@contextmanager
def seed_for_run(ctx: HostContext, turn: int) -> Iterator[None]:
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
