"""Who plays: one seat for each living agent, in the order of the names."""

from typing import TYPE_CHECKING, Any

from gamms.arguments import as_range
from gamms.errors import GammsError
from gamms.typing import AgentType

if TYPE_CHECKING:
    from gamms.game.game import Game

COUNTED = ("moves", "blocked", "illegal", "errors", "overruns")


class Seat:
    """What the engine keeps of one agent.

    Attributes:
        agent: the agent; Any: the agent room's own class.
        name, team, row: its own.
        flies: whether it is in the air.
        speed: how far it may go in a turn, in the unit of the game; None for one edge.
        template: its state, but for what changes from turn to turn.
        counts: how often what happened to it; see `COUNTED`.
    """

    __slots__ = ("agent", "counts", "flies", "name", "row", "speed", "team", "template")

    def __init__(self, game: "Game", agent: Any) -> None:
        self.agent = agent
        self.name, self.team, self.row = agent.name, agent.team, agent._row
        self.flies = agent.type is AgentType.AERIAL
        self.speed = None if self.flies else _speed(agent)
        self.counts = game.counts.setdefault(self.name, dict.fromkeys(COUNTED, 0))
        self.template: dict[str, Any] = {
            "curr_pos": None,
            **({"quat": None} if self.flies else {}),
            "sensor": None,
            "name": self.name,
            "team": self.team,
            "turn": 0,
            "legal": (),
            "rng": game.rng_of(self.name),
            "memory": game.memories.setdefault(self.name, {}),
            "team_memory": None,
            "facts": game.facts,
        }


def seats(game: "Game") -> list[Seat]:
    """A seat for everybody who is alive."""
    living = [agent for agent in game.ctx.agent.agents.values() if agent.alive]
    return [Seat(game, agent) for agent in sorted(living, key=lambda agent: agent.name)]


def _speed(agent: Any) -> float | None:
    if agent.speed is None:
        return None
    try:
        return as_range(agent.speed, f"speed of agent {agent.name!r}")
    except GammsError as error:
        error.add_note("On the ground it is what ctx.game lets the agent move in a turn; None for one edge.")
        raise
