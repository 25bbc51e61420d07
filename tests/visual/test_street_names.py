"""Streets have their names along them where the map is shown close by, clear of agents, legends and each other."""

import re
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType
from gamms.visual.camera import Camera
from gamms.visual.font import measure_words
from gamms.visual.labels import STREET_PX, place_street_names
from gamms.visual.layout import Layout

X, Y = 500_000.0, 6_000_000.0


def town(*streets, crs="EPSG:32635"):
    """A context with streets: (name, points, tags) each, one edge from point to point."""
    graph = nx.MultiDiGraph(**({"crs": crs} if crs else {}))
    for name, points, tags in streets:
        for (x, y), (next_x, next_y) in pairwise(points):
            for place in ((x, y), (next_x, next_y)):
                graph.add_node(hash(place) % 2**31, x=X + place[0], y=Y + place[1])
            length = float(np.hypot(next_x - x, next_y - y))
            ends = hash((x, y)) % 2**31, hash((next_x, next_y)) % 2**31
            graph.add_edge(*ends, length=length, highway="residential", **({"name": name} if name else {}), **tags)
    ctx = gamms.create_context(seed=1)
    ctx.graph.attach_networkx_graph(graph)
    return ctx


def grid(count=5, apart=60):
    """Streets from west to east and from south to north, in pieces of 20 metres."""
    along = range(0, count * apart, 20)
    across = [(f"Row {k}", [(x, apart * k) for x in along], {}) for k in range(count)]
    return town(*across, *((f"Column {k}", [(apart * k, y) for y in along], {}) for k in range(count)))


TEXT = re.compile(
    r'<text x="(-?[\d.]+)" y="(-?[\d.]+)" font-size="10.3"(?: transform="rotate\((\S+) \S+ \S+\)")?[^>]*>([^<]*)<'
)


def names(ctx, width=800, height=600, **options):
    """The names of streets in a picture: words, x and y of where they begin, and their angle."""
    svg = ctx.visual.picture(".svg", width=width, height=height, **options).decode()
    return [(words, float(x), float(y), -float(turn or 0.0)) for x, y, turn, words in TEXT.findall(svg)]


def test_streets_have_names_close_by_and_none_far_away():
    ctx = grid()
    assert {name[0] for name in names(ctx)} >= {"Row 1", "Column 2"}
    assert names(ctx, width=200, height=150) == []


def test_they_can_be_left_out():
    assert names(grid(), street_names=False) == []
    with pytest.raises(BadType, match="street_names"):
        grid().visual.picture(".svg", street_names="no")


def test_a_name_stands_along_its_street():
    ctx = town(("Hill", [(0, 0), (200, 100)], {}), ("Up", [(300, 100), (300, 0)], {}), (None, [(300, 0), (0, 0)], {}))
    angles = {words: angle for words, _, _, angle in names(ctx)}
    assert angles == {"Hill": pytest.approx(26.565, abs=0.01), "Up": pytest.approx(90.0)}


def test_pieces_of_a_street_have_one_name():
    ctx = town(("Long street", [(20 * k, 0) for k in range(10)], {}), (None, [(0, 50), (180, 50)], {}))
    assert [name[0] for name in names(ctx)] == ["Long street"]


def test_a_name_that_does_not_fit_along_its_street_is_left_out():
    streets = ("A rather long name of a street", [(0, 0), (20, 0)], {}), ("Short", [(0, 50), (200, 50)], {})
    assert [name[0] for name in names(town(*streets))] == ["Short"]


def test_a_street_that_bends_has_its_name_where_it_is_straight():
    bends = [(0, 0), (10, 12), (20, 0), (30, 12), (40, 0), (160, 0)]
    [(_, x, _, angle)] = names(town(("Bent", bends, {}), (None, [(0, 60), (160, 60)], {})))
    assert angle == pytest.approx(0.0, abs=0.5)
    assert x > 200


@pytest.mark.parametrize("value", [None, 7, ["", "Second"], "", "x" * 500, {"a": 1}])
def test_an_invalid_street_name_is_ignored(value):
    ctx = town((value, [(0, 0), (200, 0)], {}), (None, [(0, 60), (160, 60)], {}))
    assert names(ctx) == []


