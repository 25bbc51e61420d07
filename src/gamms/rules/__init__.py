"""What games are made of: who may go where when moves get in each other's way. A guest: it uses a context as you would.

    ctx.game.conflicts = gamms.rules.Conflicts(capacity=1, resolve=gamms.rules.by_priority(["red", "blue"]))

Read `conflicts.py` for how conflicts are found, `resolvers.py` for who wins them, `capacity.py` for how many a node
takes. To add a way to decide, write a function `(contest, ctx) -> winners`: nothing needs to be registered.
"""

from gamms.rules.conflicts import Conflicts
from gamms.rules.resolvers import Contest, at_random, by_priority, nobody

__all__ = ["Conflicts", "Contest", "at_random", "by_priority", "nobody"]
