"""A drone over Helsinki tells robots on the ground where it sees a runner; buildings block the radio."""

import gamms


def look_and_tell(state):
    for _, (x, y, _) in state["sensor"]["camera"][1].values():
        state["outbox"].append({"channel": "radio", "to": "robots", "body": ctx.graph.nearest_node(x, y)})
    state["action"] = (0.0, 0.0, 0.0)


def heard(state):
    for message in state["inbox"]:
        state["memory"]["target"] = message["body"]
    return state["memory"].get("target")


with gamms.create_context(seed=4) as ctx:
    streets = gamms.osm.helsinki(ctx, buildings=True)
    ctx.game.add_channel("radio", range_m=400, line_of_sight=True, loss=[(50, 0.0), (400, 0.5)])
    ctx.sensor.create_sensor("camera", "aerial_agent", sensor_range=300, team="runners")
    x, y = ctx.graph.columns().xy.mean(axis=0)
    drone = {"type": "AERIAL", "position": (x, y, 90.0), "speed": 10.0, "sensors": ["camera"]}
    ctx.agent.create_agent("drone", start_node_id=0, team="robots", strategy=look_and_tell, **drone)
    for i, node in enumerate(ctx.rng.choice(streets, 5)):
        ctx.agent.create_agent(
            f"robot_{i}", start_node_id=node, team="robots", strategy=gamms.strategies.goto(ctx, heard)
        )
    walk, centre = gamms.strategies.random_walk, ctx.graph.nearest_node(x, y)
    ctx.agent.create_agent("runner", start_node_id=centre, team="runners", strategy=walk)
    ctx.game.add(gamms.rules.tag("robots", "runners", then="eliminate"))
    ctx.game.add(gamms.rules.last_team())
    print(ctx.game.run(max_turns=60).headline())
