"""Tag on a grid, as a user of 1.0.0 would write it: configs in dicts, a rule that puts agents back."""

import gamms
from gamms import sensor

N = 8
sensor_config = {
    "neigh_red_0": {"type": sensor.SensorType.NEIGHBOR},
    "neigh_red_1": {"type": sensor.SensorType.NEIGHBOR},
    "neigh_blue_0": {"type": sensor.SensorType.NEIGHBOR},
    "neigh_blue_1": {"type": sensor.SensorType.NEIGHBOR},
    "spy": {"type": sensor.SensorType.AGENT, "sensor_range": 5},
}
agent_config = {
    "red_0": {"meta": {"team": 0}, "sensors": ["neigh_red_0", "spy"], "start_node_id": 0},
    "red_1": {"meta": {"team": 0}, "sensors": ["neigh_red_1", "spy"], "start_node_id": 5},
    "blue_0": {"meta": {"team": 1}, "sensors": ["neigh_blue_0"], "start_node_id": N * N - 1},
    "blue_1": {"meta": {"team": 1}, "sensors": ["neigh_blue_1"], "start_node_id": N * N - N + 2, "color": (0, 0, 255)},
}
goal = {"blue_0": 0, "blue_1": N - 1}

ctx = gamms.create_context(vis_engine=gamms.visual.Engine.NO_VIS, logger_config={"level": "CRITICAL"})
graph = ctx.graph.graph
for i in range(N):
    for j in range(N):
        graph.add_node({"id": i * N + j, "x": float(j), "y": float(i)})
edge_count = 0
for i in range(N):
    for j in range(N):
        for di, dj in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            if 0 <= i + di < N and 0 <= j + dj < N:
                edge = {"id": edge_count, "source": i * N + j, "target": (i + di) * N + j + dj, "length": 1.0}
                graph.add_edge(edge)
                edge_count += 1

for name, config in sensor_config.items():
    ctx.sensor.create_sensor(name, config["type"], **config)
for name, config in agent_config.items():
    ctx.agent.create_agent(name, **config)


def distance(a, b):
    a, b = graph.get_node(a), graph.get_node(b)
    return abs(a.x - b.x) + abs(a.y - b.y)


def chase(state):
    for kind, data in state["sensor"].values():
        if kind == sensor.SensorType.NEIGHBOR:
            choices = sorted(data)
        elif kind == sensor.SensorType.AGENT:
            others = [node for name, node in sorted(data.items()) if name.startswith("blue")]
    state["action"] = min(choices, key=lambda node: (min(distance(node, other) for other in others), node))


def run_home(name):
    def strategy(state):
        kind, data = next(iter(state["sensor"].values()))
        assert kind == sensor.SensorType.NEIGHBOR
        state["action"] = min(sorted(data), key=lambda node: (distance(node, goal[name]), -node))

    return strategy


for agent in ctx.agent.create_iter():
    agent.register_strategy(chase if agent.meta["team"] == 0 else run_home(agent.name))

tags, scores, path = [], [], []


def reset(agent):
    agent.current_node_id = agent_config[agent.name]["start_node_id"]
    agent.prev_node_id = agent_config[agent.name]["start_node_id"]


def tag_rule(ctx, turn):
    for red in ("red_0", "red_1"):
        for blue in ("blue_0", "blue_1"):
            ragent, bagent = ctx.agent.get_agent(red), ctx.agent.get_agent(blue)
            if ragent.current_node_id == bagent.current_node_id:
                tags.append([turn, red, blue, ragent.current_node_id])
                reset(ragent)
                reset(bagent)


def score_rule(ctx, turn):
    for blue, node in goal.items():
        if ctx.agent.get_agent(blue).current_node_id == node:
            scores.append([turn, blue])
            reset(ctx.agent.get_agent(blue))


def termination_rule(ctx, turn):
    if turn >= 40 or len(tags) >= 6:
        ctx.terminate()


turn_count = 0
while not ctx.is_terminated():
    turn_count += 1
    for agent in ctx.agent.create_iter():
        state = agent.get_state()
        agent.strategy(state)
        agent.set_state()
    ctx.visual.simulate()
    path.append([[agent.current_node_id, agent.prev_node_id] for agent in ctx.agent.create_iter()])
    tag_rule(ctx, turn_count)
    score_rule(ctx, turn_count)
    termination_rule(ctx, turn_count)

outcome = {"turns": turn_count, "tags": tags, "scores": scores, "path": path}
