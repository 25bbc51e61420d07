"""Legends: beside the map, the same in every format, and declared by drawers."""

import numpy as np
import PIL.Image
import pytest

import gamms
from gamms.errors import BadType
from gamms.ir.draw import DrawKind
from gamms.visual.camera import Camera
from gamms.visual.legend import Legend, LegendRow, LegendRows, grow_blocks, make_block, make_plain_block, merge_blocks
from gamms.visual.page import Page, PageStyle

FIRE = LegendRows("", (LegendRow((200, 0, 0), "fire", "3"),))


def test_the_map_leaves_room_for_the_legend(ctx):
    ctx.visual.set_graph_visual(node_size=0.1, edge_color=(1, 2, 3))
    wide = (np.abs(ctx.visual.frame(640, 640).astype(int) - (1, 2, 3)).max(axis=2) < 8).any(axis=0)
    ctx.visual.set_values(nodes={0: 0, 1: 1})
    slim = (np.abs(ctx.visual.frame(640, 640).astype(int) - (1, 2, 3)).max(axis=2) < 8).any(axis=0)
    assert np.flatnonzero(wide).max() > np.flatnonzero(slim).max()


def test_the_legend_stands_beside_a_chosen_view(ctx, tmp_path):
    ctx.visual.look_at(5.0, 0.0, 6.0)  # streets reach the edges of the picture
    column = {}
    for has_legend in (True, False):
        file = tmp_path / f"{has_legend}.png"
        ctx.visual.save(file, 600, 400, labels=False, legend=has_legend, scale_bar=False)
        with PIL.Image.open(file) as image:
            column[has_legend] = np.asarray(image.convert("RGB"))[:, -4:].reshape(-1, 3)
    assert len(np.unique(column[True], axis=0)) == 1
    assert len(np.unique(column[False], axis=0)) > 1


def test_something_else_than_a_legend_is_refused(ctx):
    ctx.visual.add_artist("own", {"drawer": lambda *_: None, "legend": "fire"})
    with pytest.raises(BadType, match="artist 'own'"):
        ctx.visual.frame(320, 200)


def test_a_small_picture_has_no_legend(ctx):
    before = ctx.visual.frame(60, 40)
    ctx.visual.add_artist("own", {"drawer": lambda *_: None, "legend": FIRE})
    assert (ctx.visual.frame(60, 40) == before).all()


def test_rows_of_a_legend_beyond_the_limit_are_counted():
    rows = LegendRows("", tuple(LegendRow((0, 0, 0), f"team {number}") for number in range(40)))
    commands = Page(1280, 720, (rows,), PageStyle()).make_commands(Camera(1280, 720, 0.0, 0.0, 1.0))
    assert commands.text[-1] == "and 29 more"


# -- what signs mean --------------------------------------------------------------------------------------------

TEAMS = LegendRows("", (LegendRow((200, 0, 0), "red", "0"), LegendRow((0, 0, 200), "blue", "12")), "score")
FLAG, TAGGED = (
    LegendRows("", (LegendRow((9, 9, 9), "flag", sign="flag"),)),
    LegendRows("", (LegendRow((9, 9, 9), "tagged", sign="cross"),)),
)
TURN = LegendRows("turn 3", ())


def texts(*blocks, width=640, height=400):
    return Page(width, height, blocks, PageStyle()).make_commands(Camera(width, height, 0.0, 0.0, 1.0)).text


def test_rows_without_a_title_are_one_block_in_which_nothing_is_said_twice():
    assert merge_blocks([TURN, TEAMS, FIRE, FLAG, FLAG]) == (
        TURN,
        LegendRows("", TEAMS.rows + FLAG.rows, "score"),
        FIRE,
    )


def test_in_a_film_no_row_of_the_legend_moves():
    first = merge_blocks([TEAMS, FLAG])
    scored = LegendRows("", (LegendRow((200, 0, 0), "red", "1"), TEAMS.rows[1]), "score")
    second = grow_blocks(first, merge_blocks([TURN, scored, TAGGED]))
    assert second == (TURN, LegendRows("", scored.rows + FLAG.rows + TAGGED.rows, "score"))
    assert grow_blocks(second, (FIRE,)) == (FIRE, *second[1:])
    assert grow_blocks((), first) == first


def test_scores_have_a_heading_and_zero_is_a_score():
    assert texts(TEAMS) == ("", "score", "", "", "red", "0", "", "", "blue", "12")


def test_a_picture_too_small_for_signs_still_explains_colours():
    signs = LegendRows("", (LegendRow((9, 9, 9), "a sign with a rather long explanation", sign="ring"),))
    assert "red" in texts(TEAMS, signs, width=300)
    assert "a sign with a rather long explanation" not in texts(TEAMS, signs, width=300)


SIGNS = LegendRows(
    "", tuple(LegendRow((9, 9, 9), f"a {sign} of theirs", sign=sign) for sign in ("dot", "field", "band", "flag"))
)


def test_where_rows_have_no_room_letters_become_smaller_and_then_the_signs_go():
    many = merge_blocks([TEAMS, SIGNS])
    whole, colors = Legend(many, 900, 400), Legend((TEAMS,), 900, 400)
    smaller = Legend(many, 900, 0.8 * whole.height)
    assert (smaller.width, smaller.height) == pytest.approx((0.8 * whole.width, 0.8 * whole.height))
    without = Legend(many, 900, 0.6 * whole.height)
    assert (without.width, without.height) == (colors.width, colors.height)
    assert Legend(many, 900, 0.6 * colors.height).height == 0.0


def test_a_long_legend_does_not_cover_the_space_below_the_map(ctx):
    rows = LegendRows("", tuple(LegendRow((9, 9, 9), f"sign {number}", sign="ring") for number in range(9)))
    page = Page(400, 300, (TEAMS, rows), PageStyle(title="a title", note="a note", has_captions=True))
    _, top, _, bottom = page._margins
    assert page.legend.width > 0.0
    assert page.legend.height <= 300 - top - bottom


@pytest.mark.parametrize("sign", ["disc", "ring", "dot", "field", "line", "band", "flag", "cross", "unheard of"])
def test_each_sign_is_drawn_in_its_colour(sign):
    commands = Page(640, 400, (LegendRows("", (LegendRow((1, 2, 3), "it", sign=sign),)),), PageStyle()).make_commands(
        Camera(640, 400, 0.0, 0.0, 1.0)
    )
    assert (commands.color[commands.kind != DrawKind.TEXT, :3] == (1, 2, 3)).all(axis=1).any()


def test_a_recorded_legend_is_the_same_block():
    for block in (TEAMS, FLAG, FIRE, TURN):
        assert make_block(make_plain_block(block)) == block


def test_a_sensor_that_no_agent_carries_is_explained(ctx):
    eyes = ctx.sensor.create_sensor("eyes", gamms.sensor.SensorType.RANGE, sensor_range=8.0)
    eyes.sense(0)
    assert ">sensor of no agent<" in ctx.visual.picture(".svg").decode()
