"""Random numbers of agents, which follow from the turn: a game goes on from any turn as if it had been played."""

from collections.abc import Callable, Sequence
from copy import deepcopy
from functools import wraps
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from numpy.random import Generator, Philox

from gamms import kernels
from gamms.errors import BadValue
from gamms.text import shown

if TYPE_CHECKING:
    from gamms.game.game import Game

T = TypeVar("T")


class Draws:
    """The keyed draws of one agent: `state["draw"]`.

    Draw number k of a turn follows from the seed, the agent's name, the turn and k alone (`kernels.draws`), so no other
    agent's draws change it. Each agent has draws of its own; what `choice` takes a fraction of a microsecond for takes
    NumPy's generators seven.

    Args:
        seed: of the game.
        clock: its `turn` counts: the game, or the moment at which a copy was made.
        name: of the agent.
    """

    __slots__ = ("_clock", "_count", "_key", "_name", "_seed", "_turn")

    def __init__(self, seed: int, clock: "Game | _Moment", name: str) -> None:
        self._seed, self._clock, self._name = seed, clock, name
        self._turn, self._key, self._count = -1, 0, 0

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
        return self._seed, self._name, now, self._count if now == self._turn else 0

    def bits(self) -> int:
        """Return 64 random bits."""
        turn = self._clock.turn
        if turn != self._turn:
            purpose = kernels.purpose_key(self._seed, "agent")
            self._turn, self._count = turn, 0
            self._key = kernels.turn_key(purpose, kernels.name_key(self._name), turn)
        count = self._count
        self._count = count + 1
        return kernels.bits_at(self._key, count)

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
        return kernels.below(self.bits(), n)

    def choice(self, options: Sequence[T]) -> T:
        """Return one of the options, each as likely.

        Raises:
            BadValue: there is none.
        """
        return options[self.below(len(options))]


class _Moment(NamedTuple):
    """A turn that stays as it is."""

    turn: int


def _draws_at(seed: int, name: str, turn: int, count: int) -> Draws:
    draws = Draws(seed, _Moment(turn), name)
    for _ in range(count):
        draws.bits()
    return draws


class TurnGenerator(Generator):
    """A NumPy generator whose draws follow from its key and the turn of a game, and from nothing that was drawn before.

    Args:
        game: whose turns count.
        name: of the agent.
    """

    # NOTE: made when something is drawn, not with the agent: most agents never ask, and a Philox takes 15 us and
    # 1.7 kB (benchmarks/README.md, turns).

    def __init__(self, game: "Game", name: str) -> None:
        self._game, self._name = game, name
        self._turn = -1
        self._begin: Any = None

    def seek(self) -> None:
        """Begin the stream of this turn."""
        if self._begin is None:
            super().__init__(Philox(key=kernels.stream_key(self._game.ctx.seed, "agent", self._name)))
            self._begin = super().bit_generator.state
        self._turn = self._game.turn
        self._begin["state"]["counter"][2] = self._turn
        super().bit_generator.state = self._begin

    @property
    def bit_generator(self) -> Any:
        """The Philox of this turn."""
        if self._turn != self._game.turn:
            self.seek()
        return super().bit_generator

    def __reduce__(self) -> Any:
        # A copy is a generator of NumPy's that goes on from here.
        return Generator, (deepcopy(self.bit_generator),)


def _drawing(method: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(method)
    def draw(self: TurnGenerator, *args: Any, **kwargs: Any) -> Any:
        if self._turn != self._game.turn:
            self.seek()
        return method(self, *args, **kwargs)

    return draw


for _name, _method in list(vars(Generator).items()):
    if not _name.startswith("_") and callable(_method):
        setattr(TurnGenerator, _name, _drawing(_method))
