"""No byte of what a team knew has the name or the look of an agent that it has not seen, also when it is inflated."""

import base64
import io
import re
import zlib
from itertools import chain

import pytest
from games import grid_context, replayed
from test_cuts import cut_of, stay, to_and_fro

import gamms
from gamms.recorder import open as opened
from gamms.sensor import SensorType
from gamms.visual import Artist
from gamms.web.links import Audience
from gamms.web.streams import Streams

SECRETS = (b"zqspy", b"zqlens", b"zqbase", b"zqnote", b"zqsecond", b"zqcount", b"zqplan", b"hotpink", b"darkkhaki")
OF_HOST = {b"zqbase", b"zqplan", b"zqcount"}  # which the team of the spy does not know either


def inflated(data):
    """The bytes, and all that a part of them inflates to."""
    yield data
    for start in range(len(data)):
        inflater = zlib.decompressobj(-15)
        try:
            part = inflater.decompress(data[start:], 1 << 20)
        except zlib.error:
            continue
        if len(part) > 8:
            yield part


def secrets_in(data):
    data = b"".join([data, *map(base64.b64decode, re.findall(rb'class="recording">([^<]*)<', data))])
    return sorted({secret for part in inflated(data) for secret in SECRETS if secret in part})


def scene(*, sees_late=False, **more):
    """Blue walks between nodes 0 and 1; red, with all its looks and names, stands far away, or on node 2."""
    ctx = grid_context(**more)
    ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=12.0)
    ctx.sensor.create_sensor("zqlens", SensorType.AGENT_RANGE, sensor_range=1.0)
    ctx.agent.create_agent("blue_0", start_node_id=0, team="blue", sensors=["eyes"], strategy=to_and_fro)
    ctx.agent.create_agent(
        "zqspy", start_node_id=2 if sees_late else 8, team="red", sensors=["zqlens"], strategy=stay, hat="zqnote"
    )
    ctx.game.data["flags"] = {"bases": {"blue": 4, "red": 5}, "carriers": {"blue": "zqspy", "red": None}}
    ctx.visual.set_graph_visual(width=300, height=300)
    ctx.visual.set_agent_visual("blue_0", color="darkseagreen", size=5)
    ctx.visual.set_agent_visual("zqspy", color="hotpink", size=5)
    ctx.visual.set_sensor_visual("zqlens", node_color="darkkhaki")
    return ctx


def played(ctx, turns=3, **more):
    stream = io.BytesIO()
    ctx.record.start(stream, sensed=True, **more)

    @ctx.game.add
    def tell(ctx):
        ctx.game.emit("noise", agent="zqspy", note="zqnote")
        if ctx.game.turn == 2:
            ctx.visual.set_agent_visual("zqspy", color="hotpink", size=9)
            circle = Artist(ctx, gamms.visual.Shape.Circle, 40)
            circle.data = {"x": 20.0, "y": 20.0, "radius": 3.0, "color": "darkkhaki"}
            ctx.visual.add_artist("zqbase", circle)

    ctx.game.run(turns)
    ctx.record.close()
    return stream.getvalue()


def zqplan(state):
    """Remember and send the note; its own name is recorded as that of the strategy."""
    state["memory"]["zqnote"] = {"zqnote": state["turn"]}
    state["team_memory"]["zqnote"] = ["zqnote"] * (1 + state["turn"])
    state["outbox"] = [{"channel": "wire", "to": "red", "body": "zqnote"}]
    state["action"] = 0 if state["turn"] == 2 else state["curr_pos"]  # 0 is not legal


