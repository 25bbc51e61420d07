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
        is_plain: whether it moves along one edge, on the ground.
        rng, memory: its own, as it finds them in its state.
        sees_world_only: whether all its sensors are built-in ones, which look at nothing but the graph and the agents.
        counts: how often what happened to it; see `COUNTED`.
        usual: what a usual turn needs of all this, in the form that is read fastest.
    """

    __slots__ = (
        "agent",
        "counts",
        "flies",
        "is_plain",
        "memory",
        "name",
        "rng",
        "row",
        "sees_world_only",
        "speed",
        "team",
        "usual",
    )

    def __init__(self, game: "Game", agent: Any) -> None:
        self.agent = agent
        self.name, self.team, self.row = agent.name, agent.team, agent._row
        self.flies = agent.type is AgentType.AERIAL
        self.speed = None if self.flies else _speed(agent)
        self.is_plain = not self.flies and self.speed is None and game.legal == "edges"
        self.rng = game.rng_of(self.name)
        self.memory = game.memories.setdefault(self.name, {})
        self.sees_world_only = all(_is_built_in(type(sensor)) for sensor in agent._sensor_list.values())
        self.usual = (agent, self.row, self.name, self.team, self.rng, self.memory, self.is_plain)
        self.counts = game.counts.setdefault(self.name, dict.fromkeys(COUNTED, 0))


def _is_built_in(kind: type) -> bool:
    return kind.__module__.startswith("gamms.sensor.") and kind.__module__ != "gamms.sensor.function"


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
