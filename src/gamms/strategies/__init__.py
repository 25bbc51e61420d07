"""Strategies for games: plain functions `strategy(state) -> None` that set `state["action"]`.

    from gamms.strategies import chase, first, patrol

    ctx.agent.create_agent("anna", start_node_id=0, sensors=["near", "seen"], team="red", strategy=first(
        chase(ctx, otherwise=None),
        patrol(ctx, [0, 12, 7]),
    ))

`stay` and `random_walk` are strategies; the other functions make strategies. Strategies that need the map take the
context first. An unknown node or an invalid argument raises when the strategy is made, not when it plays.

**No action.** A strategy that has nothing to do calls another strategy, its `otherwise`. With `otherwise=None` it sets
no action, and `first` then calls the next strategy. An agent that stays on purpose sets the action to its own node.

**Memory.** Functions keep no state. All memories are in `state["memory"]`, so that one strategy can serve many agents,
and a game that is reset starts without memories.

**Knowledge.** Strategies know the map and the team of each agent; the positions of other agents come only from the
agent's sensors. An agent without a team (None) is an enemy of all; a sensor with `team=` does not show such agents.

`ctx.game` sets the keys of the state that strategies read: `legal`, `draw`, `memory`, `team`. In your own loop, set
them yourself where a strategy needs them. Without `legal`, an agent moves along one edge at a time.

**Batches.** The core plays some strategies in batches, as declared by `offer_steps`: `stay`, `random_walk`, `goto`,
`follow_path`, `patrol`, `random_waypoints`, `chase`, `flee`, `first`, `mix`, and a `pool` of these. It calls the others
game by game.

Read `knowledge.py` first, about the knowledge of strategies and the steps of agents. `travel.py` has strategies
without enemies, `stops.py` routes along a list of nodes, `encounters.py` strategies about enemies, `assignment.py` a
team that shares out enemies, `sweeping.py` a team that visits all nodes, `pool.py` pools of opponents; `paces.py`
converts distances to turns.
May import: `belief`, `context` and below. To add a strategy, write a function and name it below.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.strategies.assignment import assign
from gamms.strategies.encounters import chase, flee, follow_belief, guard, intercept, safest_exit
from gamms.strategies.pool import pool, pool_for_scenario
from gamms.strategies.sweeping import sweep
from gamms.strategies.travel import (
    first,
    follow_path,
    goto,
    human,
    mix,
    patrol,
    random_walk,
    random_waypoints,
    stay,
    unblock,
)

__all__ = [
    "assign",
    "chase",
    "first",
    "flee",
    "follow_belief",
    "follow_path",
    "goto",
    "guard",
    "human",
    "intercept",
    "mix",
    "patrol",
    "pool",
    "random_walk",
    "random_waypoints",
    "safest_exit",
    "stay",
    "sweep",
    "unblock",
]

FOR_SCENARIOS = {**{name: globals()[name] for name in __all__}, "pool": pool_for_scenario}

_suggest_names(__name__, __all__)
