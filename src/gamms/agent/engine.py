"""The agent engine: creates agents and stores them by name."""

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import repeat
from numbers import Integral
from types import MappingProxyType
from typing import Any, Literal, Never, NoReturn, overload
from weakref import WeakSet

import numpy as np

from gamms.agent.agent import AerialAgent, Agent, BaseAgent
from gamms.agent.carried_sensors import find_sensors, list_sensors
from gamms.agent.snapshots import (
    AgentSet,
    AgentsSnapshot,
    Roster,
    find_uncreated_teams,
    list_attributes,
    list_details,
)
from gamms.agent.teams import (
    Agents,
    AgentsByName,
    Team,
    UncreatedMembers,
    check_starts,
    check_values,
    is_attribute,
    make_column,
    make_member,
    note_created,
)
from gamms.arguments import as_declared, as_member, as_name, explain_misspelled, spell_out_options
from gamms.compat import Surface
from gamms.core.copies import copy_values
from gamms.deciding import ContextPart, Guarded, get_phase, refuse_to_judges
from gamms.errors import BadValue, ContextTerminated, Duplicate, GammsError, MissingKey, UnknownName, nearest
from gamms.ir import events
from gamms.ir.agents import AgentBlock, Position, read_vector
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, may_be_mode
from gamms.ir.journal import CLOSED, PLAIN, MutedJournal
from gamms.ir.positions import Positions
from gamms.ir.schema import VECTORS
from gamms.progress import delay_interrupts
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.actions import check_node, make_strategy
from gamms.typing.agent_engine import AgentType, DeletedAgent, IAgentEngine, SensorsOfAgent, TurnAccess
from gamms.typing.game import AerialStrategy, AsyncStrategy, NodeId, Strategy
from gamms.typing.sensor_engine import ISensor, find_owner

_MANY = 1000  # number of nodes from which an array is faster than single look-ups
_KINDS_OF_KEYWORDS = frozenset({"type", "agent_type"})
_OF_TEAMS = dict.fromkeys(("start_node_id", "sensors", "team", "strategy"))  # data of a team in addition to its columns
_KEYWORDS = _OF_TEAMS | dict.fromkeys(
    ("type", "agent_type", "orientation", "meta", "speed", "mode", "position", "quat")
)
_OF_FLYERS = {
    one: f"{one}= is only for flying agents: also give type=AgentType.AERIAL and speed=."
    for one in ("position", "quat")
}


class _AgentsByTeam(dict[Any, list[BaseAgent]]):
    """The agents of each team; an unknown team is an error that lists the teams."""

    def __missing__(self, team: object) -> NoReturn:
        raise UnknownName("team", team, self)


