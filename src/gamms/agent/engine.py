"""The agent room's front: creates agents and keeps them by name."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from weakref import WeakSet

from gamms.agent.agent import Agent
from gamms.arguments import as_name, misspelt
from gamms.errors import BadType, ContextTerminated, Duplicate, MissingKey, NotYet, UnknownName, nearest
from gamms.ir.agents import AgentColumns
from gamms.typing import IContext
from gamms.typing.agent_engine import AgentType, IAgentEngine, IMoves, Roll, Standing
from gamms.typing.sensor_engine import ISensor

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
        self._gone: WeakSet[Agent] = WeakSet()  # deleted agents that somebody still holds

    def create_agent(self, name: str, **kwargs: Any) -> Agent:
        """Create an agent; nothing has changed when this raises."""
        if self._ctx.is_terminated():
            raise ContextTerminated("ctx.agent")
        if as_name(name, "an agent") in self.agents:
            raise Duplicate("an agent", name)
        self._refuse_other_types(name, kwargs)
        sensors = self._found_sensors(name, kwargs.pop("sensors", ()))
        strategy = kwargs.pop("strategy", None)
        hints = misspelt(kwargs, _KEYWORDS)
        if "start_node_id" not in kwargs:
            raise MissingKey(" ".join([f"Agent {name!r} needs start_node_id=, the node it stands on.", *hints]))
        agent = Agent(self._ctx, name, kwargs.pop("start_node_id"), **kwargs)
        agent.register_strategy(strategy)
        for hint in hints:
            self._ctx.logger.warning(f"Agent {name!r}: {hint} It is kept as an attribute.")
        try:
            for key, sensor in sensors.items():
                agent.register_sensor(key, sensor)
        except BaseException:
            agent._leave()
            raise
        agent._live_in(self.columns)
        self.agents[name] = agent
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
        agent._leave()
        self._gone.add(agent)
        self._dead += 1
        if self._dead > len(self.agents):  # so that deleting costs each agent its share only once
            self._sweep()

    def create_iter(self) -> "Living":
        """The agents in the order of their creation; each loop over it takes those of its beginning that are left."""
        return Living(self)

    def roll(self) -> Roll:
        """Who is where, as arrays."""
        if self._dead:
            self._sweep()
        columns = self.columns
        nodes, moves = columns.nodes()
        return Roll(columns.names, nodes, moves, columns.teams, *columns.places())

    def standing(self) -> Standing:
        """Who stands on which node."""
        # NOTE: asked after every single move: no call but the one that follows it (benchmarks/README.md, w3).
        if self._dead:
            self._sweep()
        columns = self.columns
        crowds = columns.crowds()
        rest = columns.node, columns.teams, crowds.at, crowds.taken
        return tuple.__new__(Standing, (columns.names, *rest, columns.moves))

    def terminate(self) -> None:
        """Close the room: agents stay readable and do nothing."""
        for agent in (*self.agents.values(), *self._gone):
            agent._rest()

    def _sweep(self) -> None:
        """Drop the rows of deleted agents."""
        living = list(self.agents.values())
        self.columns.keep([agent._row for agent in living])
        for row, agent in enumerate(living):
            agent._row = row
        self._dead = 0

    def _found_sensors(self, name: str, given: Any) -> dict[str, ISensor]:
        """The sensors an agent is to carry, by the name it knows them by."""
        if isinstance(given, str) or not isinstance(given, Iterable):
            raise BadType(f"sensors= of agent {name!r} must be a list of sensor ids or a dict, not {given!r}.")
        pairs = given.items() if isinstance(given, Mapping) else ((sensor_id, sensor_id) for sensor_id in given)
        found = {}
        for key, sensor in pairs:
            try:
                found[key] = sensor if isinstance(sensor, ISensor) else self._ctx.sensor.get_sensor(sensor)
            except KeyError as error:
                self._ctx.logger.warning(f"Agent {name!r} goes without a sensor: {error}")
        return found

    def _refuse_other_types(self, name: str, kwargs: dict[str, Any]) -> None:
        """Take `type` and its synonym `agent_type` from the keywords.

        As in 1.0.0, a `type` that is none means BASIC, and an `agent_type` that is none is the caller's attribute.
        """
        kind = kwargs.pop("type", AgentType.BASIC)
        kind = AgentType.__members__.get(kind.upper(), kind) if isinstance(kind, str) else kind
        if kind not in tuple(AgentType):
            hint = nearest(str(kind).upper(), AgentType.__members__)
            self._ctx.logger.warning(f"Agent {name!r}: unknown type {kind!r}, so it is BASIC.{hint}")
        if AgentType.AERIAL in (kind, kwargs.get("agent_type")):
            raise NotYet("aerial agents (AgentType.AERIAL)")


class Living(Iterator[Agent]):
    """The agents that live, as often as a program loops over them: 1.0.0 gave a view that could be kept."""

    def __init__(self, engine: AgentEngine) -> None:
        self._engine = engine
        self._loop: Iterator[Agent] | None = None

    def __len__(self) -> int:
        return len(self._engine.agents)

    def __iter__(self) -> Iterator[Agent]:  # noqa: PYI034 - every loop is one of its own
        columns = self._engine.columns
        for agent in list(self._engine.agents.values()):
            if agent._columns is columns:
                yield agent

    def __next__(self) -> Agent:
        if self._loop is None:
            self._loop = iter(self)
        return next(self._loop)
