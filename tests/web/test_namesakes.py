"""A side is a team, or an agent without a team, also where both have the same name."""

import io
import zlib
from itertools import chain

import pytest
from shown_game import ShownGame, game_in

import gamms
from gamms import recorder, web
from gamms.errors import BadValue, UnknownName
from gamms.knowledge.sides import Side, find_named_side, label_sides
from gamms.rendering import Fog
from gamms.web.links import Audience
from gamms.web.streams import Streams


def play(name, show=lambda _: None):
    """Return a recording of anna of the team red, who sees no other, and of an agent with this name; and what is shown.

    The agent without a team sees zoe of another team.
    """
    stream = io.BytesIO()
    shown = []
    with gamms.create_context(seed=3, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 20))
        for one, node, team in (("anna", 0, "red"), (name, 8, None), ("zoe", 10, "mice")):
            ctx.sensor.create_sensor(f"eyes of {team}", "agent_range", sensor_range=25.0)
            ctx.agent.create_agent(one, start_node_id=node, team=team, sensors=[f"eyes of {team}"], strategy=go_east)
        ctx.game.add(lambda ctx: ctx.game.emit("tag", agent="zoe", other=name, node=3))
        ctx.record.start(stream)
        for _ in range(4):
            ctx.game.step()
            shown.append(show(ctx))
        ctx.record.stop()
    return stream.getvalue(), shown


def go_east(state):
    state["action"] = state["curr_pos"] + (state["name"] != "anna")


def cut(data, side):
    stream = io.BytesIO()
    with recorder.open(io.BytesIO(data)) as recording:
        recording.cut(stream, side)
    return stream.getvalue()


def list_names(data):
    with recorder.open(io.BytesIO(data)) as recording:
        return [recording[turn].agents["name"].tolist() for turn in range(recording.turns + 1)]


@pytest.fixture(scope="module")
def namesakes():
    """The recording of a game with a team and an agent without a team that are both called red."""
    return play("red")[0]


def test_a_team_sees_in_fog_nothing_of_an_agent_with_its_name():
    def show(ctx):
        fog = Fog(ctx, "team red")
        fog.look()
        witnesses = ctx.visual.drawing.events.find_witnesses(ctx.game.events[-1])
        found = len(fog.hidden), fog.filtered(ctx.visual.artists.list_shown()).keys() & {"red", "solo", "anna", "zoe"}
        ctx.visual.artists.fog = None
        return (*found, fog.side in witnesses, fog.is_own("red"))

    assert play("red", show)[1] == play("solo", show)[1] == [(2, {"anna"}, False, False)] * 4


def test_cuts_and_pages_of_namesakes_have_the_knowledge_of_the_one_that_is_named(namesakes):
    assert list_names(cut(namesakes, "team red")) == [["anna"]] * 5
    assert list_names(cut(namesakes, "agent red")) == [["red", "zoe"]] * 5
    with recorder.open(io.BytesIO(namesakes)) as recording:
        pages = [game_in(web.page(recording, audience=one)) for one in (None, "team red", "agent red", "mice")]
    sides = [[state.agents["side"].tolist() for state in page] for page in pages]
    both = [["red", "agent red", "mice"], ["red"], ["agent red", "mice"], ["mice", "agent red"]]
    assert sides == [[one] * 5 for one in both]
    assert [page.header["sides"][1] for page in pages] == ["agent red", None, "agent red", None]


def test_a_name_of_several_sides_is_refused_with_the_texts_that_tell_them_apart(namesakes):
    with pytest.raises(BadValue, match=r"Several sides .* 'red'.* Write 'team red' or 'agent red' in"):
        cut(namesakes, "red")


def test_the_link_of_a_team_shows_nothing_of_an_agent_with_its_name():
    with gamms.create_context(seed=3) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 20))
        for name, node, team in (("anna", 0, "red"), ("red", 8, None)):
            ctx.agent.create_agent(name, start_node_id=node, team=team)
        streams = Streams(ctx.graph.columns)
        ctx.record.follow(streams)
        stream = streams.get_stream(Audience("red"))
        ctx.game.step()
        streams.end()
        game = ShownGame(b"".join(map(zlib.decompress, [*stream.opening, *chain(*(one for one, _ in stream._parts))])))
    assert [state.agents["name"].tolist() for state in game] == [["anna"]] * 2


def test_namesakes_have_colors_of_their_own():
    _, shown = play("red", lambda ctx: ctx.visual.drawing.group_colors())
    assert shown[0].keys() == {"red", "agent red", "mice"}
    assert len(set(shown[0].values())) == 3


ALL = [Side("1", None), Side(1, None), Side("red", None), Side(None, "red"), Side(None, "agent red"), Side(None, "bo")]


def test_each_side_has_a_text_of_its_own_by_which_it_is_found():
    labels = label_sides(reversed(ALL))
    assert labels == dict(zip(ALL, ["1", "int 1", "red", "agent agent red", "agent red", "bo"], strict=True))
    named = {given: find_named_side(given, ALL) for given in (1, "1", "int 1", "team red", "bo", "agent bo")}
    assert named == dict(zip(named, [ALL[1], ALL[0], ALL[1], ALL[2], ALL[5], ALL[5]], strict=True))


def test_the_names_in_an_error_about_namesakes_name_one_side_each():
    sides = [*ALL, Side(None, "1")]
    with pytest.raises(BadValue, match="Write 'team 1' or 'agent 1'"):
        find_named_side("1", sides)
    named = [find_named_side(given, sides) for given in ("team 1", "agent 1", "int 1")]
    assert named == [ALL[0], Side(None, "1"), ALL[1]]


@pytest.mark.parametrize("team", [True, 1.0])
def test_an_integer_that_equals_a_team_names_no_side(team):
    with pytest.raises(UnknownName, match="Unknown team 1"):
        find_named_side(1, [Side(team, None)])


@pytest.mark.parametrize("given", [True, 1.0, "2", "agent red 2", None])
def test_what_only_equals_a_team_names_no_side(given):
    with pytest.raises(UnknownName, match="Unknown team"):
        find_named_side(given, ALL)
