"""Many games at once: `scenario.batch(1000)` and `ctx.game.batch(1000)`.

`games.py` is the front; read it first. A batch plays in arrays (`arrays.py`) where strategies, rules and conflicts of
the game have an array form or can be called in the middle, and one game after the other (`one_by_one.py`) elsewhere;
both give the same games; `why_not.py` says which. Games of which every part is in `gamms.core` are played there, from
`in_core.py`. `turn.py` is what array forms of rules get, played by
`moves_of_turn.py`, `view.py` what those of strategies get: `sight.py` says whom sensors show them, `reports.py`
from the air, `surroundings.py` which nodes, `vectors.py` puts that into numbers, `routes.py` knows how far it is,
`routes_of_maps.py` where roads are closed, and `flows.py` what spreads. `columns.py` has who plays, `state.py` what a
batch remembers, `scores.py` the scores, `begun.py` what of that is taken from a game that has begun, `movement.py`
where actions lead, `travel.py` by metres (`reach.py`: to which nodes), `flights.py` in the air, `asking.py` asks what
agents do, at each arrival by `arrivals.py`, `deeds.py` what agents do besides moving, `channels.py` what they send,
`given.py` what comes from outside. `forms.py` declares array forms; `scalar_rules.py` calls rules that have none and
`scalar_strategies.py` such strategies, in the context of `rule_fork.py` (`unknown.py`: what that lacks);
`game_forms.py` has all of these, `roads.py` the roads that rules have closed in games, and `joined_view.py` shows games
that have left the arrays beside the others; `alone.py` plays array strategies and rules in games that are played alone.
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
