"""The cursor: a context that stands on one game of a block after the other, so that plain functions play in all games.

`cursor.py` says which functions are called when; the loop over the games is in `gamms.core.ask`. `pointed.py` points
the context at a game, whose values are made when functions read them, and `shown.py` takes the changes of functions
from it. `called_functions.py` finds these functions, and `own_functions.py` those that differ between games. If a
function does what this context cannot do in one game alone, the game leaves (`LeavesSharedContext`) and continues in a
context of its own (`separate_games.py`).
"""
