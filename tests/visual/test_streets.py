"""Roads are drawn by their class: greater ones broader, tunnels dashed and below buildings, bridges above."""

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.ir.draw import DrawKind
from gamms.visual.constants import Layer
from gamms.visual.drawers.streets import cut_dashes


def town(*roads, crs="EPSG:32635"):
    """A context with parallel roads of 100 m, one for each dict of tags."""
    graph = nx.MultiDiGraph(**({"crs": crs} if crs else {}))
    for number, tags in enumerate(roads):
        for end in (0, 1):
            graph.add_node(2 * number + end, x=500_000.0 + 100.0 * end, y=6_000_000.0 + 20.0 * number)
        graph.add_edge(2 * number, 2 * number + 1, length=100.0, **tags)
    ctx = gamms.create_context()
    ctx.graph.attach_networkx_graph(graph)
    return ctx


def lines(ctx, theme="light"):
    """Rows of (y, width, colour, layer) of the roads, in painting order."""
    with ctx.visual.drawing.themed(gamms.visual.themes.THEMES[theme]):
        commands = ctx.visual.draw_commands()
    rows = [row for row in commands.in_painting_order() if commands.kind[row] == DrawKind.LINE]
    return [
        (
            round(float(commands.points[commands.offsets[row], 1] - 6_000_000.0)),
            float(commands.width[row]),
            tuple(commands.color[row][:3].tolist()),
            int(commands.layer[row]),
        )
        for row in rows
    ]


def test_the_greater_a_road_the_broader_it_is():
    kinds = ["footway", "service", "residential", "primary", "motorway"]
    found = lines(town(*({"highway": kind} for kind in kinds)))
    assert [row[0] for row in found] == [0, 20, 40, 60, 80]
    assert [row[1] for row in found] == pytest.approx([0.8, 1.4, 2.0, 3.2, 5.2])


def test_a_road_without_a_class_is_a_street():
    [plain] = lines(town({}))
    assert plain == lines(town({"highway": "residential"}))[0] == lines(town({"highway": "unheard_of"}))[0]


def test_a_road_of_several_classes_has_the_greatest():
    [both] = lines(town({"highway": ["footway", "primary"]}))
    assert both == lines(town({"highway": "primary"}))[0]


def test_a_graph_without_coordinates_of_the_earth_has_no_classes():
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(nx.DiGraph([(0, 1, {"highway": "motorway"}), (2, 3, {"tunnel": "yes"})]))
        assert len({row[1:] for row in lines(ctx)}) == 1


def test_great_roads_stand_out_in_every_theme():
    for theme, sign in (("light", -1), ("dark", 1), ("print", -1)):
        street, main, motorway = (
            sum(row[2]) for row in lines(town(*({"highway": k} for k in ("residential", "primary", "motorway"))), theme)
        )
        assert sign * street < sign * main < sign * motorway


def test_a_declared_colour_is_that_of_all_roads():
    ctx = town({"highway": "motorway"}, {"highway": "footway"}, {"highway": "service", "tunnel": "yes"})
    ctx.visual.set_graph_visual(edge_color=(1, 2, 3))
    assert {row[2] for row in lines(ctx)} == {(1, 2, 3)}


@pytest.mark.parametrize("tags", [{"tunnel": "yes"}, {"tunnel": "building_passage"}, {"layer": "-1"}, {"layer": -2}])
def test_tunnels_are_dashed_and_lie_below_buildings(tags):
    ctx = town({"highway": "residential", **tags}, {"highway": "residential"})
    tunnel, street = ([row for row in lines(ctx) if row[0] == y] for y in (0, 20))
    assert len(tunnel) > 5
    assert len(street) == 1
    assert {row[3] for row in tunnel} == {Layer.TUNNELS}
    assert Layer.TUNNELS < Layer.OBSTACLES < street[0][3]
    assert sum(tunnel[0][2]) > sum(street[0][2])  # paler


@pytest.mark.parametrize("tags", [{"tunnel": "no"}, {"layer": "0"}, {"layer": "?"}, {"layer": "-1", "bridge": "yes"}])
def test_a_road_that_only_sounds_like_a_tunnel_is_on_the_ground(tags):
    [street] = lines(town({"highway": "residential", **tags}))
    assert street[3] == Layer.GRAPH


def test_nodes_that_only_tunnels_lead_to_lie_below_buildings_too():
    ctx = town({"tunnel": "yes"}, {})
    commands = ctx.visual.draw_commands()
    is_node = commands.kind == DrawKind.CIRCLE
    assert sorted(commands.layer[is_node].tolist()) == [Layer.TUNNELS] * 2 + [Layer.GRAPH] * 2


def test_a_footbridge_is_painted_above_the_motorway_it_crosses():
    found = lines(town({"highway": "footway", "bridge": "yes"}, {"highway": "motorway"}))
    assert [row[0] for row in found] == [20, 0]


ways = st.lists(
    st.lists(st.tuples(*[st.integers(-50, 50).map(float)] * 2), min_size=2, max_size=5), min_size=1, max_size=4
)


@given(ways)
def test_dashes_are_a_fixed_share_of_a_way_and_hold_both_its_ends(ways):
    points = np.array([point for way in ways for point in way])
    offsets = np.cumsum([0, *map(len, ways)])
    found, ends = cut_dashes(points, offsets, 7.0)
    drawn = [found[begin:end] for begin, end in pairwise(ends.tolist())]
    assert all(len(dash) >= 2 for dash in drawn)
    total = sum(_length(np.array(way)) for way in ways)
    assert sum(map(_length, drawn)) == pytest.approx(0.6 * total)
    kept = {tuple(point) for dash in drawn for point in dash.tolist()}
    assert kept >= {end for way in ways if len(set(way)) > 1 for end in (way[0], way[-1])}


def _length(way):
    return float(np.hypot(*np.diff(way, axis=0).T).sum())
