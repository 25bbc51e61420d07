"""The agent room's front: creates agents and keeps them by name."""

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from numbers import Integral
from typing import Any, Literal, NamedTuple, overload
from weakref import WeakSet

from gamms.agent.aerial import AerialAgent
from gamms.agent.agent import Agent
from gamms.agent.member import Member
from gamms.arguments import as_name, misspelt
from gamms.deciding import Guarded, phase_of, refused_while_deciding
from gamms.errors import BadType, ContextTerminated, Duplicate, MissingKey, UnknownName, nearest
from gamms.ir import events as kinds
from gamms.ir.agents import BY_ROW, AgentColumns
from gamms.ir.graph import FloatArray
from gamms.readonly import ReadOnlyMapping, frozen
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.agent_engine import AgentType, IAgentEngine, IMoves, Roll, SensorsOfAgent, Standing
from gamms.typing.sensor_engine import ISensor, is_sensor
from gamms.typing.state import AerialStrategy, AsyncStrategy, NodeId, Strategy

_KEYWORDS = (
    "start_node_id",
    "sensors",
    "team",
    "strategy",
    "type",
    "agent_type",
    "orientation",
    "meta",
    "speed",
    "position",
    "quat",
)


class AgentsSnapshot(NamedTuple):
    """All agents at one moment: the columns, and of each agent what is not in them."""

    columns: dict[str, list[Any]]
    roster: tuple[AgentColumns, int]  # which agents there are, and which team, speed and sensors they have
    agents: list[tuple[Member, dict[str, Any], Any, dict[str, Any], dict[str, Any]]]
    # agent, attributes, strategy, sensors, last state
    gone: list[tuple[Member, AgentColumns]]  # deleted agents with columns of their own
    rows: dict[int, int]  # id() of an agent -> its row

    def place_of(self, agent: Any) -> Any:
        """Return the node an agent was on, or (x, y, z) of a flyer; where it is now if it came later."""
        row = self.rows.get(id(agent))
        if row is not None:
            position = self.columns["position"][row]
            return self.columns["node"][row] if position is None else position
        return getattr(agent, "position", agent.current_node_id)