def scene_with_a_plan():
    """The scene in which the spy has a secret in every kind of column, event and fact, before the game and in it."""
    ctx = scene()
    ctx.game.add_channel("radio", range_m=50.0, jammers=[{"radius_m": 1.0, "agent": "zqspy"}], eavesdroppers=["zqspy"])
    ctx.game.add_channel("zqwire", range_m=1.0, teams=["red"], relay=["zqspy"])
    ctx.game.deeds = {"zqdeed": {"zqfield": "node"}}
    ctx.game.add_channel("wire", range_m=1.0)
    ctx.agent.get_agent("zqspy").register_strategy(zqplan)
    ctx.game.publish(to="red", plan="zqnote")
    ctx.game.publish(to="zqspy", plan="zqnote")
    ctx.game.collect("zqcount", lambda agent: agent.current_node_id, per="agent")
    ctx.sensor.create_sensor("zqsecond", SensorType.AGENT_RANGE, sensor_range=2.0, delay_turns=1)

    @ctx.game.add
    def change(ctx):
        spy = ctx.agent.get_agent("zqspy")
        ctx.game.data[f"zqnote {ctx.game.turn}"] = "zqnote"
        ctx.game.publish(to="red", plan=f"zqnote {ctx.game.turn}")
        ctx.game.publish(to="zqspy", plan=f"zqnote {ctx.game.turn}")
        spy.zqnote = f"zqnote {ctx.game.turn}"
        spy.speed = 1 + ctx.game.turn
        if ctx.game.turn == 1:
            spy.register_sensor("zqsecond", ctx.sensor.get_sensor("zqsecond"))

    return ctx


PROVENANCE = {"strategies": {"zqspy": "zqnote"}}


@pytest.fixture(scope="module")
def whole():
    return played(scene_with_a_plan(), provenance=PROVENANCE)


def test_the_whole_recording_has_them_and_the_cut_does_not(whole):
    assert secrets_in(whole) == sorted(SECRETS)
    cut = cut_of(whole, "blue")
    assert secrets_in(cut) == []
    assert secrets_in(cut_of(whole, "red")) == sorted({*SECRETS} - OF_HOST)
    with opened(io.BytesIO(cut)) as recording:
        assert [one["name"] for one in recording.header["visuals"]["artists"]] == ["graph", "blue_0"]


def test_neither_do_pages(whole):
    with opened(io.BytesIO(whole)) as recording:
        assert b"zqspy" in secrets_in(gamms.web.page(recording))
        assert secrets_in(gamms.web.page(recording, audience="blue")) == []


def test_neither_do_streams():
    ctx = scene_with_a_plan()
    streams = Streams(ctx.graph.columns)
    of_blue, of_red = [Audience(team) for team in ("blue", "red")]
    ctx.record.follow(streams)
    for audience in (of_blue, of_red):
        streams.get_stream(audience)
    played(ctx, provenance=PROVENANCE)
    streams.end()
    sent = [
        b"".join(map(zlib.decompress, chain(one.opening, *(messages for messages, _ in one._parts))))
        for one in map(streams.get_stream, (of_blue, of_red))
    ]
    assert secrets_in(sent[0]) == []
    assert b"zqnote" in secrets_in(sent[1])


def test_an_agent_brings_its_look_when_it_is_seen_first():
    cut = cut_of(played(scene(sees_late=True)), "blue")
    with opened(io.BytesIO(cut)) as recording:
        assert [one["name"] for one in recording.header["visuals"]["artists"]] == ["graph", "blue_0"]
        shown = [
            [one["name"] for one in step["data"]["artists"]] for step in recording.steps() if step["event"] == "VISUALS"
        ]
        assert shown[0] == ["graph", "blue_0", "zqspy"]
        sizes = [
            step["data"]["artists"][2]["keywords"]["size"] for step in recording.steps() if step["event"] == "VISUALS"
        ]
        assert sizes == [5, 9]
    ctx, _ = replayed(cut)
    assert "zqspy" in ctx.visual.artists.declared


def test_colours_of_agents_without_a_team_come_with_them():
    ctx = grid_context()
    ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=1.0)
    ctx.agent.create_agent("blue_0", start_node_id=0, team="blue", sensors=["eyes"], strategy=to_and_fro)
    ctx.agent.create_agent("zqspy", start_node_id=8, strategy=stay)
    ctx.visual.artists.team_colors = {"blue": "green", "zqspy": "black"}
    data = played(ctx, turns=1)
    assert b"zqspy" in secrets_in(data)
    assert secrets_in(cut_of(data, "blue")) == []
    with opened(io.BytesIO(cut_of(data, "blue"))) as recording:
        assert [*recording.header["visuals"]["team_colors"]] == ["blue"]
