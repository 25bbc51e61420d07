"""Four figures as a paper needs them, as PNG and SVG: a city, a grid world, capture the flag, and a view from the air.

Give the folder to write into; without one it is `figures`.
"""

import sys
from math import cos, sin
from pathlib import Path

import numpy as np

import gamms
from gamms.agent import AgentType
from gamms.rules import capture_flag, tag, territory
from gamms.sensor import SensorType
from gamms.strategies import chase, flee, goto, mix, random_walk

WIDE, TALL = (840, 560), (660, 720)  # pixels: 7 by 4.7 and 5.5 by 6 inches
DPI = 120
BLUE, RED = (20, 80, 165), (208, 48, 40)
CENTER = (386045.0, 6672330.0)  # of Helsinki, metres in EPSG:32635


def a_city(folder):
    """The roads of a city as a graph: every junction is a node, colored by how far away it is."""
    with gamms.create_context(seed=1) as ctx:
        gamms.osm.helsinki(ctx, resolution=60.0)
        start = ctx.graph.nearest_node(*CENTER)
        ctx.visual.set_graph_visual(node_size=0.0, edge_color=(110, 114, 120))
        metres = ctx.graph.distances(source=start)
        ctx.visual.set_values(nodes=metres, name="metres")
        save(ctx, folder / "city", TALL)


def a_grid_world(folder):
    """A grid with walls, two teams, and what one of them sees."""
    with gamms.create_context(seed=3) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(9, 14))
        for i, (x0, y0, x1, y1) in enumerate([(45, 15, 45, 45), (85, 35, 85, 75), (85, 35, 105, 35), (15, 55, 35, 55)]):
            ctx.graph.add_obstacle_face(i, (x0, y0, 5), (x1, y1, 5), (x0, y0, 0), (x1, y1, 0), 1)
        ctx.visual.set_graph_visual(node_size=0.8, node_color=(140, 143, 148), edge_color=(190, 193, 198))
        ctx.visual.set_obstacle_visual(boundary_thickness=1.4, color_map={1: (70, 70, 70)})
        eyes = ctx.sensor.create_sensor("eyes", SensorType.OCCLUDED_MAP, sensor_range=42.0)
        starts = {"seeker": [(3, 3)], "hider": [(1, 7), (5, 6), (7, 11), (2, 12)]}
        for team, places in starts.items():
            for i, (row, column) in enumerate(places):
                ctx.agent.create_agent(f"{team}_{i}", start_node_id=14 * row + column, team=team)
        for agent in ctx.agent.create_iter():
            ctx.visual.set_agent_visual(agent.name, color=BLUE if agent.team == "seeker" else RED, size=2.6)
        ctx.agent.get_agent("seeker_0").register_sensor("eyes", eyes)
        eyes.sense(14 * 3 + 3)
        ctx.visual.set_sensor_visual("eyes", color=BLUE, layer=15)
        ctx.visual.add_artist("legend", gamms.visual.legend_of_teams(ctx))
        save(ctx, folder / "grid_world", WIDE)


def capture_the_flag(folder):
    """Two territories with a flag each, one of which is carried home."""
    with gamms.create_context(seed=11) as ctx:
        gamms.osm.helsinki(ctx, resolution=30.0)
        low, high = ctx.graph.columns().xy.min(axis=0), ctx.graph.columns().xy.max(axis=0)
        bases = {"red": low + (0.3, 0.2) * (high - low), "blue": low + (0.6, 0.8) * (high - low)}
        flags = {team: ctx.graph.nearest_node(*place) for team, place in bases.items()}
        for team, enemy in (("red", "blue"), ("blue", "red")):
            starts = list(ctx.graph.distances(source=flags[team], cutoff=250.0))
            for i in range(4):
                name = f"{team}_{i}"
                eyes = ctx.sensor.create_sensor(f"{name}/eyes", SensorType.AGENT_RANGE, sensor_range=90.0, team=enemy)
                attack = mix(0.9, goto(ctx, target(team, enemy)), random_walk)
                strategy = attack if i < 3 else mix(0.6, chase(ctx, otherwise=random_walk), random_walk)
                ctx.agent.create_agent(
                    name, start_node_id=starts[7 * i], team=team, sensors={"eyes": eyes}, strategy=strategy
                )
        ctx.game.add(territory.published(territory.by_distance(ctx, flags)))
        ctx.game.add(tag("red", "blue", metres=5.0, territory="territory", mutual=True, score=0))
        ctx.game.add(capture_flag(flags, territory="territory", goal=None))
        while ctx.game.turn < 300 and not is_worth_seeing(ctx):
            ctx.game.step()
        save(ctx, folder / "capture_the_flag", TALL)


def target(team, enemy):
    """A strategy's aim: the enemy's flag, then home."""

    def choose(state):
        flags = state["facts"]["flags"]
        return flags[team if flags[enemy]["carrier"] == state["name"] else enemy]["node"]

    return choose


def is_worth_seeing(ctx):
    """Whether a flag is on its way, and far from both bases."""
    for team, flag in ctx.game.facts.get("flags", {}).items():
        if flag["carrier"] is not None:
            node = ctx.agent.get_agent(flag["carrier"]).current_node_id
            home = next(one["node"] for other, one in ctx.game.facts["flags"].items() if other != team)
            if ctx.graph.distance(node, home) < 0.75 * ctx.graph.distance(flag["node"], home):
                return True
    return False


def from_the_air(folder):
    """A drone over agents on the ground: its field of view, and whom it sees there."""
    with gamms.create_context(seed=4) as ctx:
        gamms.osm.helsinki(ctx, resolution=15.0)
        camera = ctx.sensor.create_sensor("camera", SensorType.AERIAL_AGENT, sensor_range=170.0, team="runners")
        nearby = np.hypot(*(ctx.graph.columns().xy - CENTER).T) < 260.0
        nodes = ctx.graph.columns().node_ids[nearby]
        for i, node in enumerate(ctx.rng.choice(nodes, size=9, replace=False).tolist()):
            ctx.agent.create_agent(f"runner_{i}", start_node_id=node, team="runners", strategy=flee(ctx))
        drone = ctx.agent.create_agent(
            "drone", type=AgentType.AERIAL, start_node_id=ctx.graph.nearest_node(*CENTER), speed=10.0, team="drone"
        )
        drone.register_sensor("camera", camera)
        drone.position = (CENTER[0] - 60.0, CENTER[1], 90.0)
        drone.orientation = (cos(0.4), sin(0.4))
        drone.get_state()
        ctx.visual.look_at(*CENTER, 640.0)
        save(ctx, folder / "from_the_air", WIDE)


def save(ctx, path, size):
    """Save a figure in both formats."""
    for suffix in (".png", ".svg"):
        ctx.visual.save(path.with_suffix(suffix), *size, dpi=DPI, background="white", fit="tight")
    print(f"{path.stem}: {len(ctx.graph.columns().node_ids)} nodes, {len(ctx.agent.agents)} agents")


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for figure in (a_city, a_grid_world, capture_the_flag, from_the_air):
        figure(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "figures"))
