"""The game engine: `ctx.game`, which plays turns of simultaneous moves.

Read `game.py` first, then `turn.py`; the state is `gamms.ir.game_state`. A rule is a plain function, so new rules need
no changes here. `batch.py` is the interface of many games at once, which `batch_engine.py` plays in the core, phase by
phase: `block` has their state, `movement` how agents go, `array_functions` what array rules and strategies get, and
`rows` calls plain functions. May import: typing, kernels, ir and below, never another engine.
"""

from gamms.errors import IllegalMutation
from gamms.errors import list_names as _list_names
from gamms.game.decisions import TeamArrays
from gamms.game.game import Game
from gamms.game.movement.legality import IllegalAction
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
_list_names(__name__, __all__)
