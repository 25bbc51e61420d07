"""Teams of many agents that are created, read and set together, as arrays."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from gamms import kernels
from gamms.agent.agent import Agent
from gamms.arguments import as_ids
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.agents import AgentBlock
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import Sensed
from gamms.kernels.draws import BitArray
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.sensor_engine import ISensor, is_sensor


class Team:
    """Agents that were created by `ctx.agent.create_team`: `red_0`, `red_1`, …, in this order in all arrays.

    Its members are agents like others, and stay in it when they change their team or are deleted.

    Attributes:
        name: of the team.
    """

    def __init__(self, ctx: IContext, name: str, agents: list[Agent]) -> None:
        self._ctx, self.name, self._agents = ctx, name, agents
        self._draws = 0
        self._keys: BitArray | None = None  # of the names, for draws

    def __repr__(self) -> str:
        """Name the team, and how many agents it has."""
        return f"Team({self.name!r}, {len(self)} agents)"

    def __len__(self) -> int:
        return len(self._agents)

    def __iter__(self) -> Iterator[Agent]:
        return iter(self._agents)

    @property
    def agents(self) -> list[Agent]:
        """The members."""
        return list(self._agents)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the members."""
        return tuple(agent.name for agent in self._agents)

    @property
    def node_ids(self) -> IntArray:
        """Where the members are, (agents,) ids of nodes."""
        return np.array([agent.current_node_id for agent in self._agents], np.int64)

    @property
    def alive(self) -> BoolArray:
        """Which members take part, (agents,)."""
        return np.array([agent.alive for agent in self._agents], np.bool_)

    def __getitem__(self, column: str) -> "np.ndarray[Any, Any]":
        """Return the values of an attribute of all members, (agents,); the array is read-only, `set` writes.

        Raises:
            UnknownName (KeyError): a member has no such attribute.
        """
        try:
            values = np.array([getattr(agent, column) for agent in self._agents])
        except AttributeError:
            known = sorted({name for agent in self._agents for name in vars(agent)})
            raise UnknownName("column", column, ["alive", "speed", *known]) from None
        values.setflags(write=False)
        return values

    def set(self, column: str, values: object, where: object = None) -> None:
        """Set an attribute of members, checked and recorded as `agent.energy = 5` is.

        Args:
            column: its name.
            values: one value for all, or one for each member, (agents,).
            where: which members, (agents,) booleans; None: all.

        Raises:
            BadValue: there are more or fewer values than agents; nothing has changed then.
            BadType: `where` is no array of booleans.
        """
        chosen = np.ones(len(self), np.bool_) if where is None else np.asarray(where)
        if chosen.dtype != np.bool_ or chosen.shape != (len(self),):
            raise BadType(f"where= of a team is an array ({len(self)},) of booleans, not {shown(where)}.")
        for agent, value, is_chosen in zip(self._agents, each_of(values, len(self), column), chosen, strict=True):
            if is_chosen:
                setattr(agent, column, value)

    def sense(self, sensor: str | ISensor) -> Sensed:
        """Look from where the members are, with a sensor or the one of that id: one look for each.

        Raises:
            UnknownName (KeyError): there is no such sensor.
            BadType: it is none.
        """
        one = self._ctx.sensor.get_sensor(sensor) if isinstance(sensor, str) else sensor
        if not is_sensor(one):
            raise BadType(f"A team senses with a sensor or its id, not {shown(sensor)}.")
        return one.sense_many(self.node_ids)

    def random_actions(self) -> IntArray:
        """Return a legal node for each member, its own included, each as likely: (agents,) ids.

        They follow from the seed of the context, the names, and how often this was called.
        """
        near = self._ctx.graph.graph.neighborhoods
        legal = [near[agent.current_node_id] for agent in self._agents]
        purpose = kernels.purpose_key(self._ctx.seed, "random_actions")
        if self._keys is None:
            self._keys = kernels.name_keys(self.names)
        bits = kernels.draw_bits_many(purpose, self._keys, self._draws)
        self._draws += 1
        chosen = kernels.below_many(bits, np.array(list(map(len, legal))))
        return np.array([nodes[k] for nodes, k in zip(legal, chosen.tolist(), strict=True)], np.int64)

    def move(self, node_ids: object) -> None:
        """Move all living members at once, each along one edge or not at all.

        Args:
            node_ids: where to, (agents,).

        Raises:
            BadValue: one is not legal, or there are more or fewer than members; none has moved then.
        """
        wanted = as_ids(node_ids, "node_ids")
        if len(wanted) != len(self):
            raise BadValue(f"Team {self.name!r} has {len(self)} agents, and {len(wanted)} node_ids were given.")
        near = self._ctx.graph.graph.neighborhoods
        for agent, node in zip(self._agents, wanted, strict=True):
            if agent.alive and node not in near[agent.current_node_id]:
                raise BadValue(
                    f"Agent {agent.name!r} cannot go to node {node}: no edge leads there from node "
                    f"{agent.current_node_id}."
                )
        for agent, node in zip(self._agents, wanted, strict=True):
            if agent.alive:
                agent._block.move(agent._row, node)


def added(
    ctx: IContext, block: AgentBlock, names: list[str], nodes: list[int], team: str, strategy: Any
) -> list[Agent]:
    """Add agents that carry nothing to a block, all at once; the nodes are on the map."""
    # NOTE: in half the time of one by one (benchmarks/README.md, teams).
    first, agents = block.add_all(names, nodes, team), []
    for row in range(first, first + len(names)):
        agent = Agent.__new__(Agent)
        near = agent._begin(ctx, block, ()).neighborhoods
        for name, value in (("_near", near), ("_row", row), ("strategy", strategy)):
            object.__setattr__(agent, name, value)
        agents.append(agent)
    return agents


def each_of(values: object, count: int, name: str) -> list[Any]:
    """Return one plain value for each of several agents.

    Raises:
        BadValue: there are more or fewer.
    """
    if isinstance(values, Mapping | str | bytes) or np.ndim(values) == 0:  # type: ignore[arg-type] # anything may be given
        return [values.item() if isinstance(values, np.generic) else values] * count
    listed: list[Any] = values.tolist() if isinstance(values, np.ndarray) else list(values)  # type: ignore[call-overload]
    if len(listed) != count:
        raise BadValue(f"{name}: one value, or {count}, one for each agent; not {len(listed)}.")
    return listed
