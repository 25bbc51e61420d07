"""What artists of a program's own draw is in a recording, so that a replay without the program shows it."""

import io
import subprocess
import sys
from copy import deepcopy

import numpy as np
import pytest
from games import act, copied, empty_context, grid_context, recorded, replayed

import gamms
from gamms import limits
from gamms.errors import TooLarge
from gamms.ir import events as kinds
from gamms.recorder import RecordingError, Writer
from gamms.rules import capture_flag, tag, territory
from gamms.typing import ArtistType
from gamms.visual import Artist
from gamms.visual.artist import ArtistGroup
from gamms.visual.legend import ColorScale, LegendRow, LegendRows

REPLAY = """
import sys, gamms
with gamms.create_context(seed=2, logger_config={"level": "CRITICAL"}) as ctx:
    pictures = []
    ctx.visual.after_turn.append(lambda: pictures.append(ctx.visual.picture(".svg")))
    list(ctx.record.replay(sys.argv[1]))
    pictures.append(ctx.visual.picture(".svg"))
sys.stdout.buffer.write(b"\\0".join(pictures))
"""


def circle_around_a(ctx, data):
    x, y = ctx.visual.drawing.position_of("a", data["_alpha"])
    ctx.visual.render_circle(x, y, 4.0, (200, 0, 100), 2)
    ctx.visual.render_text(f"turn {ctx.game.turn}", x, y + 2.0, font_size=14)
    ctx.visual.drawing.render_lines([(0, 0), (x, y), (20, 20)], [0, 3], (1, 2, 3, 99), 0.5, in_world=True)
    ctx.visual.render_rectangle(x, y, 20, 10, (5, 6, 7))
    ctx.visual.render_polygon([(0, 0), (3, 0), (x, y)], (9, 9, 9))


def game_of(ctx):
    """Red takes the flag of blue, in colours of their own; an artist follows it, and another one stays."""
    ctx.agent.create_agent(
        "a", start_node_id=0, team="red", strategy=lambda state: state.update(action=max(state["legal"]))
    )
    ctx.agent.create_agent(
        "b", start_node_id=8, team="blue", strategy=lambda state: state.update(action=min(state["legal"]))
    )
    ctx.game.add(territory.published(dict.fromkeys(range(4), "red"), colors={"red": (10, 90, 10)}))
    ctx.game.add(capture_flag({"blue": 2}, goal=None, colors={"blue": "orange"}))
    ctx.game.add(tag("red", "blue"))
    ctx.visual.add_artist(
        "around",
        {
            "drawer": circle_around_a,
            "legend": lambda ctx: LegendRows("Score", (LegendRow((1, 2, 3), "a", f"{ctx.game.turn}"),)),
        },
    )
    ctx.visual.add_artist("box", {"shape": gamms.visual.Shape.Rectangle, "x": 0, "y": 0, "width": 9, "height": 9})
    still = Artist(ctx, lambda ctx, data: ctx.visual.render_circle(5, 5, data["r"], (0, 99, 0)), 12)
    still.set_artist_type(ArtistType.STATIC)
    still.data = {"r": 2.0, "legend": ColorScale("heat", ((0, 0, 0), (9, 9, 9)), "0", "1", "2")}
    ctx.visual.add_artist("still", still)
    return still


def play(ctx):
    still = game_of(ctx)
    for turn in range(6):
        ctx.visual.artists.get("box").data["x"] = 2.0 * turn
        still.data["r"] = 2.0 + turn // 3
        if turn == 2:
            ctx.visual.set_values(nodes={0: 1.0, 1: 2.0}, name="heat")
        if turn == 4:
            ctx.visual.artists.get("around").set_visible(False)
        if turn == 5:
            ctx.visual.artists.get("around").set_visible(True)
            ctx.visual.artists.get("around").set_layer(3)
            ctx.visual.remove_artist("box")
        ctx.game.step()


@pytest.mark.parametrize("declares", [False, True])
def test_a_replay_without_the_program_shows_the_same_pictures(declares, tmp_path):
    path, pictures = tmp_path / "game.ggr", []
    with grid_context() as ctx:
        if declares:
            ctx.visual.set_graph_visual(node_size=1.0)
            ctx.visual.set_agent_visual("b", size=2.0)
        ctx.visual.after_turn.append(lambda: pictures.append(ctx.visual.picture(".svg")))
        ctx.record.start(path)
        play(ctx)
        ctx.record.stop()
    shown = subprocess.run([sys.executable, "-c", REPLAY, str(path)], capture_output=True, check=True).stdout
    replays = shown.split(b"\0")
    assert replays == [*pictures, pictures[-1]]
    assert len(set(pictures)) == 6
    assert b"turn 6" in pictures[-1]
    assert b"turn 5" not in pictures[4]
    assert copied(path.read_bytes()) == path.read_bytes()


