"""Goals of the rule `reach` are drawn, in replays too, and the legend says what they are."""

import re

import numpy as np
import pytest

import gamms
from gamms.ir.draw import DrawKind
from gamms.rules import reach
from gamms.visual.appearance import PAPER, TEAM_COLORS
from gamms.visual.legend import _SIGNS

BLUE, RED = TEAM_COLORS[:2]


@pytest.fixture
def race():
    """Two agents on a street, without rules."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 40))
        for name, node in (("red", 0), ("blue", 20)):
            stay = lambda state: state.update(action=state["curr_pos"])
            ctx.agent.create_agent(name, start_node_id=node, team=name, strategy=stay)
        yield ctx


def goals(ctx):
    """Where rings are on the layer of goals, and of which colours."""
    commands = ctx.visual.draw_commands()
    rows = (commands.layer == 18).nonzero()[0]
    places = {tuple(commands.points[commands.offsets[row]].tolist()) for row in rows}
    return places, set(map(tuple, commands.color[rows, :3].tolist())) - {PAPER}


def words(ctx):
    return re.findall(r">([^<>]+)</text>", ctx.visual.picture(".svg", 600, 400, labels=False, scale_bar=False).decode())


def test_each_teams_goals_are_drawn_in_its_color(race):
    race.game.add(reach({"red": [5, 9], "blue": 0}))
    assert goals(race) == ({(50.0, 0.0), (90.0, 0.0), (0.0, 0.0)}, {RED, BLUE})
    assert {"red", "blue", "goal"} <= set(words(race))


def test_a_goal_where_an_agent_stands_differs_from_an_agent_in_view(race):
    race.game.add(reach("red", 20))
    commands = race.visual.draw_commands()
    ticks = (commands.layer == 18) & (commands.kind == DrawKind.POLYGON)
    ends = [commands.points[commands.offsets[row] + 2] for row in ticks.nonzero()[0]]
    assert {tuple(end.tolist()) for end in ends} == {(16.0, 0.0), (0.0, 16.0), (-16.0, 0.0), (0.0, -16.0)}
    assert sum(len(part.points) == 2 for part in _SIGNS["goal"]) == 4  # in the legend, too


def test_a_goal_at_the_edge_of_the_map_is_drawn_whole(race):
    pytest.importorskip("pygame")
    race.game.add(reach("red", 39))
    seen = race.visual.frame(400, 100, labels=False, legend=False, scale_bar=False).astype(int)
    rows, columns = np.nonzero(np.abs(seen - RED).max(axis=2) < 40)
    is_goal = columns > 200  # and not the agent, which is at the other edge
    assert np.ptp(rows[is_goal]) > 16
    assert np.ptp(rows[is_goal]) == pytest.approx(np.ptp(columns[is_goal]), abs=1)


def test_two_rules_may_have_goals_of_one_team(race):
    race.game.add(reach("red", 5))
    race.game.add(reach("red", [6, 11]), name="another")
    assert goals(race)[0] == {(50.0, 0.0), (60.0, 0.0), (110.0, 0.0)}


def test_where_a_team_began_is_drawn_from_the_first_turn_on(race):
    race.game.add(reach("red", "starts of blue"))
    race.game.run(1)
    assert goals(race) == ({(200.0, 0.0)}, {RED})


def test_many_goals_are_faint_dots(race):
    race.game.add(reach("red", range(20, 40)))
    commands = race.visual.draw_commands()
    rows = commands.layer == 18
    assert (rows.sum(), set(commands.width[rows].tolist())) == (20, {0.0})
    assert commands.color[rows, 3].max() < 255


def test_a_program_can_hide_the_goals_and_their_row_of_the_legend(race):
    race.game.add(reach("red", 5))
    race.visual.add_artist("goals", {"drawer": lambda ctx, data: None}).set_visible(False)
    assert goals(race)[0] == set()
    assert "goal" not in words(race)
