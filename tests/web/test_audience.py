"""A page for a team holds what the team knows, which is checked on the recording in it."""

import io
import random
import zlib
from itertools import chain

import numpy as np
import pytest
from shown_game import ShownGame, game_in

import gamms
from gamms import recorder, web
from gamms.agent import AgentType
from gamms.errors import BadValue, UnknownName
from gamms.ir.packing import to_bytes
from gamms.rendering import Fog
from gamms.visual.drawers.rules import FlagsDrawer
from gamms.web.links import Audience
from gamms.web.streams import Streams

SECRET = "the plan is to wait"


@pytest.fixture(scope="module", params=[True, False], ids=["sensed", "asked again"])
def hunt(request):
    """A recording of two red agents with eyes and two blue ones that have a plan; whether it says what was sensed."""
    stream = io.BytesIO()
    with gamms.create_context(seed=3) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(7, 7))
        for number, (team, node) in enumerate((("red", 0), ("red", 6), ("blue", 42), ("blue", 48))):
            eyes = ctx.sensor.create_sensor(
                f"eyes {team} {number}", gamms.sensor.SensorType.AGENT_RANGE, sensor_range=25.0
            )
            ctx.agent.create_agent(
                f"{team}_{number}", start_node_id=node, team=team, sensors={"eyes": eyes.sensor_id}, strategy=wander
            )
        ctx.game.data["flags"] = {"bases": {"red": 0, "blue": 48}, "carriers": {"red": "blue_2", "blue": None}}
        ctx.visual.add_artist("flags", {"drawer": FlagsDrawer("flags")})
        ctx.game.data["hidden"] = SECRET
        ctx.record.start(stream, sensed=request.param)
        for _ in range(40):
            ctx.game.step()
            node = {agent.name: agent.current_node_id for agent in ctx.agent.create_iter()}
            graph = ctx.graph.columns()
            if all(distance(graph, node["blue_2"], node[own]) > 45.0 for own in ("red_0", "red_1")):
                ctx.game.emit("ambush", agent="blue_2", note=SECRET, node=node["blue_2"])
        ctx.record.stop()
    with recorder.open(io.BytesIO(stream.getvalue())) as recording:
        yield recording


def wander(state):
    random.seed(state["turn"] * 7 + len(state["name"]) + state["curr_pos"])
    if "blue" in state["name"]:
        state["memory"]["plan"] = SECRET
    else:
        state["memory"]["seen"] = state["turn"]
    state["action"] = random.choice(state["legal"])


def distance(graph, a, b):
    (x, y), (u, v) = (graph.xy[graph.node_ids.tolist().index(node)] for node in (a, b))
    return np.hypot(x - u, y - v)


def test_others_are_there_while_sensors_report_them(hunt):
    graph = hunt.graph.columns()
    counts = [0, 0]
    cut = game_in(web.page(hunt, audience="red"))
    assert cut.turns == hunt.turns
    for turn, (whole, known) in enumerate(zip(hunt, cut, strict=True)):
        nodes = dict(zip(whole.agents["name"].tolist(), whole.agents["node"].tolist(), strict=True))
        found = dict(zip(known.agents["name"].tolist(), known.agents["node"].tolist(), strict=True))
        for name, node in nodes.items():
            if name.startswith("red"):
                assert found[name] == node
            elif turn < hunt.turns:  # at the end the last report counts
                is_near = any(distance(graph, node, nodes[own]) <= 25.0 for own in ("red_0", "red_1"))
                assert found.get(name) == (node if is_near else None), (turn, name)
                counts[is_near] += 1
    assert min(counts) > 5


def test_no_byte_contains_secrets_of_others(hunt):
    assert SECRET in game_in(web.page(hunt)).said()
    cut = game_in(web.page(hunt, audience="red"))
    said = cut.said()
    assert SECRET not in said
    assert "plan" not in said
    assert "eyes blue" not in said
    assert "'Memory', 'seen'" in said
    for part in cut.sent:
        columns = cut.columns(part)
        assert {part["agents"][row] for row in columns["looks"][0]} == {"red_0", "red_1"}
        assert columns["sights"]["red"]["nodes"].size


