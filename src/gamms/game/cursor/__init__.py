"""The cursor: a context that stands on one game of a block after the other, so that plain functions play in all games.

`cursor.py` calls plain rules and strategies in a context that it points at each game in turn, with the agents that this
game has, and with values that are made when functions read them (`pointed.py`). `called_functions.py` finds these
functions, and `own_functions.py` those that differ between games. If a plain function does what this context cannot do
in one game alone, it raises `LeavesSharedContext`, and the game continues in a context of its own
(`separate_games.py`).
"""
