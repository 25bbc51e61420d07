"""A program with a window: its camera, its artists, people who answer by keys and clicks, and the window's inside."""

import os

os.environ["SDL_VIDEODRIVER"] = os.environ["SDL_AUDIODRIVER"] = "dummy"

import pygame

import gamms

ctx = gamms.create_context(
    vis_engine=gamms.visual.Engine.PYGAME,
    vis_kwargs={"width": 800, "height": 400, "simulation_time_constant": 0.05},
    logger_config={"level": "CRITICAL"},
)
view = ctx.visual._render_manager


def camera():
    return [round(float(value), 6) for value in (view.camera_x, view.camera_y, view.camera_size, view.camera_size_y)]


def press(key):
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key))
    pygame.event.post(pygame.event.Event(pygame.KEYUP, key=key))


cameras = [camera()]
at_start = {name: [artist.get_layer(), artist.get_visible()] for name, artist in ctx.visual._dynamic_artists.items()}
for i in range(6):
    ctx.graph.graph.add_node({"id": i, "x": 10.0 * i, "y": 5.0 * (i % 2)})
for i in range(5):
    ctx.graph.graph.add_edge({"id": i, "source": 0, "target": i + 1, "length": 1.0})
ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
ctx.agent.create_agent("anna", start_node_id=0, sensors=["near"])
ctx.agent.create_agent("drone", start_node_id=0, type=gamms.agent.AgentType.AERIAL, speed=2.0)

drawn = []


def draw(ctx, data):
    drawn.append(data["x"])
    ctx.visual.render_rectangle(data["x"], 0.0, 20, 10, (0, 0, 255))
    x, y = view.world_to_screen(40.0, 5.0)
    pygame.draw.circle(ctx.visual._get_target_surface(), (0, 255, 255), (x, y), 6)


artists = {
    "graph": ctx.visual.set_graph_visual(width=1980, height=1080),
    "anna": ctx.visual.set_agent_visual("anna", color=(255, 0, 0), size=2),
    "drone": ctx.visual.set_agent_visual("drone", size=1),
    "sensor": ctx.visual.set_sensor_visual("near"),
    "obstacles": ctx.visual.set_obstacle_visual(),
}
own = gamms.visual.Artist(ctx, draw, layer=35)
own.data["x"] = 25.0
artists["own"] = ctx.visual.add_artist("own", own)
cameras.append(camera())
refused = []
for call in (
    lambda: ctx.visual.set_sensor_visual("nothing"),
    lambda: ctx.visual.set_agent_visual("anna", image_path="nowhere.png"),
):
    try:
        call()
    except (KeyError, OSError) as error:
        refused.append([kind.__name__ for kind in (KeyError, OSError) if isinstance(error, kind)])
ctx.visual.update()
corner = [round(value) for value in view.world_to_screen(25.0, 0.0)]
pixels = [
    list(ctx.visual._screen.get_at(at))[:3]
    for at in (
        [corner[0] + 1, corner[1] + 1],
        [corner[0] + 18, corner[1] + 8],
        [round(value) for value in view.world_to_screen(40.0, 5.0)],
        [round(value) for value in view.world_to_screen(30.0, 5.0)],  # a node
    )
]

answers = []
for key in (pygame.K_3, pygame.K_0, pygame.K_5):
    press(key)
    answers.append(ctx.visual.human_input("anna", {"curr_pos": 0}))
for key in (pygame.K_UP, pygame.K_DOWN, pygame.K_0):
    press(key)
    answers.append([round(float(part), 6) for part in ctx.visual.human_input("drone", {"curr_pos": (0.0, 0.0, 0.0)})])
view.camera_x, view.camera_y, view.camera_size = 20.0, 0.0, 40.0
cameras.append(camera())
pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, button=1, pos=(600, 100)))
answers.append([round(float(part), 6) for part in ctx.visual.human_input("drone", {"curr_pos": (0.0, 0.0, 0.0)})])
pygame.event.post(pygame.event.Event(pygame.MOUSEMOTION, pos=(400, 200), rel=(0, 0), buttons=(0, 0, 0)))
# A notch of 1.0.0 is a twentieth, one of ours a quarter, so that ours is turned by a part of a notch.
pygame.event.post(pygame.event.Event(pygame.MOUSEWHEEL, x=0, y=1, precise_y=0.218649223))
ctx.visual.update()
cameras.append(camera())

waiting = []
ctx.visual._sim_time_constant = 0.02
ctx.visual._toggle_waiting_simulation(True)
while ctx.visual._waiting_simulation:
    waiting.append(artists["anna"].data["_alpha"] <= 1.0)
    ctx.visual.handle_input()
    ctx.visual.handle_single_draw()
    ctx.visual._pygame.display.flip()
    ctx.visual.handle_tick()

state = ctx.agent.get_agent("anna").get_state()
state["action"] = 4
ctx.agent.get_agent("anna").set_state()
ctx.visual.simulate()
replaced = []
ctx.visual.simulate = lambda: replaced.append("shown")
ctx.visual.simulate()
look = artists["anna"].data["agent_data"]
ctx.visual.remove_artist("own")
pygame.event.post(pygame.event.Event(pygame.QUIT))
at_end = ctx.visual.human_input("anna", ctx.agent.get_agent("anna").get_state())

outcome = {
    "at start": at_start,
    "cameras": cameras,
    "layers": {name: artist.get_layer() for name, artist in artists.items()},
    "types": {name: artist.get_artist_type().name for name, artist in artists.items()},
    "dynamic": sorted(ctx.visual._dynamic_artists),
    "agent": [look.name, list(look.color), look.size],
    "sensor": sorted(name for name in artists["anna"].data if name == "agent_data"),
    "viewport": [round(float(value), 6) for value in ctx.visual.get_viewport()],
    "refused": refused,
    "drawn": sorted(set(drawn)),
    "pixels": pixels,
    "answers": answers,
    "waited": [bool(waiting), all(waiting), ctx.visual._simulation_time == 0],
    "replaced": replaced,
    "at end": [at_end, ctx.is_terminated()],
}
