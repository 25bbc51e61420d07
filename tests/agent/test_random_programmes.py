"""Whatever a program does with agents, the engine answers like a plain dict of plain records."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

import gamms

NAMES = st.sampled_from([f"agent_{i}" for i in range(12)])
NODES = st.integers(0, 5)


class AgentEngineMachine(RuleBasedStateMachine):
    """A context beside `{name: [node, previous, team]}`; deleted agents are held on to."""

    @initialize()
    def open(self):
        self.ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
        self.model, self.held, self.gone, self.last = {}, {}, [], None
        for id in range(6):
            self.ctx.graph.graph.add_node({"id": id, "x": id, "y": 0})
        self.ctx.sensor.create_sensor("all", gamms.sensor.SensorType.AGENT)

    @rule(name=NAMES, node=NODES, team=st.integers(0, 2))
    def create(self, name, node, team):
        try:
            self.held[name] = self.ctx.agent.create_agent(name, start_node_id=node, team=team)
        except ValueError:
            assert name in self.model
        else:
            assert name not in self.model
            self.model[name] = [node, node, team]

    @rule(name=NAMES)
    def delete(self, name):
        self.ctx.agent.delete_agent(name)
        record = self.model.pop(name, None)
        if record is not None:
            self.gone.append((self.held.pop(name), record))

    @precondition(lambda self: self.model)
    @rule(data=st.data(), node=st.integers(0, 7))
    def act(self, data, node):
        name = data.draw(st.sampled_from(list(self.model)))
        self.held[name].get_state()["action"] = node
        try:
            self.held[name].set_state()
        except KeyError:
            assert node > 5
        else:
            self.model[name][:2] = [node, self.model[name][0]]

    @precondition(lambda self: self.model)
    @rule(data=st.data(), node=NODES)
    def put(self, data, node):
        name = data.draw(st.sampled_from(list(self.model)))
        self.held[name].current_node_id = node
        self.model[name][0] = node

    @precondition(lambda self: self.gone)
    @rule(data=st.data(), node=NODES)
    def move_a_deleted_one(self, data, node):
        agent, record = data.draw(st.sampled_from(self.gone))
        agent.get_state()["action"] = node
        agent.set_state()
        record[:2] = [node, record[0]]

    @rule(data=st.data())
    def delete_in_a_loop(self, data):
        doomed = data.draw(st.lists(NAMES, unique=True))
        for agent in self.ctx.agent.create_iter():
            assert agent.name in self.model
            if agent.name in doomed:
                self.delete(agent.name)

    @rule()
    def ask_where_agents_are(self):
        positions = self.ctx.agent.positions
        now = (list(positions.names), positions.node_ids.tolist(), list(positions.teams))
        nodes, teams = ([record[i] for record in self.model.values()] for i in (0, 2))
        assert now == (list(self.model), nodes, teams)
        assert (positions.flyers.tolist(), positions.flyer_xyz.shape) == ([], (0, 3))
        assert len(self.ctx.agent.block) == len(self.model)
        if self.last is not None and self.last[0] == positions.version:
            assert self.last[1] == now
        self.last = (positions.version, now)

    @precondition(lambda self: self.model)
    @rule(data=st.data(), team=st.integers(0, 2))
    def change_sides(self, data, team):
        name = data.draw(st.sampled_from(list(self.model)))
        self.held[name].team = self.model[name][2] = team

    @rule()
    def ask_who_stands_where(self):
        positions = self.ctx.agent.positions
        assert positions.names == list(self.model)
        assert positions.node_ids.tolist() == [record[0] for record in self.model.values()]

    @rule()
    def sense(self):
        sensor = self.ctx.sensor.get_sensor("all")
        sensor.sense(0)
        assert list(sensor.data.items()) == [(name, record[0]) for name, record in self.model.items()]

    @invariant()
    def agents_are_what_the_model_says(self):
        if not hasattr(self, "ctx"):
            return
        for name, agent in self.held.items():
            assert self.ctx.agent.get_agent(name) is agent
        everybody = [(a.name, [a.current_node_id, a.prev_node_id, a.team]) for a in self.ctx.agent.create_iter()]
        assert everybody == list(self.model.items())
        for agent, record in self.gone:
            assert [agent.current_node_id, agent.prev_node_id, agent.team] == record

    def teardown(self):
        if hasattr(self, "ctx"):
            self.ctx.terminate()


AgentEngineMachine.TestCase.settings = settings(stateful_step_count=40)
TestAgentEngine = AgentEngineMachine.TestCase
