"""Snapshots of the agents of a game."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import compress
from typing import Any

from gamms.agent.agent import BaseAgent
from gamms.agent.teams import AgentsByName, UncreatedMembers
from gamms.core.copies import copy_values
from gamms.ir.agents import AgentBlock, get_speed, list_speeds
from gamms.ir.positions import Positions
from gamms.ir.schema import PLACES
from gamms.typing.graph_engine import Node


class Roster:
    """The set of agents and their kinds; shared by snapshots until it changes.

    Args:
        block: block of the agents.
        stored: name -> the agent, or the `UncreatedMembers` that it belonged to, in the order of the rows.

    Attributes:
        stored: the argument `stored`.
        version: structure version of the block for which this roster is valid.
        columns: columns of the block that define the roster.
        teams: members whose objects did not exist.
        agents: agents whose objects existed.
        has_teams: whether a team was created whose agent objects are made on demand.
        strategies, sensors, shared: the strategies and sensors of `agents`, and the sensors that others also carry.
    """

    def __init__(self, block: AgentBlock, stored: dict[str, Any]) -> None:
        self.stored = stored
        self.version = block.structure, block.structure.version
        self.columns = block.copy_structure()
        self.has_teams = block.has_teams
        self.teams = list(find_uncreated_teams(stored).values()) if block.has_teams else []
        self.agents: list[BaseAgent] = [one for one in stored.values() if type(one) is not UncreatedMembers]
        self.strategies = [agent.strategy for agent in self.agents]
        self.sensors = [agent._sensor_list.copy() for agent in self.agents]
        self.shared = [agent._shared for agent in self.agents]

    def is_of(self, block: AgentBlock) -> bool:
        """Return whether this roster is valid now, except for members whose objects were created since."""
        return self.version == (block.structure, block.structure.version)


class AgentSet:
    """A set of agents that a context has in some games: see `AgentStorage.share`.

    Args:
        block: their block.
        by_name: name -> the agent, in the order of the rows.
        positions: the positions of the agents in the block.

    Attributes:
        block, by_name, positions: the arguments of these names.
        members: the agents, in the order of the rows.
        equipment: the strategy and the sensors of each.
    """

    def __init__(self, block: AgentBlock, by_name: dict[str, BaseAgent], positions: Positions) -> None:
        self.block = block
        self.by_name = by_name
        self.positions = positions
        self.members = [*by_name.values()]
        self.equipment = [(agent.strategy, agent._sensor_list.copy()) for agent in self.members]


@dataclass(eq=False)
class AgentsSnapshot:
    """All agents at one moment: the columns, and the data of each agent outside the columns."""

    roster: Roster
    columns: dict[str, Any]
    attributes: list[dict[str, Any]]
    states: list[dict[str, Any]]  # last states given to agents
    of_teams: list[dict[str, Any]]  # attributes of members whose objects did not exist
    deleted: list[tuple[BaseAgent, AgentBlock]]  # with their own blocks

    @property
    def names(self) -> list[str]:
        """The names of the agents, in the order of their rows."""
        return self.roster.columns["names"]

    @cached_property
    def places(self) -> dict[str, Any]:
        """Name -> the node of the agent, or (x, y, z) of a flying agent."""
        games = self.columns["games"]
        ids = self.columns["numbers"].ids
        found = {name: ids[number] for name, number in zip(self.names, games.get_row("node"), strict=True)}
        xyz = games.get_row("position").tolist()
        for at, name in enumerate(compress(self.names, games.get_row("kind"))):
            found[name] = tuple(xyz[3 * at : 3 * at + 3])
        return found

    @property
    def strategies(self) -> list[Any]:
        """The strategies of the agents, each once."""
        all_of_them = [*self.roster.strategies, *(members.strategy for members in self.roster.teams)]
        return [*{id(one): one for one in all_of_them}.values()]

    def has(self, name: str, agent: Any) -> bool:
        """Return whether an agent existed; `agent` may be its `UncreatedMembers`."""
        known = self.roster.stored.get(name)
        return known is agent or (type(known) is UncreatedMembers and known.made.get(name) is agent)

    def find_place(self, agent: BaseAgent) -> Any:
        """Return the node of an agent, or (x, y, z) if it flies; the present one if it was created later."""
        if self.has(agent.name, agent):
            return self.places[agent.name]
        return getattr(agent, "position", agent.current_node_id)

    def find_places(self, agents: Mapping[str, BaseAgent]) -> dict[str, Any]:
        """Return name -> position of some agents; see `find_place`."""
        stored: Mapping[str, Any] = agents.get_stored() if isinstance(agents, AgentsByName) else agents
        places = self.places
        return {
            name: places[name] if self.has(name, one) else self.find_place(agents[name]) for name, one in stored.items()
        }

    def list_hidden(
        self, block: AgentBlock, known: Collection[str], node: Node
    ) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the row, and the columns without hidden values, of each agent of a private fork that is not `known`.

        Such an agent keeps its speed, and its height if it flies; it is on `node` until it is placed.
        """
        speeds = dict(zip(self.names, list_speeds(self.columns["games"]), strict=True))
        for row, name in enumerate(block.names):
            if name not in known:
                was = self.places.get(name)
                place = (node.x, node.y, was[2] if isinstance(was, tuple) else 0.0) if block.kind[row] else None
                columns = {column.name: column.initial for column in PLACES}
                columns |= {"node": node.id, "previous": node.id, "position": place, "previous_position": place}
                columns |= {"quat": block.flights.get_rotation(row), "speed": speeds.get(name, get_speed(block, row))}
                yield row, columns

    def write_attributes(self, agent: BaseAgent) -> None:
        """Set the attributes of an agent of a copy, and clear its state."""
        agent._last[0] = {}
        if agent.name in self.roster.stored:
            each = zip(self.roster.agents, self.attributes, strict=True)
            own: dict[str, Any] = next((own for one, own in each if one.name == agent.name), {})
            agent.__dict__.clear()
            agent.__dict__.update(copy_values(own))


