"""Pictures of the present state: what is drawn, in which order, where the camera looks, what is written."""

import logging
from xml.etree import ElementTree as ET

import pytest

import gamms
from gamms.errors import BadType, BadValue, TooLarge
from gamms.limits import allowing
from gamms.visual.appearance import TEAM_COLORS

SVG = "{http://www.w3.org/2000/svg}"


def dot(layer):
    """An artist's dict that draws one dot."""
    return {"drawer": lambda ctx, data: ctx.visual.render_circle(1, 2, 1), "layer": layer}


def test_artists_are_painted_by_layer_then_in_the_order_of_their_declaration(ctx):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    ctx.visual.set_agent_visual("red_0")
    for name, layer in (("top", 90), ("low", 1), ("high", 50), ("high too", 50)):
        ctx.visual.add_artist(name, dot(layer))
    assert ctx.visual.draw_commands().layer.tolist() == [1, 20, 20, 20, 20, 50, 50, 90]


def test_an_invisible_artist_is_not_drawn(ctx):
    ctx.visual.set_graph_visual().set_visible(False)
    assert len(ctx.visual.draw_commands()) == 0


def test_a_drawer_that_fails_is_logged_with_its_name_and_the_others_draw_on(ctx, caplog):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    ctx.visual.add_artist("broken", {"drawer": lambda ctx, data: data["colour"]})
    ctx.visual.add_artist("dot", dot(90))
    assert len(ctx.visual.draw_commands()) == 1
    assert [record.levelno for record in caplog.records] == [logging.ERROR]
    assert "'broken' could not be drawn: KeyError: 'colour'" in caplog.text


def test_an_unknown_agent_is_warned_about_once_and_drawn_when_it_exists(ctx, caplog):
    ctx.visual.set_graph_visual().set_visible(False)
    ctx.visual.set_agent_visual("comes_later")
    assert len(ctx.visual.draw_commands()) == 0
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    ctx.agent.create_agent("comes_later", start_node_id=0)
    assert len(ctx.visual.draw_commands()) > 0
    assert len(caplog.records) == 1


def test_a_wrong_name_that_is_declared_before_any_agent_is_warned_about_in_the_first_drawing(caplog):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        ctx.visual.set_agent_visual("rad_0")
        assert not caplog.records
        ctx.agent.create_agent("red_0", start_node_id=0)
        ctx.visual.draw_commands()
        ctx.visual.draw_commands()
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "Unknown agent 'rad_0'. Did you mean 'red_0'?" in caplog.text


def test_a_bad_coordinate_is_an_error_of_the_artist_that_gave_it(ctx, caplog):
    ctx.visual.set_graph_visual().set_visible(False)
    ctx.visual.add_artist("lost", {"x": float("nan"), "y": 0, "radius": 1})
    assert len(ctx.visual.draw_commands()) == 0
    assert "'lost' could not be drawn: BadValue" in caplog.text


def test_where_nothing_was_declared_streets_and_teams_are_drawn_below_the_users_artists(ctx):
    ctx.visual.add_artist("flag", dot(90))
    commands = ctx.visual.draw_commands()
    assert set(commands.layer.tolist()) == {5, 10, 20, 90}
    colors = {tuple(color) for color in commands.color[commands.layer == 20, :3].tolist()}
    assert colors == {*TEAM_COLORS[:2], (255, 255, 255)}


def test_drawing_twice_gives_the_same_file(ctx, tmp_path):
    ctx.visual.save(tmp_path / "one.svg")
    ctx.visual.save(str(tmp_path / "two.svg"))
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.svg", "two.svg"]


def test_an_empty_scenario_gives_an_empty_picture(ctx, tmp_path):
    ctx.visual.set_graph_visual().set_visible(False)
    ctx.visual.save(tmp_path / "a.svg")
    assert ET.parse(tmp_path / "a.svg").getroot().find(f"{SVG}rect") is not None


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        (("a.svg", 0, 10), BadValue, "positive width and height, not 0 x 10"),
        (("a.svg", 10, -1), BadValue, "positive"),
        (("a.svg", 10.5, 10), BadType, "width"),
        (("a.png", float("nan"), 10), BadType, "width"),
        (("a.png", 40_000, 40_000), TooLarge, "picture of 40000 x 40000 pixels would take about 29.8 GiB"),
        (("a.png", 1, 10**9), BadValue, "at most 65535 pixels"),
        (("a.bmp",), BadValue, r"as '\.bmp': use \.svg, \.png, \.pdf\. For a film use ctx\.visual\.film"),
        (("picture",), BadValue, "as 'picture': use .svg"),
        (("no/folder/a.svg",), FileNotFoundError, "Create it first"),
    ],
)
def test_an_impossible_picture_is_refused_and_nothing_is_written(ctx, tmp_path, arguments, error, words):
    name, *size = arguments
    with pytest.raises(error, match=words):
        ctx.visual.save(tmp_path / name, *size)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("dpi", [0, -96, float("nan"), float("inf"), 10_001, 10**9])
def test_an_impossible_dpi_is_refused(ctx, dpi):
    with pytest.raises(BadValue, match="dpi"):
        ctx.visual.picture(".png", 64, 48, dpi=dpi)


def test_more_memory_may_be_allowed_for_a_picture(ctx):
    with allowing(1000), pytest.raises(TooLarge):
        ctx.visual.picture(".svg", 10, 10)
    with allowing(2000):
        ctx.visual.picture(".svg", 10, 10)


def test_a_failed_save_keeps_the_old_picture(ctx, tmp_path):
    path = tmp_path / "a.svg"
    path.write_text("old")
    with pytest.raises(BadType):
        ctx.visual.save(path, background=7)
    assert path.read_text() == "old"


def test_an_svg_leaves_out_invisible_shapes(ctx, tmp_path):
    ctx.visual.look_at(10, 10, 2.0)
    ctx.visual.save(tmp_path / "near.svg", 300, 200)
    ctx.visual.look_at_all()
    ctx.visual.save(tmp_path / "all.svg", 300, 200)
    near, all = ((tmp_path / name).read_text() for name in ("near.svg", "all.svg"))
    assert near.count("<circle") < all.count("<circle")


def test_a_note_of_a_million_letters_is_written_as_far_as_there_is_room(ctx):
    same = [ctx.visual.frame(300, 200, note="a" * count, title="b" * count) for count in (3_000, 1_000_000)]
    assert (same[0] == same[1]).all()
    assert (same[0] != ctx.visual.frame(300, 200)).any()
