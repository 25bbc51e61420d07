"""`gamms replay --window`: a recording in a window, until it is closed."""

import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

import gamms
from gamms import recordings
from gamms.cli import app
from gamms.strategies import random_walk


@pytest.fixture
def recording(tmp_path):
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        for i in range(3):
            ctx.agent.create_agent(f"a_{i}", start_node_id=i, team="ab"[i % 2], strategy=random_walk)
        ctx.record.start(tmp_path / "game.ggr")
        ctx.game.run(4)
    return tmp_path / "game.ggr"


@pytest.fixture
def shown(monkeypatch):
    """How many turns had been shown when the window was closed, after thirty frames."""
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    from gamms.visual.window.engine import WindowEngine

    turns, frames, in_view = [], [], []
    draw = WindowEngine.handle_single_draw

    def draw_and_close(engine):
        draw(engine)
        if len(engine.ctx.graph.columns().xy):
            in_view.append(is_in_view(engine))
        frames.append(engine.ctx.record.is_replaying)
        if len(frames) == 30:
            turns.append(engine.overlay.turns)
            assert all(in_view)
            engine.quit()

    monkeypatch.setattr(WindowEngine, "handle_single_draw", draw_and_close)
    return turns


def test_a_recording_is_shown_turn_by_turn_and_stays_until_it_is_closed(recording, shown):
    result = CliRunner().invoke(app, ["replay", str(recording), "--window", "--seconds", "0.05"])
    assert result.exit_code == 0, result.output
    assert "4 turns" in result.output
    assert shown == [4]


@pytest.mark.parametrize("has_captions", [True, False])
@pytest.mark.parametrize("is_command", [True, False])
def test_captions_are_shown_in_the_window_of_a_replay_unless_turned_off(
    recording, monkeypatch, has_captions, is_command
):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    from gamms.visual.window.engine import WindowEngine

    found = []
    monkeypatch.setattr(
        WindowEngine,
        "handle_single_draw",
        lambda engine: found.append((engine.overlay.has_captions, engine.overlay.labels)) or engine.quit(),
    )
    if is_command:
        options = [] if has_captions else ["--no-captions"]
        assert CliRunner().invoke(app, ["replay", str(recording), "--window", *options]).exit_code == 0
    else:
        recordings.watch(recording, captions=has_captions)
    assert found == [(has_captions, "auto")]


def is_in_view(engine):
    """Whether the whole map is seen, and takes at least half of the width or of the height."""
    xy = engine.ctx.graph.columns().xy
    on_screen = engine._render_manager.camera().to_screen(xy) / (engine.pictures.width, engine.pictures.height)
    extent = on_screen.max(axis=0) - on_screen.min(axis=0)
    return bool(((on_screen >= 0.0) & (on_screen <= 1.0)).all() and extent.max() >= 0.5)


@pytest.mark.parametrize("program", ["gamms.create_context(vis_engine=gamms.visual.Engine.PYGAME)", "replay"])
def test_without_a_display_there_is_no_window_at_once(recording, program):
    pytest.importorskip("pygame")
    named = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER", "XDG_RUNTIME_DIR")
    bare = {name: value for name, value in os.environ.items() if name not in named}
    words = ["-c", f"import gamms; {program}"]
    if program == "replay":
        words = ["-m", "gamms", "replay", str(recording), "--window"]
    ended = subprocess.run([sys.executable, *words], env=bare, timeout=30, capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert ended.stderr.startswith("gamms: No window can be opened here" if program == "replay" else "Traceback")
    assert "No window can be opened here" in ended.stderr
