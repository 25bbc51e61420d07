"""On random worlds, both graph engines and a brute-force scan of plain records see the same."""

from math import atan2, inf, pi, remainder

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

import gamms
from gamms.graph import Engine
from gamms.sensor import SensorType

IDS = st.integers(0, 12)
PLACES = st.tuples(st.integers(-4, 4), st.integers(-4, 4))
RANGES = st.sampled_from([0, 1, 2, 2.5, 5**0.5, 2**0.5, 30, inf])
FOVS = st.sampled_from([0, 1.0, pi / 2, pi, 3 * pi / 2, 2 * pi, 7])
DIRECTIONS = st.sampled_from([(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 2), (3, -4)])
HONOURED = {  # what each kind looks at; the rest of its keywords is ignored
    "MAP": (),
    "RANGE": ("sensor_range",),
    "ARC": ("sensor_range", "fov", "orientation"),
    "AGENT": ("fov", "orientation"),
    "AGENT_RANGE": ("sensor_range",),
    "AGENT_ARC": ("sensor_range", "fov", "orientation"),
}


class World:
    """Plain records, and scans over all of them."""

    def __init__(self):
        self.nodes, self.edges, self.agents, self.owners = {}, {}, {}, {}

    def heading(self, sensor, orientation):
        if self.owners[sensor] is None:
            return orientation
        node, before, fixed = self.agents[self.owners[sensor]]
        (x, y), (x0, y0) = self.nodes[node], self.nodes[before]
        a, b = fixed or (x - x0, y - y0)
        return (orientation[0] * a - orientation[1] * b, orientation[0] * b + orientation[1] * a)

    def is_seen(self, id, observer, radius, fov, heading):
        (x, y), (x0, y0) = self.nodes[id], self.nodes[observer]
        dx, dy = x - x0, y - y0
        if dx * dx + dy * dy > radius * radius:
            return False
        if fov == 2 * pi or heading == (0, 0) or id == observer:
            return True
        return abs(remainder(atan2(dy, dx) - atan2(heading[1], heading[0]), 2 * pi)) <= fov / 2 + 1e-9

    def neighbors(self, observer):
        return list(dict.fromkeys([observer, *(t for s, t in self.edges.values() if s == observer)]))

    def map(self, observer, *cone):
        nodes = [id for id in self.nodes if self.is_seen(id, observer, *cone)]
        edges = [(id, *ends) for id, ends in self.edges.items() if set(ends) <= set(nodes)]
        return [(id, (id, *self.nodes[id])) for id in nodes], edges

    def crowd(self, sensor, observer, *cone):
        everybody = [(name, record[0]) for name, record in self.agents.items() if name != self.owners[sensor]]
        return [(name, node) for name, node in everybody if self.is_seen(node, observer, *cone)]


