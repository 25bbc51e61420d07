"""What a page shows of rules and artists is what pictures show, in both themes, and in every turn."""

import io
import zlib

import numpy as np
import pytest
from shown_game import ShownGame, game_in

import gamms
from gamms import recorder, web
from gamms.errors import BadType
from gamms.ir import events
from gamms.ir.game_state import as_collected
from gamms.visual.artist import ArtistGroup
from gamms.visual.charts import select_charts
from gamms.visual.themes import THEMES
from gamms.web.knowledge import AgentFacts
from gamms.web.streams import Streams


def ring(ctx, data):
    """Draw a ring around the agent that comes first, in a color of the theme."""
    x, y = ctx.visual.drawing.position_of("red_0", data.get("_alpha", 1.0))
    ctx.visual.render_circle(x, y, 4.0, ctx.visual.drawing.theme.ink, 2)


def warn(ctx):
    """Say that a turn is over."""
    ctx.game.emit("warned", agent="red_0")


warn.drawer = ring


@pytest.fixture(scope="module")
def played():
    """A recorded game with shipped rules and a rule with its own drawer, and what pictures showed in each turn."""
    stream, shown = io.BytesIO(), []
    with gamms.create_context(seed=2) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        for number, (team, node) in enumerate((("red", 0), ("red", 4), ("blue", 24), ("blue", 20))):
            strategy = gamms.strategies.random_walk
            ctx.agent.create_agent(f"{team}_{number}", start_node_id=node, team=team, strategy=strategy)
        ctx.game.add(gamms.rules.capture_flag({"red": 0, "blue": 24}))
        ctx.game.add(gamms.rules.tag("red", "blue", then="eliminate"))
        ctx.game.add(gamms.rules.resource("fuel", 20))
        ctx.game.add(gamms.rules.hold([12], 3, ends=False))
        ctx.game.add(warn)
        ctx.record.start(stream)
        for _ in range(12):
            ctx.game.step()
            shown.append({theme: drawn(ctx, theme) for theme in ("light", "dark")})
        ctx.record.stop()
    return stream.getvalue(), shown


def drawn(ctx, theme):
    """Return what the artists of signs draw in a theme: name -> colors and points."""
    with ctx.visual.drawing.themed(THEMES[theme]):
        found = {
            name: ArtistGroup(ctx, {name: one}).draw_artists() for name, one in ctx.visual.artists.list_signs().items()
        }
    return {name: (one.color, one.points) for name, one in found.items() if len(one)}


def test_a_strategy_is_called_as_the_function_that_the_program_called():
    stream = io.BytesIO()
    with gamms.create_context(seed=2) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        ctx.agent.create_agent("anna", start_node_id=0, strategy=gamms.strategies.patrol(ctx, [0, 1]))
        ctx.record.start(stream)
        ctx.game.step()
        ctx.record.stop()
    stream.seek(0)
    with recorder.open(stream) as recording:
        facts = AgentFacts(recording.detached(1)).list_changes(None, 1)
        assert {key: words for _, _, key, words in facts}["strategy"].endswith(":patrol")


def test_signs_of_each_turn_are_those_of_pictures_in_both_themes(played):
    data, expected = played
    with recorder.open(io.BytesIO(data)) as recording:
        states = list(game_in(web.page(recording)))
    for state, shown in zip(states[1:], expected, strict=True):
        slots = {slot.removeprefix("drawing "): one for slot, one in state.slots.items() if slot[:8] == "drawing "}
        now = {name: one for name, one in slots.items() if one is not None}
        assert {name for name, one in now.items() if len(one["commands"]["kind"])} == shown["light"].keys()
        for theme, drawings in shown.items():
            for name, (colors, points) in drawings.items():
                styles = now[name]["commands"]["style"]
                assert np.array_equal(now[name]["colors"][theme][styles], colors) or name == "rule_warn"
                assert now[name]["commands"]["counts"].sum() == len(points)
    assert {"flags", "held", "resources", "rule_warn"} <= now.keys()
    assert now["resources"]["facts"].keys() == {"red_0", "red_1", "blue_2", "blue_3"}


def test_a_rule_with_a_drawer_of_its_own_is_painted_and_its_words_are_said(chromium, played, tmp_path):
    with recorder.open(io.BytesIO(played[0])) as recording:
        recording.save(tmp_path / "game.html", turn=5)
    page = chromium.open(tmp_path / "game.html")
    page.settle()
    drawings = "gamms.views[0].replay.state.drawings"
    assert page.value(f"[...{drawings}.get('rule_warn').get('commands').get('kind')]") == [1]
    assert "red_0: warned" in page.value("document.querySelector('.captions').textContent")
    assert page.messages == []


