"""Agents that are discs are drawn together, and look as if each had drawn itself."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.ir.draw import DrawSpace
from gamms.visual import Artist
from gamms.visual.artist import ArtistGroup, collect_drawn_looks, list_looks
from gamms.visual.backends.raster import paint_picture
from gamms.visual.camera import Camera
from gamms.visual.default_scene import TOGETHER
from gamms.visual.drawers import render_agent
from gamms.visual.drawing import Commands, Disc
from gamms.visual.shown_turn import MovePaths

COLUMNS = ("kind", "layer", "space", "size", "width", "angle", "color", "offsets", "points")


@pytest.fixture
def town():
    """Twenty agents of changing looks on a grid with one bend, one move after the start."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        edge = next(ctx.graph.graph.get_edges())
        ctx.graph.graph.update_edge({"id": edge, "linestring": [(0, 0), (4, 3), (10, 0)]})
        for i in range(20):
            agent = ctx.agent.create_agent(f"a{i}", start_node_id=i % 9)
            ctx.visual.set_agent_visual(f"a{i}", color=(10 * i, 200 * (i % 2), 40), size=1 + i % 3)
            agent.get_state()["action"] = next(ctx.graph.graph.get_neighbors(i % 9))
            agent.set_state()
        yield ctx


class Alone(Artist):
    """An artist that draws in its own way, so that it is never drawn with others."""

    def draw(self):
        super().draw()


def drawn(ctx, artists, share=1.0):
    return ArtistGroup(ctx, artists).draw_artists(share)


def alone(ctx):
    """The same artists, each drawn by itself."""
    artists = {}
    for name in ctx.agent.agents:
        artists[name] = Alone(ctx, render_agent, 20)
        artists[name].data = ctx.visual.artists.get(name).data
    return artists


def looks(ctx):
    return {name: ctx.visual.artists.get(name) for name in ctx.agent.agents}


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 1.0])
def test_agents_together_draw_what_each_would_draw(town, share):
    town.visual.drawing.motion.begin_turn()
    one_by_one, places = drawn(town, alone(town), share), positions(town)
    together = drawn(town, looks(town), share)
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(together, column), getattr(one_by_one, column))
    assert positions(town) == places


def positions(ctx):
    return [ctx.visual.artists.get(name).data["agent_data"].current_position for name in ctx.agent.agents]


def test_an_agent_that_cannot_be_drawn_leaves_the_others(town, caplog):
    town.visual.artists.get("a3").data["agent_data"].color = "no such color"
    assert len(drawn(town, looks(town))) == 4 * 19
    assert "a3" in caplog.text


numbers = st.floats(0.0, 12.0)
looks_of_discs = st.builds(
    Disc, numbers, numbers, st.sampled_from([(200, 0, 0), (0, 90, 0, 120)]), st.just("white"), st.just(3.0)
).filter(lambda disc: abs(disc.radius - disc.at_least_px) >= 1.0)  # else the smooth edges overlap
discs = st.lists(looks_of_discs, min_size=1, max_size=5)


@given(discs, st.lists(st.tuples(numbers, numbers), min_size=5, max_size=5))
def test_circles_below_others_are_left_out_without_a_trace(styles, places):
    pytest.importorskip("pygame")
    whole, commands = Commands(), Commands()
    commands.add_discs(places, styles, np.arange(5) % len(styles))
    frozen, camera = commands.freeze(), Camera(48, 48, -12.0, 36.0, 1.0)
    for row in range(len(frozen)):  # a text in between, so that no circle is painted with the next
        disc = styles[row // 4 % len(styles)]
        if len(disc.color) == 3 and (row % 2 == 0) == (disc.radius < disc.at_least_px):
            continue  # of an opaque disc the larger size is painted alone
        [(x, y)], color = frozen.points[[row]].tolist(), tuple(frozen.color[row].tolist())
        whole.add_circles([(x, y)], frozen.size[row], color, frozen.width[row], DrawSpace(frozen.space[row]))
        whole.add_text("", 0, 0, "black", 10)
    one, other = (paint_picture(each, camera, (255, 255, 255, 255)).pixels() for each in (frozen, whole.freeze()))
    np.testing.assert_array_equal(one, other)


points = st.tuples(st.integers(-5, 5), st.integers(-5, 5))
lines = st.lists(st.lists(points, min_size=2, max_size=5), min_size=1, max_size=4)


@given(lines, st.floats(0.0, 1.0))
def test_a_share_of_a_path_is_a_share_of_its_length(lines, share):
    from shapely import LineString

    paths = MovePaths.from_bends(np.empty((0, 2, 2)), [np.array(line, float) for line in lines])
    for row, (line, place) in enumerate(zip(lines, paths.find_points(share).tolist(), strict=True)):
        expected = LineString(line).interpolate(share, normalized=True)
        np.testing.assert_allclose(place, (expected.x, expected.y), atol=1e-9)
        so_far = paths.list_points_until(row, share, tuple(place))
        assert so_far[0] == line[0]
        np.testing.assert_allclose(so_far[-1], place, atol=1e-9)


@pytest.fixture(scope="module")
def large():
    """Two teams of 100 on a grid, after a turn in which some moved, stay stacked, or went out; and a drone."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(8, 8))
        edge = next(ctx.graph.graph.get_edges())
        ctx.graph.graph.update_edge({"id": edge, "linestring": [(0, 0), (4, 3), (10, 0)]})
        for team in ("red", "blue"):
            ctx.agent.create_team(team, [(i * i) % 64 if i < 60 else 9 + i % 2 for i in range(100)])
        ctx.agent.create_agent("drone", type="aerial", start_node_id=3, speed=2.0, team="air")
        for team in ("red", "blue"):
            ctx.game.command(team, lambda view: view.choose(np.arange(len(view.names)) % view.counts), arrays=True)
        ctx.game.step()
        ctx.agent.get_agent("red_7").alive = False
        ctx.visual.drawing.motion.begin_turn()
        yield ctx


def apart(ctx, artists):
    """The same agents, each with an artist of its own."""
    found = {}
    for name, artist in artists.items():
        for look in artist.data.get("looks", ()):
            found[look.name] = Artist(ctx, render_agent, artist.get_layer())
            found[look.name].data = {"agent_data": look}
        found.setdefault(name, artist)
    return {name: artist for name, artist in found.items() if name != TOGETHER}


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("has_default_look", [True, False])
def test_many_agents_of_the_default_look_are_drawn_as_if_each_had_an_artist(large, share, has_default_look):
    shown = large.visual.artists.list_shown()
    artists = {name: shown[name] for name in (TOGETHER, "drone")}
    assert "red_1" not in shown
    singly = apart(large, artists)
    large.visual.drawing.has_default_look = has_default_look
    bulk, each = drawn(large, artists, share), drawn(large, singly, share)
    assert len(bulk) == len(each) > 4 * 199
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(bulk, column), getattr(each, column))
    names, columns = collect_drawn_looks(artists)
    by_name = collect_drawn_looks(singly)
    assert names == by_name[0]
    assert "red_7" not in names
    np.testing.assert_array_equal(columns, by_name[1])
    assert [look.current_position for look in list_looks(artists)] == [
        look.current_position for look in list_looks(singly)
    ]


def test_an_agent_that_is_deleted_within_a_turn_is_not_drawn_with_the_others(large):
    artists = large.visual.artists.list_shown()
    before = drawn(large, {TOGETHER: artists[TOGETHER]})
    large.agent.delete_agent("blue_0")
    assert len(drawn(large, {TOGETHER: artists[TOGETHER]})) == len(before) - 4
    assert "blue_0" not in collect_drawn_looks(artists)[0]
