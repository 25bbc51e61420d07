"""A drone searches a grid for people who are lost, and tells robots by radio where it sees them; these go there."""

from math import hypot

import gamms
from gamms import rules, strategies

SIDE, HEIGHT, SPEED, PATIENCE, TURNS = 20, 30.0, 12.0, 12, 150
LANES = [(x, y) for i, y in enumerate((25, 75, 125, 175)) for x in ((0, 190) if i % 2 == 0 else (190, 0))]


def drone(state):
    """Fly along the lanes, and report each person in view."""
    for who, (_, (x, y, _)) in state["sensor"]["camera"][1].items():
        state["outbox"].append({"channel": "radio", "to": "robots", "body": {"who": who, "at": [x, y]}})
    x, y, _ = state["curr_pos"]
    lane = state["memory"].get("lane", 0)
    if hypot(LANES[lane][0] - x, LANES[lane][1] - y) < SPEED:
        lane = (lane + 1) % len(LANES)
    state["memory"]["lane"] = lane
    state["action"] = (LANES[lane][0] - x, LANES[lane][1] - y, 0.0)


def robot(ctx):
    """Make the strategy of a robot: go to the nearest of the places that were reported lately, else stay."""

    def target(state):
        reports = state["memory"].setdefault("reports", {})
        for message in state["inbox"]:
            reports[message["body"]["who"]] = (message["turn"], ctx.graph.nearest_node(*message["body"]["at"]))
        fresh = [
            node
            for _, (turn, node) in sorted(reports.items())
            if state["turn"] - turn <= PATIENCE and node != state["curr_pos"]
        ]
        return ctx.graph.routes.nearest(state["curr_pos"], fresh)

    return strategies.goto(ctx, target)


def build(seed, robots, lost):
    """Return the game, before its first turn: robots and people are on these nodes."""
    ctx = gamms.create_context(seed=seed)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(SIDE, SIDE))
    ctx.sensor.create_sensor("camera", "aerial_agent", sensor_range=55.0, team="lost")
    flight = {"type": "AERIAL", "position": (0.0, 25.0, HEIGHT), "speed": SPEED, "sensors": ["camera"]}
    ctx.agent.create_agent("drone", start_node_id=0, team="robots", strategy=drone, **flight)
    for i, node in enumerate(robots):
        ctx.agent.create_agent(f"robot_{i}", start_node_id=node, team="robots", strategy=robot(ctx))
    for i, node in enumerate(lost):
        ctx.agent.create_agent(f"lost_{i}", start_node_id=node, team="lost", strategy=strategies.random_walk)
    ctx.game.add_channel("radio", range_m=130, loss=[(40, 0.0), (130, 0.6)])
    ctx.game.add(rules.tag("robots", "lost", then="eliminate"))
    ctx.game.add(rules.last_team())
    ctx.game.add(rules.time_limit(TURNS))
    return ctx