ERRORS = {
    "missing": {"detection": 0.4},
    "late": {"delay_turns": 2},
    "displaced": {"position_noise_m": 15.0},
    "of nobody": {"exclude": "blue"},
}


@pytest.fixture(scope="module", params=ERRORS)
def erring(request):
    """A recording of a red agent whose eyes err, past which two blue ones wander."""
    stream = io.BytesIO()
    with gamms.create_context(seed=5) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.sensor.create_sensor("eyes", "agent_range", sensor_range=25.0, **ERRORS[request.param])
        ctx.agent.create_agent("red_0", start_node_id=12, team="red", sensors=["eyes"], strategy=wander)
        for number, node in enumerate((6, 18)):
            ctx.agent.create_agent(f"blue_{number}", start_node_id=node, team="blue", strategy=wander)
        ctx.record.start(stream, sensed=True)
        ctx.game.run(20)
    with recorder.open(io.BytesIO(stream.getvalue())) as recording:
        yield recording


def reports_in(recording):
    """Return turn -> the reported agents and their nodes."""
    table = recording.table("sensed")
    found = {turn: {} for turn in range(1, recording.turns + 1)}
    for turn, name, node in zip(*(list(table[key]) for key in ("turn", "other", "node")), strict=True):
        found[int(turn)][str(name)] = int(node)
    return found


def test_a_team_with_eyes_that_err_gets_their_reports_and_not_the_truth(erring):
    reports = reports_in(erring)
    cut = io.BytesIO()
    erring.cut(cut, "red")
    page = game_in(web.page(erring, audience="red"))
    assert SECRET not in page.said()
    assert SECRET in game_in(web.page(erring)).said()
    with recorder.open(io.BytesIO(cut.getvalue())) as known:
        for turn, shown in zip(range(erring.turns), page, strict=False):
            for agents in (known[turn].agents, shown.agents):
                places = dict(zip(agents["name"].tolist(), agents["node"].tolist(), strict=True))
                del places["red_0"]
                assert places == reports[turn + 1], turn


def test_fog_shows_agents_only_where_eyes_that_err_report_them(erring):
    """Or on the node of the team's own agent."""
    reports = reports_in(erring)
    whole = game_in(web.page(erring))
    states = list(whole)
    in_sight = {}
    for part in whole.sent:
        columns = whole.columns(part)
        sight = columns["sights"]["red"]
        ends = np.cumsum(sight["agent_counts"])
        for turn, row in enumerate(np.split(sight["agents"], ends[:-1])[: part["turns"]]):
            in_sight[part["first"] + turn - 1] = {part["agents"][agent] for agent in row}
    missed = 0
    for turn in range(erring.turns):
        agents = states[turn].agents
        places = dict(zip(agents["name"].tolist(), agents["node"].tolist(), strict=True))
        own = places.pop("red_0")
        seen = {name for name, node in places.items() if node in (own, reports[turn + 1].get(name))}
        assert in_sight[turn] == seen, turn
        missed += sum(distance(erring.graph.columns(), own, node) <= 25.0 for node in places.values()) - len(seen)
    assert missed > 5


TURNS = 12
HOME = 6  # in view of the eyes, as are its neighbors 7 and 11


