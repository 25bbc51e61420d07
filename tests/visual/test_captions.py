"""What happens is said below films: in sentences, by kind where there is none, with turn, scores and the end."""

import re

import pytest

import gamms
from gamms.knowledge.sides import Side
from gamms.visual.captions import Captions, find_scores, write_captions


@pytest.fixture
def duel():
    """Two teams of two on a street of ten nodes, which stay where they are."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 10, 10.0))
        for number in range(4):
            team = ("red", "blue")[number % 2]
            name = f"{team}_{number // 2}"
            ctx.agent.create_agent(name, start_node_id=3 * number, team=team, strategy=lambda state: None)
        yield ctx


def words_of(events):
    return [caption.words for caption in write_captions(events)]


def text_of(picture):
    return re.findall(r"<text[^>]*>([^<]+)", picture.decode())


def emits(*turns):
    """A rule that emits kinds of events, those of the first turn first."""

    def emit(ctx):
        for kind, data in turns[ctx.game.turn - 1] if ctx.game.turn <= len(turns) else ():
            ctx.game.emit(kind, **data)

    return emit


# -- words --------------------------------------------------------------------------------------------------------


def test_who_arrives_is_not_said_to_be_out():
    events = [{"kind": kind, "agent": "robot_1", "node": 7} for kind in ("arrive", "eliminated")]
    lost = {"kind": "eliminated", "agent": "robot_2", "node": 7}
    assert words_of([*events, lost]) == ["robot_1 arrives at node 7", "robot_2 is out"]


def test_an_event_is_a_sentence_about_the_agent_to_whom_it_happens():
    assert words_of([{"kind": "take", "agent": "red_2", "flag": "blue"}]) == ["red_2 takes the blue flag"]
    assert words_of([{"kind": "tag", "agent": "blue_3", "other": "red_1"}]) == ["red_1 is tagged by blue_3"]


def test_all_events_of_an_agent_in_a_turn_are_one_sentence():
    events = [
        {"kind": "tag", "agent": "blue_3", "other": "red_1", "node": 7},
        {"kind": "eliminated", "agent": "blue_0"},
        {"kind": "respawned", "agent": "red_1", "node": 2},
        {"kind": "drop", "agent": "red_1", "flag": "blue"},
    ]
    first = "red_1 is tagged by blue_3, loses the blue flag and starts again"
    assert words_of(events) == [first, "blue_0 is out"]


def test_an_event_without_a_sentence_is_its_kind_and_agent():
    assert words_of([{"kind": "storm", "agent": "anna", "strength": 3}, {"kind": "dusk"}]) == ["anna: storm", "dusk"]


@pytest.mark.parametrize("event", [{"kind": "tag", "agent": "anna"}, {"kind": "take", "agent": "anna"}])
def test_an_event_without_the_fields_of_its_sentence_is_not_made_up(event):
    assert words_of([event]) == [f"anna: {event['kind']}"]


def test_braces_in_names_are_letters():
    assert words_of([{"kind": "tag", "agent": "{flag}", "other": "{0.x}"}]) == ["{0.x} is tagged by {flag}"]


def test_teams_without_a_score_have_none_only_where_no_team_has_one(duel):
    assert find_scores(duel) == {}
    duel.game.scores["blue"] += 2
    assert find_scores(duel) == {"red": 0, "blue": 2}


# -- pictures and films -------------------------------------------------------------------------------------------


def test_a_picture_of_the_end_says_how_the_game_ended(duel):
    duel.game.add(lambda ctx: ctx.game.end("enough", winner="blue"))
    duel.game.run()
    assert "blue won: enough" in text_of(duel.visual.picture(".svg", 600, 400, captions=True))


def test_scores_stand_beside_the_turn_where_there_is_no_legend(duel):
    duel.game.scores["red"] += 3
    duel.game.run(1)
    duel.visual.set_graph_visual()  # without a legend
    assert "turn 1 · red 3 · blue 0" in text_of(duel.visual.picture(".svg", 600, 400, captions=True))


def test_a_caption_has_the_colour_of_its_team(duel):
    duel.game.add(emits([("dusk", {"agent": "blue_1"}), ("dawn", {})]))
    duel.game.step()
    told = Captions(duel, duel.visual.drawing).make_captions()
    assert [line.color for line in told.lines] == [duel.visual.drawing.group_colors()["blue"], None]


def test_captions_beyond_the_last_line_are_counted(duel):
    duel.game.add(emits([(kind, {}) for kind in ("one", "two", "three", "four")]))
    duel.game.step()
    assert [line.words for line in Captions(duel, duel.visual.drawing).make_captions().lines] == [
        "one",
        "two, and 2 more",
    ]


def test_a_side_gets_captions_of_its_agents_and_of_those_that_it_saw_in_the_turn(duel):
    duel.game.add(emits([("storm", {"agent": "red_0"}), ("tag", {"agent": "red_1", "other": "blue_1", "node": 0})]))
    duel.game.step()
    views = duel.visual.drawing.events.views
    blue = Side("blue", None)
    told = []
    for turn in (0, 2, 1):
        views.note(turn, blue, ["red_0"])
        told.append([line.words for line in Captions(duel, duel.visual.drawing).make_captions(blue).lines])
    assert told == [["blue_1 is tagged by red_1"]] * 2 + [["red_0: storm", "blue_1 is tagged by red_1"]]


def test_the_paper_s_loop_is_counted(duel):
    for _ in range(3):
        duel.visual.simulate()
    assert Captions(duel, duel.visual.drawing).make_captions().turn == 3


def test_a_film_without_captions_has_no_card(duel, tmp_path):
    duel.game.add(gamms.rules.time_limit(1))
    with duel.visual.film(tmp_path / "a.mp4", 10, 640, 400, 2, captions=False) as film:
        duel.game.run()
    assert film.frames == 2 + 10