class AgentEngine(Surface, ContextPart, IAgentEngine):
    """The agents of one context."""

    _called = "ctx.agent"
    _items = " ctx.agent.get_agent(name) returns an agent, and ctx.agent.create_iter() loops over all of them."

    def __init__(self, ctx: IContext) -> None:
        self._phase = get_phase(ctx)
        self._ctx = ctx
        self._agents: dict[str, BaseAgent] = Agents()
        self._is_shared = False  # whether the set of agents is copied before it changes; see `AgentStorage.share`
        self._warned = set[tuple[str, str]]()  # keywords and their values, as `_warn_of_edge_attributes` has named them
        self._renew_block()
        self._storage = AgentStorage(self)
        self._last_departure = DeletedAgent()
        # deleted agents that a program still holds; each has its own block
        self._deleted: WeakSet[BaseAgent] = WeakSet()

    @property
    def agents(self) -> dict[str, BaseAgent]:  # type: ignore[override] # an attribute, in the contract
        """The agents by name, in order of creation; read-only while agents decide."""
        is_open = not self._phase.is_deciding
        return self._agents if is_open else ReadOnlyMapping(self._agents)  # type: ignore[return-value] # it reads like it

    def __repr__(self) -> str:
        """Return a text with the number of agents of each team."""
        teams = ", ".join(f"{shown(team)}: {number}" for team, number in Counter(self._block.teams).items())
        return f"AgentEngine({len(self._agents)} agents{f'; {teams}' if teams else ''})"

    @property
    def block(self) -> AgentBlock:
        """The rows of the agents, for other engines; not for strategies."""
        if self._phase.agent is not None:
            self._phase.refuse_look("use ctx.agent.block")
        if self._block.removed:
            self._close_up()
        return self._block

    @property
    def storage(self) -> "AgentStorage":
        """Operations of other engines on all agents at once; not for strategies."""
        self._phase.refuse_look("use ctx.agent.storage")
        return self._storage

    @property
    def positions(self) -> Positions:
        """The positions of all agents; not for strategies. Get it again after agents were created or deleted."""
        # NOTE: read after every single move in the paper's loop (benchmarks: sense).
        if self._phase.agent is not None:
            self._phase.refuse_look("use ctx.agent.positions")
        if self._block.removed:
            self._close_up()
        return self._positions

    @property
    def structure_version(self) -> int:
        """A number that changes when agents, or their alive flags, teams, speeds, sensors or strategies change."""
        return self._block.structure.version

    @overload  # type: ignore[override] # narrower: the type decides the class of the agent
    def create_agent(
        self,
        name: str,
        *,
        type: Literal[AgentType.AERIAL, "AERIAL"],
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
        agent_type: Literal[AgentType.AERIAL, "AERIAL"],
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
        mode: str | Mapping[str, str] | None = None,
        type: Literal[AgentType.BASIC, "BASIC"] = AgentType.BASIC,
        agent_type: Literal[AgentType.BASIC, "BASIC"] = AgentType.BASIC,
        **attributes: object,
    ) -> Agent: ...
    @refuse_to_judges
    @as_declared(IAgentEngine.create_agent)
    def create_agent(self, name: str, **kwargs: Any) -> BaseAgent:
        """Create an agent, or raise and change nothing; the contract explains the keywords."""
        if self._ctx.is_terminated():
            raise ContextTerminated("ctx.agent")
        if as_name(name, "an agent") in self._agents:
            raise Duplicate("an agent", name)
        if "sensors" in kwargs:
            kwargs["sensors"] = list_sensors(kwargs["sensors"])
        given = dict(kwargs)
        kind = self._find_kind(name, kwargs) if not _KINDS_OF_KEYWORDS.isdisjoint(kwargs) else AgentType.BASIC
        carried = kwargs.pop("sensors", ())
        skips = self._block.trusts_nodes or not isinstance(carried, Mapping)  # a list, as in 1.0.0, or a replay
        sensors = find_sensors(self._ctx, name, carried, skips_unknown=skips) if "sensors" in given else {}
        strategy = kwargs.pop("strategy", None)
        hints = [] if _KEYWORDS.keys() >= kwargs.keys() else explain_misspelled(given, _KEYWORDS)
        hints += [hint for one, hint in _OF_FLYERS.items() if kind is AgentType.BASIC and one in kwargs]
        for needed, what in _NEEDED[kind].items():
            if needed not in kwargs:
                raise MissingKey(" ".join([f"Agent {shown(name)} needs {needed}=, {what}.", *hints]))
        for hint in hints:
            self._ctx.logger.warning(f"Agent {shown(name)}: {hint} It is stored as an attribute.")
        self._check_travel(name, kwargs, flies=kind is AgentType.AERIAL)
        with delay_interrupts(at_most_once=True):
            self._phase.known_names.update(kwargs)
            self._copy_on_change()
            block = self._block
            journal = self._block.journal
            if not journal.is_silent:
                block.journal = MutedJournal(journal)  # all following changes are part of the creation
            try:
                agent = self._add_agent(_CLASSES[kind], name, kwargs, strategy)
                if sensors:
                    created = self._equip(agent, sensors)
                    given["sensors"] = created if created != sensors else given["sensors"]
            finally:
                block.journal = journal
            journal.number_agent(agent._row, name)
            self._note_starts([(name, getattr(agent, "position", agent.current_node_id))])
            if not journal.is_silent:
                journal.note(events.AGENT_CREATE, {"name": name, "kwargs": given, "state": self._list_more(agent._row)})
        return agent

    @refuse_to_judges
    @spell_out_options()
    def create_team(
        self,
        name: str,
        start_node_ids: Iterable[NodeId] | IntArray,
        *,
        sensors: SensorsOfAgent = (),
        strategy: Strategy | AsyncStrategy | None = None,
        columns: Mapping[str, object] = MappingProxyType({}),
        **_others: Never,
    ) -> Team:
        """Create the agents of a team in one call: `red_0`, `red_1`, … on the ground.

        A plan with arrays (`ctx.game.command(name, plan, arrays=True)`) decides for them fastest. Without start nodes,
        the team is only declared: rules may mention it, and its agents are created later.

        Args:
            name: name of the team, and prefix of the agents' names.
            start_node_ids: (agents,) first node of each agent.
            sensors: sensors of every agent, as for `create_agent`.
            strategy: strategy of every agent.
            columns: attributes: name -> one value for all agents, or one for each, (agents,).

        Raises:
            UnknownName (KeyError): a node or a sensor does not exist.
            Duplicate: an agent with one of these names exists.
            BadType, BadValue: an argument is invalid, or the team is too large (TooLarge); nothing has changed.
        """
        team = as_name(name, "a team")
        carried = list_sensors(sensors)
        if self._ctx.is_terminated():
            raise ContextTerminated("ctx.agent")
        are_made = bool(carried) or not self._block.journal.is_silent
        nodes = check_starts(start_node_ids, self._ctx.graph.graph, are_made=are_made)
        names = tuple([f"{team}_{number}" for number in range(len(nodes))])
        taken = next((one for one in names if one in self._agents), None)
        if taken is not None:
            raise Duplicate("an agent", taken)
        values = check_values(columns, len(nodes), _others)
        find_sensors(self._ctx, team, carried)
        with delay_interrupts(at_most_once=True):
            return self._add_team(team, names, nodes, carried, strategy, values)

    def _add_team(
        self,
        team: str,
        names: tuple[str, ...],
        nodes: list[int],
        carried: SensorsOfAgent,
        strategy: Strategy | AsyncStrategy | None,
        values: dict[str, list[Any]],
    ) -> Team:
        """Add the agents of a team; on an error nothing has changed."""
        self._copy_on_change()
        if not names:
            self._block.number_teams((team,))
            return Team(self._ctx, team, UncreatedMembers(names, strategy, {}), lambda: self._block)
        shared = {"sensors": carried, "strategy": strategy, "team": team}
        rows = zip(nodes, zip(*values.values(), strict=True) if values else repeat(()), strict=False)
        given = ({"start_node_id": node, **shared, **dict(zip(values, row, strict=True))} for node, row in rows)
        if not carried and all(map(is_attribute, values)):
            members = self._add_together(names, nodes, team, strategy, values)
            note_created(self._block, names, given)
            self._note_starts(zip(names, nodes, strict=True))
            return Team(self._ctx, team, members, lambda: self._block)
        members = UncreatedMembers(names, strategy, {})
        known = set(self._ctx.sensor.sensors)
        try:
            for one, keywords in zip(names, given, strict=True):
                members.made[one] = self.create_agent(one, **keywords)
        except BaseException:
            for agent in members.made.values():
                self._delete(agent)
            for sensor_id in self._ctx.sensor.sensors.keys() - known:
                self._ctx.sensor.delete_sensor(sensor_id)
            raise
        return Team(self._ctx, team, members, lambda: self._block)

    def _check_travel(self, name: str, kwargs: Mapping[str, Any], *, flies: bool) -> None:
        """Refuse the mode of an agent that flies, and warn of attributes that look like one."""
        if flies and kwargs.get("mode") is not None and not self._block.trusts_nodes:
            raise BadValue(f"Agent {shown(name)} flies over all edges: mode= is only for agents on the ground.")
        self._warn_of_edge_attributes(name, kwargs)

    def _warn_of_edge_attributes(self, name: str, attributes: Mapping[str, object]) -> None:
        """Warn once of attributes whose text names an attribute of the edges, as if it said how an agent travels."""
        texts = {key: value for key, value in attributes.items() if isinstance(value, str) and key not in _KEYWORDS}
        if not texts or self._block.trusts_nodes:
            return
        columns = self._ctx.graph.columns()
        known = columns.edge_attributes
        for key, value in texts.items():
            if value in known and (key, value) not in self._warned:
                self._warned.add((key, value))
                self._ctx.logger.warning(
                    f"Agent {shown(name)}: {key}={value!r} names an attribute of the edges, but it is an attribute of "
                    f"the agent, and changes no route. {_explain_routes(columns, value)}"
                )

    def _note_starts(self, starts: Iterable[tuple[str, int | Position]]) -> None:
        """Tell the game where agents were created."""
        if self._phase.created is not None:
            self._phase.created(starts)

    def _add_together(
        self, names: tuple[str, ...], nodes: list[int], team: str, strategy: Any, values: dict[str, list[Any]]
    ) -> UncreatedMembers:
        """Add agents without sensors; their objects are created on first access."""
        graph = self._ctx.graph.graph
        block = self._block
        block.take_graph(graph)
        unknown: Iterable[int] = dict.fromkeys(nodes)
        if len(nodes) > _MANY and not block.trusts_nodes:
            placed = np.array(nodes, np.int64)
            unknown = placed[~np.isin(placed, self._ctx.graph.columns().node_ids)].tolist()
        for node in unknown:
            check_node(graph, block, node)
        if strategy is not None:
            strategy = make_strategy(self._ctx, strategy)
            self._phase.change_strategies()
        self._warn_of_edge_attributes(names[0], {key: column[0] for key, column in values.items()})
        for hint in explain_misspelled({**_OF_TEAMS, **values}, _KEYWORDS):
            self._ctx.logger.warning(f"Agents of team {shown(team)}: {hint} It is stored as an attribute.")
        block.has_teams = True
        block.add_all(names, nodes, team)
        columns = {name: make_column(column) for name, column in values.items()}
        members = UncreatedMembers(names, strategy, columns)
        if not isinstance(self._agents, AgentsByName):
            self._agents = AgentsByName(self._agents, self._make_member)
        self._agents.update(dict.fromkeys(names, members))  # type: ignore[arg-type] # they stand in for agents
        return members

    def _make_member(self, name: str, members: UncreatedMembers) -> BaseAgent:
        return make_member(self._ctx, self._block, name, members)

    def get_agent(self, name: str) -> BaseAgent:
        """Return an agent by its name (KeyError)."""
        try:
            return self._agents[name]
        except (KeyError, TypeError):
            raise UnknownName("agent", name, self._agents) from None

    @refuse_to_judges
    def delete_agent(self, name: str) -> None:
        """Delete an agent; an unknown name is only warned about."""
        agent = self._agents.get(as_name(name, "an agent"))
        if agent is None:
            self._ctx.logger.warning(f"{UnknownName('agent', name, self._agents)} Nothing is deleted.")
            return
        with delay_interrupts(at_most_once=True):
            self._copy_on_change()
            departure = DeletedAgent(agent)
            self._delete(agent)
            self._last_departure.next = departure
            self._last_departure = departure

    def create_iter(self) -> "AgentIterator":
        """Return an iterator over the agents in order of creation; agents deleted during the loop are skipped."""
        return AgentIterator(self)

    @property
    def teams(self) -> dict[Any, list[BaseAgent]]:
        """Team -> its agents in order of creation, including dead ones; teams are sorted by their text."""
        teams: dict[Any, list[BaseAgent]] = {}
        for agent in self._agents.values():
            teams.setdefault(agent.team, []).append(agent)
        return _AgentsByTeam(sorted(teams.items(), key=lambda item: str(item[0])))

    @refuse_to_judges
    def terminate(self) -> None:
        """Close the engine: agents stay readable, and their methods do nothing."""
        with suppress(GammsError):  # a custom graph may already be closed
            self.block.locate()  # while there is a graph
        for block in (self._block, *(agent._block for agent in self._deleted)):
            block.journal = CLOSED

    def _list_stored(self) -> dict[str, Any]:
        """Return name -> the agent, or the `UncreatedMembers` that it belongs to."""
        return self._agents.get_stored() if isinstance(self._agents, AgentsByName) else dict(self._agents)

    def _copy_on_change(self) -> None:
        """Copy the set of agents, which is about to change, if `AgentStorage.share` has returned it."""
        if not self._is_shared:
            return
        self._is_shared = False
        block = self.block
        self._renew_block()
        self._block.take_all(block.copy_values(), block.copy_structure())
        self._block.has_teams = block.has_teams
        self._block.succeed(block)
        for agent in self._agents.values():
            agent._block = self._block

    def _renew_block(self) -> None:
        self._block = AgentBlock()
        self._block.structure.phase = self._phase
        self._phase.drop_plans()
        self._positions = Positions(self._block)

    def _add_agent(self, kind: Callable[..., BaseAgent], name: str, kwargs: dict[str, Any], strategy: Any) -> BaseAgent:
        """Add a new agent; on an error nothing has changed."""
        block = self._block
        if block.graph is None:
            block.take_graph(self._ctx.graph.graph)
        rows = len(block)
        try:
            agent = kind(self._ctx, name, _block=block, **kwargs)
            if strategy is not None:
                agent.strategy = strategy
        except BaseException:
            if len(block) > rows:
                block.remove(rows)
            raise
        self._agents[name] = agent
        return agent

    def _equip(self, agent: BaseAgent, sensors: Mapping[str, Any]) -> dict[str, ISensor]:
        """Give a new agent its sensors and return them; create declared ones; on an error remove the agent."""
        engine = self._ctx.sensor
        carried = {}
        owners = [(sensor, find_owner(sensor)) for sensor in sensors.values()]
        try:
            for key, sensor in sensors.items():
                is_declared = isinstance(sensor, Mapping)
                carried[key] = engine.from_declaration(f"{agent.name}/{key}", sensor) if is_declared else sensor
                agent._add_sensor(key, carried[key])
        except BaseException:
            self._take_out(agent)
            for key, (sensor, owner) in zip(carried, owners, strict=False):
                if carried[key] is not sensor:
                    engine.delete_sensor(carried[key].sensor_id)
                elif find_owner(sensor) != owner:
                    sensor.set_owner(owner)
            raise
        return carried

    def _list_more(self, row: int) -> dict[str, Any]:
        """Return the data that does not follow from the keywords of a new agent: rotation and position in the air."""
        block = self._block
        more: dict[str, Any] = {name: read_vector(block, name, row) for name in VECTORS}
        if block.kind[row]:
            more["node"] = block.find_nearest_node(row)
        return {name: value for name, value in more.items() if value is not None}

    def _delete(self, agent: BaseAgent) -> None:
        self._take_out(agent)
        self._block.journal.note(events.AGENT_DELETE, {"name": agent.name})

    def _take_out(self, agent: BaseAgent) -> None:
        """Remove an agent, which continues in its own block; its sensors have no owner."""
        row = agent._row
        block = self._block
        del self._agents[agent.name]
        agent._move_to_block(AgentBlock(block.graph, numbers=block.numbers))
        for sensor in agent._sensor_list.values():
            agent._clear_owner(sensor)
        self._deleted.add(agent)
        block.remove(row)
        if len(block.removed) > len(self._agents):  # so that the cost per deletion is constant
            self._close_up()

    def _close_up(self) -> None:
        """Drop the rows of removed agents."""
        made = self._agents.get_created() if isinstance(self._agents, AgentsByName) else self._agents
        with delay_interrupts():
            self._block.close_up()
            for agent, row in zip(made.values(), self._block.rows.find_rows(made), strict=True):
                object.__setattr__(agent, "_row", row)  # NOTE: a third of the time (benchmarks: deletion)

    def _find_kind(self, name: str, kwargs: dict[str, Any]) -> AgentType:
        """Return the agent type given by `type` or its synonym `agent_type`.

        As in 1.0.0, an invalid `type` means BASIC, and `agent_type` is also stored as an attribute.
        """
        given = kwargs.pop("type", AgentType.BASIC)
        kind = _as_type(given)
        if kind is None:
            hint = nearest(given.upper() if isinstance(given, str) else given, AgentType.__members__)
            self._ctx.logger.warning(f"Agent {shown(name)}: unknown type {shown(given)}, so it is BASIC.{hint}")
        return AgentType.AERIAL if AgentType.AERIAL in (kind, _as_type(kwargs.get("agent_type"))) else AgentType.BASIC


