"""A rule with a drawer of its own shows everywhere, without a line of JavaScript, and is recorded by default."""

import numpy as np
import pytest
from PIL import Image, ImageSequence

import gamms
from gamms import recorder
from gamms.visual import Engine
from gamms.visual.backends.pillow_backend import decode_pixels

COLOR = (251, 3, 249)  # that nothing else has


def draw_alarm(ctx, data):
    """Draw a disc around the agent that the rule watches."""
    x, y = ctx.visual.drawing.position_of("anna", data.get("_alpha", 1.0))
    ctx.visual.render_circle(x, y, 4.0, COLOR)


def alarm(ctx):
    """Watch an agent."""


alarm.drawer = draw_alarm


def shows(pixels):
    """Whether the disc is among pixels."""
    return (np.abs(pixels[..., :3].astype(int) - COLOR).max(axis=-1) < 40).sum() > 20


def played(ctx, *around):
    """Play two turns of a game with the rule."""
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
    ctx.agent.create_agent("anna", start_node_id=5, team="red", strategy=gamms.strategies.random_walk)
    ctx.game.add(alarm)
    for begin in around:
        begin(ctx)
    ctx.game.run(max_turns=2)
    return ctx


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A recording of the game, and the picture of its last turn."""
    path = tmp_path_factory.mktemp("alarm") / "game.ggr"
    with gamms.create_context(seed=1) as ctx:
        played(ctx, lambda ctx: ctx.record.start(path))
        picture = ctx.visual.picture(".png", 400, 400)
    return path, picture


def test_it_shows_in_a_picture(recording):
    assert shows(decode_pixels(recording[1]))


def test_it_shows_in_a_window(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    options = {"width": 400, "height": 400, "simulation_time_constant": 0.0, "stay_open": False}
    with gamms.create_context(vis_engine=Engine.PYGAME, vis_kwargs=options, seed=1) as ctx:
        import pygame

        played(ctx)
        ctx.visual.update()
        assert shows(pygame.surfarray.array3d(pygame.display.get_surface()))


def test_it_shows_in_a_film(tmp_path):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        ctx.agent.create_agent("anna", start_node_id=5, team="red", strategy=gamms.strategies.random_walk)
        ctx.game.add(alarm)
        with ctx.visual.film(tmp_path / "game.gif", width=400, height=400, frames_per_turn=1):
            ctx.game.run(max_turns=2)
    with Image.open(tmp_path / "game.gif") as film:
        first = np.asarray(next(ImageSequence.Iterator(film)).convert("RGB"))
    assert shows(first)


def test_it_shows_in_a_replay(recording):
    with gamms.create_context() as ctx:
        for _ in ctx.record.replay(recording[0]):
            pass
        assert shows(decode_pixels(ctx.visual.picture(".png", 400, 400)))


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_it_shows_in_a_page(chromium, recording, tmp_path, theme):
    with recorder.open(recording[0]) as game:
        game.save(tmp_path / "game.html", turn=2, theme=theme)
    page = chromium.open(tmp_path / "game.html")
    page.settle()
    assert shows(decode_pixels(page.picture()))
    assert page.messages == []


def test_a_drawing_that_stays_is_not_painted_again_when_another_changes(chromium, tmp_path):
    def draw_turn(ctx, data):
        ctx.visual.render_circle(10.0 * ctx.game.turn, 0.0, 2.0, COLOR)

    draw_turn.once_a_turn = True
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        ctx.agent.create_agent("anna", start_node_id=5, team="red")
        ctx.visual.add_artist("stays", {"drawer": lambda ctx, _: ctx.visual.render_circle(5.0, 5.0, 9.0), "layer": 12})
        ctx.visual.add_artist("changes", {"drawer": draw_turn, "layer": 13})
        ctx.game.run(max_turns=3, record=tmp_path / "game.ggr")
    with recorder.open(tmp_path / "game.ggr") as game:
        game.save(tmp_path / "game.html")
    page = chromium.open(tmp_path / "game.html")
    keys = []
    for turn in (1, 2, 3):
        page.value(f"gamms.seek({turn})")
        page.settle()
        keys.append(page.value("['lasting', 'new'].map((name) => gamms.views[0].scene.caches.get(name).key)"))
    assert len({lasting for lasting, _ in keys}) == 1
    assert len({new for _, new in keys}) == 3
