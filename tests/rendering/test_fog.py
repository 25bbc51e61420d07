"""Fog shows what the sensors of a team reported: in a live game, in its recording, and as in the team's cut."""

import copy
import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms import recorder, scenario
from gamms.agent import AgentType
from gamms.errors import BadValue
from gamms.ir.packing import to_bytes
from gamms.knowledge.sides import Side
from gamms.rendering import Fog
from gamms.rules import capture_flag, tag
from gamms.sensor import SensorType
from gamms.strategies import random_walk
from gamms.visual.artist import ArtistGroup
from gamms.web.painter import Painter

QUIET = {"level": "CRITICAL"}


def draw(ctx):
    """Return all that a picture shows, as bytes."""
    return to_bytes(ctx.visual.draw_commands().to_plain(), "a picture")


def draw_artists(ctx, *names):
    """Return the kinds and the points of what artists draw."""
    shown = ctx.visual.artists.list_shown()
    plain = ArtistGroup(ctx, {name: shown[name] for name in names if name in shown}).draw_artists().to_plain()
    return plain["kind"].tolist(), plain["points"].round(6).tolist()


def watch_live(ctx, team, turns):
    """Play turns, and return what the fog of a team shows when agents decide, then after the last turn."""
    internals = ctx.game.internals  # the game is there, before the fog follows it
    fog = Fog(ctx, team)
    pictures = {}

    def look(*_):
        if ctx.game.turn not in pictures:  # or a later part of the turn observes
            fog.look()
            pictures[ctx.game.turn] = draw(ctx)

    internals.after_observing.append(look)
    for _ in range(turns):
        ctx.game.step()
    fog.look()
    return [*pictures.values(), draw(ctx)]


def watch_recording(recording, team, show=draw):
    """Return what the fog of a team shows of the recording, from the start to the last turn."""
    pictures = []
    with gamms.create_context(seed=99, logger_config=QUIET) as ctx:
        playbacks = []
        ctx.visual.show_playback = playbacks.append
        records = ctx.record.replay(recording)
        next(records, None)
        fog = Fog(ctx, team)
        for turn in range(recording.turns + 1):
            playbacks[0].seek(turn)
            fog.look()
            pictures.append(show(ctx))
        playbacks[0].close()
    return pictures


def open_recording(stream):
    return recorder.open(io.BytesIO(stream.getvalue()))


@pytest.mark.parametrize(
    ("name", "team", "turns"),
    [("hunt_in_fog", "hunters", 6), ("search_by_drones", "searchers", 5), ("hide_and_seek", "seekers", 2)],
)
def test_live_fog_of_the_gallery_is_the_fog_of_the_recording_at_every_turn(name, team, turns):
    stream = io.BytesIO()
    with scenario.from_gallery(name).build() as ctx:
        ctx.record.start(stream)
        live = watch_live(ctx, team, turns)
        ctx.record.stop()
    with open_recording(stream) as recording:
        assert [a == b for a, b in zip(live, watch_recording(recording, team), strict=True)] == [True] * (turns + 1)


ERRORS = [
    {},
    {"detection": 0.5},
    {"delay_turns": 1},
    {"position_noise_m": 12.0},
    {"false_alarm_rate": 1.0},
    {"exclude": "blue"},
]
KINDS = [
    *((SensorType.AGENT_RANGE, errors) for errors in ERRORS),
    (SensorType.RANGE, {}),
    (SensorType.OCCLUDED_AGENT, {"detection": 0.7}),
    (SensorType.AGENT_ARC, {"fov": 2.0}),
    (SensorType.AERIAL_AGENT, {"delay_turns": 1}),
]


