"""`gamms replay --window`: a recording in a window, until somebody closes it."""

import pytest
from typer.testing import CliRunner

import gamms
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
    """How many turns had been shown when the window was closed, which somebody does after sixty frames."""
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    from gamms.visual.window.engine import WindowEngine

    turns, frames = [], []
    draw = WindowEngine.handle_single_draw

    def draw_and_close(engine):
        draw(engine)
        frames.append(engine.ctx.record.is_replaying)
        if len(frames) == 60:
            turns.append(engine.turns)
            engine.quit()

    monkeypatch.setattr(WindowEngine, "handle_single_draw", draw_and_close)
    return turns


def test_a_recording_is_shown_turn_by_turn_and_stays_until_it_is_closed(recording, shown):
    result = CliRunner().invoke(app, ["replay", str(recording), "--window", "--seconds", "0.05"])
    assert result.exit_code == 0, result.output
    assert "4 turns" in result.output
    assert shown == [4]
