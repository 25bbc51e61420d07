"""How a game stood before its first turn, and how to get back there."""

from copy import deepcopy
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from gamms.game.game import Game


class Start(NamedTuple):
    """What `reset` restores."""

    seed: int
    chance: Any  # where the context's own stream stood, None where it had not been asked for
    agents: Any  # as the agent room keeps them
    world: Any  # as the graph room keeps it
    data: dict[str, Any]
    scores: dict[Any, float]
    events: list[dict[str, Any]]
    facts: dict[str, Any]
    turn: int  # 0, but for a game that goes on from a recording
    memories: dict[str, dict[Any, Any]]  # those with something in them, as are the next ones
    team_memories: dict[Any, dict[Any, Any]]

    def place_of(self, agent: Any) -> Any:
        """Where an agent began: a node id, or (x, y, z)."""
        return self.agents.place_of(agent)

    def restore(self, game: "Game", seed: int | None) -> None:
        """Let everything be as it was, with the streams of another seed if there is one."""
        ctx = game.ctx
        ctx.graph.restore(self.world)
        ctx.agent.restore(self.agents)
        ctx.sensor.reset()
        is_same = seed is None or seed == self.seed
        ctx.reseed(self.seed if seed is None else seed, self.chance if is_same else None)
        game.forget_streams()
        game.begin_anew()
        for memory in game.memories.values():
            memory.clear()
        for name, memory in self.memories.items():
            game.memory_of(name).update(deepcopy(memory))
        game.team_memories = deepcopy(self.team_memories)
        game.turn = self.turn
        game.collectors.clear()
        game.data.clear()
        game.data.update(deepcopy(self.data))
        game.scores.clear()
        game.scores.update(self.scores)
        game.events.extend(dict(event) for event in self.events)
        game._facts.clear()
        game._facts.update(self.facts)


def taken(game: "Game") -> Start:
    """How a game stands now."""
    ctx = game.ctx
    return Start(
        ctx.seed,
        ctx.chance(),
        ctx.agent.kept(),
        ctx.graph.kept(),
        deepcopy(game.data),
        dict(game.scores),
        [dict(event) for event in game.events],
        dict(game._facts),
        game.turn,
        {name: deepcopy(memory) for name, memory in game.memories.items() if memory},
        deepcopy(game.team_memories),
    )