def test_drawings_beside_an_agent_move_with_it_in_a_film_of_the_replay():
    def place(ctx, share):
        commands = ctx.visual.artists.list_shown()["mine"]
        return ArtistGroup(ctx, {"mine": commands}).draw_artists(share).points.tolist()

    def beside(ctx, data):
        ctx.visual.render_circle(*ctx.visual.drawing.position_of("a", data["_alpha"]), 1.0)

    with grid_context() as ctx:
        ctx.agent.create_agent("a", start_node_id=0)
        ctx.visual.add_artist("mine", {"drawer": beside})
        ctx.visual.add_artist("box", {"drawer": lambda ctx, _: ctx.visual.render_circle(1, 1, 1)})

        def play(ctx):
            act(ctx, "a", 1)
            ctx.visual.simulate()
            act(ctx, "a", 1)
            ctx.visual.simulate()

        data = recorded(play, ctx)
    again, places = empty_context(seed=2), []
    again.visual.after_turn.append(lambda: places.append([place(again, share) for share in (0.0, 0.25, 1.0)]))
    replayed(data, again)
    assert places == [[[[0.0, 0.0]], [[2.5, 0.0]], [[10.0, 0.0]]], [[[10.0, 0.0]]] * 3]
    with gamms.recorder.open(io.BytesIO(data)) as rec:
        assert rec.counts()["VISUAL_COMMANDS"] == 2
    assert copied(data) == data


@pytest.mark.parametrize("engine", ["NO_VIS", "OFFSCREEN"])
def test_they_are_recorded_with_any_visual_engine_unless_they_are_left_out(engine):
    calls = []
    with grid_context(vis_engine=gamms.visual.Engine[engine]) as ctx:
        ctx.agent.create_agent("a", start_node_id=0)
        ctx.visual.add_artist("mine", {"drawer": lambda ctx, data: calls.append(1)})
        recorded(lambda ctx: ctx.game.step(), ctx)
        assert len(calls) == 2
        data = recorded(lambda ctx: ctx.game.step(), ctx, drawings=False)
        recorded(lambda ctx: ctx.game.step(), ctx, version=2)
        assert len(calls) == 2
    assert not replayed(data)[0].visual.artists.declared


def test_a_drawer_or_legend_that_fails_is_logged_and_the_game_goes_on(ctx, monkeypatch):
    said = []
    monkeypatch.setattr(
        ctx.logger, "error", lambda *words: said.append(words[0] % words[1:] if len(words) > 1 else words[0])
    )

    def fail(*_):
        raise OSError("no such thing")

    ctx.agent.create_agent("a", start_node_id=0)
    ctx.visual.add_artist("mine", {"drawer": fail})
    ctx.visual.add_artist("other", {"drawer": lambda ctx, data: ctx.visual.render_circle(1, 1, 1), "legend": fail})
    data = recorded(lambda ctx: ctx.game.step(), ctx)
    assert "Artist 'mine' could not be drawn: OSError: no such thing" in said
    assert "The legend of artist 'other' failed: OSError: no such thing" in said
    assert b"<circle" in replayed(data)[0].visual.picture(".svg")


def test_drawings_too_large_for_a_recording_are_left_out_with_a_warning(ctx, monkeypatch):
    said = []
    monkeypatch.setattr(ctx.logger, "warning", lambda words, *_: said.append(words))
    monkeypatch.setattr("gamms.ir.draw.MOST_POINTS", 3)
    ctx.agent.create_agent("a", start_node_id=0)
    ctx.visual.add_artist("mine", {"drawer": lambda ctx, _: ctx.visual.drawing.render_circles([(0, 0)] * 4, 1.0)})
    recorded(lambda ctx: [ctx.game.step() for _ in range(3)], ctx)
    assert said == ["Artist 'mine': A drawing of 4 points cannot be recorded; at most 3 points can."]


def test_a_game_that_is_resumed_shows_them_until_its_next_turn():
    with gamms.recorder.open(io.BytesIO(recorded(play))) as rec, rec.resume(2) as again:
        assert b"turn 2" in again.visual.picture(".svg")
        again.game.step()
        assert b"turn 2" not in again.visual.picture(".svg")


def test_a_recording_of_a_context_that_has_replayed_another_has_its_drawings(ctx):
    ctx.agent.create_agent("c", start_node_id=3)
    data = recorded(play)
    again, _ = replayed(recorded(lambda ctx: replayed(data, ctx), ctx))
    assert b"turn 6" in again.visual.picture(".svg")


# -- what strangers write -------------------------------------------------------------------------------------------

SPEC = {"name": "mine", "kind": "drawing", "keywords": {}, "layer": 30, "visible": True}
COMMANDS = {
    "kind": np.array([1, 3], np.uint8),
    "space": np.array([0, 1], np.uint8),
    "size": np.array([1.0, 0.0]),
    "width": np.array([0.0, 1.0]),
    "angle": np.zeros(2),
    "color": np.full((2, 4), 255, np.uint8),
    "counts": np.array([1, 2]),
    "points": np.arange(6.0).reshape(3, 2),
    "text": ["", ""],
}