class AgentEngine(Guarded, IAgentEngine):
    """The agents of one context."""

    _called = "ctx.agent"

    def __init__(self, ctx: IContext, moves: IMoves) -> None:
        self._phase = phase_of(ctx)
        self._ctx = ctx
        self._moves = moves
        self._agents: dict[str, Member] = {}
        self._columns = AgentColumns()
        self._dead = 0  # rows of deleted agents
        self._gone: WeakSet[Member] = WeakSet()  # deleted agents that somebody still holds

    @property
    def agents(self) -> dict[str, Member]:  # type: ignore[override] # an attribute, in the contract
        """The agents by name, in the order of their creation; read-only while agents decide."""
        is_open = self._phase.agent is None
        return self._agents if is_open else ReadOnlyMapping(self._agents)  # type: ignore[return-value] # it reads like it

    @property
    def columns(self) -> AgentColumns:
        """Their rows, and for a while those of deleted agents; not for strategies."""
        self._phase.refuse("use ctx.agent.columns")
        return self._columns

    @property
    def moves(self) -> IMoves:  # type: ignore[override] # an attribute, in the contract
        """The one writer of where they are; not for strategies."""
        self._phase.refuse("use ctx.agent.moves")
        return self._moves

    @overload  # type: ignore[override] # narrower: what is created is of the class that its type says
    def create_agent(
        self,
        name: str,
        *,
        type: Literal[AgentType.AERIAL],
        start_node_id: NodeId,
        speed: float,
        position: Sequence[float] | FloatArray | None = None,
        quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        sensors: SensorsOfAgent = (),
        team: Hashable = None,
        strategy: AerialStrategy | AsyncStrategy | None = None,
        orientation: tuple[float, float] | None = None,
        **attributes: object,
    ) -> AerialAgent: ...
    @overload
    def create_agent(
        self,
        name: str,
        *,
        agent_type: Literal[AgentType.AERIAL],
        start_node_id: NodeId,
        speed: float,
        position: Sequence[float] | FloatArray | None = None,
        quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        sensors: SensorsOfAgent = (),
        team: Hashable = None,
        strategy: AerialStrategy | AsyncStrategy | None = None,
        orientation: tuple[float, float] | None = None,
        **attributes: object,
    ) -> AerialAgent: ...
    @overload
    def create_agent(
        self,
        name: str,
        *,
        start_node_id: NodeId,
        sensors: SensorsOfAgent = (),
        team: Hashable = None,
        strategy: Strategy | AsyncStrategy | None = None,
        orientation: tuple[float, float] | None = None,
        speed: float | None = None,
        type: Literal[AgentType.BASIC] = AgentType.BASIC,
        agent_type: Literal[AgentType.BASIC] = AgentType.BASIC,
        **attributes: object,
    ) -> Agent: ...
    @refused_while_deciding
    def create_agent(self, name: str, **kwargs: Any) -> Member:
        """Create an agent; nothing has changed when this raises."""
        if self._ctx.is_terminated():
            raise ContextTerminated("ctx.agent")
        if as_name(name, "an agent") in self._agents:
            raise Duplicate("an agent", name)
        if "sensors" in kwargs:
            kwargs["sensors"] = _listed(kwargs["sensors"])
        given = dict(kwargs)
        kind = self._kind_of(name, kwargs)
        sensors = self._found_sensors(name, kwargs.pop("sensors", ()))
        strategy = kwargs.pop("strategy", None)
        hints = misspelt(kwargs, _KEYWORDS)
        for needed, what in _NEEDED[kind].items():
            if needed not in kwargs:
                raise MissingKey(" ".join([f"Agent {shown(name)} needs {needed}=, {what}.", *hints]))
        agent = _CLASSES[kind](self._ctx, name, **kwargs)
        agent.register_strategy(strategy)
        for hint in hints:
            self._ctx.logger.warning(f"Agent {shown(name)}: {hint} It is kept as an attribute.")
        agent._live_in(self._columns)
        self._agents[name] = agent  # before its sensors: one may ask who its owner is
        log = self._columns.journal
        self._columns.journal = kinds.Muted(log)  # what follows is a part of the creation
        try:
            self._equip(agent, sensors)
        finally:
            self._columns.journal = log
        if log is not kinds.NOBODY:
            log.entered(agent._row, name)
            log.note(kinds.AGENT_CREATE, {"name": name, "kwargs": given, "state": self._more_of(agent._row)})
        return agent

    def get_agent(self, name: str) -> Member:
        """An agent by name (KeyError)."""
        try:
            return self._agents[name]
        except (KeyError, TypeError):
            raise UnknownName("agent", name, self._agents) from None

    @refused_while_deciding
    def delete_agent(self, name: str) -> None:
        """Take an agent out of the world; an unknown name is only warned about."""
        agent = self._agents.get(as_name(name, "an agent"))
        if agent is None:
            self._ctx.logger.warning(f"{UnknownName('agent', name, self._agents)} Nothing is deleted.")
            return
        self._take_out(agent)
        self._columns.journal.note(kinds.AGENT_DELETE, {"name": name})

    def create_iter(self) -> "Living":
        """The agents in the order of their creation; each loop over it takes those of its beginning that are left."""
        return Living(self)

    @property
    def teams(self) -> dict[Any, list[Member]]:
        """Team -> its agents in the order of their creation, dead ones too; the teams in the order of their text."""
        teams: dict[Any, list[Member]] = {}
        for agent in self._agents.values():
            teams.setdefault(agent.team, []).append(agent)
        return dict(sorted(teams.items(), key=lambda item: str(item[0])))

    def settle(self) -> None:
        """Bring everything that is kept about the agents up to date."""
        if self._dead:
            self._sweep()
        if self._columns.flying:
            self._moves.locate(self._columns)
        self._columns.settle()

    def roll(self) -> Roll:
        """Who is where, as arrays."""
        if self._dead:
            self._sweep()
        columns = self._columns
        if columns.flying:
            self._moves.locate(columns)
        nodes, moves = columns.nodes()
        return self._phase.shown(Roll(columns.names, nodes, moves, columns.teams, *columns.places(), columns.out))

    def standing(self) -> Standing:
        """Who stands on which node."""
        # NOTE: asked after every single move: no call but the one that follows it (benchmarks/README.md, w3).
        if self._dead:
            self._sweep()
        columns = self._columns
        if columns.flying:
            self._moves.locate(columns)
        crowds = columns.crowds()
        rest = columns.node, columns.teams, crowds.at, crowds.taken
        standing = tuple.__new__(Standing, (columns.names, *rest, columns.moves))
        return standing if self._phase.agent is None else frozen(standing)

    @refused_while_deciding
    def write_by(self, moves: IMoves) -> None:
        """Let all agents be moved by another writer, those that come later, too."""
        self._moves = moves
        for agent in (*self._agents.values(), *self._gone):
            agent._write_by(moves)

    @refused_while_deciding
    def snapshot(self) -> AgentsSnapshot:
        """Return all agents as they are now, for `restore`."""
        self.settle()
        columns = {name: list(getattr(self._columns, name)) for name in BY_ROW}
        agents = [
            (agent, _copied(agent.__dict__), agent.strategy, agent._sensor_list.copy(), agent._last[0])
            for agent in self._agents.values()
        ]
        roster = self._columns, self._columns.roster
        rows = {id(agent): row for row, (agent, *_) in enumerate(agents)}
        gone = [(agent, agent._columns) for agent in self._gone if agent._columns is not self._columns]
        return AgentsSnapshot(columns, roster, agents, gone, rows)

    @refused_while_deciding
    def restore(self, before: AgentsSnapshot) -> None:
        """Restore all agents: those that came since are deleted, those that went are back."""
        self.settle()
        columns = self._columns
        if before.roster == (columns, columns.roster):
            columns.move_back(before.columns)
        else:
            self._restore_roster(before)
            self._columns.write_back(before.columns)
        for agent, attributes, strategy, sensors, last in before.agents:
            if attributes or agent.__dict__:
                agent.__dict__.clear()
                agent.__dict__.update(_copied(attributes))
            if agent.strategy is not strategy:
                agent.strategy = strategy
            agent._last[0] = last
            if agent._sensor_list != sensors:
                for name in [name for name in agent._sensor_list if name not in sensors]:
                    agent.deregister_sensor(name)
                for name, sensor in sensors.items():
                    agent.register_sensor(name, sensor)

    @refused_while_deciding
    def put(self, agent: Member, values: dict[str, Any]) -> None:
        """Let the columns say of an agent what they said once, unchecked; for who plays a recording."""
        columns, row = self._columns, agent._row
        for name, value in values.items():
            getattr(columns, name)[row] = value
        columns.touched.add(row)
        if columns.kind[row]:
            columns.adrift.add(row)

    @refused_while_deciding
    def terminate(self) -> None:
        """Close the room: agents stay readable and do nothing."""
        for agent in (*self._agents.values(), *self._gone):
            agent._rest()

    def _restore_roster(self, before: AgentsSnapshot) -> None:
        """Restore which agents there are, in the same order."""
        there = {id(agent) for agent, *_ in before.agents}
        for agent in [agent for agent in self._agents.values() if id(agent) not in there]:
            self.delete_agent(agent.name)
        self.settle()
        if [agent for agent, *_ in before.agents] != list(self._agents.values()):
            self._columns, columns = AgentColumns(), self._columns
            self._columns.journal, self._columns.roster = columns.journal, columns.roster
            self._columns.moves = columns.moves + 1
            self._agents = {}
            for agent, *_ in before.agents:
                agent._live_in(self._columns)
                self._agents[agent.name] = agent
        for agent, own in before.gone:  # they are again as they were when they were deleted
            agent._columns, agent._row = own, 0

    def _equip(self, agent: Member, sensors: dict[str, ISensor]) -> None:
        """Give a new agent its sensors, or take it out again."""
        owners = [(sensor, getattr(sensor, "_owner", None)) for sensor in sensors.values()]
        try:
            for key, sensor in sensors.items():
                agent.register_sensor(key, sensor)
        except BaseException:
            equipped = list(agent._sensor_list.values())
            self._take_out(agent)
            for sensor, owner in owners:
                if owner is not None and any(sensor is one for one in equipped):
                    sensor.set_owner(owner)
            raise

    def _more_of(self, row: int) -> dict[str, Any]:
        """What does not follow from the keywords of a new agent alone: how it is turned, where it flies."""
        columns = self._columns
        more = {name: getattr(columns, name)[row] for name in ("heading", "position", "previous_position", "quat")}
        if columns.kind[row]:
            more["node"] = self._moves.nearest(columns, row)
        return {name: value for name, value in more.items() if value is not None}

    def _take_out(self, agent: Member) -> None:
        del self._agents[agent.name]
        agent._leave()
        self._columns.roster += 1
        self._gone.add(agent)
        self._dead += 1
        if self._dead > len(self._agents):  # so that deleting costs each agent its share only once
            self._sweep()

    def _sweep(self) -> None:
        """Drop the rows of deleted agents."""
        living = list(self._agents.values())
        self._columns.keep([agent._row for agent in living])
        for row, agent in enumerate(living):
            agent._row = row
        self._dead = 0

    def _found_sensors(self, name: str, given: Any) -> dict[str, ISensor]:
        """The sensors an agent is to carry, by the name it knows them by."""
        if isinstance(given, str) or not isinstance(given, Iterable):
            raise BadType(
                f"sensors= of agent {shown(name)} must be a list of sensor ids or a dict, not {shown(given)}."
            )
        pairs = given.items() if isinstance(given, Mapping) else ((sensor_id, sensor_id) for sensor_id in given)
        found = {}
        for key, sensor in pairs:
            is_id = isinstance(sensor, str)
            if not is_id and not is_sensor(sensor):
                raise BadType(f"Agent {name!r} cannot carry {shown(sensor)}: sensors= takes sensors and their ids.")
            if isinstance(given, Mapping):
                as_name(key, "a sensor")
            try:
                found[key if is_id or isinstance(given, Mapping) else sensor.sensor_id] = (
                    self._ctx.sensor.get_sensor(sensor) if is_id else sensor
                )
            except KeyError as error:
                self._ctx.logger.warning(f"Agent {shown(name)} goes without a sensor: {error}")
        return found

    def _kind_of(self, name: str, kwargs: dict[str, Any]) -> AgentType:
        """What `type` and its synonym `agent_type` ask for.

        As in 1.0.0, a `type` that is none means BASIC, and `agent_type` is an attribute, too, whatever it is.
        """
        given = kwargs.pop("type", AgentType.BASIC)
        kind = _as_type(given)
        if kind is None:
            hint = nearest(given.upper() if isinstance(given, str) else given, AgentType.__members__)
            self._ctx.logger.warning(f"Agent {shown(name)}: unknown type {shown(given)}, so it is BASIC.{hint}")
        return AgentType.AERIAL if AgentType.AERIAL in (kind, _as_type(kwargs.get("agent_type"))) else AgentType.BASIC


