"""The default look is made again when what it depends on has changed, and only then."""

import gamms
from gamms.sensor import SensorType
from gamms.visual.default_scene import DefaultScene
from gamms.visual.themes import THEMES


def test_as_long_as_nothing_changes_the_artists_are_the_same(ctx):
    ctx.sensor.get_sensor("spy").sense(0)
    usual = DefaultScene(ctx, THEMES["light"])
    first = usual.list_artists({})
    assert list(first) == ["graph", "obstacles", "red_0", "blue_0", "sensor_spy", "rings", "tags", "legend"]
    assert usual.list_artists({}) == first


def test_a_street_that_comes_changes_the_map_and_no_agent(ctx):
    usual = DefaultScene(ctx, THEMES["light"])
    first = usual.list_artists({})
    ctx.graph.graph.add_edge({"id": 9, "source": 2, "target": 1, "length": 11})
    second = usual.list_artists({})
    assert second["graph"] is not first["graph"]
    assert second["red_0"] is first["red_0"]


def test_obstacles_are_drawn_as_soon_as_there_are_some(ctx):
    usual = DefaultScene(ctx, THEMES["light"])
    ctx.graph.remove_obstacle_face(0)
    assert "obstacles" not in usual.list_artists({})
    ctx.graph.add_obstacle_face(1, (4, 3, 9), (2, 3, 9), (4, 3, 0), (2, 3, 0), 1)
    assert "obstacles" in usual.list_artists({})


def test_who_changes_sides_changes_color(ctx):
    usual = DefaultScene(ctx, THEMES["light"])
    first = usual.list_artists({})["red_0"].data["agent_data"].color
    ctx.agent.get_agent("red_0").team = "green"
    assert usual.list_artists({})["red_0"].data["agent_data"].color != first


def test_agents_come_and_go(ctx):
    usual = DefaultScene(ctx, THEMES["light"])
    ctx.agent.delete_agent("red_0")
    ctx.agent.create_agent("new", start_node_id=0)
    assert [name for name in usual.list_artists({}) if name in ("red_0", "blue_0", "new")] == ["blue_0", "new"]


def test_the_default_look_of_an_empty_world_is_no_error():
    with gamms.create_context() as ctx:
        assert list(DefaultScene(ctx, THEMES["light"]).list_artists({})) == ["graph", "tags", "legend"]
        ctx.sensor.create_sensor("eye", SensorType.MAP)
        assert len(ctx.visual.draw_commands()) == 0
