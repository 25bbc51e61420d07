"""Rules for games: contacts, tags, flags, places, resources, payoffs, ends of games, and conflicts of moves.

    ctx.game.add(gamms.rules.tag("red", "blue", hops=1))
    ctx.game.add(gamms.rules.time_limit(200))
    ctx.game.conflicts = gamms.rules.Conflicts(capacity=1, resolve=gamms.rules.by_priority(["red", "blue"]))

Read `contacts.py` first: which agents meet (`gamms.core.contacts` finds them; `meetings.py` passes it the columns of a
turn). `gamms.core.rules` plays the rules of `tagging.py`, `flags.py` and `endings.py`, in one game and in batches;
`in_core.py` builds them. A rule is declared by a `RuleSpec` of `game/settings.py`. `places.py`, `resources.py` and
`payoffs.py` have rules about nodes, resources and points, and `territory.py` makes their shared data. `conflicts.py`
decides which agents win conflicts, which `game/conflicts.py` defines.
May import: `context` and below. To add a rule write a function `rule(ctx)`; to add a resolver call `by_rank`, or write
a function `(contest, ctx) -> winners`; no registration is needed. Annotate parameters that name teams by
`gamms.typing.game.Team`, TEAMS or OWNERS, so that scenario files with misspelled teams are refused.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.game.conflicts import Conflicts, Contest, at_random
from gamms.rules import territory
from gamms.rules.conflicts import by_priority, by_rank, nobody
from gamms.rules.contacts import Contact, contacts, one_to_one
from gamms.rules.endings import arrive, last_team, none_left, reach, time_limit
from gamms.rules.flags import capture_flag
from gamms.rules.payoffs import payoff
from gamms.rules.places import discover, hold, idleness, idleness_table
from gamms.rules.resources import cooldown, resource
from gamms.rules.tagging import respawn, tag

__all__ = [
    "Conflicts",
    "Contact",
    "Contest",
    "arrive",
    "at_random",
    "by_priority",
    "by_rank",
    "capture_flag",
    "contacts",
    "cooldown",
    "discover",
    "hold",
    "idleness",
    "idleness_table",
    "last_team",
    "nobody",
    "none_left",
    "one_to_one",
    "payoff",
    "reach",
    "resource",
    "respawn",
    "tag",
    "territory",
    "time_limit",
]

_suggest_names(__name__, __all__)