_CLASSES: dict[AgentType, type[Agent] | type[AerialAgent]] = {
    AgentType.BASIC: Agent,
    AgentType.AERIAL: AerialAgent,
}
_NEEDED = {
    AgentType.BASIC: {"start_node_id": "the node it stands on"},
    AgentType.AERIAL: {"start_node_id": "the node it starts from", "speed": "map units per step"},
}


def _listed(sensors: Any) -> Any:
    """Sensors in a form that can be looked at more than once; what is none stays as it is."""
    if isinstance(sensors, list | tuple | dict | str) or not isinstance(sensors, Iterable):
        return sensors
    return dict(sensors) if isinstance(sensors, Mapping) else list(sensors)


def _as_type(given: Any) -> AgentType | None:
    """A type given as a member, by name or by number; None if it is none."""
    if isinstance(given, str):
        return AgentType.__members__.get(given.upper())
    return AgentType(int(given)) if isinstance(given, Integral) and given in _CLASSES else None


def _copied(attributes: dict[str, Any]) -> dict[str, Any]:
    """Copy the caller's attributes; values that cannot be copied are shared."""
    if not attributes:
        return {}
    copied = {}
    for name, value in attributes.items():
        try:
            copied[name] = deepcopy(value)
        except Exception:  # noqa: BLE001 - whatever a caller's object raises when it is copied
            copied[name] = value
    return copied


class Living(Iterator[Member]):
    """The agents that live, as often as a program loops over them: 1.0.0 gave a view that could be kept."""

    def __init__(self, engine: AgentEngine) -> None:
        self._engine = engine
        self._loop: Iterator[Member] | None = None

    def __len__(self) -> int:
        return len(self._engine._agents)

    def __iter__(self) -> Iterator[Member]:  # noqa: PYI034 - every loop is one of its own
        columns = self._engine._columns
        for agent in list(self._engine._agents.values()):
            if agent._columns is columns:
                yield agent

    def __next__(self) -> Member:
        if self._loop is None:
            self._loop = iter(self)
        return next(self._loop)
