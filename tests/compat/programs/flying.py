"""Aerial agents beside one on the ground: steps, turns, teleports, sensors, a loop, and everything one can read."""

from gamms.AgentEngine.agent_engine import AgentType
from gamms.SensorEngine.sensor_engine import SensorType

import gamms

ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
graph = ctx.graph.graph
N = 5
for id in range(N * N):
    graph.add_node({"id": id, "x": float(id % N), "y": float(id // N)})
edges = 0
for id in range(N * N):
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        if 0 <= id % N + dx < N and 0 <= id // N + dy < N:
            graph.add_edge({"id": edges, "source": id, "target": id + dx + N * dy, "length": 1.0})
            edges += 1
for name in ("near_kite", "near_anna"):
    ctx.sensor.create_sensor(name, SensorType.NEIGHBOR)
ctx.sensor.create_sensor("all", SensorType.AGENT)
kite = ctx.agent.create_agent("kite", type=AgentType.AERIAL, start_node_id=12, speed=0.75, sensors=["near_kite"])
hawk = ctx.agent.create_agent("hawk", type=1, start_node_id=0, speed=2, sensors=["all"])
anna = ctx.agent.create_agent("anna", start_node_id=24, sensors=["near_anna"])


def rounded(numbers):
    return [round(float(number), 9) + 0.0 for number in numbers]


def shown(agent):
    places = [rounded(agent.position), rounded(agent.prev_position), rounded(agent.quat)]
    return [agent.name, agent.type.name, *places, agent.current_node_id, agent.prev_node_id, round(agent.speed, 9)]


log = [shown(kite), shown(hawk), kite.state]


def act(agent, action):
    state = agent.get_state()
    state["action"] = action
    agent.set_state()
    log.append([sorted(state), shown(agent), rounded(state["curr_pos"]), rounded(state["quat"])])


STEPS = [
    (1, 0, 0),
    (0.0, 3.0, 0.1),
    (0, 0, 0),
    (1.0, -2.0, 2.0),
    (0, 0, -5),
    {"direction": [-1.0, -1.0, 0.0]},
    {"direction": (0, 1, 0), "quat": [0.0, 0.0, 0.0, 2.0]},
    {"quat": (1.0, 1.0, 1.0, 1.0)},
    {"quat": (0, 0, 0, 0)},
    {},
    {"node_id": 3},
]
for step in STEPS:
    act(kite, step)
    act(hawk, step)
    seen = kite.state["sensor"]["near_kite"]
    log.append([seen[0].name, sorted(seen[1]), sorted(hawk.state["sensor"]["all"][1].items())])

kite.position = (3.2, 1.1, 4.0)
log.append(shown(kite))
kite.position = (3.2, 1.1, 4.0)
log.append(shown(kite))
kite.current_node_id = 7
log.append(shown(kite))
kite.prev_node_id = 20
log.append(shown(kite))
kite.quat = (0.0, 0.0, 0.0, 0.5)
log.append(shown(kite))
for yaw_free in ((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)):  # where 1.0.0 has the yaw right
    kite.quat = yaw_free
    log.append(rounded(kite.orientation))


def rise_and_circle(state):
    x, y, z = state["curr_pos"]
    state["action"] = (2.0 - y, x - 2.0, 1.0) if z < 3.0 else (0, 0, -1)


def walk(state):
    state["action"] = min(state["sensor"]["near_anna"][1])


kite.register_strategy(rise_and_circle)
hawk.register_strategy(rise_and_circle)
anna.register_strategy(walk)
for _ in range(6):
    for agent in ctx.agent.create_iter():
        agent.step()
        log.append(shown(agent) if agent.type == AgentType.AERIAL else [agent.name, agent.current_node_id])
    ctx.visual.simulate()

KNOWN = (KeyError, ValueError, TypeError, AttributeError, NotImplementedError)


def refused(call, *args, **kwargs):
    try:
        call(*args, **kwargs)
    except KNOWN as error:
        return next(kind.__name__ for kind in type(error).__mro__ if kind in KNOWN)
    return None


def tried(action):
    kite.get_state()["action"] = action
    return refused(kite.set_state)


errors = {
    "no speed": refused(ctx.agent.create_agent, "new", type=AgentType.AERIAL, start_node_id=0),
    "no start": refused(ctx.agent.create_agent, "new", type=AgentType.AERIAL, speed=1.0),
    "unknown start": refused(ctx.agent.create_agent, "new", type=AgentType.AERIAL, start_node_id=99, speed=1.0),
    "taken": refused(ctx.agent.create_agent, "kite", type=AgentType.AERIAL, start_node_id=0, speed=1.0),
    "no action": (kite.get_state(), refused(kite.set_state))[1],
    "two numbers": tried((1, 0)),
    "four numbers": tried((1, 0, 0, 0)),
    "a list": tried([1, 0, 0]),
    "a node": tried(3),
    "text": tried("up"),
    "nothing": tried(None),
    "letters": tried(("a", "b", "c")),
    "a flat direction": tried({"direction": (1, 0)}),
    "no direction": tried({"direction": None}),
    "a short quat": tried({"quat": (1, 0, 0)}),
    "no quat": tried({"quat": None}),
    "none of these": tried((0, 0, 1)),
    "read-only speed": refused(setattr, kite, "speed", 2.0),
    "read-only past": refused(setattr, kite, "prev_position", (0, 0, 0)),
    "unknown node": refused(setattr, kite, "current_node_id", 99),
}
log.append(shown(kite))
ctx.agent.delete_agent("hawk")
log.append([agent.name for agent in ctx.agent.create_iter()])
ctx.terminate()
outcome = {"log": log, "errors": errors}
