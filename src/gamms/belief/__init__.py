"""Beliefs: what an agent knows of others from what it and its team have seen, and not seen.

    from gamms import belief

    def hunt(state):
        known = belief.observe(ctx, state)  # in every turn
        known.last_seen                     # {"anna": Sighting(node=12, turn=3, by="bert")}
        known.reachable("anna")             # the ids of all nodes on which she can be
        known.probability("anna")           # node -> probability

Memories hold observations (`evidence.py`), and nothing else: beliefs are worked out from these on demand, so that those
of teammates are merged by merging observations, and a recording grows by one line for each agent and turn. `Filter` has
the probabilities without memories, for many targets at once, `GamesFilter` for those of many games.

Read `belief.py` first. `reach.py` has where targets can be, `filter.py` and `motion.py` where they probably are, and
`teams.py` what teams believe in batches; all compute with `gamms.core.belief`. A new model of motion is a function in
`motion.py`. May import: `context` and below.
"""

from gamms.belief.belief import Belief, artist, belief_of, believed, observe
from gamms.belief.evidence import Sighting, merge, note
from gamms.belief.filter import Filter, GamesFilter
from gamms.belief.motion import Motion, mixture, random_walk, to_goals

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
