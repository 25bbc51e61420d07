"""Themes and trails of pictures, frames, films and renders are those of the window."""

import re

import numpy as np
import pytest

import gamms
from gamms.errors import BadType, BadValue
from gamms.visual.appearance import TEAM_COLORS, is_dark
from gamms.visual.shown_turn import MOST_TURNS
from gamms.visual.themes import THEMES


def texts(svg):
    """The colours in which a picture writes, and those of the edges of its words."""
    groups = re.findall(r'fill="#(\w{6})"(?: fill-opacity="[\d.]+")?><text[^>]*?(?:stroke="#(\w{6})")?', svg)
    return {ink for ink, _ in groups}, set(re.findall(r'stroke="#(\w{6})" stroke-width="3" paint-order', svg))


def hexadecimal(color):
    return "{:02x}{:02x}{:02x}".format(*color[:3])


def test_a_background_of_the_callers_wins_and_words_can_be_read_on_it(ctx):
    svg = ctx.visual.picture(".svg", theme="print", background=(10, 20, 30)).decode()
    assert 'fill="#0a141e"/>' in svg
    assert all(not is_dark(tuple(bytes.fromhex(ink))) for ink in texts(svg)[0])


def test_teams_on_paper_are_distinguished_in_grey():
    red, green, blue = np.array(THEMES["print"].teams, float).T
    grey = np.sort(0.299 * red + 0.587 * green + 0.114 * blue)
    assert np.diff(grey).min() > 25.0
    assert grey.max() < 230.0


def test_colors_that_were_declared_are_those_of_every_theme(ctx):
    ctx.visual.artists.team_colors = {"red": (1, 2, 3)}
    for name in THEMES:
        svg = ctx.visual.picture(".svg", theme=name).decode()
        assert "#010203" in svg
        assert f"#{hexadecimal(THEMES[name].teams[1])}" not in svg


@pytest.mark.parametrize("call", ["picture", "frame", "film"])
def test_an_unknown_theme_is_an_error_that_names_those_that_there_are(ctx, call, tmp_path):
    pytest.importorskip("pygame")
    arguments = {"picture": [".svg"], "frame": [], "film": [tmp_path / "a.gif"]}[call]
    with pytest.raises(BadValue, match=r"Unknown theme 'drak'; there are: light, dark, print\. Did you mean 'dark'"):
        getattr(ctx.visual, call)(*arguments, theme="drak")


@pytest.fixture
def road():
    """An agent that walks along a road, and one that flies beside it."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 30))
        walk = iter(range(1, 30))
        ctx.agent.create_agent("anna", start_node_id=0, team="red", strategy=lambda s: s.update(action=next(walk)))
        drone = ctx.agent.create_agent(
            "drone", start_node_id=0, type=gamms.agent.AgentType.AERIAL, speed=5.0, team="blue"
        )
        drone.register_strategy(lambda state: state.update(action=(3.0, 4.0, 0.0)))
        yield ctx


def trails(ctx, turns, team="red"):
    """The lines of trails, from the oldest to the last, and how opaque they are."""
    artists = ctx.visual.artists.list_shown(turns)
    commands = gamms.visual.artist.ArtistGroup(ctx, {n: artists[n] for n in ("past trails", "trails")}).draw_artists()
    color = ctx.visual.drawing.group_colors()[team]
    rows = [row for row in range(len(commands)) if tuple(commands.color[row, :3].tolist()) == color]
    lines = [commands.points[slice(*commands.offsets[[row, row + 1]])].tolist() for row in rows]
    return lines, commands.color[rows, 3].tolist()


def test_trails_are_the_ways_of_the_last_turns_the_older_the_fainter(road):
    road.game.run(5)
    lines, alphas = trails(road, 3)
    assert [[x for x, _ in line] for line in lines] == [[20.0, 30.0], [30.0, 40.0], [40.0, 50.0]]
    assert alphas == sorted(alphas)
    assert len(trails(road, 200)[0]) == 5


def test_those_who_fly_have_trails_too(road):
    road.game.run(2)
    assert trails(road, 9, "blue")[0] == [[[0.0, 0.0], [3.0, 4.0]], [[3.0, 4.0], [6.0, 8.0]]]


def test_a_picture_has_as_many_trails_as_are_asked_for(road):
    road.game.run(6)
    red = re.compile(f'stroke="#{hexadecimal(TEAM_COLORS[1])}" stroke-opacity')
    lengths = [len(red.findall(road.visual.picture(".svg", trails=turns).decode())) for turns in (0, 1, 4)]
    assert lengths == [0, 1, 4]


def test_trails_end_where_a_game_is_reset(road):
    road.game.run(4)
    road.game.reset(1)
    assert trails(road, 9)[0] == []
    road.agent.get_agent("anna").register_strategy(lambda state: state.update(action=1))
    road.game.step()
    assert [[x for x, _ in line] for line in trails(road, 9)[0]] == [[0.0, 10.0]]


def test_an_agent_that_is_put_elsewhere_has_no_trail_that_leads_there(road):
    road.game.add(lambda ctx: ctx.game.turn == 3 and ctx.game.respawn("anna"))
    walk = iter([1, 2, 3, 1, 2])
    road.agent.get_agent("anna").register_strategy(lambda state: state.update(action=next(walk)))
    road.game.run(5)
    assert [[x for x, _ in line] for line in trails(road, 9)[0]] == [[0, 10], [10, 20], [0, 10], [10, 20]]


def test_an_agent_that_comes_or_goes_has_no_trail_from_elsewhere(road):
    road.game.run(2)
    road.agent.create_agent("new", start_node_id=9, team="red", strategy=lambda state: state.update(action=10))
    road.game.step()
    lines, _ = trails(road, 1)
    assert sorted(line[0][0] for line in lines) in ([20.0], [20.0, 90.0])
    road.agent.delete_agent("new")
    road.game.step()
    assert all(line[-1][0] <= 40.0 for line in trails(road, 1)[0])


@pytest.mark.parametrize("turns", [-1, MOST_TURNS + 1])
def test_more_turns_than_are_remembered_are_refused(road, turns):
    with pytest.raises(BadValue, match=f"trails is a number of turns from 0 to {MOST_TURNS}, not {turns}"):
        road.visual.picture(".svg", trails=turns)


def test_trails_are_a_number(road):
    with pytest.raises(BadType, match="trails"):
        road.visual.picture(".svg", trails="all")


@pytest.mark.parametrize("option", ["theme", "fit"])
@pytest.mark.parametrize("value", [{"id": 1}, np.array([1, 2])], ids=["dict", "array"])
def test_an_option_name_must_be_a_text(option, value):
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        with pytest.raises(BadValue):
            ctx.visual.frame(**{option: value})
