"""The games of a batch in contexts of their own, in which plain functions are called as in one game.

`contexts.py` makes the context of a game when a function is called in it. `row.py` has the game: what a function reads
is made from the columns of all games, and what it changes is written there; `state.py` is its state. `functions.py`
says which functions are called when, and `by_seed.py` makes games that differ by their seeds. If a rule changes more
than columns hold, its game gets columns of its own; `shown_games.py` shows such games in those of all games.
"""
