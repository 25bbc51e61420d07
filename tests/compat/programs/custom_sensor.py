"""A sensor of the user's own, beside built-in ones: which cells of a ring were visited, and by whom."""

import gamms
from gamms.typing import ISensor

ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
graph = ctx.graph.graph
for i in range(10):
    graph.add_node({"id": i, "x": i % 5, "y": i // 5})
for i in range(10):
    graph.add_edge({"id": i, "source": i, "target": (i + 1) % 10, "length": 1.0})

visited = {}


@ctx.sensor.custom(name="VISITS")
class VisitSensor(ISensor):
    def __init__(self, ctx, sensor_id, reach):
        self.ctx = ctx
        self.reach = reach
        self._sensor_id = sensor_id
        self._owner = None
        self._data = {}

    @property
    def sensor_id(self):
        return self._sensor_id

    @property
    def type(self):
        return gamms.sensor.SensorType.CUSTOM

    @property
    def data(self):
        return self._data

    def set_owner(self, owner):
        self._owner = owner

    def sense(self, node_id):
        visited.setdefault(node_id, []).append(self._owner)
        self._data = {"ahead": [visited.get((node_id + i) % 10, []) for i in range(1, self.reach + 1)]}

    def update(self, data):
        self._data.update(data)


for name, reach in (("short", 1), ("long", 3)):
    ctx.sensor.add_sensor(VisitSensor(ctx, name, reach))
ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
ctx.agent.create_agent("anna", start_node_id=0, sensors=["short", "near"])
berta = ctx.agent.create_agent("berta", start_node_id=4, meta={"team": 1})
for sensor_id in ("long", "near"):
    berta.register_sensor(sensor_id, ctx.sensor.get_sensor(sensor_id))

log = []
for turn in range(12):
    for agent in ctx.agent.create_iter():
        state = agent.get_state()
        kinds = {name: kind.name for name, (kind, _) in state["sensor"].items()}
        for kind, data in state["sensor"].values():
            if kind == gamms.sensor.SensorType.VISITS:
                seen = data["ahead"]
        unseen = all(not names for names in seen)
        state["action"] = (state["curr_pos"] + 1) % 10 if unseen or turn % 3 else state["curr_pos"]
        agent.set_state()
        log.append([agent.name, agent.current_node_id, kinds, [list(names) for names in seen]])
ctx.sensor.get_sensor("long").update({"extra": 1})
outcome = {
    "log": log,
    "sensors": {agent.name: list(agent._sensor_list) for agent in ctx.agent.create_iter()},
    "kind": str(ctx.sensor.get_sensor("short").type),
    "data": sorted(ctx.sensor.get_sensor("long").data),
}
ctx.terminate()
