"""What was declared to look somehow looks so in a replay, too."""

import io

import pytest
from games import act, copied, empty_context, grid_context, recorded, replayed

import gamms
from gamms.recorder import RecordingError, Writer
from gamms.visual import Artist, Color, Shape


def declare(ctx):
    ctx.visual.set_graph_visual(node_color=Color.Red, node_size=4.5, edge_color=(1, 2, 3), draw_id=True)
    ctx.visual.set_obstacle_visual(color_map={1: (9, 8, 7)}, boundary_thickness=2.0, fill=True)
    ctx.visual.set_agent_visual("a", color=Color.Green, size=3)
    ctx.visual.set_sensor_visual("near", node_color=Color.Cyan, layer=3)
    ctx.visual.add_artist("disc", {"x": 1.0, "y": 2.0, "scale": 3.0, "color": (5, 6, 7), "layer": 50})
    box = Artist(ctx, Shape.Rectangle, 60)
    box.data["box"] = gamms.visual.Rectangle(0.0, 0.0, 20.0, 10.0, (4, 4, 4))
    ctx.visual.add_artist("box", box)
    ctx.visual.add_artist("mine", {"drawer": lambda ctx, _: ctx.visual.render_circle(0, 0, 1), "layer": 70})


def a_game(ctx):
    ctx.agent.create_agent("a", start_node_id=0)
    ctx.agent.create_agent("b", start_node_id=1, team="red")
    for node in (1, 4, 5):
        act(ctx, "a", node)
        ctx.visual.simulate()


def picture(ctx, tmp_path):
    ctx.visual.artists.declared.pop("mine", None)  # what a function draws is not in a recording
    path = tmp_path / "picture.svg"
    ctx.visual.save(path)
    return path.read_text()


def test_a_replay_looks_the_same(ctx, tmp_path):
    declare(ctx)
    data = recorded(a_game, ctx)
    again, _ = replayed(data)
    assert picture(again, tmp_path) == picture(ctx, tmp_path)
    assert list(again.visual.artists.declared) == ["graph", "obstacles", "a", "sensor_near", "disc", "box"]
    assert copied(data) == data


def test_drawings_declared_after_the_start_look_the_same(ctx, tmp_path):
    def play(ctx):
        a_game(ctx)
        ctx.visual.remove_artist("disc")
        ctx.visual.set_agent_visual("a", color=Color.Blue)
        artist = ctx.visual.set_agent_visual("b", size=9.0)
        artist.set_visible(False)
        artist.set_layer(2)
        ctx.visual.simulate()

    declare(ctx)
    data = recorded(play, ctx)
    again, _ = replayed(data)
    assert picture(again, tmp_path) == picture(ctx, tmp_path)
    assert copied(data) == data


def test_drawings_declared_in_the_first_turn_are_in_the_header_whenever_it_is_written(tmp_path):
    def play(ctx):
        ctx.visual.set_graph_visual(node_size=4.5)
        a_game(ctx)
        ctx.visual.set_graph_visual(node_size=5.5)
        ctx.visual.simulate()

    data = recorded(play)
    with gamms.recorder.open(io.BytesIO(data)) as rec:
        (graph,) = rec.header["visuals"]["artists"]
        assert graph["keywords"]["node_size"] == 4.5
        assert rec.counts()["VISUALS"] == 1
    with grid_context() as ctx:
        ctx.record.start(tmp_path / "game")
        play(ctx)
    assert (tmp_path / "game.ggr").read_bytes() == data


def test_artists_of_the_context_stay_as_they_are(ctx):
    ctx.visual.set_agent_visual("a", size=3.0)
    ctx.visual.set_agent_visual("b", size=3.0)
    data = recorded(a_game, ctx)
    again = empty_context()
    mine = again.visual.set_agent_visual("a", size=7.0)
    replayed(data, again)
    assert again.visual.artists.declared["a"] is mine
    assert again.visual.artists.declared["b"].data["agent_data"].size == 3.0


def test_a_replay_that_is_part_of_another_recording_takes_its_look_along(ctx, tmp_path):
    declare(ctx)
    data = recorded(a_game, ctx)
    other = grid_context()
    other.agent.create_agent("c", start_node_id=3)
    again, _ = replayed(recorded(lambda ctx: replayed(data, ctx), other))
    assert picture(again, tmp_path) == picture(other, tmp_path)
    assert "disc" in again.visual.artists.declared


def test_no_path_of_a_picture_is_recorded(ctx):
    ctx.visual.set_agent_visual("a", image_path="/home/me/picture.png", size=3.0)
    data = recorded(a_game, ctx)
    look = replayed(data)[0].visual.artists.declared["a"].data["agent_data"]
    assert (look.size, look.image) == (3.0, None)
    with gamms.recorder.open(io.BytesIO(data)) as rec:
        assert "picture.png" not in repr(rec.header)


def test_nothing_is_said_where_nothing_was_declared(ctx):
    with gamms.recorder.open(io.BytesIO(recorded(a_game, ctx))) as rec:
        assert "visuals" not in rec.header


@pytest.mark.parametrize(
    "visuals",
    [
        5,
        {},
        {"artists": [5], "is_declared": True},
        {"artists": [{"name": "a", "kind": "agent", "keywords": 5, "layer": 1, "visible": True}], "is_declared": True},
        {"artists": [{"name": 5, "kind": "graph", "keywords": {}, "layer": 1, "visible": True}], "is_declared": True},
        {"artists": [{"name": "a", "kind": "agent", "keywords": {}, "layer": "x", "visible": 1}], "is_declared": True},
        {"artists": [{"name": "a", "kind": ["agent"], "keywords": {}, "layer": 1, "visible": 1}], "is_declared": 1},
    ],
)
def test_a_look_that_was_not_recorded_is_refused(visuals, ctx):
    stream = io.BytesIO()
    Writer(stream, {"world": ctx.graph.storage.pack(), "visuals": visuals}).close()
    with pytest.raises(RecordingError, match="visuals of this recording"):
        replayed(stream.getvalue(), ctx)
    assert not ctx.visual.artists.declared


def test_kinds_and_keywords_of_later_versions_are_passed_over(ctx):
    words = {"name": "a", "keywords": {"color": (1, 2, 3), "new": 5, "name": "a"}, "layer": 1, "visible": True}
    artists = [{**words, "kind": "agent"}, {**words, "kind": "cloud", "name": "b"}]
    ctx.visual.artists.add_specs({"artists": artists, "is_declared": True})
    assert list(ctx.visual.artists.declared) == ["a"]
