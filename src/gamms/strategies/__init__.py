"""Strategies to build games from: plain functions `strategy(state) -> None` that set `state["action"]`.

    from gamms.strategies import chase, first, patrol

    ctx.agent.create_agent("anna", start_node_id=0, sensors=["near", "seen"], team="red", strategy=first(
        chase(ctx, otherwise=None),
        patrol(ctx, [0, 12, 7]),
    ))

`stay` and `random_walk` are strategies; the other functions make one. What needs the map takes the context first. An
unknown node or an impossible argument raises when the strategy is made, not when it plays.

**No action.** A strategy that has nothing to do calls another one, its `otherwise`. With `otherwise=None` it sets no
action, and `first` then calls the next one. An agent that stays where it wants to be sets the action to its own node.

**Memory.** No state is kept in a function. What has to be remembered is in `state["memory"]`, so that one strategy can
serve many agents, and a game that is reset starts from nothing.

**Knowledge.** The map is known, and which agent is of which team; where others are, only the agent's sensors tell.
An agent of no team (None) is an enemy of all; a sensor with `team=` leaves such agents out.

`ctx.game` puts into the state what these read: `legal`, `draw`, `memory`, `team`. In a loop of your own, put it there
yourself where a strategy asks for it. Without `legal`, an agent goes along one edge at a time.

**Batches.** The core plays some of them in batches, by what `offer_steps` declares: `stay`, `random_walk`, `goto`,
`follow_path`, `patrol`, `random_waypoints`, `chase`, `flee` and `first`. The others are called game by game.

`travel.py` has those that need no enemies, `stops.py` how agents go along a list, `encounters.py` those that act on
enemies, `assignment.py` the one by which a team shares them out, `sweeping.py` the one by which it visits all nodes;
read `knowledge.py` first, which has what they know and how they go a step; `paces.py` says how long ways take.
May import: `belief`, `context` and below. To add a strategy, write a function and name it below.
"""

from gamms.strategies.assignment import assign
from gamms.strategies.encounters import chase, flee, follow_belief, guard, intercept, safest_exit
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
    "random_walk",
    "random_waypoints",
    "safest_exit",
    "stay",
    "sweep",
    "unblock",
]
