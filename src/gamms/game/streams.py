"""Random streams that begin anew in every turn, so that a game can go on from any turn as if it had been played."""

from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any

from numpy.random import Generator, Philox

if TYPE_CHECKING:
    from gamms.game.game import Game


class TurnGenerator(Generator):
    """A NumPy generator whose draws follow from its key and the turn of a game, and from nothing that was drawn before.

    Args:
        key: 128 bits; see `kernels.stream_key`.
        game: whose turns count.
    """

    def __init__(self, key: int, game: "Game") -> None:
        super().__init__(Philox(key=key))
        self._game = game
        self._turn = -1
        self._begin: Any = self.bit_generator.state

    def seek(self) -> None:
        """Begin the stream of this turn."""
        # NOTE: when something is drawn, not in every turn: most agents of most games never ask (benchmarks, turns).
        self._turn = self._game.turn
        self._begin["state"]["counter"][2] = self._turn
        self.bit_generator.state = self._begin


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