def with_drawing(ctx, drawing, *, in_header=False):
    """A recording with such a drawing."""
    stream = io.BytesIO()
    header = {"world": ctx.graph.storage.pack(), "visuals": {"artists": [SPEC], "is_declared": False}}
    writer = Writer(stream, header | ({"drawings": [drawing]} if in_header else {}))
    with gamms.recorder.open(io.BytesIO(recorded(lambda ctx: None, ctx))) as rec:
        writer.keyframe(rec.reader.keyframe(0)[1])
    writer.add_turn([(kinds.VISUAL_COMMANDS, drawing)])
    writer.close()
    return stream.getvalue()


def drawing(**changes):
    return {"artist": "mine", "layer": 30, "visible": True, "commands": COMMANDS | changes}


def test_a_drawing_written_by_hand_is_drawn(ctx):
    again, _ = replayed(with_drawing(ctx, drawing()))
    assert len(again.visual.draw_commands().kind[again.visual.draw_commands().layer == 30]) == 2
    again, _ = replayed(with_drawing(ctx, {**drawing(), "artist": "of nobody"}))
    assert not (again.visual.draw_commands().layer == 30).any()


WRONG = {
    "no dict": 5,
    "no name": {"layer": 1, "visible": True, "commands": COMMANDS},
    "a name that is a list": {**drawing(), "artist": []},
    "a layer that is none": {**drawing(), "layer": "x"},
    "commands that are none": {**drawing(), "commands": [1]},
    "a missing column": {**drawing(), "commands": {"kind": np.zeros(0, np.uint8)}},
    "a list": drawing(kind=[1, 3]),
    "texts as numbers": drawing(text=[1, 2]),
    "too few texts": drawing(text=["a"]),
    "floats as kinds": drawing(kind=np.array([1.0, 3.0])),
    "an image": drawing(kind=np.array([6, 3]), text=["/etc/passwd", ""]),
    "an unknown kind": drawing(kind=np.array([99, 3])),
    "an unknown space": drawing(space=np.array([9, 1])),
    "a column that is longer": drawing(size=np.zeros(3)),
    "colours of three": drawing(color=np.zeros((2, 3), np.uint8)),
    "a circle of two points": drawing(counts=np.array([2, 1])),
    "a line of one point": drawing(counts=np.array([1, 1]), points=np.zeros((2, 2))),
    "counts below zero": drawing(counts=np.array([4, -1])),
    "counts beyond the points": drawing(counts=np.array([1, 1 << 62])),
    "counts that wrap": drawing(counts=np.array([1, 2], np.uint64) + np.uint64((1 << 64) - 2)),
    "points that are far": drawing(points=np.full((3, 2), 1e300)),
    "points that are no numbers": drawing(points=np.full((3, 2), np.nan)),
    "points in space": drawing(points=np.zeros((3, 3))),
    "a size below zero": drawing(size=np.array([-1.0, 0.0])),
    "an endless width": drawing(width=np.array([0.0, np.inf])),
    "an endless angle": drawing(angle=np.array([0.0, np.inf])),
    "a start with more points": {**drawing(), "start": np.zeros((4, 2))},
    "a start that is none": {**drawing(), "start": 5},
    "a start that is far": {**drawing(), "start": np.full((3, 2), 1e300)},
    "a legend that is none": {**drawing(), "legend": 5},
    "a legend of numbers": {**drawing(), "legend": [{"title": 5, "rows": []}]},
    "a legend without colours": {**drawing(), "legend": [{"title": "", "ends": ["", "", ""], "colors": []}]},
    "a legend with a row of nothing": {**drawing(), "legend": [{"title": "", "rows": [()]}]},
}


@pytest.mark.parametrize("in_header", [False, True])
@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG.keys())
def test_a_drawing_that_was_not_recorded_is_refused(wrong, in_header, ctx):
    again = empty_context()
    with pytest.raises(RecordingError):
        replayed(with_drawing(ctx, deepcopy(wrong), in_header=in_header), again)
    assert not again.visual.artists.drawings.commands


def test_drawings_of_many_artists_take_no_more_memory_than_is_allowed(ctx):
    again = empty_context()
    specs = [{**SPEC, "name": str(name)} for name in range(100)]
    again.visual.artists.add_specs({"artists": specs, "is_declared": False})
    with limits.allowing(1 << 18), pytest.raises(TooLarge, match="What the artists of this recording draw"):
        for name in range(100):
            points = np.zeros((1_000, 2))
            again.visual.artists.add_drawing({**drawing(counts=np.array([1, 999]), points=points), "artist": str(name)})
    assert len(again.visual.artists.drawings.commands) == 1


def test_drawings_of_an_artist_that_is_not_there_take_no_memory(ctx):
    stream = io.BytesIO(with_drawing(ctx, {**drawing(), "artist": "other"}))
    again = empty_context()
    replayed(stream.getvalue(), again)
    assert not again.visual.artists.drawings.commands
