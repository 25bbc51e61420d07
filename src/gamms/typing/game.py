"""Contract of the turn engine: what it gives to rules, plans and resolvers of conflicts."""

from collections.abc import Awaitable, Callable, Hashable, Mapping
from typing import Annotated, Any, NamedTuple, Protocol

Track = tuple[tuple[int, ...], tuple[float, ...]]
"""Nodes, and from 0 to 1 when an agent is at each of them; it is at the last one until 1."""

Rule = Callable[[Any], object]
"""Is called with the `gamms.Context` in every turn; what it returns is ignored.

Any: `Context` is made of what is declared here and cannot be named here; a rule says it itself:
`def rule(ctx: gamms.Context) -> None`.
"""

TeamPlan = Callable[[dict[str, Any]], Awaitable[None] | None]
"""Decides for a team: it is called with the states of its agents by name, and sets `state["action"]` in each.

Any: `State`, or `AerialState` of agents that fly.
"""


TEAMS, OWNERS = "teams", "teams, or other owners"

Team = Annotated[Hashable, TEAMS]
"""A parameter of a function that makes rules, which names teams: a scenario file is checked for misspelt ones."""


def team_parameters(make_rule: Callable[..., object]) -> dict[str, str]:
    """Return the parameters of a function whose annotations say that they name teams: name -> TEAMS or OWNERS."""
    notes = ((name, getattr(one, "__metadata__", ())) for name, one in make_rule.__annotations__.items())
    return {name: note for name, some in notes for note in some if note in (TEAMS, OWNERS)}


class Move(NamedTuple):
    """What one agent on the ground is about to do, or has done, in a turn."""

    agent: str
    team: Any
    start: int  # node id
    end: int  # node id; the start for one that stays
    path: tuple[int, ...]  # node ids from start to end; only the start for one that stays


class IConflicts(Protocol):
    """Decides which agents have to stay where moves get in each other's way.

    May offer `involved(starts, ends) -> list[int]`: which of some moves, given by where they start and end, can decide
    who has to stay; `resolve` is then asked about these alone, and not at all where there are none.
    """

    @property
    def resolve(self) -> Callable[[Mapping[str, Move], Any], set[str]]:
        """The method `resolve(moves, ctx)`, which returns the names of the agents that must stay where they are.

        `moves` are all moves of this turn by name, in the order of the names, stayers included. The answer must not
        depend on that order, nor on anything but the moves and the context. For the type of `ctx` see `Rule`.
        """
