"""What is declared adds to the default look; where the graph is declared, nothing else is drawn."""

import pytest

import gamms
from gamms.errors import BadType, BadValue, UnknownName
from gamms.rules import capture_flag, territory
from gamms.sensor import SensorType
from gamms.visual.appearance import TEAM_COLORS

TEAL, BLUE = (0, 128, 128), TEAM_COLORS[0]


def legend_rows(svg):
    """The words of a picture's legend that name teams."""
    return [team for team in ("red", "blue") if f">{team}</text>" in svg]


def colors_in(commands, layer):
    """The colours on a layer."""
    return set(map(tuple, commands.color[commands.layer == layer, :3].tolist()))


@pytest.mark.parametrize(
    ("name", "declare"),
    [
        ("red_0", lambda visual: visual.set_agent_visual("red_0", color=TEAL)),
        ("sensor_spy", lambda visual: visual.set_sensor_visual("spy")),
        ("obstacles", lambda visual: visual.set_obstacle_visual()),
    ],
)
def test_a_declared_drawing_replaces_only_its_part_of_the_default_look(ctx, name, declare):
    before = ctx.visual.artists.list_shown()
    artist = declare(ctx.visual)
    shown = ctx.visual.artists.list_shown()
    assert shown[name] is artist
    assert {one: shown[one] for one in before if one != name} == {one: before[one] for one in before if one != name}
    assert legend_rows(ctx.visual.picture(".svg").decode()) == ["red", "blue"]


@pytest.mark.parametrize("is_graph_first", [True, False])
def test_a_program_that_declares_the_graph_sees_its_declarations_as_in_1_0_0(ctx, is_graph_first):
    def declare_others():
        ctx.visual.set_sensor_visual("spy")
        return ctx.visual.set_agent_visual("red_0").data["agent_data"]

    ctx.sensor.get_sensor("spy").sense(0)
    look = None if is_graph_first else declare_others()
    ctx.visual.draw_commands()
    ctx.visual.set_graph_visual()
    look = look or declare_others()
    assert set(ctx.visual.artists.list_shown()) == {"graph", "red_0", "sensor_spy"}
    assert (look.color, look.size) == ((0, 0, 0), 8.0)
    commands = ctx.visual.draw_commands()
    assert {8.0, 10.0} == set(commands.size[(commands.layer == 40) & (commands.width > 0.0)].tolist()) - {2.0}
    ctx.visual.remove_artist("graph")
    assert set(ctx.visual.artists.list_shown()) == {"red_0", "sensor_spy"}


@pytest.fixture
def game():
    """Two teams with flags and territories on a street."""
    with gamms.create_context(seed=1, logger_config={"level": "WARNING"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 8))
        for name, node in (("red", 0), ("blue", 7)):
            ctx.agent.create_agent(f"{name}_0", start_node_id=node, team=name, strategy=lambda state: None)
        ctx.game.add(territory.published({node: "red" if node < 4 else "blue" for node in range(8)}))
        ctx.game.add(capture_flag({"red": 0, "blue": 7, "gold": 4}, goal=None))
        yield ctx


@pytest.mark.parametrize(
    ("colors", "error", "words"),
    [
        ({"reed": "red"}, UnknownName, "Unknown team 'reed'. Did you mean 'red'?"),
        ({"red": "rod"}, BadValue, "The color of team 'red': Unknown color 'rod'"),
        ({"blue": 5}, BadType, "The color of team 'blue': A color is"),
        ({"blue": (1, 2)}, BadValue, "The color of team 'blue': A color has three or four"),
        ([("red", "blue")], BadType, "team_colors must be a mapping from teams to colors"),
    ],
)
def test_a_wrong_team_or_color_is_named_and_changes_nothing(game, colors, error, words):
    game.visual.artists.team_colors = {"red": TEAL}
    with pytest.raises(error, match=words.replace("?", r"\?")):
        game.visual.artists.team_colors = colors
    assert dict(game.visual.artists.team_colors) == {"red": TEAL}


def test_colors_of_teams_are_a_copy_that_cannot_be_written_to(game):
    mine = {"red": TEAL}
    game.visual.artists.team_colors = mine
    mine["red"] = BLUE
    with pytest.raises(TypeError):
        game.visual.artists.team_colors["red"] = BLUE
    assert dict(game.visual.artists.team_colors) == {"red": TEAL}


def test_agents_without_a_team_go_by_their_names(ctx):
    ctx.agent.create_agent("lone", start_node_id=0)
    ctx.visual.artists.team_colors = {"lone": TEAL}
    assert ctx.visual.artists.list_shown()["lone"].data["agent_data"].color == TEAL


def test_no_team_chooses_a_color_that_was_given_to_another(ctx):
    ctx.agent.create_agent("third", start_node_id=1, team="third")
    ctx.visual.artists.team_colors = {"blue": TEAM_COLORS[2], "red": TEAM_COLORS[3]}
    colors = ctx.visual.drawing.group_colors()
    assert len(set(colors.values())) == 3


def test_a_strategy_cannot_change_the_colors_of_teams(game):
    found = []

    def paint(state):
        with pytest.raises(gamms.errors.IllegalMutation) as caught:
            game.visual.artists.team_colors = {}
        found.append(str(caught.value))

    game.agent.get_agent("red_0").register_strategy(paint)
    game.game.step()
    assert "team_colors" in found[0]


def test_a_sensor_that_was_declared_keeps_its_color_and_agents_theirs(ctx):
    ctx.sensor.create_sensor("eye", SensorType.RANGE, sensor_range=3.0).sense(0)
    ctx.visual.set_sensor_visual("eye", color=TEAL)
    commands = ctx.visual.draw_commands()
    assert colors_in(commands, 40) == {TEAL}
    assert {BLUE, TEAM_COLORS[1]} < colors_in(commands, 20)


def test_a_misspelt_keyword_of_a_visual_is_warned_about(ctx, heard):
    ctx.visual.set_agent_visual("red_0", colour="red", size=3)
    ctx.visual.set_graph_visual(nodecolor="red", width=1980, height=1080)
    ctx.visual.set_sensor_visual("eyes", color="red", mine=1)
    assert heard == [
        "Visual 'red_0': Unknown keyword 'colour'. Did you mean 'color'? It is left to drawers of your own.",
        "Visual 'graph': Unknown keyword 'nodecolor'. Did you mean 'node_color'? It is left to drawers of your own.",
    ]


def test_a_drawer_asks_for_the_color_in_effect_of_a_team():
    ctx = gamms.create_context(seed=1)
    ctx.graph.add_nodes([0, 1], x=[0, 10], y=[0, 0])
    for name, team in (("ann", "red"), ("ben", 2), ("cid", None)):
        ctx.agent.create_agent(name, start_node_id=0, team=team)
    seen = []
    ctx.visual.add_artist("own", {"drawer": lambda ctx, _: seen.append(ctx.visual.drawing.color_of("red"))})
    for theme in ("light", "dark"):
        ctx.visual.picture(".svg", theme=theme)
    ctx.visual.artists.team_colors = {"red": "#882255"}
    ctx.visual.picture(".svg")
    light, dark, declared = dict.fromkeys(seen)
    assert light != dark
    assert declared == (136, 34, 85)
    color_of = ctx.visual.drawing.color_of
    colors = [color_of(team) for team in ("red", 2, "cid", "of no agent")]
    assert color_of("2") == color_of(2)
    assert len(set(colors)) == 4
    ctx.agent.create_agent("dan", start_node_id=0, team="of no agent")
    assert [color_of(team) for team in ("red", 2)] == colors[:2]