def test_the_first_of_several_names_counts():
    assert [name[0] for name in names(town((["One", "Two"], [(0, 0), (200, 50)], {})))] == ["One"]


def test_tunnels_and_maps_without_metres_have_no_names():
    assert names(town(("Under", [(0, 0), (200, 50)], {"tunnel": "yes"}))) == []
    assert names(town(("Nowhere", [(0, 0), (200, 50)], {}), crs=None)) == []


def test_they_are_never_many():
    assert 1 < len(names(grid(30, 20), width=900, height=700)) <= 900 * 700 / 50_000
    assert len(names(grid(30, 20), width=400, height=300)) <= 3


def test_a_great_road_is_named_first():
    streets = [(f"Lane {k}", [(0, 30 * k), (300, 30 * k)], {}) for k in range(12)]
    graph = town(*streets, ("Great road", [(0, 180), (40, 180), (300, 195)], {"service": "x"}))
    row = next(row for row, name in graph.graph.columns().edge_attributes["name"].items() if name == "Great road")
    graph.graph.columns().edge_attributes["highway"][row] = "primary"
    assert "Great road" in [name[0] for name in names(graph, width=400, height=340)]


places = st.lists(st.integers(0, 74), min_size=0, max_size=12, unique=True)


@given(places, st.integers(0, 3))
@settings(max_examples=12)
def test_no_name_touches_an_agent_its_name_the_legend_or_another(starts, title):
    ctx = grid()
    ids = ctx.graph.columns().node_ids.tolist()
    for number, start in enumerate(starts):
        ctx.agent.create_agent(
            f"agent {number}", start_node_id=ids[start % len(ids)], team="red" if number % 2 else "blue"
        )
    svg = ctx.visual.picture(".svg", width=700, height=600, title="x" * title).decode()
    boxes = [box(*one) for one in names(ctx, 700, 600, title="x" * title)]
    others = [
        (float(x), float(y) - 9.9, float(x) + measure_words(words, 18.0), float(y) + 2.5)
        for x, y, words in re.findall(r'<text x="([\d.]+)" y="([\d.]+)" font-size="12.4"[^>]*>([^<]*)<', svg)
    ]
    dots = [
        (float(x) - float(r), float(y) - float(r), float(x) + float(r), float(y) + float(r))
        for x, y, r in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="([\d.]+)"', svg)
        if float(r) > 5.0
    ]
    for number, one in enumerate(boxes):
        for other in [*boxes[:number], *others, *dots]:
            assert one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]


def box(words, x, y, angle):
    """The box around words along a row or a column of the grid; y is their baseline, before they are turned."""
    wide, high = measure_words(words, STREET_PX), 0.6 * 10.3
    if abs(angle) < 1.0:
        return x, y - high, x + wide, y
    top = y - 0.8 * 10.3  # around which they are turned, upwards
    return x + 0.2 * 10.3, top - wide, x + 0.8 * 10.3, top


def test_a_name_covers_no_goal():
    ctx = town(("Long Lane", [(0, 0), (100, 0), (200, 0)], {}))
    node = ctx.graph.nearest_node(X + 100, Y)
    ctx.agent.create_agent("anna", start_node_id=ctx.graph.nearest_node(X, Y), team="red")
    assert [name[0] for name in names(ctx, 800, 200, legend=False)] == ["Long Lane"]
    ctx.game.add(gamms.rules.reach("red", [node]))
    assert names(ctx, 800, 200, legend=False) == []


def test_names_stay_where_they_are_while_the_picture_moves():
    ctx = grid()
    places = []
    for shift in range(0, 12, 3):
        camera = Camera(800, 600, X - 20.0 + shift, Y + 180.0, 3.0)
        found = place_street_names(camera, 1.0, ctx, {}, Layout((0.0, 0.0, 800.0, 600.0)))
        places.append({one.words: (one.x / 3.0 + camera.left, camera.top - one.y / 3.0) for one in found})
    stays = set.intersection(*map(set, places))
    assert len(stays) > 3
    for words in stays:
        assert all(place[words] == pytest.approx(places[0][words], abs=0.01) for place in places)


def test_films_have_them(tmp_path):
    ctx = grid()
    frames = [ctx.visual.frame(400, 400, street_names=shown) for shown in (True, False)]
    assert (frames[0] != frames[1]).any()
