"""`gamms render`: films and pictures of recordings, of whom one follows, and of what a team can see."""

from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from typer.testing import CliRunner

import gamms
from gamms import cli, recordings, rendering
from gamms.errors import BadType, BadValue
from gamms.rendering import Fog, RenderOptions
from gamms.rules import capture_flag, territory
from gamms.sensor import SensorType
from gamms.sensor.ground import AgentSensor

SAMPLES = Path(__file__).parents[1] / "recorder/samples/version2"
QUIET = {"level": "CRITICAL"}
LENGTH = 30


def run(*arguments):
    return CliRunner().invoke(cli.app, ["render", *map(str, arguments)], catch_exceptions=False)


def east(state):
    state["action"] = max(state["legal"])


@pytest.fixture(scope="module")
def game(tmp_path_factory):
    """Red walks ten nodes along a road, sees 25 metres far, and passes blue, which stays."""
    path = tmp_path_factory.mktemp("game") / "game.ggr"
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        nodes = np.arange(LENGTH)
        ctx.graph.add_nodes(nodes, x=nodes * 10.0, y=np.zeros(LENGTH))
        ways = np.arange(LENGTH - 1)
        ctx.graph.add_edges(range(2 * len(ways)), [*ways, *(ways + 1)], [*(ways + 1), *ways])
        ctx.sensor.create_sensor("near", SensorType.RANGE, sensor_range=25.0)
        ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=25.0)
        ctx.agent.create_agent("red_0", start_node_id=0, team="red", sensors=["near", "eyes"], strategy=east)
        ctx.agent.create_agent("blue_0", start_node_id=6, team="blue")
        ctx.agent.create_agent("blue_1", start_node_id=29, team="blue")
        ctx.game.add(territory.published(dict.fromkeys(range(15), "red")))
        ctx.game.add(capture_flag({"blue": 29}, goal=None))
        ctx.record.start(path)
        ctx.game.run(max_turns=10)
        ctx.record.stop()
    return path


def test_drawings_of_artists_are_rendered_but_not_in_fog_because_they_may_tell_too_much(tmp_path):
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.add_nodes([0, 1], x=[0.0, 10.0], y=[0.0, 0.0])
        ctx.graph.add_edges([0, 1], [0, 1], [1, 0])
        ctx.sensor.create_sensor("near", SensorType.RANGE, sensor_range=25.0)
        ctx.agent.create_agent("red_0", start_node_id=0, team="red", sensors=["near"], strategy=east)
        ctx.visual.add_artist("mine", {"drawer": lambda ctx, _: ctx.visual.render_text("where blue is", 5.0, 0.0)})
        ctx.record.start(tmp_path / "game.ggr")
        ctx.game.run(max_turns=2)
    for options, is_shown in (([], True), (["--fog", "red"], False)):
        run(tmp_path / "game.ggr", tmp_path / "game.svg", *options)
        assert ("where blue is" in (tmp_path / "game.svg").read_text()) == is_shown


@pytest.mark.parametrize("fog", [[], ["--fog", "red"]])
def test_views_of_sensors_are_drawn_unless_they_are_left_out(game, tmp_path, fog):
    for number, option in enumerate(([], ["--sensors"], ["--no-sensors"])):
        assert run(game, tmp_path / f"{number}.svg", *fog, *option).exit_code == 0
    seen = ["field of view" in (tmp_path / f"{number}.svg").read_text() for number in range(3)]
    assert seen == [True, True, False]


def film_of(path):
    with av.open(str(path)) as file:
        return [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]


def test_a_film_has_the_turns_that_were_asked_for(game, tmp_path):
    done = run(game, tmp_path / "game.mp4", "--turns", "3:5", "--width", 320, "--height", 100, "--frames-per-turn", 2)
    assert done.exit_code == 0, done.stderr
    assert "(3 turns)" in done.stdout
    assert len(film_of(tmp_path / "game.mp4")) == 6 + 30  # the last one is held for a second


def test_without_options_the_command_makes_the_same_as_the_function(game, tmp_path):
    run(game, tmp_path / "command.svg")
    rendering.render(game, tmp_path / "function.svg")
    assert (tmp_path / "command.svg").read_bytes() == (tmp_path / "function.svg").read_bytes()


