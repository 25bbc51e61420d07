"""The nodes that agents of a batch see are those that the sensors show them in a game that is played alone."""

import numpy as np
import pytest
from batch_scenes import scene

import gamms
from gamms.errors import BadValue, TooLarge, UnknownName
from gamms.game.block import sensing
from gamms.sensor.ground import MapSensor


def with_eyes(ctx, kind, keywords, name="eye"):
    """Let the red agents carry a sensor, on a map with a wall."""
    if name == "eye":
        ctx.agent.get_agent("red_2").orientation = (3.0, 4.0)
        ctx.graph.add_obstacle_face(0, tr=(33, 14, 8), tl=(5, 12, 8), br=(33, 14, 0), bl=(5, 12, 0), type=14)
    for agent in ctx.agent.agents.values():
        if agent.team == "red":
            agent.register_sensor(name, ctx.sensor.create_sensor(f"{agent.name}/{name}", kind, **keywords))


def test_all_sensors_together_show_each_node_once():
    with scene().build(seed=1) as ctx:
        with_eyes(ctx, "RANGE", {"sensor_range": 20.0})
        with_eyes(ctx, "NEIGHBOR", {}, "next")
        with ctx.game.batch(3) as games:
            view = games.observe("red")
            assert (view.seen_nodes().mask == view.seen_nodes("eye").mask).all()
            assert len(view.seen_nodes().at) == len(view.seen_nodes("eye").at) > len(view.seen_nodes("next").at)
            some = view.only(np.array([[False, False, True]] * 3))
            assert set(some.seen_nodes().viewers.tolist()) == {2}
            assert not len(games.observe("blue").seen_nodes().at)
            with pytest.raises(UnknownName, match="'eyes'"):
                view.seen_nodes("eyes")


def test_sensors_without_an_array_form_are_named():
    class Mine(MapSensor):
        pass

    with scene().build(seed=1) as ctx:
        ctx.agent.get_agent("red_1").register_sensor("mine", Mine(ctx, "mine", gamms.sensor.SensorType.RANGE, 5.0))
        with ctx.game.batch(2) as games, pytest.raises(BadValue, match="a class of its own"):
            games.observe("red").seen_nodes("mine")


def test_more_nodes_than_arrays_hold_are_refused(monkeypatch):
    with scene().build(seed=1) as ctx:
        with_eyes(ctx, "RANGE", {"sensor_range": 20.0})
        with ctx.game.batch(4) as games:
            monkeypatch.setattr(sensing, "_MOST_PAIRS", 10)
            with pytest.raises(TooLarge, match="Ask for fewer games"):
                games.observe("red").seen_nodes()
