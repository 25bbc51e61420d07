"""Strategies to build games from: plain functions `state -> None` that set `state["action"]`.

    from gamms.strategies import chase, first, patrol

    ctx.agent.create_agent("anna", start_node_id=0, sensors=["near", "seen"], team="red", strategy=first(
        chase(ctx, otherwise=None),
        patrol(ctx, [0, 12, 7]),
    ))

`stay` and `random_walk` are strategies; everything else makes one. What needs the map takes the context first, and an
unknown node or an impossible argument raises when the strategy is made, not when it plays.

**Undecided.** A strategy that has nothing to do asks another one, its `otherwise`. With `otherwise=None` it leaves the
action unset, which means: I have not decided. `first` then asks the next one. To staying there is nothing undecided: an
agent that stays sets the action to its own node.

**Memory.** Nothing that changes is kept in a function. What has to be remembered is in `state["memory"]`, so that one
strategy can serve many agents, and a game that starts anew starts anew.

**Knowledge.** The map is known, and who plays for which team; where others are, only the agent's sensors say.
Whoever plays for no team (None) is everybody's enemy; a sensor with `team=` leaves such agents out.

`ctx.game` puts into the state what these read: `legal`, `rng`, `memory`, `team`. In a loop of your own, put it there
yourself where a strategy asks for it. Without `legal`, an agent goes along one edge at a time.

Read `walks.py` first, then `ways.py` (along roads), `encounters.py` (with enemies) and `choices.py` (of strategies);
`knowledge.py` reads states. A client: it uses a context as you would. To add a strategy, write a function and name it
below.
"""

from gamms.strategies.choices import first, human, mix
from gamms.strategies.encounters import chase, flee, guard
from gamms.strategies.walks import random_walk, stay
from gamms.strategies.ways import follow_path, goto, patrol

__all__ = ["chase", "first", "flee", "follow_path", "goto", "guard", "human", "mix", "patrol", "random_walk", "stay"]
