"""No sign has two meanings, signs look different from each other, and no ring is around one's own team."""

from itertools import combinations

import numpy as np
import pytest

import gamms
from gamms.bridge.driving import Drive
from gamms.ir.draw import DrawKind
from gamms.rules import capture_flag
from gamms.strategies import stay
from gamms.visual import legend
from gamms.visual.constants import Layer
from gamms.visual.default_scene import _VIEWS
from gamms.visual.drawers import marks, rules, standings
from gamms.visual.legend import LegendRow, LegendRows


def rows_of_all_signs(monkeypatch):
    """Return the rows of all legends that come with GAMMS."""
    counted = {standings.RESOURCES: ["fuel"], standings.COOLDOWNS: ["scan"]}
    monkeypatch.setattr(standings, "find_counts", lambda _, group: counted[group])
    monkeypatch.setattr(marks, "_find_latest_tags", lambda *_: [1])
    blocks = [
        rules._FLAGS,
        rules._GOALS,
        rules.TerritoryDrawer.legend,
        marks.make_elimination_rows({"a": True, "b": False}),
    ]
    blocks += [standings.render_held.legend, standings.render_discovered.legend]
    blocks += [standings._make_amount_rows(None), standings._make_cooldown_rows(None)]
    rows = [row for block in blocks for row in block.rows]
    rows += [LegendRow(legend.SIGN, words, sign=sign) for _, words, sign in _VIEWS]
    return rows + [
        LegendRow(legend.SIGN, words, sign=sign) for words, sign in (("tagged", "tag"), ("message", "curve"))
    ]


def test_no_sign_has_two_meanings(monkeypatch):
    meanings = dict[str, set[str]]()
    for row in [*rows_of_all_signs(monkeypatch), LegendRow(legend.SIGN, "robot, as measured", sign="plus")]:
        meanings.setdefault(row.sign, set()).add(row.name)
    assert [names for names in meanings.values() if len(names) > 1] == []
    assert meanings.keys() | {"disc"} == legend._SIGNS.keys()


def test_a_robot_is_explained_by_a_sign_of_its_own():
    assert Drive("a", None, None, (1.0, 1.0), None).drawer.legend.rows[0].sign == "plus"


def test_each_sign_is_painted_in_its_own_way():
    pytest.importorskip("pygame")
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        painted = {}
        artist = ctx.visual.add_artist("sign", {"drawer": lambda ctx, data: None})
        for sign in legend._SIGNS:
            artist.data = {"legend": LegendRows("", (LegendRow((200, 30, 30), "sign", sign=sign),))}
            painted[sign] = ctx.visual.frame(400, 200, scale_bar=False).astype(int)
    for one, other in combinations(painted, 2):
        different = (np.abs(painted[one] - painted[other]).max(axis=2) > 40).sum()
        assert different > 12, (one, other)


@pytest.fixture
def met():
    """Two blue agents and a red one, which all see each other."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 9))
        eyes = {"eyes": gamms.sensor.agent_range(range_m=90)}
        ctx.agent.create_team("blue", [0, 4], sensors=eyes, strategy=stay)
        ctx.agent.create_team("red", [8], sensors=eyes, strategy=stay)
        yield ctx


def circles(ctx, layer):
    """Return where circles of a layer are, each with its color."""
    commands = ctx.visual.draw_commands()
    rows = np.flatnonzero((commands.layer == layer) & (commands.kind == DrawKind.CIRCLE))
    return [(*commands.points[commands.offsets[row]].tolist(), *commands.color[row, :3].tolist()) for row in rows]


def test_in_view_never_rings_ones_own_team(met):
    met.game.run(1)
    colors = met.visual.drawing.group_colors()
    rings = circles(met, Layer.SEEN)
    blue, red = (tuple(colors[team][:3]) for team in ("blue", "red"))
    assert {ring for ring in rings if ring[2:] == blue} == {(80.0, 0.0, *blue)}
    assert {ring for ring in rings if ring[2:] == red} == {(0.0, 0.0, *red), (40.0, 0.0, *red)}


def test_agents_without_a_team_ring_each_other():
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 9))
        for name, node in (("a", 0), ("b", 4)):
            eyes = {"eyes": gamms.sensor.agent_range(range_m=90)}
            ctx.agent.create_agent(name, start_node_id=node, sensors=eyes, strategy=stay)
        ctx.game.run(1)
        assert {ring[:2] for ring in circles(ctx, Layer.SEEN)} == {(0.0, 0.0), (40.0, 0.0)}


def test_the_home_of_a_flag_is_a_square_and_no_ring(met):
    met.game.add(capture_flag({"blue": 0, "red": 8}))
    met.game.run(1)
    assert circles(met, Layer.FLAGS) == []
