"""Whatever flies, walks, comes, goes and changes on the map: everybody agrees on who is where."""

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

import gamms
from gamms.typing import IAgentEngine

NAMES = st.sampled_from([f"agent_{i}" for i in range(8)])
NODES = st.integers(0, 9)
PARTS = st.integers(-6, 6).map(lambda part: part / 2)
POSITIONS = st.tuples(PARTS, PARTS, PARTS)
SOMEBODY = st.integers(0, 100)


class Sky(RuleBasedStateMachine):
    """A context beside `{name: position or node}`; the nearest node is looked for among all of them."""

    @initialize()
    def open(self):
        self.ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
        self.graph, self.engine = self.ctx.graph.graph, self.ctx.agent
        self.nodes, self.model, self.last = {}, {}, None
        for id in range(4):
            self.put_node(id, float(id), 0.0)

    @rule(id=NODES, x=PARTS, y=PARTS)
    def put_node(self, id, x, y):
        if id in self.nodes:
            self.graph.update_node({"id": id, "x": x, "y": y})
        else:
            self.graph.add_node({"id": id, "x": x, "y": y})
        self.nodes[id] = (x, y)

    @precondition(lambda self: len(self.nodes) > 1)
    @rule(which=SOMEBODY)
    def remove_a_node_that_nobody_stands_on(self, which):
        free = [id for id in self.nodes if id not in self.model.values()]
        if free and len(self.nodes) > 1:
            id = free[which % len(free)]
            self.graph.remove_node(id)
            del self.nodes[id]

    @rule(name=NAMES, which=SOMEBODY, flies=st.booleans())
    def create(self, name, which, flies):
        if name in self.model:
            return
        node = list(self.nodes)[which % len(self.nodes)]
        more = {"type": "AERIAL", "speed": 1.5} if flies else {}
        self.engine.create_agent(name, start_node_id=node, team=which % 3, **more)
        self.model[name] = (*self.nodes[node], 0.0) if flies else node

    @rule(name=NAMES)
    def delete(self, name):
        self.engine.delete_agent(name)
        self.model.pop(name, None)

    @precondition(lambda self: self.model)
    @rule(which=SOMEBODY, direction=POSITIONS, node=SOMEBODY)
    def act(self, which, direction, node):
        agent, name = self.one(which)
        node = list(self.nodes)[node % len(self.nodes)]
        flies = isinstance(self.model[name], tuple)
        before, below = self.model[name], agent.current_node_id
        agent.get_state()["action"] = direction if flies else node
        agent.set_state()
        assert agent.prev_node_id == below
        if flies:
            assert agent.prev_position == before
            assert np.linalg.norm(np.subtract(agent.position, before)) - 1.5 * any(direction) < 1e-9
        self.model[name] = agent.position if flies else node

    @precondition(lambda self: self.model)
    @rule(which=SOMEBODY, position=POSITIONS, node=SOMEBODY, goes_to_node=st.booleans())
    def teleport(self, which, position, node, goes_to_node):
        agent, name = self.one(which)
        node = list(self.nodes)[node % len(self.nodes)]
        if not isinstance(self.model[name], tuple):
            agent.current_node_id = self.model[name] = node
        elif goes_to_node:
            agent.current_node_id = node
            self.model[name] = (*self.nodes[node], self.model[name][2])
        else:
            agent.position = self.model[name] = position

    @precondition(lambda self: self.model)
    @rule(which=SOMEBODY, team=st.integers(0, 2))
    def change_sides(self, which, team):
        self.one(which)[0].team = team

    @rule()
    def ask_who_stands_where(self):
        positions, slow = self.engine.positions, IAgentEngine.positions.fget(self.engine)
        assert positions.names == slow.names == list(self.model)
        assert positions.node_ids.tolist() == slow.node_ids.tolist()
        assert positions.nodes == slow.nodes

    @rule()
    def ask_for_arrays(self):
        positions, slow = self.engine.positions, IAgentEngine.positions.fget(self.engine)
        assert positions.names == slow.names == list(self.model)
        assert positions.node_ids.tolist() == slow.node_ids.tolist()
        assert positions.teams == slow.teams
        assert positions.flyers.tolist() == slow.flyers.tolist()
        assert positions.flyer_xyz.tolist() == slow.flyer_xyz.tolist()
        places = positions.flyer_xyz
        assert [tuple(place) for place in places.tolist()] == [p for p in self.model.values() if type(p) is tuple]
        assert (positions.node_ids.dtype, positions.flyers.dtype, places.dtype) == (np.int64, np.int64, np.float64)
        now = (list(positions.names), positions.node_ids.tolist(), list(positions.teams), positions.flyer_xyz.tolist())
        if self.last is not None and self.last[0] == positions.version:
            assert self.last[1] == now
        self.last = (positions.version, now)

    @invariant()
    def agents_are_what_the_model_says(self):
        for name, place in getattr(self, "model", {}).items():
            agent = self.engine.get_agent(name)
            if isinstance(place, tuple):
                assert agent.position == place

    @rule()
    def look_below_everybody(self):
        for name, place in self.model.items():
            node = self.engine.get_agent(name).current_node_id
            if isinstance(place, tuple):
                away = {id: np.hypot(x - place[0], y - place[1]) for id, (x, y) in self.nodes.items()}
                assert away[node] <= min(away.values()) + 1e-12
            else:
                assert node == place

    def one(self, which):
        name = list(self.model)[which % len(self.model)]
        return self.engine.get_agent(name), name

    def teardown(self):
        if hasattr(self, "ctx"):
            self.ctx.terminate()


Sky.TestCase.settings = settings(stateful_step_count=40)
TestSky = Sky.TestCase
