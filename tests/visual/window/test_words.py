"""The words on the window: turn and scores, teams, the panel of an agent, names, and the source of the map."""

import networkx as nx
import numpy as np
import pytest

from gamms.errors import BadValue, NotOffered
from gamms.sensor import SensorType
from gamms.typing import ISensor
from gamms.visual.camera import Camera
from gamms.visual.charts import ChartLine, draw_chart
from gamms.visual.legend import LegendRow, LegendRows, Pen
from gamms.visual.window import overlay, panels
from gamms.visual.window.input import make_question


def frame(ctx, said):
    said.clear()
    ctx.visual.update()
    return list(said)


def test_lines_that_are_broader_than_the_window_go_on_below(open_window, said):
    ctx = open_window(width=200)
    ctx.visual.hud = lambda ctx: ["one two three four five six", "x" * 100]
    words = frame(ctx, said)
    assert "one two three four five six" not in words
    assert " ".join(words[: words.index("x" * 89 + "…")]) == "one two three four five six"


def test_a_hud_that_fails_is_logged_once(ctx, said, caplog):
    def fail(ctx):
        raise RuntimeError("no words")

    ctx.visual.hud = fail
    frame(ctx, said)
    frame(ctx, said)
    assert [record.message for record in caplog.records if "no words" in record.message] == [
        "The HUD could not be written: RuntimeError: no words"
    ]


def test_those_who_are_left_are_counted_once_an_agent_is_out(ctx, said):
    assert not any(line.startswith("left") for line in frame(ctx, said))
    ctx.game.eliminate("blue_0")
    assert "left: red 1 · blue 0" in frame(ctx, said)


def test_pointing_at_an_agent_shows_its_knowledge(ctx, said, person):
    ctx.agent.get_agent("red_0").get_state()
    frame(ctx, said)
    person.point(*ctx.visual._render_manager.world_to_screen(0.0, 0.0))
    words = frame(ctx, said)
    assert "red_0 · team red" in words
    assert "at node 0, from 0" in words
    assert "near (NEIGHBOR): 0, 1" in words
    person.point(3, 3)
    assert "red_0 · team red" not in frame(ctx, said)


def test_names_are_written_where_there_is_room(open_window, said):
    ctx = open_window(labels=True)
    for i in range(50):
        ctx.agent.create_agent(f"twin_{i}", start_node_id=1)
    words = frame(ctx, said)
    assert {"red_0", "blue_0"} <= set(words)
    assert not any(line.startswith("twin_") for line in words)
    assert sum(int(line[1:]) for line in words if line.startswith("\N{MULTIPLICATION SIGN}")) <= 50


def test_the_source_of_the_map_is_always_named(ctx, said):
    ctx.graph.graph.attribution = "© a person"
    ctx.visual.overlay.hud.toggle()
    assert frame(ctx, said) == ["© a person"]
    ctx.visual.overlay.hud.toggle()
    assert {"© a person", "F1: keys", "turn 0"} <= set(frame(ctx, said))


def test_a_pause_and_a_question_say_what_to_do(ctx, said, person):
    person.press("SPACE")
    assert any("space goes on" in line for line in frame(ctx, said))
    person.press("SPACE", "0")
    said.clear()
    ctx.visual.human_input("red_0", {"curr_pos": 0})
    ctx.visual.question = None
    person.press("F1")
    assert any("N: light or dark" in line for line in frame(ctx, said))


def test_an_agent_whose_node_is_gone_is_logged_and_the_window_goes_on(ctx, said, person, caplog):
    frame(ctx, said)
    person.click(*ctx.visual._render_manager.world_to_screen(0.0, 0.0))
    ctx.graph.graph.remove_node(0)
    frame(ctx, said)
    assert "turn 0" in frame(ctx, said)
    assert any("red_0" in record.message for record in caplog.records if record.levelname == "ERROR")


