"""Pictures of a recording are those of the game, to the last byte."""

import pytest

import gamms
from gamms import recorder
from gamms.errors import BadValue
from gamms.rules import capture_flag, tag
from gamms.strategies import random_walk

TURNS = 8


def played(path, declare):
    """Record a game with all that is drawn; return the pictures of its turns, and of its end, bigger."""
    with gamms.create_context(seed=3, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6))
        for number, (name, team) in enumerate((("a", "red"), ("b", "blue"), ("c", "blue"))):
            sensor = ctx.sensor.create_sensor(f"{name}_eyes", "agent_range", sensor_range=25.0)
            ctx.agent.create_agent(
                name, start_node_id=number * 14, team=team, sensors=[sensor.sensor_id], strategy=random_walk
            )
        ctx.agent.create_agent("kite", type="aerial", start_node_id=8, speed=4.0, strategy=fly)
        ctx.game.add(tag("red", "blue", then="eliminate"))
        ctx.game.add(capture_flag({"red": 0, "blue": 35}))
        if declare:
            ctx.visual.set_graph_visual(edge_color=(200, 0, 0))
            ctx.visual.set_agent_visual("a", color=(0, 0, 200), size=9)
            ctx.visual.add_artist("ring", {"drawer": ring})
        ctx.record.start(path)
        pictures = [ctx.visual.picture(".svg")]
        for _ in range(TURNS):
            ctx.game.step()
            pictures.append(ctx.visual.picture(".svg"))
        return pictures, ctx.visual.picture(".png", 500, 400, title="the end", background=(10, 20, 30))


def fly(state):
    state["action"] = (1.0, 0.5, 0.0)


def ring(ctx, data):
    x, y = ctx.visual.drawing.position_of("b", data.get("_alpha", 1.0))
    ctx.visual.render_circle(x, y, 3.0, (0, 160, 0), width=2)


def test_a_turn_that_is_not_there_is_refused(tmp_path):
    played(tmp_path / "game.ggr", declare=False)
    with recorder.open(tmp_path / "game.ggr") as recording:
        for turn in (-1, TURNS + 1):
            with pytest.raises(BadValue, match=f"has {TURNS} turns"):
                recording.save(tmp_path / "turn.svg", turn=turn)
        with pytest.raises(FileNotFoundError, match="no folder"):
            recording.save(tmp_path / "nowhere" / "turn.svg")
    assert not (tmp_path / "turn.svg").exists()


def test_a_program_that_only_opens_a_recording_needs_no_other_import(tmp_path, monkeypatch, printed_with_a_new_gamms):
    monkeypatch.chdir(tmp_path)
    played(tmp_path / "game.ggr", declare=False)
    uses = "rec.graph.columns()", "rec.resume(2).terminate()", "rec.save('turn.svg')", "rec._repr_html_()[:3]"
    code = "import gamms; rec = gamms.recorder.open('game.ggr'); {}; print('done')"
    assert printed_with_a_new_gamms(map(code.format, uses)) == ["done"] * len(uses)
