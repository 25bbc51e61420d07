"""How a game stood before its first turn, and how to get back there."""

from copy import deepcopy
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.game.ruleset import NamedRule

if TYPE_CHECKING:
    from gamms.game.game import Game


class Start(NamedTuple):
    """What `reset` restores."""

    seed: int
    chance: Any  # where the context's own stream stood, None where it had not been asked for
    first: tuple[int, Any]  # seed and chance of the first start in this context
    agents: Any  # as the agent engine keeps them
    world: Any  # as the graph engine keeps it
    sensors: Any  # as the sensor engine keeps them
    settings: dict[str, Any]
    rules: tuple[NamedRule, ...]
    collectors: Any
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

    def chance_of(self, seed: int) -> Any:
        """Where the context's own stream stood at the start with this seed; None: at its beginning."""
        known = dict([self.first, (self.seed, self.chance)])
        return known.get(seed)

    def restore(self, game: "Game") -> None:
        """Restore everything but the random streams."""
        ctx = game.ctx
        ctx.graph.restore(self.world)
        ctx.agent.restore(self.agents)
        ctx.sensor.restore(self.sensors)
        game.begin_anew()
        game.configure(self.settings)
        game.restore_rules(self.rules)
        game._collectors.restore(self.collectors)
        for memory in game.memories.values():
            memory.clear()
        for name, memory in self.memories.items():
            game.memory_of(name).update(deepcopy(memory))
        game.team_memories = deepcopy(self.team_memories)
        game.turn = self.turn
        game.data.clear()
        game.data.update(deepcopy(self.data))
        game.scores.clear()
        game.scores.update(self.scores)
        game.events.extend(dict(event) for event in self.events)
        game._facts.clear()
        game._facts.update(self.facts)


def taken(game: "Game", before: Start | None) -> Start:
    """Return how a game stands now; `before` is its last start, if it has had one."""
    ctx = game.ctx
    chance = ctx.chance()
    return Start(
        ctx.seed,
        chance,
        (ctx.seed, chance) if before is None else before.first,
        ctx.agent.kept(),
        ctx.graph.kept(),
        ctx.sensor.kept(),
        game.settings(),
        game.rules,
        game._collectors.kept(),
        deepcopy(game.data),
        dict(game.scores),
        [dict(event) for event in game.events],
        dict(game._facts),
        game.turn,
        {name: deepcopy(memory) for name, memory in game.memories.items() if memory},
        deepcopy(game.team_memories),
    )
