"""Values of nodes and edges: colours in order, a legend that explains them, and bad values named."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.draw import DrawKind
from gamms.visual.appearance import DIVERGING, LEVELS, find_color_table, find_levels
from gamms.visual.legend import ColorScale, LegendRows


def lightness(colors):
    """How light each colour looks, by CIE 1931: the third root of its luminance."""
    parts = np.array(colors) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return np.cbrt(linear @ (0.2126, 0.7152, 0.0722))


def discs(ctx):
    """Colour -> the centres of the discs of values, which lie on layer 13."""
    commands, found = ctx.visual.draw_commands(), {}
    for row in np.flatnonzero((commands.layer == 13) & (commands.kind == DrawKind.CIRCLE)).tolist():
        found.setdefault(tuple(commands.color[row, :3].tolist()), set()).add(
            tuple(commands.points[commands.offsets[row]])
        )
    return found


@pytest.mark.parametrize("name", ["viridis", "magma", "cividis"])
def test_a_map_grows_lighter_in_even_steps(name):
    steps = np.diff(lightness(find_color_table(name)[::15]))
    assert (steps > 0).all()
    assert steps[2:].max() < 2 * steps[2:].min()  # screens show no steps in what is almost black


def test_the_diverging_map_is_lightest_in_the_middle_and_alike_on_both_sides():
    light = lightness(find_color_table(DIVERGING))
    assert (np.diff(light[: LEVELS // 2]) > 0).all()
    assert (np.diff(light[LEVELS // 2 :]) < 0).all()
    assert np.abs(light - light[::-1]).max() < 0.05


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=20), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_larger_values_never_have_lower_colors(values, one, other):
    low, high = min(one, other), max(one, other)
    found = find_levels(np.sort(values), low, high)
    assert (np.diff(found) >= 0).all()
    assert found.min() >= 0
    assert found.max() < LEVELS


def test_each_node_has_the_color_of_its_value_and_nan_has_none(ctx):
    ctx.visual.set_values(nodes={0: 1.0, 1: math.nan, 2: 3.0})
    colors = find_color_table("viridis")
    assert discs(ctx) == {colors[0]: {(0.0, 0.0)}, colors[-1]: {(10.0, 10.0)}}


def test_edges_are_drawn_along_their_streets_with_the_highest_value_on_top(ctx):
    ctx.visual.set_values(edges={2: 5, 0: 9, 1: 7}, cmap="magma")
    commands = ctx.visual.draw_commands()
    rows = np.flatnonzero((commands.layer == 13) & (commands.kind == DrawKind.LINE))
    assert np.diff(commands.offsets)[rows].tolist() == [3, 3, 2, 2, 2, 2]  # the bend first
    assert tuple(commands.color[rows[-1], :3]) == find_color_table("magma")[-1]


def test_values_beyond_vmin_and_vmax_have_the_colors_of_the_ends(ctx):
    ctx.visual.set_values(nodes={0: -50, 1: math.inf, 2: 0.5}, vmin=0, vmax=1)
    colors = find_color_table("viridis")
    assert discs(ctx) == {colors[0]: {(0, 0)}, colors[-1]: {(10, 0)}, colors[128]: {(10, 10)}}


def test_the_diverging_map_is_palest_at_zero(ctx):
    ctx.visual.set_values(nodes={0: -1, 1: 0, 2: 4}, cmap="diverging")
    assert discs(ctx)[find_color_table("diverging")[128]] == {(10.0, 0.0)}


def test_a_function_may_say_the_colors(ctx):
    artist = ctx.visual.set_values(nodes={0: 1, 1: 2, 2: 1}, cmap=lambda value: "red" if value > 1 else (0, 0, 9))
    assert discs(ctx) == {(255, 0, 0): {(10.0, 0.0)}, (0, 0, 9): {(0.0, 0.0), (10.0, 10.0)}}
    assert [row.name for row in artist.data["legend"].rows] == ["1", "2"]


def test_a_function_of_many_values_is_explained_by_a_bar(ctx):
    ctx.graph.add_nodes(range(3, 40), x=np.arange(37.0), y=np.zeros(37))
    artist = ctx.visual.set_values(nodes={id: id for id in range(40)}, cmap=lambda value: (value, 0, 0))
    bar = artist.data["legend"]
    assert isinstance(bar, ColorScale)
    assert (bar.low, bar.high, bar.colors[0], bar.colors[-1]) == ("0", "39", (0, 0, 0), (39, 0, 0))


def test_a_second_call_replaces_and_none_removes(ctx):
    ctx.visual.set_values(nodes={0: 1.0})
    ctx.visual.set_values(nodes={2: 1.0})
    assert list(discs(ctx).values()) == [{(10.0, 10.0)}]
    assert ctx.visual.set_values(nodes=None) is None
    assert discs(ctx) == {}


def test_two_names_are_shown_side_by_side(ctx):
    ctx.visual.set_values(nodes={0: 1, 1: 2}, name="heat")
    ctx.visual.set_values(nodes={2: 1}, name="cold")
    assert sum(map(len, discs(ctx).values())) == 3


def test_equal_values_are_explained_by_one_row(ctx):
    artist = ctx.visual.set_values(nodes={0: 2.5, 1: 2.5})
    assert isinstance(artist.data["legend"], LegendRows)
    assert [row.name for row in artist.data["legend"].rows] == ["2.5"]


def test_a_node_that_is_gone_is_left_out(ctx):
    ctx.visual.set_values(nodes={0: 1, 2: 1})
    ctx.agent.delete_agent("blue_0")
    ctx.graph.graph.remove_node(2)
    assert list(discs(ctx).values()) == [{(0.0, 0.0)}]


@pytest.mark.parametrize(
    ("given", "error", "hint"),
    [
        ({"nodes": {7: 1.0}}, UnknownName, "node 7"),
        ({"edges": {7: 1.0}}, UnknownName, "edge 7"),
        ({"nodes": {0: 1}, "cmap": "virids"}, UnknownName, "Did you mean 'viridis'"),
        ({"nodes": {0: "high"}}, BadType, "'high'"),
        ({"nodes": {0: True}}, BadType, "True"),
        ({"nodes": {"a": 1}}, BadType, "'a'"),
        ({"nodes": [1.0]}, BadType, "mapping"),
        ({"nodes": {0: 1}, "edges": {0: 1}}, BadValue, "another name"),
        ({"nodes": {0: 1}, "vmin": 2, "vmax": 1}, BadValue, "vmin below vmax"),
        ({"nodes": {0: 1}, "cmap": lambda _: "no color"}, BadValue, "no color"),
    ],
)
def test_a_bad_call_is_named_and_changes_nothing(ctx, given, error, hint):
    ctx.visual.set_values(nodes={0: 1.0})
    with pytest.raises(error, match=hint):
        ctx.visual.set_values(**given)
    assert list(discs(ctx).values()) == [{(0.0, 0.0)}]


def test_nothing_but_nan_is_no_error(ctx):
    assert ctx.visual.set_values(nodes={0: math.nan}).data["legend"] is None
    assert discs(ctx) == {}
