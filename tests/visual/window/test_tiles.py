"""Tiles: what was painted once and shifted is what would be painted now."""

import numpy as np
import pytest

import gamms
from gamms.visual.scene import FrameBudget, SurfacePool


def grid(ctx, side):
    graph = ctx.graph.graph
    ids = np.arange(side * side)
    graph.add_nodes(ids, x=(ids // side) * 10.0, y=(ids % side) * 10.0)
    pairs = [(i, i + 1) for i in ids.tolist() if (i + 1) % side] + [(i, i + side) for i in ids.tolist()[:-side]]
    sources, targets = zip(*pairs, strict=True)
    graph.add_edges(range(len(pairs)), sources=sources, targets=targets)


@pytest.fixture
def ctx(open_window):
    ctx = open_window(is_empty=True)
    ctx.visual.hud = None
    grid(ctx, 30)
    return ctx


def settle(ctx):
    """Draw frames until everything is painted as it should be."""
    import time

    for _ in range(6000):
        ctx.visual.update()
        if ctx.visual._scene.is_sharp(ctx.visual._render_manager.camera()):
            return
        time.sleep(0.01)
    pytest.fail("the map does not become sharp")


def painted_now(ctx):
    """The world without any memory, through the window's camera."""
    from gamms.visual.backends.raster import paint_picture

    camera, background = ctx.visual._render_manager.camera(), ctx.visual.overlay.hud.theme.background
    return paint_picture(ctx.visual.draw_commands(), camera, background).pixels()


def differs(one, other):
    return np.abs(one.astype(int) - other).max(axis=2) > 60


def test_panning_in_small_steps_leaves_no_seams(ctx, seen):
    ctx.visual.set_graph_visual(node_size=2)
    view = ctx.visual._render_manager
    view.camera_size = 60.0
    for _ in range(40):
        ctx.visual.update()
        view.camera_x += 3.3
        view.camera_y -= 1.7
    settle(ctx)
    assert differs(seen(ctx), painted_now(ctx)).mean() < 0.002


def test_zooming_far_out_and_in_again_keeps_memory_bounded(ctx, person):
    ctx.visual.set_graph_visual(node_size=2)
    for notch in [1] * 60 + [-1] * 90 + [1] * 60:
        person.turn_wheel(notch)
        ctx.visual.update()
    [tiles] = [part.tiles for part in ctx.visual._scene._parts if part.tiles is not None]
    assert sum(len(level.tiles) for level in tiles._levels.values()) < 2000


def test_zooming_out_does_not_dim_the_paper(ctx, seen, person):
    ctx.visual.set_graph_visual(node_size=0)
    ctx.visual.update()
    for _ in range(30):
        person.turn_wheel(-1)
        ctx.visual.update()
        assert np.abs(seen(ctx)[:, 5:60].astype(int) - (252, 252, 250)).max() <= 2


def test_glass_shows_the_map_behind_it(ctx, seen):
    """A static layer above a moving one is painted on a transparent surface."""
    ctx.visual.set_graph_visual(node_size=2)
    behind = {"drawer": lambda ctx, data: ctx.visual.render_circle(150, 150, 100, (255, 0, 0)), "layer": 3}
    ctx.visual.add_artist("behind", behind)
    settle(ctx)
    assert differs(seen(ctx), painted_now(ctx)).mean() < 0.002
    view = ctx.visual._render_manager
    view.camera_size *= 1.1
    ctx.visual.update()
    assert tuple(seen(ctx)[180, 325]) == (255, 0, 0) or (seen(ctx) == (255, 0, 0)).all(axis=2).any()


def test_there_is_always_time_for_one_thing():
    budget = FrameBudget(-1.0)
    assert budget.has_time(5.0)
    assert not budget.has_time(0.0)


def test_a_repeated_action_takes_the_time_of_the_first():
    budget = FrameBudget(-1.0)
    budget.spend()
    assert not budget.has_time(0.0)


def test_a_sheet_that_would_hold_too_much_memory_is_not_kept():
    pool = SurfacePool()
    assert pool.get_surface("part", 3000, 2000).get_parent() is not pool.get_surface("part", 3000, 2000).get_parent()


def test_a_window_paints_nothing_after_the_context_has_ended(ctx):
    ctx.terminate()
    ctx.visual.update()
    ctx.visual.look_at_all()
    assert isinstance(ctx.visual, gamms.visual.PygameVisualizationEngine)
