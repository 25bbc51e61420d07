"""Drawing primitives: commands while a picture is drawn, nothing at any other time."""

import inspect

import pytest

from gamms.ir.draw import DrawKind
from gamms.typing import IVisualizationEngine
from gamms.visual import NoEngine

CALLS = {
    "render_text": ("hello", 1, 2),
    "render_rectangle": (0, 0, 10, 20),
    "render_circle": (1, 2, 3),
    "render_line": (0, 0, 1, 1),
    "render_linestring": ([(0, 0), (1, 1)],),
    "render_polygon": ([(0, 0), (1, 1), (1, 0)],),
    "render_lines": ([(0, 0), (1, 1)], [0, 2]),
    "render_circles": ([(0, 0), (1, 1)], 2),
    "render_image": (0, 0, __file__, 5),
    "render_layer": (1,),
    "create_layer": (1,),
    "clear_layer": (1,),
    "fill_layer": (1,),
}


@pytest.mark.parametrize("name", CALLS)
def test_outside_a_picture_a_primitive_does_nothing(ctx, name):
    assert getattr(ctx.visual if name.endswith("_layer") else ctx.visual.drawing, name)(*CALLS[name]) is None


def drawn(ctx, draw):
    """The commands of one drawer."""
    ctx.visual.set_graph_visual().set_visible(False)
    ctx.visual.add_artist("mine", {"drawer": draw})
    return ctx.visual.draw_commands()


@pytest.mark.parametrize("name", [name for name in CALLS if name.startswith("render_") and name != "render_layer"])
def test_inside_a_picture_a_primitive_is_a_command(ctx, name):
    commands = drawn(ctx, lambda ctx, data: getattr(ctx.visual.drawing, name)(*CALLS[name]))
    assert len(commands) == (2 if name == "render_circles" else 1)
    assert commands.layer.tolist() == [30] * len(commands)


@pytest.mark.parametrize("name", [name for name in vars(IVisualizationEngine) if name.startswith("render_")])
def test_signatures_are_those_of_the_contract(name):
    def shape(engine):
        parameters = inspect.signature(getattr(engine, name)).parameters.values()
        return [(one.name, one.default, one.kind) for one in parameters]

    assert shape(NoEngine) == shape(IVisualizationEngine)


def test_a_closed_linestring_returns_to_its_start(ctx):
    corners = [(0, 0), (1, 0), (1, 1)]
    commands = drawn(ctx, lambda ctx, data: ctx.visual.render_linestring(corners, closed=True))
    assert commands.kind.tolist() == [DrawKind.LINE]
    assert commands.points.tolist() == [[0, 0], [1, 0], [1, 1], [0, 0]]


def test_text_is_36_pixels_high_unless_said_otherwise(ctx):
    def draw(ctx, data):
        ctx.visual.render_text("a", 0, 0)
        ctx.visual.render_text("b", 0, 0, font_size=12)

    assert drawn(ctx, draw).size.tolist() == [36, 12]


def test_an_image_that_is_missing_is_logged(ctx, caplog):
    assert len(drawn(ctx, lambda ctx, data: ctx.visual.render_image(0, 0, "no/such.png", 5))) == 0
    assert "no/such.png" in caplog.text
