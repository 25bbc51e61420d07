"""Beliefs: the knowledge of an agent about others, from the observations of the agent and its team.

    from gamms import belief

    def hunt(state):
        known = belief.observe(ctx, state)  # in every turn
        known.last_seen                     # {"anna": Sighting(node=12, turn=3, by="bert")}
        known.reachable("anna")             # the ids of all nodes on which she can be
        known.probability("anna")           # node -> probability

Memories hold only observations (`evidence.py`): beliefs are computed from these on demand, so that the beliefs of
teammates are merged by merging observations, and a recording grows by one line per agent and turn. `Filter` computes
probabilities without memories, for many targets at once, `GamesFilter` for many games.

Read `belief.py` first. `ground.py` has the map, `reach.py` computes where targets can be, `filter.py` and `motion.py`
where they probably are; all use `gamms.core.belief`. To add a model of motion, write a function in `motion.py`.
May import: `context` and below.
"""

from gamms.belief.belief import Belief, artist, belief_of, believed, observe
from gamms.belief.evidence import Sighting, merge, note
from gamms.belief.filter import Filter, GamesFilter
from gamms.belief.motion import Motion, mixture, random_walk, to_goals
from gamms.errors import suggest_names as _suggest_names

__all__ = [
    "Belief",
    "Filter",
    "GamesFilter",
    "Motion",
    "Sighting",
    "artist",
    "belief_of",
    "believed",
    "merge",
    "mixture",
    "note",
    "observe",
    "random_walk",
    "to_goals",
]

_suggest_names(__name__, __all__)