class AgentStorage(Guarded):
    """Operations of other engines on the agents of a context: decide, restore and copy."""

    _called = "ctx.agent.storage"

    def __init__(self, engine: AgentEngine) -> None:
        self._engine = engine
        self._phase = engine._phase
        self._roster: Roster | None = None  # roster of the last snapshot that was taken or restored

    def get_turn_access(self, agent: BaseAgent) -> TurnAccess:
        """Return the data of an agent that the turn engine uses; valid until `structure_version` changes."""
        return TurnAccess(agent._row, agent._carried, agent._last)

    def list_details(self) -> list[tuple[dict[str, ISensor], dict[str, Any], Any]]:
        """Return the sensors, attributes and strategy of each agent, read-only."""
        return list_details(self._engine._list_stored(), self._engine._block.modes)

    def list_strategies(self) -> list[Any]:
        """Return the strategy of each agent."""
        return [one.strategy for one in self._engine._list_stored().values()]

    def get_attributes(self) -> dict[int, dict[str, Any]]:
        """Return the attributes of agents that have any, by row; read-only."""
        return list_attributes(self._engine._agents, self._engine._block.modes)

    def list_created(self) -> list[BaseAgent]:
        """Return the agents whose objects exist: all except unused members of teams."""
        return [agent for agent in self._engine._list_stored().values() if type(agent) is not UncreatedMembers]

    @property
    def present_block(self) -> AgentBlock:
        """The rows of the agents, also while agents decide; rows of deleted agents may not be closed up yet."""
        return self._engine._block

    @property
    def last_departure(self) -> DeletedAgent:
        """The agent that was deleted last."""
        return self._engine._last_departure

    def renew_strategies(self, own: Callable[[Any], Any]) -> None:
        """Replace the strategies of teams, for agents whose objects are created later."""
        for members in find_uncreated_teams(self._engine._list_stored()).values():
            members.strategy = own(members.strategy)

    def detach_agents(self) -> None:
        """Detach the present set of agents from the one that `share` has returned."""
        self._engine._copy_on_change()

    def share(self) -> AgentSet:
        """Return the present set of agents, for `show`; when agents are created or deleted, it stays as it is."""
        engine = self._engine
        block = engine.block
        agents = engine._agents
        if isinstance(agents, AgentsByName):
            engine._agents = Agents({name: agents[name] for name in agents})
        engine._is_shared = True
        return AgentSet(block, {**engine._agents}, engine._positions)

    def show(self, agents: AgentSet) -> None:
        """Set the agents of the context to a set that `share` has returned."""
        engine = self._engine
        engine._is_shared = True
        engine._block = agents.block
        engine._phase.drop_plans()
        engine._positions = agents.positions
        engine._agents.clear()  # the same dict, which a function may hold
        engine._agents |= agents.by_name
        journal = agents.block.journal
        agents.block.journal = PLAIN
        for row, (agent, equipment) in enumerate(zip(agents.members, agents.equipment, strict=True)):
            object.__setattr__(agent, "_block", agents.block)  # NOTE: see `_close_up`
            object.__setattr__(agent, "_row", row)
            _equip_as(agent, *equipment)
        agents.block.journal = journal

    def snapshot(self, copy_attributes: Callable[[dict[str, Any]], dict[str, Any]] = copy_values) -> AgentsSnapshot:
        """Return the present state of all agents, for `restore` and `copy_from`; attributes are copied as told."""
        engine = self._engine
        block = self._engine.block
        block.locate()
        roster = self._roster
        if roster is None or block.has_teams or not roster.is_of(block):
            roster = Roster(block, engine._list_stored())
            self._roster = roster
        attributes = [agent.__dict__ for agent in roster.agents]
        return AgentsSnapshot(
            roster,
            block.copy_values(),
            [copy_attributes(one) if one else {} for one in attributes],
            [agent._last[0] for agent in roster.agents],
            [dict(one.columns) for one in roster.teams],
            [(agent, agent._block) for agent in engine._deleted or () if agent._block is not block],
        )

    def restore(self, before: AgentsSnapshot, *, keeps_attributes: bool = False) -> None:
        """Restore all agents: delete agents created since, bring back agents deleted since.

        Args:
            before: the agents.
            keeps_attributes: whether their custom attributes stay as they are now.
        """
        roster = before.roster
        is_same = roster.is_of(self._engine.block)
        if not is_same:
            self._restore_agents(before)
        block = self._engine.block
        block.restore(before.columns, None if is_same else roster.columns)
        for members in roster.teams:
            for one in _list_made(members, roster):
                one._last[0] = {}
                _equip_as(one, members.strategy, {})
        for agent, state in zip(roster.agents, before.states, strict=True):
            agent._last[0] = state
        if not keeps_attributes:
            _restore_attributes(before)
        if not is_same:
            for agent, strategy, sensors in zip(roster.agents, roster.strategies, roster.sensors, strict=True):
                _equip_as(agent, strategy, sensors)
            _share_sensors(roster.agents)
            roster.version = block.structure, block.structure.version
            self._roster = roster

    def copy_from(self, before: AgentsSnapshot, other: AgentEngine, memo: dict[int, Any]) -> None:
        """Copy the agents of another context into this one, which must have none.

        Args:
            before: the agents.
            other: the agent engine of the other context, whose agents may have changed since.
            memo: maps their sensors to the copies, and gets the copies of agents; see `copy.deepcopy`.
        """
        engine = self._engine
        block = engine.block
        roster = before.roster
        block.graph = engine._ctx.graph.graph if roster.stored else None
        memo[id(other)] = engine
        memo[id(other._storage)] = self
        memo[id(other._block)] = block
        block.take_all(before.columns, roster.columns)
        block.has_teams = roster.has_teams
        if roster.teams:
            engine._agents = AgentsByName({}, engine._make_member)
        for members, columns in zip(roster.teams, before.of_teams, strict=True):
            memo[id(members)] = members.copy_members(columns)
        equipment = zip(roster.agents, roster.strategies, roster.sensors, roster.shared, before.states, strict=True)
        for row, (name, agent) in enumerate(roster.stored.items()):
            if type(agent) is UncreatedMembers:
                engine._agents[name] = memo[id(agent)]
            else:
                _, *carried = next(equipment)
                engine._agents[name] = agent._copy_to(engine._ctx, block, row, carried, memo)
        for agent, attributes in zip(roster.agents, before.attributes, strict=True):
            if attributes:  # after all copies exist, because attributes may refer to them
                memo[id(agent)].__dict__.update(copy_values(attributes, memo))

    def hide(self, before: AgentsSnapshot, known: Collection[str]) -> None:
        """Hide the agents that are not `known`, in the copy of the game with which an agent looks ahead."""
        engine = self._engine
        graph = self._engine._ctx.graph.graph
        first = graph.get_node(min(graph.get_nodes()))
        for row, columns in before.list_hidden(engine.block, known, first):
            engine.block.write(row, columns)
        for name, agent in engine._list_stored().items():
            agent.strategy = None
            if type(agent) is not UncreatedMembers and name not in known:
                before.write_attributes(agent)

    def _restore_agents(self, before: AgentsSnapshot) -> None:
        """Restore the set of agents and their order."""
        engine = self._engine
        for name, agent in list(engine._list_stored().items()):
            if not before.has(name, agent):
                engine.delete_agent(name)
        block = engine.block
        then = before.roster.stored
        if list(then) != list(engine._list_stored()):
            engine._renew_block()
            engine._block.has_teams = block.has_teams
            engine._block.succeed(block)
            engine._agents = AgentsByName({}, engine._make_member) if block.has_teams else Agents()
            for name, known in then.items():
                agent = known.made.get(name, known) if type(known) is UncreatedMembers else known
                if type(agent) is UncreatedMembers:
                    engine._block.take_over(block, block.find_row(name))
                else:
                    agent._move_to_block(engine._block)
                engine._agents[name] = agent
        for agent, own in before.deleted:  # restored as they were when they were deleted
            agent._block = own
            agent._row = 0