def play_hiding(errors, hideout, seen_turns, *, flies=False):
    """Play a game in which a blue agent is at home whenever eyes that err report it, and else in its hideout.

    Args:
        errors: the settings of the eyes.
        hideout: a neighbor of its home.
        seen_turns: the turns with a report of it.
        flies: whether the red agent watches from the air.

    Returns:
        What the red team is given as bytes (its stream, its cut, its page, its live fog), the same for everyone, and
        turn -> the reports of the eyes.
    """
    reports = {}

    def watch(state):
        ((_, seen),) = state["sensor"].values()
        reports[state["turn"]] = dict(seen)
        if not flies:
            state["action"] = state["curr_pos"]

    def hide(state):
        state["memory"]["plan"] = f"to hide on {hideout}"
        is_seen = state["turn"] + 1 + errors.get("delay_turns", 0) in seen_turns
        state["action"] = HOME if is_seen else hideout

    saved = io.BytesIO()
    with gamms.create_context(seed=5) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.sensor.create_sensor("eyes", "aerial_agent" if flies else "agent_range", sensor_range=25.0, **errors)
        wings = {"type": AgentType.AERIAL, "speed": 5.0} if flies else {}
        red = ctx.agent.create_agent("red_0", start_node_id=12, team="red", sensors=["eyes"], strategy=watch, **wings)
        if flies:
            red.position = (20.0, 20.0, 5.0)
        ctx.sensor.create_sensor("blue eyes", "agent_range", sensor_range=10.0 + hideout)
        ctx.agent.create_agent("blue_0", start_node_id=HOME, team="blue", strategy=hide, sensors=["blue eyes"])
        ctx.record.start(saved, sensed=True)
        following = Streams(ctx.graph.columns)
        ctx.record.follow(following)
        streams = [following.get_stream(audience) for audience in (Audience("red"), Audience())]
        fog = Fog(ctx, "red")
        pictures = [], []

        def draw(*_):
            fog.look()
            pictures[0].append(ctx.visual.draw_commands().to_plain())
            ctx.visual.artists.fog = None
            pictures[1].append(ctx.visual.draw_commands().to_plain())

        ctx.game.internals.after_observing.append(draw)
        ctx.visual.after_turn.append(draw)
        ctx.game.run(TURNS)
        following.end()
        ctx.record.stop()
        red_stream, stream = [
            b"".join(map(zlib.decompress, chain(one.opening, *(messages for messages, _ in one._parts))))
            for one in streams
        ]
    with recorder.open(io.BytesIO(saved.getvalue())) as recording:
        cut = io.BytesIO()
        recording.cut(cut, "red")
        red_picture, picture = [to_bytes(one, "pictures") for one in pictures]
        red = {"stream": red_stream, "cut": cut.getvalue(), "page": web.page(recording, audience="red")}
        whole = {"stream": stream, "cut": saved.getvalue(), "page": web.page(recording)}
        return red | {"fog": red_picture}, whole | {"fog": picture}, reports


@pytest.mark.parametrize(
    ("errors", "fewest", "most", "flies"),
    [
        ({"detection": 0.4}, 2, TURNS - 3, False),
        ({"delay_turns": 2}, TURNS - 2, TURNS - 2, False),
        ({"delay_turns": 3, "detection": 0.5}, 2, TURNS - 5, False),
        ({"delay_turns": 3, "detection": 0.5}, 2, TURNS - 5, True),
        ({"exclude": "blue"}, 0, 0, False),
        ({"exclude": "blue"}, 0, 0, True),
    ],
)
def test_no_byte_of_a_team_depends_on_places_that_its_eyes_do_not_report(errors, fewest, most, flies):
    """Streams, cuts, pages and live fog of two games are equal, if the games differ only in places that are not
    reported, and in the nodes that the eyes of others cover.
    """
    reports = play_hiding(errors, 7, range(TURNS), flies=flies)[-1]
    seen_turns = {turn for turn, seen in reports.items() if "blue_0" in seen}
    assert fewest <= len(seen_turns) <= most
    one, one_whole, one_reports = play_hiding(errors, 7, seen_turns, flies=flies)
    other, other_whole, other_reports = play_hiding(errors, 11, seen_turns, flies=flies)
    assert one_reports == other_reports
    assert {turn for turn, seen in one_reports.items() if "blue_0" in seen} == seen_turns
    assert [key for key in one if one[key] != other[key]] == []
    assert [key for key in one if one_whole[key] == other_whole[key]] == []


@pytest.mark.parametrize("errors", [*ERRORS.values(), {"false_alarm_rate": 0.5}])
def test_the_stream_of_a_team_with_eyes_that_err_has_their_reports_and_not_the_truth(errors):
    red, whole, reports = play_hiding(errors, 7, range(0, TURNS, 3))
    game = ShownGame(red["stream"])
    assert game.turns == TURNS
    for turn, shown in zip(range(TURNS), game, strict=False):
        places = dict(zip(shown.agents["name"].tolist(), shown.agents["node"].tolist(), strict=True))
        assert places == {"red_0": 12} | reports[turn], turn
    assert ["to hide" in ShownGame(one["stream"]).said() for one in (red, whole)] == [False, True]


