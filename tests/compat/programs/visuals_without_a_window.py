"""A program that was written for a window and runs without one; its own artist, and a human who stays."""

import gamms

ctx = gamms.create_context(
    vis_engine=gamms.visual.Engine.NO_VIS,
    vis_kwargs={"width": 1980, "height": 1080, "simulation_time_constant": 0.3},
    logger_config={"level": "CRITICAL"},
)
for i in range(4):
    ctx.graph.graph.add_node({"id": i, "x": i, "y": 0})
for i in range(3):
    ctx.graph.graph.add_edge({"id": i, "source": i, "target": i + 1, "length": 1.0})
ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
ctx.agent.create_agent("human", start_node_id=1, sensors=["near"])

artists = {
    "graph": ctx.visual.set_graph_visual(width=1980, height=1080, node_color=gamms.visual.Color.Black, draw_id=True),
    "agent": ctx.visual.set_agent_visual("human", color=gamms.visual.Color.Red, size=10),
    "unknown": ctx.visual.set_agent_visual("nobody", color=(0, 0, 0)),
    "sensor": ctx.visual.set_sensor_visual("near", node_color=(0, 255, 0)),
    "obstacles": ctx.visual.set_obstacle_visual(boundary_thickness=2.0),
}
drawn = []


def draw(ctx, data):
    drawn.append(data)
    ctx.visual.render_circle(data["x"], 0.0, 1.0, gamms.visual.Color.Blue)


own = gamms.visual.Artist(ctx, draw, layer=35)
own.data["x"] = 3
artists["own"] = ctx.visual.add_artist("own", own)
circle = gamms.visual.Artist(ctx, gamms.visual.Shape.Circle)
circle.data = {"x": 0, "y": 0, "scale": 10.0}
ctx.visual.add_artist("circle", circle)
circle.set_visible(False)
circle.set_layer(7)
shown = [circle.get_visible(), circle.get_layer(), circle.get_artist_type().name]
ctx.visual.remove_artist("circle")

human = ctx.agent.get_agent("human")
human.register_strategy(lambda state: state.update(action=ctx.visual.human_input("human", state)))
turns = 0
while not ctx.is_terminated():
    turns += 1
    for agent in ctx.agent.create_iter():
        agent.step()
    ctx.visual.simulate()
    if turns == 3:
        ctx.terminate()

outcome = {
    "layers": {name: artist.get_layer() for name, artist in artists.items()},
    "shown": shown,
    "drawn": drawn,
    "turns": turns,
    "human": [human.current_node_id, human.prev_node_id],
    "viewport": ctx.visual.get_viewport(),
}