def _explain_routes(columns: GraphColumns, name: str) -> str:
    """Return the hint for an attribute of an agent that names an attribute of the edges."""
    if not may_be_mode(columns, name):
        return "Modes and weights are attributes of edges with numbers, or with true or false."
    return (
        f"mode={name!r} says which edges the agent may use, and ctx.game.weight = {name!r} by which costs agents with "
        "speeds in metres choose their ways."
    )


def _list_made(members: UncreatedMembers, roster: Roster) -> list[BaseAgent]:
    """Return the members of a team whose objects were created since a roster was made."""
    return [one for name, one in members.made.items() if roster.stored.get(name) is members]


def _restore_attributes(before: AgentsSnapshot) -> None:
    """Set the custom attributes of all agents to their values in a snapshot."""
    roster = before.roster
    for members, columns in zip(roster.teams, before.of_teams, strict=True):
        members.columns = columns.copy()
        for one in _list_made(members, roster):
            _renew(one, copy_values(members.get_attributes(one.name)))
    for agent, attributes in zip(roster.agents, before.attributes, strict=True):
        if attributes or agent.__dict__:
            _renew(agent, copy_values(attributes))


def _renew(agent: BaseAgent, attributes: dict[str, Any]) -> None:
    """Set the attributes of an agent to their values in the snapshot."""
    agent.__dict__.clear()
    agent.__dict__.update(attributes)


