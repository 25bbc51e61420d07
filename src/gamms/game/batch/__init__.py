"""Many games at once: `scenario.batch(1000)` and `ctx.game.batch(1000)`.

Start with `games.py`, the public interface. `arrays.py` plays the games in the core, with `in_core.py`,
`strategy_steps.py` and `travelers.py`; between the phases of the core it calls array functions, and plain functions in
a context that `cursor.py` points at each game in turn, with the agents that this game has (`pointed.py`).
`called_functions.py` finds these functions, and `read_values.py` makes values that they read. If a plain function does
what this context cannot do in one game alone, it raises `LeavesSharedContext`, and the game continues in a context of
its own (`separate_games.py`).

`state.py` holds the state of a batch, `columns.py` its agents and logs, `scores.py` the scores, `initial_state.py` the
state of the first turn, and `own_functions.py` strategies that differ between games. Array rules get a turn
(`turn.py`), array strategies and observers a view (`view.py`). `movement.py`, `by_edges.py` and `travel.py` find
legal moves, `noted_moves.py` those in games in contexts of their own, `sensing.py` the agents and nodes that sensors
show, `vectors.py` observations as numbers, `routes.py` distances, `roads.py` closed roads, `flows.py` diffusion;
`deeds.py` and `channels.py` check deeds and messages, `given.py` actions from outside. `forms.py` has the declarations
of strategies; `array_functions.py` declares array functions, and calls them in games that are played alone.
"""

from gamms.game.batch.array_functions import array_rule, array_strategy
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
