"""The agent room's front: creates agents and keeps them by name."""

from collections.abc import Iterator
from typing import Any

from gamms.agent.agent import Agent
from gamms.arguments import as_name, misspelt
from gamms.errors import BadType, BadValue, ContextTerminated, Duplicate, NotYet, UnknownName, UnknownType
from gamms.ir.agents import AgentColumns
from gamms.typing import IContext
from gamms.typing.agent_engine import AgentType, IAgentEngine, IMoves, Roll

_KEYWORDS = ("start_node_id", "sensors", "team", "strategy", "type", "agent_type", "orientation", "meta")


class AgentEngine(IAgentEngine):
    """The agents of one context.

    Attributes:
        agents: the agents by name, in the order of their creation.
        columns: their rows, and for a while those of deleted agents.
        moves: the one writer of where they are.
    """

    def __init__(self, ctx: IContext, moves: IMoves) -> None:
        self._ctx = ctx
        self.moves = moves
        self.agents: dict[str, Agent] = {}
        self.columns = AgentColumns()
        self._dead = 0  # rows of deleted agents

    def create_agent(self, name: str, **kwargs: Any) -> Agent:
        """Create an agent; nothing has changed when this raises."""
        if self._ctx.is_terminated():
            raise ContextTerminated("ctx.agent")
        if as_name(name, "an agent") in self.agents:
            raise Duplicate("an agent", name)
        _refuse_other_types(kwargs)
        sensors = self._found_sensors(name, kwargs.pop("sensors", ()))
        strategy = kwargs.pop("strategy", None)
        hints = misspelt(kwargs, _KEYWORDS)
        if "start_node_id" not in kwargs:
            raise KeyError(" ".join(["start_node_id", *hints]))
        agent = Agent(self._ctx, name, kwargs.pop("start_node_id"), **kwargs)
        agent.register_strategy(strategy)
        for hint in hints:
            self._ctx.logger.warning(f"Agent {name!r}: {hint} It is kept as an attribute.")
        agent.live_in(self.columns)
        self.agents[name] = agent
        for sensor_id in sensors:
            agent.register_sensor(sensor_id, self._ctx.sensor.get_sensor(sensor_id))
        return agent

    def get_agent(self, name: str) -> Agent:
        """An agent by name (KeyError)."""
        try:
            return self.agents[name]
        except (KeyError, TypeError):
            raise UnknownName("agent", name, self.agents) from None

    def delete_agent(self, name: str) -> None:
        """Take an agent out of the world; an unknown name is only warned about."""
        agent = self.agents.pop(name, None)
        if agent is None:
            self._ctx.logger.warning(f"{UnknownName('agent', name, self.agents)} Nothing is deleted.")
            return
        agent.leave()
        self._dead += 1
        if self._dead > len(self.agents):  # so that deleting costs each agent its share only once
            self._sweep()

    def create_iter(self) -> Iterator[Agent]:
        """The agents of this moment in the order of their creation, without those deleted meanwhile."""
        agents = self.agents
        for agent in list(agents.values()):
            if agent._columns is self.columns:
                yield agent

    def roll(self) -> Roll:
        """Who is where."""
        if self._dead:
            self._sweep()
        return Roll(self.columns.names, *self.columns.nodes())

    def terminate(self) -> None:
        """Close the room: agents stay readable and do nothing."""
        for agent in self.agents.values():
            agent.rest()

    def _sweep(self) -> None:
        """Drop the rows of deleted agents."""
        living = list(self.agents.values())
        self.columns.keep([agent._row for agent in living])
        for row, agent in enumerate(living):
            agent._row = row
        self._dead = 0

    def _found_sensors(self, name: str, ids: Any) -> list[str]:
        if isinstance(ids, str) or not hasattr(ids, "__iter__"):
            raise BadType(f"sensors= of agent {name!r} must be a list of sensor ids, not {ids!r}.")
        found = []
        for sensor_id in ids:
            try:
                self._ctx.sensor.get_sensor(sensor_id)
                found.append(sensor_id)
            except KeyError as error:
                self._ctx.logger.warning(f"Agent {name!r} goes without a sensor: {error}")
        return found


def _refuse_other_types(kwargs: dict[str, Any]) -> None:
    given = [kwargs.pop(key) for key in ("type", "agent_type") if key in kwargs]
    if len(given) == 2 and given[0] != given[1]:
        raise BadValue(f"type={given[0]!r} and agent_type={given[1]!r} are synonyms and contradict each other.")
    for kind in given:
        try:
            agent_type = AgentType(kind)
        except ValueError:
            raise UnknownType(f"Unknown agent type {kind!r}. Use AgentType.BASIC or AgentType.AERIAL.") from None
        if agent_type is AgentType.AERIAL:
            raise NotYet("An agent of type AERIAL")
