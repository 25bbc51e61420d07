"""Sensors with a range and a field of view on a moving agent; everything sorted, because 1.0.0 keeps no order."""

from math import pi

import gamms

SensorType = gamms.sensor.SensorType
ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
graph = ctx.graph.graph
for i in range(25):
    graph.add_node({"id": i, "x": 10.0 * (i % 5), "y": 10.0 * (i // 5)})
ends = [(i, i + 1) for i in range(24) if i % 5 != 4] + [(i, i + 5) for i in range(20)]
for count, (a, b) in enumerate(ends):
    graph.add_edge({"id": 2 * count, "source": a, "target": b, "length": 10.0})
    graph.add_edge({"id": 2 * count + 1, "source": b, "target": a, "length": 10.0})

sensor_config = {
    "near": {"type": SensorType.NEIGHBOR},
    "map": {"type": SensorType.MAP},
    "disc": {"type": SensorType.RANGE, "sensor_range": 15.0},
    "beam": {"type": SensorType.ARC, "sensor_range": 25.0, "fov": pi / 2},
    "half": {"type": SensorType.ARC, "sensor_range": 10.0, "fov": pi},
    "all": {"type": SensorType.AGENT},
    "close": {"type": SensorType.AGENT_RANGE, "sensor_range": 20.0},
    "front": {"type": SensorType.AGENT_ARC, "sensor_range": 40.0, "fov": 2.0},
    "eyes": {"type": SensorType.AGENT, "fov": 1.0},
}
for name, config in sensor_config.items():
    ctx.sensor.create_sensor(name, config["type"], **config)
scout = ctx.agent.create_agent("scout", start_node_id=12, sensors=list(sensor_config))
for i, node in enumerate((0, 7, 11, 13, 22, 24)):
    ctx.agent.create_agent(f"other_{i}", start_node_id=node)


def shown(kind, data):
    if isinstance(data, list):
        return sorted(data)
    if "nodes" in data:
        return [sorted(data["nodes"]), sorted(edge.id for edge in data["edges"])]
    return sorted(data.items())


log = []
for action in (13, 13, 18, {"node_id": 17}, {"node_id": 12, "orientation": (0.0, -1.0)}, 11, 24):
    state = scout.get_state()
    seen = {name: [kind.name, shown(kind, data)] for name, (kind, data) in state["sensor"].items()}
    log.append([state["curr_pos"], [round(part, 9) + 0.0 for part in scout.orientation], seen])
    state["action"] = action
    scout.set_state()
outcome = {"log": log, "end": [scout.current_node_id, scout.prev_node_id], "keys": sorted(scout.state)}
ctx.terminate()
