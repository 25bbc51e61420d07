"""The game room: who may write where agents are, and `ctx.game`, which plays turns in which all move at once.

Read `game.py` first, then `turn.py`; `moves.py` is the one writer of moves. A rule is a plain function; a new one needs
nothing here. May import: typing, kernels, ir and below, never another room.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gamms.game.moves import Moves
from gamms.typing.game import Move

if TYPE_CHECKING:
    from gamms.game.errors import IllegalAction, Meddling
    from gamms.game.game import Game
    from gamms.game.result import Result
    from gamms.game.settings import Settings

__all__ = ["Game", "IllegalAction", "Meddling", "Move", "Moves", "Result", "Settings"]

_HOMES = {"Game": "game", "IllegalAction": "errors", "Meddling": "errors", "Result": "result", "Settings": "settings"}


def __getattr__(name: str) -> Any:
    if name in _HOMES:  # loaded when they are asked for: the paper's own loop needs none of them
        return getattr(import_module(f"gamms.game.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
