"""The game room: who may write where agents are. The turn engine will live here.

Read `moves.py`, the one writer of moves. May import: typing, kernels, ir and below, never another room.
"""

from gamms.game.moves import Moves

__all__ = ["Moves"]
