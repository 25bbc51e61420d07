"""Worlds to walk in, and the turn engine's turn by hand: all see the same world, all decide, then all move."""

from contextlib import contextmanager
from math import inf

import numpy as np
import pytest

import gamms
from gamms.agent import AgentType
from gamms.sensor import SensorType

WIDTH = 6


def grid(width=WIDTH):
    """Nodes and edges: node `width * y + x` is at (10 x, 10 y), edges lead both ways and are 10 long."""
    at = {(x, y): width * y + x for y in range(width) for x in range(width)}
    steps = ((1, 0), (-1, 0), (0, 1), (0, -1))
    edges = [(at[x, y], at[x + dx, y + dy], 10.0) for x, y in at for dx, dy in steps if (x + dx, y + dy) in at]
    return {node: (10.0 * x, 10.0 * y) for (x, y), node in at.items()}, edges


class World:
    """A context whose agents decide and move together; their states have what the turn engine gives."""

    def __init__(self, ctx, nodes, edges, seed, reach):
        self.ctx, self.seed, self.reach, self.turn = ctx, seed, reach, 0
        sources, targets, lengths = zip(*edges, strict=True)
        ctx.graph.add_nodes(list(nodes), *zip(*nodes.values(), strict=True))
        ctx.graph.add_edges(range(len(edges)), sources, targets, lengths)
        ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
        self.agents, self.rngs, self.memories = {}, {}, {}

    def add(self, name, node, strategy=None, *, sight=inf, **keywords):
        """An agent that sees those at most `sight` away."""
        eyes = self.ctx.sensor.create_sensor(f"eyes of {name}", SensorType.AGENT_RANGE, sensor_range=sight)
        keywords |= {"sensors": {"near": "near", "eyes": eyes}, "strategy": strategy}
        agent = self.agents[name] = self.ctx.agent.create_agent(name, start_node_id=node, **keywords)
        self.rngs[name] = np.random.default_rng([self.seed, *name.encode()])
        self.memories[name] = {}
        return agent

    def state_of(self, agent):
        state = agent.get_state()
        state |= {"name": agent.name, "team": agent.team, "turn": self.turn, "legal": self.legal(agent)}
        state |= {"rng": self.rngs[agent.name], "memory": self.memories[agent.name], "team_memory": {}, "facts": {}}
        return state

    def legal(self, agent):
        if agent.type is AgentType.AERIAL:
            return ()
        found = [agent.current_node_id]
        for _ in range(self.reach):
            found += [node for at in list(found) for node in self.ctx.graph.graph.get_neighbors(at)]
        return tuple(dict.fromkeys(found))

    def play(self, turns=1):
        """Where each agent has been, by name: before, and at the end of each turn."""
        agents = [self.agents[name] for name in sorted(self.agents)]
        been = {agent.name: [agent.current_node_id] for agent in agents}
        for _ in range(turns):
            states = [self.state_of(agent) for agent in agents]
            for agent, state in zip(agents, states, strict=True):
                agent.strategy(state)
                assert not state["legal"] or state["action"] in state["legal"]
            for agent in agents:
                agent.set_state()
                been[agent.name].append(agent.current_node_id)
            self.turn += 1
        return been


@pytest.fixture(scope="session")
def open_world():
    """Opens a world: `with open_world() as world`, of a grid unless nodes and edges are given."""

    @contextmanager
    def open_one(nodes=None, edges=None, *, seed=7, reach=1):
        with gamms.create_context(logger_config={"level": "CRITICAL"}, seed=seed) as ctx:
            yield World(ctx, *(grid() if nodes is None else (nodes, edges)), seed, reach)

    return open_one


@pytest.fixture
def world(open_world):
    """A grid of six by six."""
    with open_world() as world:
        yield world