class SensorMachine(RuleBasedStateMachine):
    """Graph edits, moves and looks in any order, in a MEMORY and a SQLITE context at once."""

    @initialize(places=st.lists(PLACES, min_size=4, max_size=10, unique=True), data=st.data())
    def open(self, places, data):
        self.world, self.kinds, self.edge_id = World(), {}, 0
        self.contexts = [gamms.create_context(engine, logger_config={"level": "CRITICAL"}) for engine in Engine]
        for id, place in enumerate(places):
            self.add_node(id, place)
        ends = st.integers(0, len(places) - 1)
        for source, target in data.draw(st.lists(st.tuples(ends, ends), max_size=12)):
            self._add_edge(source, target)

    def _pick(self, data, things):
        return data.draw(st.sampled_from(sorted(things)))

    def _add_edge(self, source, target):
        edge = {"id": self.edge_id, "source": source, "target": target, "length": 1.0}
        for ctx in self.contexts:
            ctx.graph.graph.add_edge(edge)
        self.world.edges[self.edge_id] = (source, target)
        self.edge_id += 1

    @rule(id=IDS, place=PLACES)
    def add_node(self, id, place):
        if id in self.world.nodes or place in self.world.nodes.values():
            return
        for ctx in self.contexts:
            ctx.graph.graph.add_node({"id": id, "x": place[0], "y": place[1]})
        self.world.nodes[id] = place

    @rule(data=st.data())
    def add_edge(self, data):
        self._add_edge(self._pick(data, self.world.nodes), self._pick(data, self.world.nodes))

    @rule(data=st.data(), place=PLACES)
    def move_node(self, data, place):
        id = self._pick(data, self.world.nodes)
        if place in self.world.nodes.values():
            return
        for ctx in self.contexts:
            ctx.graph.graph.update_node({"id": id, "x": place[0], "y": place[1]})
        self.world.nodes[id] = place

    @rule(data=st.data())
    def remove_node(self, data):
        id = self._pick(data, self.world.nodes)
        if len(self.world.nodes) == 1 or any(id in record[:2] for record in self.world.agents.values()):
            return
        for ctx in self.contexts:
            ctx.graph.graph.remove_node(id)
        del self.world.nodes[id]
        self.world.edges = {edge: ends for edge, ends in self.world.edges.items() if id not in ends}

    @precondition(lambda self: self.world.edges)
    @rule(data=st.data())
    def remove_edge(self, data):
        id = self._pick(data, self.world.edges)
        for ctx in self.contexts:
            ctx.graph.graph.remove_edge(id)
        del self.world.edges[id]

    @precondition(lambda self: len(self.world.agents) < 5)
    @rule(data=st.data())
    def create_agent(self, data):
        name, node = f"agent_{len(self.world.agents)}", self._pick(data, self.world.nodes)
        for ctx in self.contexts:
            ctx.agent.create_agent(name, start_node_id=node)
        self.world.agents[name] = [node, node, None]

    @precondition(lambda self: self.world.agents)
    @rule(data=st.data(), turn=st.none() | DIRECTIONS)
    def move_agent(self, data, turn):
        name, node = self._pick(data, self.world.agents), self._pick(data, self.world.nodes)
        for ctx in self.contexts:
            agent = ctx.agent.get_agent(name)
            agent.get_state()["action"] = {"node_id": node, "orientation": turn}
            agent.set_state()
        self.world.agents[name] = [node, self.world.agents[name][0], turn]

    @precondition(lambda self: len(self.kinds) < 6)
    @rule(kind=st.sampled_from(["NEIGHBOR", *HONOURED]), radius=RANGES, fov=FOVS, orientation=DIRECTIONS)
    def create_sensor(self, kind, radius, fov, orientation):
        name, given = f"sensor_{len(self.kinds)}", {"sensor_range": radius, "fov": fov, "orientation": orientation}
        for ctx in self.contexts:
            ctx.sensor.create_sensor(name, SensorType[kind], **given)
        used = {key: given[key] for key in HONOURED.get(kind, ())}
        self.kinds[name] = (kind, {"sensor_range": inf, "fov": 2 * pi, "orientation": (1, 0), **used})
        self.world.owners[name] = None

    @precondition(lambda self: self.kinds and self.world.agents)
    @rule(data=st.data())
    def give_sensor(self, data):
        sensor, owner = self._pick(data, self.kinds), self._pick(data, self.world.agents)
        for ctx in self.contexts:
            ctx.agent.get_agent(owner).register_sensor(sensor, ctx.sensor.get_sensor(sensor))
        self.world.owners[sensor] = owner

    @precondition(lambda self: self.kinds)
    @rule(data=st.data())
    def look(self, data):
        observer = self._pick(data, self.world.nodes)
        for name, (kind, given) in self.kinds.items():
            cone = (given["sensor_range"], given["fov"], self.world.heading(name, given["orientation"]))
            for ctx in self.contexts:
                sensor = ctx.sensor.get_sensor(name)
                sensor.sense(observer)
                if kind == "NEIGHBOR":
                    assert sensor.data == self.world.neighbors(observer)
                elif kind.startswith("AGENT"):
                    assert list(sensor.data.items()) == self.world.crowd(name, observer, *cone)
                else:
                    edges = [(edge.id, edge.source, edge.target) for edge in sensor.data["edges"]]
                    assert (list(sensor.data["nodes"].items()), edges) == self.world.map(observer, *cone)
                    sensor.data["nodes"].clear()
                    sensor.data["edges"].clear()
                sensor.data.clear()

    def teardown(self):
        for ctx in getattr(self, "contexts", ()):
            ctx.terminate()


SensorMachine.TestCase.settings = settings(stateful_step_count=30)
TestSensors = SensorMachine.TestCase