def test_only_declared_drawings_are_explained(ctx, said):
    ctx.visual.set_graph_visual()
    assert {"red", "blue"}.isdisjoint(frame(ctx, said))
    artist = ctx.visual.add_artist(
        "fire", {"drawer": lambda *_: None, "legend": LegendRows("", (LegendRow((200, 0, 0), "fire"),))}
    )
    assert "fire" in frame(ctx, said)
    artist.set_visible(False)
    ctx.visual.update()
    assert ctx.visual.overlay.hud.legend.width == 0


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ([1, 2], "1, 2"),
        ([], "nothing"),
        (list(range(100)), "100 seen"),
        ({"nodes": {1: 2}, "edges": []}, "1 nodes, 0 edges"),
        ({"anna": 5}, "anna"),
        (None, "None"),
        ("x" * 50, "x" * 39 + "…"),
    ],
)
def test_sensor_data_is_described_in_a_few_words(data, words):
    assert overlay._summarize_data(data) == words


def test_the_nearest_point_within_reach_is_found():
    points = np.array([(0.0, 0.0), (10.0, 0.0)])
    assert overlay.find_nearest_point(points, 7.0, 0.0) == 1
    assert overlay.find_nearest_point(points, 30.0, 0.0) is None
    assert overlay.find_nearest_point(np.empty((0, 2)), 0.0, 0.0) is None


def test_a_sensor_without_a_view_is_left_out_quietly(ctx, person, caplog):
    class Mute(ISensor):
        sensor_id, type, data = "mute", SensorType.CUSTOM, None

        def last_view(self):
            raise NotOffered(self, "last_view")

        def sense(self, node_id): ...

        def update(self, data): ...

        def set_owner(self, owner): ...

    ctx.sensor.add_sensor(Mute())
    ctx.agent.get_agent("red_0").register_sensor("mute", ctx.sensor.get_sensor("mute"))
    ctx.visual.update()
    person.point(*ctx.visual._render_manager.world_to_screen(0.0, 0.0))
    ctx.visual.update()
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


# -- captions ------------------------------------------------------------------------------------------------------


def tell(ctx, kinds):
    """Let events of these kinds happen: turn -> kinds."""

    @ctx.game.add
    def rule(ctx):
        for kind in kinds.get(ctx.game.turn, ()):
            ctx.game.emit(kind, agent="red_0")


def test_events_of_a_turn_are_described(ctx, said):
    tell(ctx, {1: ["storm"], 3: ["dusk"]})
    for expected in (["red_0: storm"], [], ["red_0: dusk"]):
        ctx.game.step()
        assert [line for line in frame(ctx, said) if line.startswith("red_0:")] == expected


def test_it_is_said_for_two_seconds_however_fast_turns_are_shown(ctx, said):
    tell(ctx, {1: ["storm"]})
    ctx.visual.turn_seconds = 0.04
    ctx.visual.pace.change_speed(-2)  # a sixth of a second
    lines = []
    for _ in range(14):
        ctx.game.step()
        lines.append("red_0: storm" in frame(ctx, said))
    assert lines == [True] * 12 + [False] * 2


def test_the_newest_line_is_above_older_ones_which_disappear(open_window, said):
    ctx = open_window(simulation_time_constant=0.01)
    tell(ctx, {1: ["dawn"], 2: ["noon"], 3: ["dusk"]})
    for _ in range(3):
        ctx.game.step()
    assert [line for line in frame(ctx, said) if line.startswith("red_0:")] == ["red_0: dusk", "red_0: noon"]


def test_captions_must_be_true_or_false(open_window):
    with pytest.raises(TypeError, match="captions must be True or False, not 'yes'"):
        open_window(captions="yes")


def test_captions_and_questions_cover_each_other_in_no_window(open_window, said):
    ctx = open_window(width=300, height=300)
    tell(ctx, {1: ["a storm of which much can be said, more than the window is wide"]})
    ctx.game.step()
    ctx.visual.question = make_question(ctx, "red_0", {"curr_pos": 0})
    words = frame(ctx, said)
    assert any(line.startswith("red_0: a storm of which") and line.endswith("…") for line in words)
    prompt, *_, captions = [box for box in ctx.visual.overlay.hud.layout.areas if box[2] - box[0] > 100]
    assert captions[3] <= prompt[1]


