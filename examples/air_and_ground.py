"""A team in the air and on the ground: the drone tells where it has just seen intruders, and the guards go there."""

from math import cos, sin

import gamms
from gamms.agent import AgentType
from gamms.rules import last_team, tag, time_limit
from gamms.sensor import SensorType
from gamms.strategies import chase, first, goto, random_walk

SIZE, SPACING, HEIGHT = 15, 10.0, 40.0


def look_around(state):
    """The drone's strategy: tell the team who is where, and fly in a circle."""
    _, traffic = state["sensor"]["camera"]
    nodes = {name: ctx.graph.nearest_node(x, y) for name, (_, (x, y, _)) in traffic.items()}
    state["team_memory"]["seen"] = nodes  # the guards read it in the next turn
    angle = state["turn"] / 6.0
    state["action"] = (-sin(angle), cos(angle), 0.0)


def nearest_seen(state):
    """Where the drone has seen the intruder that is nearest to a guard; None while it sees none."""
    nodes = state["team_memory"].get("seen", {}).values()
    return min(nodes, key=lambda node: (ctx.graph.distance(state["curr_pos"], node), node), default=None)


with gamms.create_context(seed=2) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(SIZE, SIZE, SPACING))
    camera = ctx.sensor.create_sensor("camera", SensorType.AERIAL_AGENT, sensor_range=60.0, team="intruders")
    drone = ctx.agent.create_agent("drone", type=AgentType.AERIAL, start_node_id=0, speed=10.0, team="guards")
    drone.position = (130.0, 70.0, HEIGHT)
    drone.register_sensor("camera", camera)
    drone.register_strategy(look_around)
    for i in range(3):
        eyes = ctx.sensor.create_sensor(f"eyes_{i}", SensorType.AGENT_RANGE, sensor_range=15.0, team="intruders")
        pursue = first(chase(ctx, otherwise=None), goto(ctx, nearest_seen))
        ctx.agent.create_agent(f"guard_{i}", start_node_id=i, team="guards", sensors={"eyes": eyes}, strategy=pursue)
    for i, start in enumerate(ctx.rng.integers(SIZE * SIZE, size=4)):
        ctx.agent.create_agent(f"intruder_{i}", start_node_id=start, team="intruders", strategy=random_walk)

    ctx.game.add(tag("guards", "intruders", then="eliminate"))
    ctx.game.add(last_team())
    ctx.game.add(time_limit(300))
    ctx.game.collect("known", lambda ctx: len(ctx.agent.get_agent("guard_0").state["team_memory"].get("seen", {})))
    result = ctx.game.run()

tags, known = result.table("tag"), result.table("known")["value"]
for turn, guard, intruder, node in zip(tags["turn"], tags["agent"], tags["other"], tags["node"], strict=True):
    print(f"turn {turn:3d}: {guard} catches {intruder} on node {node}")
print(f"in {(known > 0).sum()} of {result.turns} turns the guards knew of an intruder from the drone")
print(f"{result.reason}: {result.scores}, the winner is {result.winner}")
