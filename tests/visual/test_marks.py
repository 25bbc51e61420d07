"""Marks of tags, outs and arrivals stand beside agents, in pixels, and say whom they are about."""

import re

import numpy as np
import pytest

import gamms
from gamms.ir.draw import DrawKind, DrawSpace
from gamms.rules import arrive, capture_flag, cooldown, discover, hold, none_left, resource, tag
from gamms.strategies import goto
from gamms.visual.artist import ArtistGroup, collect_drawn_looks, list_looks
from gamms.visual.backends.pillow_backend import decode_pixels
from gamms.visual.camera import Camera, project_to_screen
from gamms.visual.constants import Layer
from gamms.visual.drawers.marks import get_drawn_marks
from gamms.visual.labels import convert_dots

MARKS = Layer.TAGS


def staying(state):
    state["action"] = state["curr_pos"]


@pytest.fixture
def street():
    """A maker of agents on a grid of 4 x 6 nodes: name -> team and node, and a node that it goes to."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 6))

        def make(**agents):
            for name, (team, node, *target) in agents.items():
                strategy = goto(ctx, target[0]) if target else staying
                ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=strategy)
            return ctx

        yield make


def chase(street, then="eliminate"):
    """Two reds come to the node of two blues, which are tagged."""
    agents = {f"red_{number}": ("red", 1, 2) for number in range(2)} | {
        f"blue_{number}": ("blue", 2) for number in (0, 1)
    }
    ctx = street(**agents, blue_2=("blue", 14))
    ctx.game.add(tag("red", lambda agent: agent.team == "blue", then=then))
    ctx.game.run(1)
    return ctx


def rows_on(commands, layer):
    return np.flatnonzero(commands.layer == layer).tolist()


def marks(ctx):
    artists = ctx.visual.artists.list_shown()
    ArtistGroup(ctx, artists).draw_artists()
    return [mark for artist in artists.values() for mark in get_drawn_marks(artist)]


@pytest.mark.parametrize("scale", [0.5, 4.0, 40.0])
@pytest.mark.parametrize("then", ["eliminate", "respawn"])
def test_no_mark_touches_the_middle_of_a_disc(street, scale, then):
    ctx = chase(street, then)
    commands = ctx.visual.draw_commands()
    points = project_to_screen(commands, Camera(1000, 1000, 0.0, 0.0, scale))
    middles = Camera(1000, 1000, 0.0, 0.0, scale).to_screen(ctx.graph.columns().xy[[2]])
    corners = np.concatenate(
        [points[commands.offsets[row] : commands.offsets[row + 1]] for row in rows_on(commands, MARKS)]
    )
    assert np.hypot(*(corners - middles).T).min() > 6.0  # the least radius of an agent


@pytest.mark.parametrize("then", ["eliminate", lambda ctx, tagger, tagged: None], ids=["outs", "tags"])
@pytest.mark.parametrize("radius_px", [6.0, 12.0, 22.0])
def test_agents_that_share_a_node_hide_no_mark_there(street, radius_px, then):
    reds = {f"red_{number}": ("red", 2) for number in range(6)}
    ctx = street(**reds, blue_0=("blue", 2), blue_1=("blue", 14))
    ctx.game.add(tag("red", "blue", then=then))
    ctx.game.run(1)
    artists = ctx.visual.artists.list_shown()
    commands = ArtistGroup(ctx, artists).draw_artists()
    radius = next(look.size for look in list_looks(artists))
    camera = Camera(2000, 2000, 0.0, 0.0, radius_px / radius)
    points = project_to_screen(commands, camera)
    signs = [points[commands.offsets[row] : commands.offsets[row + 1]] for row in rows_on(commands, MARKS)]
    middle = np.concatenate(signs).mean(axis=0)
    dots = convert_dots(collect_drawn_looks(artists)[1], camera)
    assert (np.hypot(*(dots.centers - middle).T) > dots.radii).all()


def test_an_agent_that_passes_a_mark_covers_it(street):
    ctx = street(red_0=("red", 1, 2), blue_0=("blue", 2), red_1=("red", 14))
    ctx.game.add(tag("red", "blue", then="eliminate"))
    ctx.game.run(1)
    ctx.visual.look_at(20.0, 0.0, 20.0)
    (mark,) = marks(ctx)
    x, y = mark.current_position
    scale = 400 / 20.0  # where the mark is drawn: pixels right of the node and below it
    right, down = np.multiply(mark.shift, mark.least_px)
    place = round(200 + (x - 20.0) * scale + right), round(200 - y * scale + down)
    ctx.visual.add_artist(
        "passer", {"shape": gamms.visual.Shape.Circle, "x": 20.0, "y": 0.0, "radius": 5.0, "layer": 20}
    )
    pixels = ctx.visual.frame(400, 400, labels=False, legend=False)
    assert pixels[place[::-1]].tolist() == [0, 0, 0]


@pytest.mark.parametrize("then", ["eliminate", "respawn"])
def test_a_mark_has_the_color_of_the_agent_that_it_is_about(street, then):
    ctx = chase(street, then)
    assert {mark.color[:3] for mark in marks(ctx)} == {ctx.visual.drawing.group_colors()["blue"][:3]}


def test_who_is_out_has_one_mark_and_not_that_of_a_tag_besides(street):
    ctx = chase(street)
    words = re.findall(r">([^<>]+)</text>", ctx.visual.picture(".svg").decode())
    assert "out" in words
    assert "tagged" not in words
    assert len(marks(ctx)) == 2


def test_a_victim_of_an_earlier_turn_is_still_marked(street):
    ctx = street(red_0=("red", 1, 5), blue_0=("blue", 2), blue_1=("blue", 4))
    ctx.game.add(tag("red", "blue", then="eliminate"))
    ctx.game.run(9)
    assert [(mark.name, round(mark.current_position[0], -1)) for mark in marks(ctx)] == [("blue_0", 20), ("blue_1", 40)]


def home(street):
    ctx = street(robot_0=("robots", 0, 3), robot_1=("robots", 5, 3), thief=("thieves", 6, 7), guard=("guards", 7))
    ctx.game.add(arrive("robots", 3))
    ctx.game.add(tag("guards", "thieves", then="eliminate"))
    ctx.game.add(none_left("robots", winner="robots"))
    return ctx


def test_an_arrival_is_a_tick_and_explained_as_one(street):
    ctx = home(street)
    result = ctx.game.run(9)
    shapes = {len(corners) for corners in corners_of_marks(ctx)}
    assert {mark.name for mark in marks(ctx)} == {"robot_0", "robot_1", "thief"}
    assert shapes == {4, 6}  # ticks and a cross
    words = re.findall(r">([^<>]+)</text>", ctx.visual.picture(".svg", captions=True).decode())
    assert {"arrived", "out"} <= set(words)
    assert "robot_0 arrives at node 3" in words
    assert result.reason == "all agents of robots arrived or were eliminated"


def corners_of_marks(ctx):
    commands = ctx.visual.draw_commands()
    return [commands.points[commands.offsets[row] + 1 : commands.offsets[row + 1]] for row in rows_on(commands, MARKS)]


RULES = {
    "tags": lambda ctx: tag("red", "blue"),
    "outs": lambda ctx: tag("red", "blue", then="eliminate"),
    "flags": lambda ctx: capture_flag({"red": 0, "blue": 23}),
    "places": lambda ctx: hold([4, 5], 4),
    "nodes": lambda ctx: discover([1, 7]),
    "bars": lambda ctx: resource("fuel", 40, per_turn=10),
    "arcs": lambda ctx: cooldown("shout", 3),
}


@pytest.mark.parametrize("name", RULES)
def test_signs_of_rules_have_sizes_in_pixels(street, name):
    ctx = street(red_0=("red", 1, 2), blue_0=("blue", 2), red_1=("red", 4))
    ctx.game.deeds = {"shout": None}
    shout = lambda state: state.update(action={"node_id": state["curr_pos"], "do": {"shout": None}})
    ctx.agent.get_agent("red_1").register_strategy(shout)
    ctx.game.add(RULES[name](ctx))
    ctx.game.step()
    commands = ctx.visual.draw_commands()
    of_rules = np.isin(commands.layer, (Layer.GOALS, Layer.FLAGS, Layer.TAGS))
    assert of_rules.any()
    assert set(commands.space[of_rules].tolist()) == {DrawSpace.SCREEN}
    assert DrawKind.LINE not in commands.kind[of_rules]


@pytest.mark.parametrize("name", RULES)
def test_a_frame_shows_signs_as_a_picture_does(street, name):
    ctx = street(red_0=("red", 1, 2), blue_0=("blue", 2), red_1=("red", 4))
    ctx.game.deeds = {"shout": None}
    ctx.game.add(RULES[name](ctx))
    ctx.game.step()
    assert (ctx.visual.frame(500, 400) == decode_pixels(ctx.visual.picture(".png", 500, 400))).all()
