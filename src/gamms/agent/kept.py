"""All agents as they are at one moment, and how to let them be so again."""

from copy import deepcopy
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.ir.agents import BY_ROW, AgentColumns

if TYPE_CHECKING:
    from gamms.agent.engine import AgentEngine
    from gamms.agent.member import Member


class KeptAgents(NamedTuple):
    """The columns, and of each agent what is not in them."""

    columns: dict[str, list[Any]]
    roster: tuple[AgentColumns, int]  # which agents there are, and which team, speed and sensors they have
    agents: "list[tuple[Member, dict[str, Any], Any, dict[str, Any], dict[str, Any]]]"
    # agent, attributes, strategy, sensors, last state
    gone: "list[tuple[Member, AgentColumns]]"  # deleted agents with columns of their own
    rows: dict[int, int]  # id() of an agent -> its row

    def place_of(self, agent: Any) -> Any:
        """The node an agent was on, or (x, y, z) of one that flew; where it is now if it was not there."""
        row = self.rows.get(id(agent))
        if row is not None:
            position = self.columns["position"][row]
            return self.columns["node"][row] if position is None else position
        return getattr(agent, "position", agent.current_node_id)


def kept(engine: "AgentEngine") -> KeptAgents:
    """The agents as they are now."""
    columns = {name: list(getattr(engine._columns, name)) for name in BY_ROW}
    agents = [
        (agent, _copied(agent.__dict__), agent.strategy, agent._sensor_list.copy(), agent._last[0])
        for agent in engine._agents.values()
    ]
    roster = engine._columns, engine._columns.roster
    rows = {id(agent): row for row, (agent, *_) in enumerate(agents)}
    gone = [(agent, agent._columns) for agent in engine._gone if agent._columns is not engine._columns]
    return KeptAgents(columns, roster, agents, gone, rows)


def restore(engine: "AgentEngine", before: KeptAgents) -> None:
    """Let the agents be as they were: those that came are gone, those that went are back."""
    columns = engine._columns
    if before.roster == (columns, columns.roster):
        columns.move_back(before.columns)
    else:
        _restore_agents(engine, before)
        engine._columns.write_back(before.columns)
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


def _restore_agents(engine: "AgentEngine", before: KeptAgents) -> None:
    """Let those agents live that lived then, in the same order."""
    there = {id(agent) for agent, *_ in before.agents}
    for agent in [agent for agent in engine._agents.values() if id(agent) not in there]:
        engine.delete_agent(agent.name)
    engine.settle()
    if [agent for agent, *_ in before.agents] != list(engine._agents.values()):
        engine._columns, columns = AgentColumns(), engine._columns
        engine._columns.journal, engine._columns.roster = columns.journal, columns.roster
        engine._columns.moves = columns.moves + 1
        engine._agents = {}
        for agent, *_ in before.agents:
            agent._live_in(engine._columns)
            engine._agents[agent.name] = agent
    for agent, own in before.gone:  # they are again as they were when they were deleted
        agent._columns, agent._row = own, 0


def _copied(attributes: dict[str, Any]) -> dict[str, Any]:
    """The caller's attributes: plain values are copied, and what cannot be is shared."""
    if not attributes:
        return {}
    copied = {}
    for name, value in attributes.items():
        try:
            copied[name] = deepcopy(value)
        except Exception:  # noqa: BLE001 - whatever a caller's object raises when it is copied
            copied[name] = value
    return copied