def test_a_late_spectator_receives_the_earlier_drawings_of_artists():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        for team, node in (("red", 0), ("blue", 24)):
            ctx.agent.create_agent(team, start_node_id=node, team=team, strategy=gamms.strategies.random_walk)
        ctx.game.add(gamms.rules.capture_flag({"red": 0, "blue": 24}))
        following = Streams(ctx.graph.columns)
        ctx.record.follow(following)
        ctx.visual.add_artist("spot", {"drawer": lambda ctx, _: ctx.visual.render_circle(0, 0, 5, (1, 2, 3), 2)})
        ctx.game.run(max_turns=10)
        stream = following.get_stream(gamms.web.links.Audience())
        messages, *_ = stream.read(stream.last_keyframe)
        following.close()
    *_, state = ShownGame(b"".join(map(zlib.decompress, [*stream.opening, *messages])))
    drawn = {slot for slot in state.slots if slot.startswith("drawing ")}
    assert drawn == {"drawing flags", "drawing flags beneath", "drawing spot"}


def test_pages_have_the_edges_that_actions_have_named():
    stream = io.BytesIO()
    with gamms.create_context(seed=1) as ctx:
        for node in range(2):
            ctx.graph.add_node({"id": node, "x": 50.0 * node, "y": 0.0})
        for edge, source, length in [(10, 0, 50.0), (11, 0, 90.0), (12, 1, 50.0)]:
            ctx.graph.add_edge({"id": edge, "source": source, "target": 1 - source, "length": length})
        actions = [1, {"edge": 12}, {"edge": 11}, 0]
        ctx.agent.create_agent(
            "ann", start_node_id=0, strategy=lambda state: state.update(action=actions[state["turn"]])
        )
        ctx.agent.create_agent("ben", start_node_id=0, strategy=gamms.strategies.stay)
        ctx.record.start(stream)
        ctx.game.run(4)
        ctx.record.stop()
    with recorder.open(io.BytesIO(stream.getvalue())) as recording:
        game = game_in(web.page(recording))
    (part,) = game.sent
    named = game.columns(part)["named_edges"]
    at = [divmod(place, part["turns"]) for place in named["at"].tolist()]
    ann = part["agents"].index("ann")
    assert [*zip(at, named["edges"].tolist(), strict=True)] == [((ann, 2), 2), ((ann, 3), 1)]


def play_with_collectors(path=None):
    """Play three turns of a game with collectors; return the context."""
    ctx = gamms.create_context(seed=1)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
    ctx.sensor.create_sensor("eyes", gamms.sensor.SensorType.AGENT_RANGE, sensor_range=12.0)
    for team, start in (("red", 0), ("blue", 15)):
        ctx.agent.create_agent(team, start_node_id=start, team=team, sensors=["eyes"], strategy=gamms.strategies.stay)
    ctx.game.collect("hidden total", lambda ctx: ctx.game.turn * 1.5, every=2)
    ctx.game.collect("place", lambda agent: np.int64(agent.current_node_id), per="agent")
    ctx.game.collect("words", lambda ctx: "no number")
    ctx.game.collect("nothing", lambda ctx: float("nan"))
    if path is not None:
        ctx.record.start(path, sensed=True)
    ctx.game.run(3)
    return ctx


def test_a_page_has_the_numbers_that_a_game_collects_and_that_of_a_team_has_none(tmp_path):
    play_with_collectors(tmp_path / "game.ggr").terminate()
    with recorder.open(tmp_path / "game.ggr") as recording:
        shown = game_in(web.page(recording))
        known = web.page(recording, audience="red")
        recording.cut(tmp_path / "red.ggr", "red")
    places = {"red": 0, "blue": 15}
    charts = [state.slots.get("charts") for state in shown]
    assert charts == [
        None,
        {"place": places},
        {"hidden total": {"": 3.0}, "place": places},
        {"hidden total": {"": 3.0}, "place": places},
    ]
    assert all("charts" not in state.slots for state in game_in(known))
    assert "hidden total" not in repr([game_in(known).header, *game_in(known).sent])
    with recorder.open(tmp_path / "red.ggr") as cut:
        assert b"hidden total" not in cut.content()
        assert all(kind != events.GAME_COLLECTED for log in cut.logs() for kind, _ in events.list_events(log))


def test_at_most_four_charts_of_eight_lines_are_shown():
    many = {f"chart {i}": {f"agent {j}": j for j in range(50)} for i in range(50)}
    charts = select_charts(many | {"x" * 999: 1})
    assert [*charts] == ["chart 0", "chart 1", "chart 2", "chart 3"]
    assert {len(lines) for lines in charts.values()} == {8}
    assert select_charts({"a\nb" + "x" * 999: 1.0}) == {("a\\nb" + "x" * 999)[:60]: {"": 1.0}}


def test_charts_of_a_replay_are_those_of_the_game(tmp_path):
    with play_with_collectors(tmp_path / "game.ggr") as ctx:
        now = ctx.game.internals.state.collected
        assert now == {"hidden total": 3.0, "place": {"red": 0, "blue": 15}}
        assert ctx.game.fork(2).internals.state.collected == now
        ctx.game.reset()
        assert ctx.game.internals.state.collected == {}
    with recorder.open(tmp_path / "game.ggr") as recording:
        assert recording.detached(3).game.collected == now


@pytest.mark.parametrize("wrong", [[], {"a": "b"}, {"a": {"b": "c"}}, {1: 2}, {"a": float("nan")}, {"a": True}])
def test_damaged_collected_numbers_are_refused(wrong):
    with pytest.raises(BadType, match="Collected numbers"):
        as_collected(wrong)
