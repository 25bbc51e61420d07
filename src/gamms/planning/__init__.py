"""Planning: agents that simulate their game ahead, from their own knowledge, before they decide.

    strategy = gamms.planning.mcts(200, depth=15, rollout="gamms.strategies:chase")

    def look_ahead(state):
        model = gamms.planning.Model(state)
        model.sample(0)
        model.play(10, {state["name"]: state["legal"][-1]})
        ...

`model.py` has the simulated game; read it first. `hidden.py` samples the positions of agents that are out of sight,
`mcts.py` searches, and `pace.py` limits the time of a search. A client of the game, beliefs and scenarios: May import:
`scenario`, `strategies`, `belief` and below. To add a planner write a strategy, or a plan of a team, that makes a
`Model` from its state.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.planning.mcts import SearchOptions, mcts
from gamms.planning.model import Model, ModelOptions, Policy, closeness

__all__ = ["Model", "ModelOptions", "Policy", "SearchOptions", "closeness", "mcts"]

_suggest_names(__name__, __all__)

FOR_SCENARIOS = {"closeness": closeness, "mcts": mcts}
"""Names that scenario files may use."""