def test_a_page_begins_where_it_is_asked_to(game, tmp_path):
    pages = []
    for first in (None, 1, 4):
        rendering.render(game, tmp_path / "game.html", RenderOptions(first=first))
        pages.append((tmp_path / "game.html").read_bytes())
    assert pages[0] == pages[1] != pages[2]


@pytest.mark.parametrize(("turns", "shown"), [("", 10), (":4", 4), ("2:6", 6), ("0", 0), ("7", 7), (":", 10)])
def test_a_picture_shows_the_last_of_the_turns(game, tmp_path, turns, shown):
    out = tmp_path / "game.svg"
    done = run(game, out, *(["--turns", turns] if turns else []), "--title", "Red passes")
    assert f"(after turn {shown})" in done.stdout
    text = out.read_text()
    assert f">turn {shown}" in text
    assert "Red passes" in text


def test_a_picture_shows_the_state_of_its_turn(game, tmp_path):
    places = []
    for turns in ("0", "4", "10"):
        run(game, tmp_path / "game.svg", "--turns", turns)
        last_red = (tmp_path / "game.svg").read_text().rsplit('<g fill="#d03028"><circle cx="', 2)[1]
        places.append(float(last_red.partition('"')[0]))
    assert places[2] - places[1] == pytest.approx(1.5 * (places[1] - places[0]), rel=0.05)


def test_rules_are_drawn_though_there_are_none_in_a_recording(game, tmp_path):
    run(game, tmp_path / "game.svg")
    text = (tmp_path / "game.svg").read_text()
    assert text.count('stroke-opacity="0.275"') == 1  # the territory, in one go
    assert text.count('z"/>') >= 1  # the pennant


def test_who_is_followed_is_in_the_middle_of_every_frame(game, tmp_path):
    given = ("--follow", "red_0", "--view", 60, "--width", 320, "--height", 160, "--frames-per-turn", 3)
    run(game, tmp_path / "game.mp4", "--turns", "1:4", *given)
    pictures = film_of(tmp_path / "game.mp4")
    assert len(pictures) == 12 + 30
    middle = 100  # of the part of the picture beside the legend
    for picture in pictures:
        red = np.abs(picture[40:].astype(int) - (208, 48, 40)).max(axis=2) < 50
        rows, columns = np.nonzero(red[:, middle - 25 : middle + 25])
        assert abs(columns.mean() - 25) < 6
        assert abs(rows.mean() + 40 - 80) < 6


@pytest.mark.parametrize("suffix", [".gif", ".mp4"])
@pytest.mark.parametrize("turns", ["1:2", "4:6"])
def test_a_film_that_follows_an_agent_is_a_landscape_from_its_first_turn_on(game, tmp_path, turns, suffix):
    options = ("--follow", "auto", "--turns", turns, "--frames-per-turn", 1)
    assert run(game, tmp_path / f"clip{suffix}", *options, "--width", 320).exit_code == 0
    with av.open(str(tmp_path / f"clip{suffix}")) as file:
        stream = file.streams.video[0]
        assert (stream.width, stream.height) == (320, 180)


@pytest.fixture(scope="module")
def eventful(tmp_path_factory):
    """Anna walks most, ben tags twice, carl carries a flag at the end, and dora, with most events, is out then."""
    path = tmp_path_factory.mktemp("eventful") / "game.ggr"
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 20))
        for node, name in enumerate(("dora", "carl", "ben", "anna")):
            strategy = east if name == "anna" else gamms.strategies.stay
            ctx.agent.create_agent(name, start_node_id=node, team=name[0], strategy=strategy)

        @ctx.game.add
        def happen(ctx):
            turn = ctx.game.turn
            if turn in (3, 4, 5):
                ctx.game.emit("hit", agent="ben", other="dora")
            if turn == 5:
                ctx.game.eliminate("dora")
            if turn == 8:
                ctx.game.data["flags"] = {"bases": {"a": 0}, "carriers": {"a": "carl"}}
            ctx.game.emit("choice", agent="anna")

        ctx.record.start(path)
        ctx.game.run(max_turns=9)
        ctx.record.stop()
    return path


