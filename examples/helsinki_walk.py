"""Five walkers stroll through Helsinki, each seeing 60 m ahead of it; the last turn is saved as a picture."""

import gamms

WALKERS, TURNS = 5, 120
ARC = gamms.sensor.SensorType.ARC


def stroll(rng):
    """A strategy: go on to a node in sight; turn round only where there is none."""

    def strategy(state):
        _, (_, *options) = state["sensor"]["near"]  # the first one is the node itself
        _, view = state["sensor"]["eyes"]
        ahead = [node for node in options if node in view["nodes"]]
        choices = ahead or options or [state["curr_pos"]]
        state["action"] = choices[rng.integers(len(choices))]

    return strategy


with gamms.create_context(seed=7) as ctx:
    streets = gamms.osm.helsinki(ctx, resolution=10.0)
    print(f"Helsinki: {len(streets)} nodes, {streets.number_of_edges()} edges, {ctx.graph.crs}")

    starts = ctx.rng.choice(ctx.graph.columns().node_ids, WALKERS, replace=False)
    for i, start in enumerate(starts):
        name = f"walker_{i}"
        near = ctx.sensor.create_sensor(f"{name}/near", gamms.sensor.SensorType.NEIGHBOR)
        eyes = ctx.sensor.create_sensor(f"{name}/eyes", ARC, sensor_range=60.0, fov=2.0)
        agent = ctx.agent.create_agent(name, start_node_id=start, strategy=stroll(ctx.stream("agent", name)))
        agent.register_sensor("near", near)
        agent.register_sensor("eyes", eyes)

    metres = {agent.name: 0.0 for agent in ctx.agent.create_iter()}
    visited = {agent.name: {agent.current_node_id} for agent in ctx.agent.create_iter()}
    for _ in range(TURNS):
        for agent in ctx.agent.create_iter():
            agent.step()
            edge = streets.get_edge_data(agent.prev_node_id, agent.current_node_id)
            metres[agent.name] += edge["length"] if edge else 0.0
            visited[agent.name].add(agent.current_node_id)

    for agent in ctx.agent.create_iter():
        seen = agent.get_state()["sensor"]["eyes"][1]
        print(
            f"{agent.name}: {metres[agent.name]:6.1f} m, {len(visited[agent.name]):3d} nodes, "
            f"now sees {len(seen['nodes'])} nodes and {len(seen['edges'])} edges"
        )

    ctx.visual.set_graph_visual(node_size=0.0, edge_color=(150, 150, 150))
    for i, agent in enumerate(ctx.agent.create_iter()):
        ctx.visual.set_agent_visual(agent.name, color=(200, 40 * i, 30), size=12)
        ctx.visual.set_sensor_visual(f"{agent.name}/eyes", node_color=(0, 120, 200), edge_color=(0, 120, 200))
    ctx.visual.save("helsinki_walk.svg", width=1000, height=1100, title=f"Helsinki after {TURNS} turns")
    print("wrote helsinki_walk.svg")
