"""What games are made of: who meets whom, who wins, and who goes where when moves get in each other's way.

    ctx.game.add(gamms.rules.tag("red", "blue", hops=1))
    ctx.game.add(gamms.rules.time_limit(200))
    ctx.game.conflicts = gamms.rules.Conflicts(capacity=1, resolve=gamms.rules.by_priority(["red", "blue"]))

A client: it uses a context as you would. Rules: read `contacts.py` for who meets whom (`measures.py`: how far apart
they are), then `tagging.py`, `flags.py` and `endings.py`; `territory.py` makes the data that they share, `drawing.py`
draws it. Conflicts: read `conflicts.py` for how they are found, `resolvers.py` for who wins them, `capacity.py` for how
many a node takes. To add a rule write a function `rule(ctx)`, to add a way to decide a function
`(contest, ctx) -> winners`: nothing needs to be registered.
"""

from gamms.rules import territory
from gamms.rules.conflicts import Conflicts
from gamms.rules.contacts import Contact, contacts, one_to_one
from gamms.rules.endings import last_team, reach, time_limit
from gamms.rules.flags import capture_flag
from gamms.rules.resolvers import Contest, at_random, by_priority, nobody
from gamms.rules.tagging import tag

__all__ = [
    "Conflicts",
    "Contact",
    "Contest",
    "at_random",
    "by_priority",
    "capture_flag",
    "contacts",
    "last_team",
    "nobody",
    "one_to_one",
    "reach",
    "tag",
    "territory",
    "time_limit",
]
