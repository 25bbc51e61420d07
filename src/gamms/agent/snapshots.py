"""What snapshots of a game hold of its agents."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from gamms.agent.agent import BaseAgent
from gamms.agent.teams import AgentsByName, Members
from gamms.core.copies import copied_values
from gamms.ir.agents import AgentBlock
from gamms.ir.schema import PLACES
from gamms.typing.graph_engine import Node


class Roster:
    """Which agents there are and what they are; snapshots share it until that changes.

    Args:
        block: of the agents.
        stored: name -> the agent, or the `Members` that it was one of, in the order of the rows.

    Attributes:
        stored: as given.
        version: of the structure of the block, at which the agents are these.
        columns: those of the block that say it.
        teams: the members that were not made.
        agents: those that were made.
        strategies, sensors: of these.
    """

    def __init__(self, block: AgentBlock, stored: dict[str, Any]) -> None:
        self.stored = stored
        self.version = block.structure, block.structure.version
        self.columns = block.structure_values()
        self.teams = list(teams_in(stored).values()) if block.has_teams else []
        self.agents: list[BaseAgent] = [one for one in stored.values() if type(one) is not Members]
        self.strategies = [agent.strategy for agent in self.agents]
        self.sensors = [agent._sensor_list.copy() for agent in self.agents]

    def is_of(self, block: AgentBlock) -> bool:
        """Whether agents are these now, but for members that were made since."""
        return self.version == (block.structure, block.structure.version)


@dataclass(eq=False)
class AgentsSnapshot:
    """All agents at one moment: the columns, and of each agent what is not in them."""

    roster: Roster
    columns: dict[str, Any]
    attributes: list[dict[str, Any]]
    states: list[dict[str, Any]]  # that agents were given last
    of_teams: list[dict[str, Any]]  # the attributes of members that were not made
    deleted: list[tuple[BaseAgent, AgentBlock]]  # with blocks of their own

    @property
    def names(self) -> list[str]:
        """The names of the agents, in the order of their rows."""
        return self.roster.columns["names"]

    @cached_property
    def places(self) -> dict[str, Any]:
        """Name -> the node an agent was on, or (x, y, z) of a flyer."""
        nodes, positions = self.columns["games"].row("node"), self.columns["position"]
        places = zip(self.names, nodes, positions, strict=True)
        return {name: node if position is None else position for name, node, position in places}

    def has(self, name: str, agent: Any) -> bool:
        """Return whether an agent was there, or `Members` for one that is not made yet."""
        known = self.roster.stored.get(name)
        return known is agent or (type(known) is Members and known.made.get(name) is agent)

    def place_of(self, agent: BaseAgent) -> Any:
        """Return the node an agent was on, or (x, y, z) of a flyer; where it is now if it came later."""
        if self.has(agent.name, agent):
            return self.places[agent.name]
        return getattr(agent, "position", agent.current_node_id)

    def places_of(self, agents: Mapping[str, BaseAgent]) -> dict[str, Any]:
        """Return name -> what `place_of` returns, of some agents."""
        stored: Mapping[str, Any] = agents.stored() if isinstance(agents, AgentsByName) else agents
        places = self.places
        return {
            name: places[name] if self.has(name, one) else self.place_of(agents[name]) for name, one in stored.items()
        }

    def hidden(self, block: AgentBlock, known: Collection[str], node: Node) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the row and the columns of each agent of a copy that is not `known`, as those see it that look ahead.

        It has the speed that it had, and is on a node until it is placed; in the air, as high as it was.
        """
        speeds = dict(zip(self.names, self.roster.columns["speed"], strict=True))
        for row, name in enumerate(block.names):
            if name not in known:
                was = self.places.get(name)
                place = (node.x, node.y, was[2] if isinstance(was, tuple) else 0.0) if block.kind[row] else None
                columns = {column.name: column.initial for column in PLACES}
                columns |= {"node": node.id, "previous": node.id, "position": place, "previous_position": place}
                columns |= {"quat": block.quat[row], "speed": speeds.get(name, block.speed[row])}
                yield row, columns

    def write_attributes(self, agent: BaseAgent) -> None:
        """Give an agent of a copy the attributes that it had, and no state."""
        agent._last[0] = {}
        if agent.name in self.roster.stored:
            each = zip(self.roster.agents, self.attributes, strict=True)
            own: dict[str, Any] = next((own for one, own in each if one.name == agent.name), {})
            agent.__dict__.clear()
            agent.__dict__.update(copied_values(own))


def teams_in(stored: dict[str, Any]) -> dict[int, Members]:
    """Return id() -> `Members`, of those that stand in for agents."""
    each = dict(zip(map(id, stored.values()), stored.values(), strict=True))
    return {key: one for key, one in each.items() if type(one) is Members}


def details_of(stored: dict[str, Any]) -> list[tuple[dict[str, Any], dict[str, Any], Any]]:
    """Return the sensors, attributes and strategy of each agent, which are not to be written to."""
    alike: dict[int, Any] = {key: ({}, {}, one.strategy) for key, one in teams_in(stored).items() if not one.columns}
    return [
        alike.get(id(one)) or ({}, one.attributes(name), one.strategy)
        if type(one) is Members
        else (one._sensor_list, one.__dict__, one.strategy)
        for name, one in stored.items()
    ]


def attributes_of(agents: dict[str, BaseAgent]) -> dict[int, dict[str, Any]]:
    """Return the attributes of agents that have some, by their rows; not to be written to."""
    if not isinstance(agents, AgentsByName):
        return {row: one.__dict__ for row, one in enumerate(agents.values()) if one.__dict__}
    stored = agents.stored_once()  # NOTE: a fifth of a loop over all members (benchmarks: teams, recorded)
    if not any(type(one) is Members and one.columns for one in stored):
        made = {one._row: one.__dict__ for one in stored if type(one) is not Members}
        return {row: made[row] for row in sorted(made) if made[row]}
    return {
        row: found
        for row, (name, one) in enumerate(agents.stored_items())
        if (found := one.attributes(name) if type(one) is Members else one.__dict__)
    }
