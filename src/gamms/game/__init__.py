"""The game engine: `ctx.game`, which plays turns of simultaneous moves.

Read `game.py` first, then `turn.py`; the state is `gamms.ir.game_state`. A rule is a plain function, so new rules need
no changes here. `batch` plays many games at once. May import: typing, kernels, ir and below, never another engine.
"""

from gamms.errors import IllegalMutation
from gamms.game.decisions import TeamArrays
from gamms.game.game import Game
from gamms.game.legality import IllegalAction
from gamms.game.result import Result
from gamms.game.settings import Plan, Settings
from gamms.game.snapshots import Snapshot, SnapshotError
from gamms.typing.game import Move

__all__ = [
    "Game",
    "IllegalAction",
    "IllegalMutation",
    "Move",
    "Plan",
    "Result",
    "Settings",
    "Snapshot",
    "SnapshotError",
    "TeamArrays",
]