@pytest.mark.parametrize(
    ("turns", "options", "followed"),
    [
        ((1, 2), {}, "anna"),
        ((3, 4), {}, "ben"),
        ((3, 6), {}, "ben"),
        ((6, 7), {}, "anna"),
        ((7, 9), {}, "carl"),
        ((7, 9), {"fog": "a"}, "anna"),
    ],
)
def test_the_agent_that_most_happens_to_is_followed(eventful, tmp_path, turns, options, followed):
    given = RenderOptions(*turns, follow="auto", width=320, frames_per_turn=1)
    given = replace(given, **options)
    with gamms.recorder.open(eventful) as recording:
        assert rendering._find_most_eventful(recording, given) == followed
    if not options:
        rendering.render(eventful, tmp_path / "auto.png", RenderOptions(*turns, follow="auto"))
        rendering.render(eventful, tmp_path / "named.png", RenderOptions(*turns, follow=followed))
        assert (tmp_path / "auto.png").read_bytes() == (tmp_path / "named.png").read_bytes()


def test_a_page_follows_the_agent_that_most_happens_to(eventful, tmp_path):
    rendering.render(eventful, tmp_path / "game.html", RenderOptions(first=3, follow="auto"))
    assert '"follow": "ben"' in (tmp_path / "game.html").read_text()


def test_in_the_fog_others_are_seen_near_the_team_only(game):
    with gamms.create_context(logger_config=QUIET) as ctx:
        seen = []

        def look():
            fog = looking.setdefault("fog", None) or looking.update(fog=Fog(ctx, "red")) or looking["fog"]
            fog.look()
            shown = ctx.visual.artists.list_shown()
            seen.append([name for name in ("blue_0", "blue_1") if name in shown])

        looking = {}
        ctx.visual.after_turn.append(look)
        for _ in ctx.record.replay(game):
            pass
    assert seen == [[]] * 3 + [["blue_0"]] * 5 + [[]] * 2  # from 20 metres before it to 20 behind
    assert looking["fog"]._now == {7, 8, 9, 10, 11}  # as reported before the last move
    assert set(looking["fog"]._seen) == set(range(12))


@pytest.mark.parametrize("errors", [{"detection": 0.0}, {"delay_turns": 50}, {"exclude": "blue"}, {}])
def test_in_the_fog_of_eyes_that_err_only_reported_agents_are_seen(errors):
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, LENGTH))
        ctx.sensor.create_sensor("eyes", "agent_range", sensor_range=25.0, **errors)
        ctx.agent.create_agent("red_0", start_node_id=0, team="red", sensors=["eyes"], strategy=east)
        for number, node in enumerate((2, 3, 20)):  # red ends on node 2, and covers node 3
            ctx.agent.create_agent(f"blue_{number}", start_node_id=node, team="blue")
        internals = ctx.game.internals
        fog = Fog(ctx, "red")
        internals.after_observing.append(lambda *_: fog.look())
        ctx.game.run(max_turns=3)
        assert fog._now == {0, 1, 2, 3, 4}
        assert fog.hidden == ({"blue_1", "blue_2"} if errors else {"blue_2"})