def test_a_team_is_told_nothing_of_agents_that_it_does_not_see(open_window, said):
    ctx = open_window(fog="blue")
    ctx.sensor.create_sensor("far", SensorType.AGENT_RANGE, sensor_range=1)
    ctx.agent.get_agent("blue_0").register_sensor("far", ctx.sensor.get_sensor("far"))
    tell(ctx, {1: ["storm"]})
    ctx.game.step()
    assert "red_0: storm" not in frame(ctx, said)


def test_a_window_asks_which_side_is_meant_if_an_agent_has_the_name_of_a_team(open_window):
    ctx = open_window(fog="red")
    ctx.agent.create_agent("red", start_node_id=2)
    with pytest.raises(BadValue, match="Write 'team red' or 'agent red'"):
        ctx.game.step()


def test_captions_have_the_colours_of_the_theme(ctx):
    tell(ctx, {1: ["storm"]})
    ctx.game.step()
    before = ctx.visual.overlay.captions[0].color
    ctx.visual.toggle_theme()
    assert ctx.visual.overlay.captions[0].color == ctx.visual.drawing.group_colors()["red"] != before


@pytest.mark.parametrize(("options", "scale", "names"), [({}, 3.0, 1), ({}, 0.3, 0), ({"street_names": False}, 3.0, 0)])
def test_streets_have_their_names_close_by(open_window, monkeypatch, options, scale, names):
    written = []
    monkeypatch.setattr(overlay.Canvas, "draw_text", lambda self, words, *_, **__: written.append(words))
    ctx = open_window(is_empty=True, **options)
    graph = nx.MultiDiGraph(crs="EPSG:32635")
    for number in range(6):
        graph.add_node(number, x=500_000.0 + 30.0 * number, y=6_000_000.0)
    for number in range(5):
        graph.add_edge(number, number + 1, length=30.0, name="Long street")
    ctx.graph.attach_networkx_graph(graph)
    ctx.visual.update()
    ctx.visual.look_at(500_075.0, 6_000_000.0, 640 / scale)
    ctx.visual.camera.camera_x, ctx.visual.camera.camera_y = 500_075.0, 6_000_000.0
    ctx.visual.camera.camera_size = 320 / scale
    written.clear()
    ctx.visual.update()
    assert written.count("Long street") == names


@pytest.mark.parametrize("fog", [True, "red"])
def test_a_window_draws_what_a_game_collects_unless_it_shows_what_a_team_knows(open_window, monkeypatch, fog):
    drawn = []
    monkeypatch.setattr(panels, "draw_chart", lambda pen, name, lines, *_: drawn.append((name, lines)))
    ctx = open_window(width=900, height=500, fog=fog)
    ctx.game.collect("turns", lambda ctx: 2 * ctx.game.turn)
    ctx.game.collect("node", lambda agent: agent.current_node_id, per="agent")
    ctx.game.run(2)
    ctx.visual.update()
    if fog == "red":
        assert drawn == []
        return
    charts = dict(drawn[-2:])
    assert charts["turns"] == {"": ([1, 2], [2, 4])}
    assert charts["node"].keys() == {"red_0", "blue_0"}


@pytest.mark.parametrize("values", [[2.0], [1.0, 1.0], [1e299, -1e299, 0.0], list(range(3000))])
def test_a_chart_has_its_name_its_value_and_the_ends_of_its_scale(values):
    pen = Pen(Camera(400, 300, 0.0, 0.0, 1.0), 1.0, (0, 0, 0))
    line = ChartLine(list(range(len(values))), values)
    draw_chart(pen, "a chart", {"": line}, {}, (0.0, 0.0))
    words = pen.commands.freeze().text
    assert {"a chart", f"{values[-1]:.4g}", f"{min(values):.3g}", f"{max(values):.3g}"} <= set(words)