def find_uncreated_teams(stored: dict[str, Any]) -> dict[int, UncreatedMembers]:
    """Return id() -> `UncreatedMembers`, for members whose objects do not exist."""
    each = dict(zip(map(id, stored.values()), stored.values(), strict=True))
    return {key: one for key, one in each.items() if type(one) is UncreatedMembers}


def list_details(
    stored: dict[str, Any], modes: Sequence[str | None]
) -> list[tuple[dict[str, Any], dict[str, Any], Any]]:
    """Return the sensors, attributes and strategy of each agent, read-only; `modes` are among the attributes."""
    alike: dict[int, Any] = {
        key: ({}, {}, one.strategy) for key, one in find_uncreated_teams(stored).items() if not one.columns
    }
    return [
        alike.get(id(one)) or ({}, one.get_attributes(name), one.strategy)
        if type(one) is UncreatedMembers
        else (one._sensor_list, _add_mode(one.__dict__, modes[one._row]), one.strategy)
        for name, one in stored.items()
    ]


def _add_mode(attributes: dict[str, Any], mode: str | None) -> dict[str, Any]:
    """Return the attributes of an agent and its mode, if it has one."""
    return attributes if mode is None else {"mode": mode, **attributes}


def list_attributes(agents: dict[str, BaseAgent], modes: Sequence[str | None]) -> dict[int, dict[str, Any]]:
    """Return the attributes of agents that have any, by row; read-only; `modes` are among them."""
    if not isinstance(agents, AgentsByName):
        of_each = {row: _add_mode(one.__dict__, modes[one._row]) for row, one in enumerate(agents.values())}
        return {row: found for row, found in of_each.items() if found}
    stored = agents.collect_stored()  # NOTE: a fifth of a loop over all members (benchmarks: teams, recorded)
    if not any(type(one) is UncreatedMembers and one.columns for one in stored):
        made = {
            one._row: _add_mode(one.__dict__, modes[one._row]) for one in stored if type(one) is not UncreatedMembers
        }
        return {row: made[row] for row in sorted(made) if made[row]}
    each = {
        row: one.get_attributes(name) if type(one) is UncreatedMembers else _add_mode(one.__dict__, modes[one._row])
        for row, (name, one) in enumerate(agents.list_stored_items())
    }
    return {row: found for row, found in each.items() if found}