@pytest.mark.parametrize(
    "errors", [{"detection": 0.5}, {"position_noise_m": 20.0}, {"false_alarm_rate": 2.0}, {"delay_turns": 1}]
)
def test_pictures_of_a_recording_show_what_sensors_reported_without_a_look(tmp_path, monkeypatch, errors):
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, LENGTH))
        ctx.sensor.create_sensor("eyes", "agent_range", sensor_range=100.0, **errors)
        ctx.agent.create_agent("red_0", start_node_id=0, team="red", sensors=["eyes"], strategy=east)
        for node in range(2, 8):
            ctx.agent.create_agent(f"blue_{node}", start_node_id=node, team="blue", strategy=east)
        ctx.game.run(max_turns=6, record=tmp_path / "game.ggr")
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        reports = [recording.observation(turn, "red_0")["sensor"]["eyes"][1] for turn in range(2, 7)]
    looks = []
    sense = AgentSensor.sense
    monkeypatch.setattr(AgentSensor, "sense", lambda *given: looks.append(given) or sense(*given))
    shown = []
    with gamms.create_context(seed=2, logger_config=QUIET) as ctx:

        def look():
            fog = Fog(ctx, "red")
            fog.look()
            assert looks == []
            (sight,) = fog.sights
            shown.append(sorted((sight.view.agents[:, 0] / 10.0).round().tolist()))
            nodes = {name: ctx.agent.get_agent(name).current_node_id for name in ctx.agent.agents}
            if "detection" in errors and ctx.game.turn < 6:
                missed = {name for name in nodes if name[0] == "b"}.difference(reports[ctx.game.turn - 1])
                assert fog.hidden == missed

        ctx.visual.after_turn.append(look)
        for _ in ctx.record.replay(tmp_path / "game.ggr"):
            pass
    assert shown == [sorted(report.values()) for report in (*reports, reports[-1])]


def test_the_fog_dims_seen_ground_and_darkens_the_rest(game, tmp_path):
    out = tmp_path / "fog.png"
    assert run(game, out, "--fog", "red", "--width", 640, "--height", 200).exit_code == 0
    pixels = gamms.visual.backends.pillow_backend.decode_pixels(out.read_bytes()).astype(int)
    for color in ((20, 22, 26), (42, 45, 51), (104, 109, 118), (206, 210, 216)):
        assert (np.abs(pixels - color).max(axis=2) < 12).any(), color


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["x.png", "--turns", "99"], "has 10 turns"),
        (["x.mp4", "--turns", "5:3"], "there are none from 5 to 3"),
        (["x.png", "--fog", "green"], "Unknown team 'green'"),
        (["x.png", "--fog", "blue"], "has a sensor"),
        (["x.mp4", "--follow", "red_9"], "Did you mean 'red_0'"),
        (["x.bmp"], "'.bmp'"),
        (["x.mp4", "--width", "0"], "positive width"),
        (["nowhere/x.mp4"], "nowhere"),
        (["x.png", "--follow", "red_0", "--view", "-1"], "positive width"),
    ],
)
def test_impossible_renderings_end_in_one_sentence(game, tmp_path, monkeypatch, arguments, hint):
    monkeypatch.chdir(tmp_path)
    done = run(game, *arguments)
    assert done.exit_code == 1
    assert done.stderr.startswith("gamms: ")
    assert hint in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_turns_that_are_no_numbers_are_a_matter_of_usage(game, tmp_path):
    done = run(game, tmp_path / "x.png", "--turns", "a:b")
    assert done.exit_code == 2
    assert "100:200" in done.stderr


@pytest.mark.parametrize(
    ("name", "options", "flaw"),
    [
        ("x.svg", ("--fps", 5), "A file .svg has no fps"),
        ("x.png", ("--frames-per-turn", 5), "A file .png has no frames_per_turn"),
        ("x.html", ("--width", 5, "--no-captions"), "A file .html has no width, captions"),
    ],
)
def test_options_that_a_file_cannot_show_are_refused(game, tmp_path, name, options, flaw):
    done = run(game, tmp_path / name, *options)
    assert (done.exit_code, list(tmp_path.iterdir())) == (1, [])
    assert flaw in done.stderr


def test_options_of_another_kind_are_refused(game, tmp_path):
    with pytest.raises(BadType, match="options are RenderOptions"):
        rendering.render(game, tmp_path / "x.svg", {"last": 2})


def test_a_film_needs_a_turn(tmp_path):
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.add_nodes([0], x=[0.0], y=[0.0])
        ctx.record.start(tmp_path / "still.ggr")
        ctx.record.stop()
    with pytest.raises(BadValue, match="no turn to film"):
        rendering.render(tmp_path / "still.ggr", tmp_path / "still.gif")
    assert rendering.render(tmp_path / "still.ggr", tmp_path / "still.svg", RenderOptions()) == 0


@pytest.mark.parametrize("path", sorted(SAMPLES.glob("*.ggr"))[:2], ids=lambda path: path.stem)
def test_recordings_of_version_2_can_be_shown(path, tmp_path):
    assert run(path, tmp_path / "old.svg").exit_code == 0