def _share_sensors(agents: Iterable[BaseAgent]) -> None:
    """Let agents that carry the same sensor set its owner before each look, also those that were brought back."""
    carriers = defaultdict[int, dict[str, tuple[BaseAgent, ISensor]]](dict)
    for agent in agents:
        for sensor in agent._sensor_list.values():
            carriers[id(sensor)][agent.name] = agent, sensor
    for together in carriers.values():
        for agent, sensor in together.values() if len(together) > 1 else ():
            if not any(sensor is one for one in agent._shared):
                agent._share(sensor)


def _equip_as(agent: BaseAgent, strategy: Callable[[Any], Any] | None, sensors: dict[str, ISensor]) -> None:
    """Give an agent its strategy and its sensors from the snapshot."""
    if agent.strategy is not strategy:
        agent.decide_by(strategy)
    if agent._sensor_list != sensors:
        for name in list(agent._sensor_list):  # all, for their order
            agent.deregister_sensor(name)
        for name, sensor in sensors.items():
            agent.register_sensor(name, sensor)


_CLASSES: dict[AgentType, type[Agent | AerialAgent]] = {AgentType.BASIC: Agent, AgentType.AERIAL: AerialAgent}
_NEEDED = {
    AgentType.BASIC: {"start_node_id": "the node it stands on"},
    AgentType.AERIAL: {"start_node_id": "the node it starts from", "speed": "map units per step"},
}


def _as_type(given: object) -> AgentType | None:
    """Return a type given as a member, by name or by number; None if it is not a type."""
    if isinstance(given, (str, AgentType)):
        return as_member(AgentType, given)
    return AgentType(int(given)) if isinstance(given, Integral) and given in _CLASSES else None


class AgentIterator(Iterator[BaseAgent]):
    """Iterates over the agents of a context any number of times, as the reusable view of 1.0.0."""

    def __init__(self, engine: AgentEngine) -> None:
        self._engine = engine
        self._loop: Iterator[BaseAgent] | None = None

    def __len__(self) -> int:
        return len(self._engine._agents)

    def __iter__(self) -> Iterator[BaseAgent]:  # noqa: PYI034 - every loop is one of its own
        block = self._engine._block
        for agent in list(self._engine._agents.values()):
            if agent._block is block:
                yield agent

    def __next__(self) -> BaseAgent:
        self._loop = self._loop or iter(self)
        return next(self._loop)