@settings(max_examples=6)
@given(seed=st.integers(0, 2**16), kinds=st.lists(st.sampled_from(KINDS), min_size=1, max_size=3))
def test_live_fog_of_any_game_is_the_fog_of_its_recording_at_every_turn(seed, kinds):
    stream = io.BytesIO()
    with gamms.create_context(seed=seed, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        for number, (kind, errors) in enumerate(kinds):
            ctx.sensor.create_sensor(f"eyes_{number}", kind, sensor_range=25.0, **errors)
            more = {"type": AgentType.AERIAL, "speed": 5.0} if "AERIAL" in kind.name else {"strategy": random_walk}
            ctx.agent.create_agent(f"red_{number}", start_node_id=12, team="red", sensors=[f"eyes_{number}"], **more)
        ctx.agent.create_team("blue", [6, 8, 18, 24], strategy=random_walk)
        ctx.game.add(tag("blue", "red"))
        ctx.record.start(stream)
        live = watch_live(ctx, "red", 4)
        ctx.record.stop()
    with open_recording(stream) as recording:
        assert [a == b for a, b in zip(live, watch_recording(recording, "red"), strict=True)] == [True] * 5


@pytest.fixture
def street():
    """Red looks 25 metres far and stays; blue walks along the street, and enters and leaves its view."""
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 20))
        ctx.sensor.create_sensor("eyes", "agent_range", sensor_range=25.0)
        ctx.agent.create_agent("red", start_node_id=5, team="red", sensors=["eyes"], strategy=stay)
        ctx.agent.create_agent("blue", start_node_id=2, team="blue", strategy=go_east)
        yield ctx


def stay(state):
    state["action"] = state["curr_pos"]


def go_east(state):
    state["action"] = max(state["legal"])


def test_between_turns_others_are_shown_where_they_were_reported(street):
    fog = Fog(street, "red")
    shown = []
    for _ in range(8):
        fog.look()
        at = street.agent.get_agent("blue").current_node_id
        shown.append((at, fog.reported.get("blue"), "blue" in fog.hidden))
        street.game.step()
    before = [(2, None, True), (3, None, True)]
    in_view = [(node + 1, (10.0 * node, 0.0), False) for node in range(3, 8)]
    in_view[1] = (5, None, False)  # on the node of red
    assert shown == [*before, *in_view, (9, None, True)]


def test_fog_shows_no_report_of_a_turn_that_is_taken_back(street):
    def fail(state):
        raise ZeroDivisionError

    fog = Fog(street, "red")
    blue = street.agent.get_agent("blue")
    for _ in range(5):
        fog.look()
        before = draw(street)
        blue.strategy = fail
        with pytest.raises(ZeroDivisionError):
            street.game.step()
        fog.look()
        assert draw(street) == before
        blue.strategy = go_east
        street.game.step()


def test_before_the_first_report_a_team_sees_its_own_nodes_in_a_recording_of_no_turns_too(street):
    stream = io.BytesIO()
    street.record.start(stream)
    fog = Fog(street, "red")
    fog.look()
    street.record.stop()
    assert (fog.hidden, fog._now) == ({"blue"}, {5})
    with open_recording(stream) as recording:
        assert watch_recording(recording, "red") == [draw(street)]


def test_no_sensor_is_asked_and_none_changes(street, monkeypatch):
    fog = Fog(street, "red")
    street.game.run(max_turns=3)
    eyes = street.sensor.get_sensor("eyes")
    before = repr(eyes.data)
    asked = []
    monkeypatch.setattr(type(eyes), "sense", lambda *given: asked.append(given))
    fog.look()
    draw(street)
    assert (asked, repr(eyes.data)) == ([], before)


def test_a_game_is_recorded_with_the_same_bytes_under_a_fog():
    recorded = []
    for is_watched in (True, False):
        stream = io.BytesIO()
        with scenario.from_gallery("hunt_in_fog").build() as ctx:
            ctx.record.start(stream, created=0, provenance="")
            fog = Fog(ctx, "hunters") if is_watched else None
            for _ in range(5):
                ctx.game.step()
                if fog is not None:
                    fog.look()
                    draw(ctx)
            ctx.record.stop()
        recorded.append(stream.getvalue())
    assert recorded[0] == recorded[1]


def test_a_new_game_begins_without_reports_of_the_last(street):
    fog = Fog(street, "red")
    street.game.run(max_turns=3)
    fog.look()
    assert fog.hidden == set()
    street.game.reset()
    fog.look()
    assert fog.hidden == {"blue"}


