"""The engine without a window: takes every call, shows nothing, keeps what was declared."""

import logging

import pytest

from gamms.errors import BadType, ContextTerminated
from gamms.typing import IVisualizationEngine
from gamms.visual import AgentData, Artist, Color, GraphData, NoEngine, Shape
from gamms.visual.drawers import render_circle


def draw_nothing(ctx, data):
    """Draw nothing."""


def test_it_is_an_engine_and_swallows_options_of_others(ctx):
    assert isinstance(NoEngine(ctx, width=1980, height=1080, anything=1), IVisualizationEngine)


def test_declared_visuals_carry_their_data(ctx):
    assert ctx.visual.set_graph_visual(node_size=3).data["graph_data"] == GraphData(Color.DarkGray, 3)
    agent = ctx.visual.set_agent_visual("a", color=(255, 0, 0), image_path="a.png").data
    assert agent == {"agent_data": AgentData("a", (255, 0, 0), 8.0, "a.png"), "_alpha": 1.0}
    assert ctx.visual.set_sensor_visual("s", layer=31).get_layer() == 31


def test_a_dict_becomes_the_data_of_a_new_artist(ctx):
    data = {"drawer": draw_nothing, "layer": 12, "x": 1}
    artist = ctx.visual.add_artist("one", data)
    assert (artist.get_drawer(), artist.get_layer()) == (draw_nothing, 12)
    assert artist.data is data


def test_a_dict_without_a_drawer_is_a_shape_on_layer_30(ctx):
    circle = ctx.visual.add_artist("one", {"x": 1, "y": 1, "radius": 1})
    assert (circle.get_drawer(), circle.get_layer()) == (render_circle, 30)
    box = ctx.visual.add_artist("two", {"shape": Shape.Rectangle})
    assert box.get_drawer() is not render_circle


def test_an_invalid_artist_is_refused(ctx):
    with pytest.raises(BadType, match="must be an Artist or a dict"):
        ctx.visual.add_artist("one", draw_nothing)


def test_removing_a_missing_artist_only_warns(ctx, caplog):
    ctx.visual.remove_artist("ghost")
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "ghost" in caplog.text


def test_a_time_that_is_none_is_refused(ctx):
    for seconds in ("a", -1):
        with pytest.raises((TypeError, ValueError), match=r"ctx\.visual\.turn_seconds must"):
            ctx.visual.turn_seconds = seconds


def test_showing_does_nothing(ctx):
    assert ctx.visual.simulate() is None
    assert ctx.visual.update() is None
    assert ctx.visual.get_viewport() is None
    assert ctx.visual.terminate() is None


def test_simulate_can_be_replaced_on_the_instance(ctx):
    ctx.visual.simulate = lambda: "mine"
    assert ctx.visual.simulate() == "mine"


def test_a_person_who_is_not_there_stays(ctx):
    assert ctx.visual.human_input("a", {"curr_pos": 7}) == 7
    assert ctx.visual.human_input("a", {"curr_pos": (1.0, 2.0, 3.0)}) == (0.0, 0.0, 0.0)


def test_after_the_end_nothing_is_kept_and_nothing_is_drawn(ctx, tmp_path):
    ctx.visual.add_artist("kept", {"drawer": draw_nothing})
    ctx.terminate()
    assert isinstance(ctx.visual.set_graph_visual(), Artist)
    assert isinstance(ctx.visual.set_agent_visual("a"), Artist)
    assert isinstance(ctx.visual.add_artist("late", {"drawer": draw_nothing}), Artist)
    ctx.visual.remove_artist("kept")
    ctx.visual.remove_artist("ghost")
    assert list(ctx.visual.artists.declared) == ["kept"]
    with pytest.raises(ContextTerminated):
        ctx.visual.save(tmp_path / "late.svg")