def test_a_pointed_camera_no_longer_follows_and_one_that_is_gone_is_not_missed():
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.add_nodes([0, 1], x=[0.0, 10.0], y=[0.0, 0.0])
        ctx.agent.create_agent("anna", start_node_id=1)
        ctx.visual.follow("anna", 5.0)
        assert ctx.visual.viewpoint.make_camera(100, 50).left == 7.5
        ctx.agent.delete_agent("anna")
        assert ctx.visual.viewpoint.make_camera(100, 50).left == 7.5
        ctx.visual.look_at_all()
        assert ctx.visual.viewpoint.make_camera(100, 50) is None
        with pytest.raises(KeyError, match="anna"):
            ctx.visual.follow("anna", 5.0)


@pytest.fixture
def duel(tmp_path):
    """Two teams of two that see each other; one of each goes out in turn 2."""
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, LENGTH))
        for number, node in enumerate((0, 3, 6, 9)):
            name = f"{'red' if number % 2 else 'blue'}_{number // 2}"
            ctx.sensor.create_sensor(f"{name}_eyes", SensorType.AGENT_RANGE, sensor_range=35.0)
            ctx.agent.create_agent(name, start_node_id=node, team=name[:-2], sensors=[f"{name}_eyes"])
        ctx.game.add(lambda ctx: ctx.game.turn == 2 and [ctx.game.eliminate(f"{team}_0") for team in ("red", "blue")])
        ctx.record.start(tmp_path / "duel")
        ctx.game.run(3)
    return tmp_path / "duel.ggr"


def shown_by_fog(ctx, kind):
    """Who is drawn, and of which sensors something is."""
    visible = {name for name, artist in ctx.visual.artists.list_shown().items() if artist.get_visible()}
    return {name for name in visible if name.startswith(kind)}


def test_the_fog_shows_what_living_members_of_the_team_see_and_no_more(duel):
    with recordings.context_for(duel) as ctx:
        fog, told = None, []
        for _ in ctx.record.replay(str(duel)):
            if len(told) != ctx.game.turn:
                fog = fog or Fog(ctx, "blue")
                fog.look()
                told.append(shown_by_fog(ctx, "sensor_"))
        assert told == [{"sensor_blue_0_eyes", "sensor_blue_1_eyes"}, *[{"sensor_blue_1_eyes"}] * 2]


@pytest.mark.parametrize("kind", ["aerial_agent", "occluded_aerial_agent"])
def test_the_fog_below_a_flyer_is_where_it_would_see_no_agent(kind):
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, LENGTH))
        ctx.graph.add_obstacles([[(75, -9, 4), (75, 9, 4), (75, -9, 0), (75, 9, 0)]])
        ctx.sensor.create_sensor("eyes", kind, sensor_range=60.0, fov=1.4)  # which looks ahead, 40 degrees downwards
        place = {"type": "AERIAL", "position": (42.0, 0.0, 10.0), "start_node_id": 4, "speed": 1.0}
        ctx.agent.create_agent("drone", team="air", sensors=["eyes"], **place)
        internals = ctx.game.internals
        fog = Fog(ctx, "air")
        internals.after_observing.append(lambda *_: fog.look())
        ctx.game.step()
        behind_the_wall = {8, 9} if kind == "aerial_agent" else set()  # over which it sees node 10
        assert fog._now == {4, 6, 7, 10} | behind_the_wall


@pytest.mark.parametrize("suffix", [".svg", ".html", ".gif"])
def test_a_truncated_recording_of_version_2_gives_no_file(tmp_path, suffix):
    whole = next(iter(sorted(SAMPLES.glob("*.ggr")))).read_bytes()
    (tmp_path / "cut.ggr").write_bytes(whole[: len(whole) - 5])
    out = tmp_path / f"cut{suffix}"
    done = run(tmp_path / "cut.ggr", out)
    assert done.exit_code == 1
    assert "truncated" in done.stderr or "cut off" in done.stderr, done.stderr
    assert not out.exists()
