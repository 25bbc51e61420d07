"""The buildings, parks, water and rails of the map of Helsinki are drawn by default, and are no obstacles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.ir.draw import DrawSpace
from gamms.ir.packing import Decoder
from gamms.ir.scenery import find_ground
from gamms.limits import MemoryBudget
from gamms.strategies import stay
from gamms.visual.constants import Layer
from gamms.visual.themes import THEMES
from gamms.web.columns import encode_drawn_map


@pytest.fixture
def helsinki():
    with gamms.create_context(seed=1) as ctx:
        gamms.osm.helsinki(ctx)
        yield ctx


def polygons(ctx):
    from gamms.ir.draw import DrawKind

    commands = ctx.visual.draw_commands()
    return int((commands.kind == DrawKind.POLYGON).sum())


def test_buildings_are_drawn_and_hide_nothing(helsinki):
    assert len(helsinki.graph.obstacle_columns().ids) == 0
    assert list(helsinki.graph.get_obstacle_faces()) == []
    assert polygons(helsinki) > 400
    low, high = helsinki.graph.columns().xy.min(axis=0), helsinki.graph.columns().xy.max(axis=0)
    assert helsinki.graph.visible([*low, 1.0], [[*high, 1.0]]).all()


@pytest.mark.parametrize("buildings", ["drawn", True])
def test_all_of_a_map_is_on_its_ground_in_pictures_and_in_pages(buildings):
    with gamms.create_context(seed=1) as ctx:
        gamms.osm.helsinki(ctx, **({} if buildings == "drawn" else {"buildings": buildings}))
        commands = ctx.visual.draw_commands()
        first = int(np.flatnonzero(commands.layer == Layer.BASE_MAP)[0])
        ground = commands.points[commands.offsets[first] : commands.offsets[first + 1]]
        packed, _ = ctx.graph.storage.pack_savable()
    assert len(ground) == 4
    of_map = commands.points[np.repeat(commands.space == DrawSpace.WORLD, np.diff(commands.offsets))]
    margin = 0.005 * np.ptp(ground, axis=0).max()
    assert (ground.min(axis=0) + margin < of_map[len(ground) :].min(axis=0)).all()
    assert (of_map[len(ground) :].max(axis=0) < ground.max(axis=0) - margin).all()
    shown = Decoder(MemoryBudget(1 << 30, "A map")).decode(encode_drawn_map(packed))
    box = shown["base_map"]["ground"] * shown["step"]
    assert np.allclose(box.T, [ground.min(axis=0), ground.max(axis=0)], atol=0.1)


@given(st.lists(st.lists(st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)), max_size=4), min_size=1, max_size=4))
def test_the_ground_of_a_map_holds_its_shapes_and_all_else_with_a_margin(parts):
    shapes, *others = [np.array(part, np.float64).reshape(-1, 2) for part in parts]
    ground = find_ground(shapes, *others)
    assert len(ground) == (2 if len(shapes) else 0)
    for points in (shapes, *others) if len(shapes) else ():
        assert ((ground[0] <= points) & (points <= ground[1])).all()
    if len(shapes) and np.ptp(np.concatenate([shapes, *others]), axis=0).max() > 1.0:
        assert (ground[0] < shapes.min(axis=0)).all()


@pytest.mark.parametrize("theme", ["light", "dark", "print"])
@pytest.mark.parametrize(("team", "channel"), [("red", 0), ("green", 1)])
def test_a_field_of_view_over_water_has_the_hue_of_its_team(helsinki, theme, team, channel):
    pytest.importorskip("pygame")
    columns = helsinki.graph.columns()
    east = columns.xy[:, 0].argmax()
    sensors = {"eyes": gamms.sensor.agent_range(range_m=200)}
    helsinki.agent.create_team(team, [int(columns.node_ids[east])], sensors=sensors, strategy=stay)
    helsinki.game.run(1)
    helsinki.visual.look_at(*columns.xy[east].tolist(), 500.0)
    look = {"scale_bar": False, "labels": False, "legend": False, "theme": theme}
    before = helsinki.visual.frame(400, 400, sensors=False, **look)
    seen = helsinki.visual.frame(400, 400, **look)
    is_water = (before == THEMES[theme].map.ground.water).all(axis=2)
    tinted = seen[is_water & (before != seen).any(axis=2)]
    assert len(tinted) > 1000
    assert (tinted.argmax(axis=1) == channel).mean() > 0.95


def test_exactly_the_obstacles_are_drawn(helsinki):
    with gamms.create_context(seed=1) as ctx:
        gamms.osm.helsinki(ctx, buildings=True)
        walls, drawn = ctx.graph.obstacle_columns(), helsinki.graph.scenery_columns().buildings
        assert all(np.array_equal(one, other) for one, other in zip(walls, drawn, strict=True))
        assert polygons(ctx) == polygons(helsinki)


def test_they_are_drawn_around_walls_too_and_left_out_with_the_buildings():
    for buildings, shapes in ((True, 290), (False, 0)):  # with the sheet of the map
        with gamms.create_context(seed=1) as ctx:
            gamms.osm.helsinki(ctx, buildings=buildings)
            assert (ctx.visual.draw_commands().layer == Layer.BASE_MAP).sum() == shapes


def test_the_first_obstacle_is_drawn_instead(helsinki):
    before = polygons(helsinki)
    x, y = helsinki.graph.columns().xy[0]
    helsinki.graph.add_obstacle_face(1, (x, y, 3), (x + 9, y, 3), (x, y, 0), (x + 9, y, 0), 0)
    assert polygons(helsinki) < before


def test_files_recordings_forks_and_snapshots_keep_them(helsinki, tmp_path):
    helsinki.graph.save(tmp_path / "map.gamms")
    helsinki.agent.create_agent("a", start_node_id=1, strategy=lambda state: None)
    helsinki.record.start(tmp_path / "game.ggr")
    helsinki.game.step()
    helsinki.record.stop()
    snapshot = helsinki.graph.storage.snapshot()
    with gamms.create_context() as ctx:
        ctx.graph.load(tmp_path / "map.gamms")
        assert ctx.graph.graph.scenery == "helsinki"
    with gamms.create_context() as ctx:
        for _ in ctx.record.replay(tmp_path / "game.ggr"):
            pass
        assert polygons(ctx) == polygons(helsinki)
    with gamms.create_context() as ctx:
        ctx.graph.storage.copy_from(snapshot)
        assert ctx.graph.graph.scenery == "helsinki"
    helsinki.graph.graph.clear()
    assert helsinki.graph.graph.scenery is None


def test_an_unknown_name_draws_nothing(helsinki):
    helsinki.graph.graph.scenery = "../../etc/passwd"
    assert polygons(helsinki) == 0