@pytest.fixture(scope="module")
def raid():
    """A recording of red agents that look, and blue ones that fetch their flag and are tagged on the way."""
    stream = io.BytesIO()
    with gamms.create_context(seed=4, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 6))
        ctx.sensor.create_sensor("eyes", "agent_range", sensor_range=15.0)
        ctx.agent.create_team("red", [0, 9], strategy=random_walk, sensors=["eyes"])
        ctx.agent.create_team("blue", [6, 15, 23], strategy=random_walk)
        ctx.agent.create_team("green", [3, 20], strategy=random_walk)
        ctx.game.add(capture_flag({"red": 7, "blue": 23}, goal=None))
        ctx.game.add(tag("blue", "green"))
        ctx.game.add(tag("blue", "red"))
        ctx.record.start(stream)
        ctx.game.run(max_turns=20)
        ctx.record.stop()
    with open_recording(stream) as recording:
        yield recording


def test_fog_shows_the_flags_and_tags_of_the_cut(raid):
    names = ("flags", "flags beneath", "tags")
    stream = io.BytesIO()
    raid.cut(stream, "red")
    fog = watch_recording(raid, "red", lambda ctx: draw_artists(ctx, *names))
    with open_recording(stream) as cut, gamms.create_context(seed=99, logger_config=QUIET) as ctx:
        playbacks = []
        ctx.visual.show_playback = playbacks.append
        records = ctx.record.replay(cut)
        next(records, None)
        known = []
        for turn in range(cut.turns + 1):
            playbacks[0].seek(turn)
            known.append(draw_artists(ctx, *names))
    assert fog == known
    assert len({str(one) for one in known}) > 5


def test_in_fog_a_flag_is_at_home_if_it_is(raid):
    def draw_whole(ctx):
        ctx.visual.artists.fog = None
        return draw_artists(ctx, "flags beneath")

    homes = watch_recording(raid, "red", lambda ctx: draw_artists(ctx, "flags beneath"))
    assert homes == watch_recording(raid, "red", draw_whole)
    assert len({len(kinds) for kinds, _ in homes}) > 1


def test_fog_of_a_copy_of_a_game_of_a_batch_begins_with_its_next_turn(tmp_path):
    hunt = scenario.from_gallery("hunt_in_fog")
    with hunt.batch(seeds=[4, 5]) as games:
        games.step()
        games.record(1, tmp_path / "game.ggr")
        with games.context(1) as ctx:
            fog = Fog(ctx, "hunters")
            with pytest.raises(BadValue, match=r"has not kept what agent 'hunters_0' has sensed.* games.record\(…\)"):
                fog.look()
            assert ctx.visual.artists.fog is None
            assert len(watch_live(copy.deepcopy(ctx), "hunters", 1)) == 2
    with hunt.build(seed=5) as ctx:
        alone = watch_live(ctx, "hunters", 1)
    with recorder.open(tmp_path / "game.ggr") as recording:
        assert watch_recording(recording, "hunters") == alone


def test_fog_and_pages_know_that_a_side_knows_of_the_events_of_its_cut(raid):
    stream = io.BytesIO()
    raid.cut(stream, "red")

    def list_known(ctx):
        events = ctx.visual.drawing.events
        return [event for event in events.list_last() if Side("red", None) in events.find_witnesses(event)]

    in_fog = watch_recording(raid, "red", list_known)[1:]
    header = {**raid.header, "world": raid.graph.packed}
    in_page = []
    with Painter(header, raid.detached(0).make_keyframe(0)) as painter:
        for log in raid.logs(1, raid.turns + 1):
            painter.add(log)
            in_page.append(list_known(painter._ctx))
    with open_recording(stream) as cut:
        in_cut = [[*cut.events(turn, turn + 1)] for turn in range(1, cut.turns + 1)]
    assert in_fog == in_cut
    assert in_page == in_cut
    assert 0 < sum(map(len, in_cut)) < len([*raid.events()])