def test_flags_say_that_one_is_carried_but_not_by_whom_out_of_sight(hunt):
    seen = []
    for state in game_in(web.page(hunt, audience="red")):
        seen.append("blue_2" in state.agents["name"])
        assert ("blue_2" in state.slots["drawing flags"]["commands"].get("agents", [])) == seen[-1]
    assert set(seen) == {False, True}


def test_seeds_that_would_play_the_game_again_are_left_out(hunt):
    cut = game_in(web.page(hunt, audience="red"))
    assert cut.header.keys() <= {"format", "package", "world", "audience", "sides"}


@pytest.fixture(scope="module")
def strangers(tmp_path_factory):
    """A recording of four sides that meet late, two of them agents without a team, as pages of all and of each."""
    path = tmp_path_factory.mktemp("strangers") / "game.ggr"
    with gamms.create_context(seed=3) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 9))
        eyes = ctx.sensor.create_sensor("eyes", "agent_range", sensor_range=15.0)
        for name, node, team in (("anna", 0, "owls"), ("solo", 2, None), ("lone", 6, None), ("zoe", 8, "mice")):
            given = {"sensors": {"eyes": eyes.sensor_id}, "strategy": to_the_middle, "start_node_id": node}
            ctx.agent.create_agent(name, **({} if team is None else {"team": team}), **given)
        ctx.record.start(path, sensed=True)
        ctx.game.run(max_turns=6)
    return path


def to_the_middle(state):
    """Go towards node 4."""
    state["action"] = state["curr_pos"] + (state["curr_pos"] < 4) - (state["curr_pos"] > 4)


def test_a_cut_names_no_agent_without_a_team_that_it_does_not_know(strangers):
    named = {}
    for side in ("owls", "lone"):
        with recorder.open(strangers) as recording:
            named[side] = game_in(web.page(recording, audience=side)).header["sides"]
    assert named == {"owls": ["owls", None, None, "mice"], "lone": ["owls", None, "lone", "mice"]}


def test_pictures_of_a_cut_have_the_colours_of_the_whole_game(strangers, tmp_path):
    colors = {}
    with recorder.open(strangers) as recording:
        recording.cut(tmp_path / "mice.ggr", "mice")
    for path in (strangers, tmp_path / "mice.ggr"):
        with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
            seen = [ctx.visual.drawing.group_colors() for _ in ctx.record.replay(path)]
        colors[path.stem] = [seen[0], seen[-1]]
    (first, _), (alone, all_met) = colors["game"], colors["mice"]
    assert len(set(first.values())) == 4
    assert alone == {"mice": first["mice"]}
    assert all_met.keys() == first.keys()
    assert [all_met[team] for team in ("owls", "mice")] == [first[team] for team in ("owls", "mice")]
    assert len(set(all_met.values())) == 4


def test_sides_that_are_no_names_are_refused(strangers, tmp_path):
    with recorder.open(strangers) as recording:
        recording.cut(tmp_path / "mice.ggr", "mice")
    damaged = tmp_path / "damaged.ggr"
    with recorder.open(tmp_path / "mice.ggr") as cut, damaged.open("wb") as file:
        writer = recorder.Writer(file, {**cut.reader.header, "sides": [3]}, seconds=None)
        writer.keyframe(cut.detached(0).make_keyframe(0))
        writer.close()
    with gamms.create_context() as ctx, pytest.raises(recorder.RecordingError, match=r"sides .*\[3\]"):
        list(ctx.record.replay(damaged))


def test_a_team_that_is_not_there_or_cannot_see_is_an_error(hunt, tmp_path):
    with pytest.raises(UnknownName):
        web.page(hunt, audience="green")
    with pytest.raises(BadValue, match="audience"):
        hunt.save(tmp_path / "no.png", audience="red")
