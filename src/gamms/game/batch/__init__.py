"""Many games at once: `scenario.batch(1000)` and `ctx.game.batch(1000)`.

`games.py` is the front; read it first. `why_not.py` says whether the core has all parts of the games. Then `arrays.py`
plays them there, from `in_core.py`, `strategy_steps.py` and `travelers.py`, and calls array functions between the
phases of the core, and plain functions in a context that `cursor.py` points at each game; else `one_by_one.py` plays
one game after the other. Both give the same games.

`state.py` is the block: what a batch remembers, `columns.py` who plays, `scores.py` the scores, `begun.py` what of
that is taken from a game that has begun. Array rules get a turn (`turn.py`), array strategies and observers a view
(`view.py`): `movement.py`, `by_edges.py` and `travel.py` (`reach.py`) say what is legal there, `sensing.py` whom and
which nodes sensors show, `vectors.py` puts that into numbers, `routes.py` knows how far it is, `roads.py` which roads
are closed in games that are observed, `flows.py` what spreads, `deeds.py` and `channels.py` check what agents do and
send, `given.py` what comes from outside. `forms.py` has what strategies declare; `alone.py` plays array functions in
games that are played alone, with the moves of `last_turn.py`.
"""

from gamms.game.batch.alone import array_rule, array_strategy
from gamms.game.batch.games import Batch, MostAgents
from gamms.game.batch.turn import ArrayRule, ArrayTurn
from gamms.game.batch.view import ArrayStrategy, ArrayView

__all__ = [
    "ArrayRule",
    "ArrayStrategy",
    "ArrayTurn",
    "ArrayView",
    "Batch",
    "MostAgents",
    "array_rule",
    "array_strategy",
]
