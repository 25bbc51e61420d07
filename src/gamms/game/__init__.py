"""The game room: who may write where agents are, and `ctx.game`, which plays turns in which all move at once.

Read `game.py` first, then `turn.py`; `moves.py` is the one writer of moves. A rule is a plain function; a new one needs
nothing here. May import: typing, kernels, ir and below, never another room.
"""

from gamms.game.errors import IllegalAction, Meddling
from gamms.game.game import Game
from gamms.game.moves import Moves
from gamms.game.result import Result
from gamms.game.settings import Settings
from gamms.typing.game import Move

__all__ = ["Game", "IllegalAction", "Meddling", "Move", "Moves", "Result", "Settings"]
