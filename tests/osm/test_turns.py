"""Turn restrictions: which signs hold, where they stay, and routes that obey them."""

import json
import random
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from turn_referee import Referee, add_signs

import gamms
from gamms.errors import BadFile, BadType, BadValue, NoPath, UnknownName
from gamms.ir.graph import list_forbidden_paths
from gamms.osm import graph_from_file, process_osm_graph, report, resample_columns

STREET = {"highway": "residential"}
NO_CUT = 1e6
# A crossing: 1 in the west, 3 in the east, 4 in the north, 5 in the south of node 2; ways 100 to 103.
CROSSING = {1: (60.17, 24.94), 2: (60.17, 24.942), 3: (60.17, 24.944), 4: (60.171, 24.942), 5: (60.169, 24.942)}
ARMS = [([1, 2], STREET), ([2, 3], STREET), ([2, 4], STREET), ([5, 2], STREET)]
KLUUVI = Path(__file__).parents[1] / "osm_online" / "data" / "kluuvi.osm.gz"


def sign(value, starts, through, ends, **tags):
    """Return a relation; ways and nodes are given by id, ways above 99."""
    members = [("way", ref, "from") for ref in starts] + [("way", ref, "to") for ref in ends]
    members += [("way" if ref >= 100 else "node", ref, "via") for ref in through]
    given = {"type": "restriction", **({"restriction": value} if value else {}), **tags}
    inside = [f'<member type="{kind}" ref="{ref}" role="{role}"/>' for kind, ref, role in members]
    return "".join([*inside, *(f'<tag k="{key}" v="{word}"/>' for key, word in given.items())])


@pytest.fixture
def signed(make_map):
    """A function that writes a map with turn restrictions."""

    def write(nodes, ways, *signs):
        path = make_map(nodes, *ways)
        relations = [f'<relation id="{id}">{inside}</relation>' for id, inside in enumerate(signs, 1)]
        path.write_text(path.read_text().replace("</osm>", "".join([*relations, "</osm>"])))
        return path

    return write


def loaded(graph):
    ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(graph)
    return ctx


def turns(path, **options):
    """Return the forbidden paths as the places of their nodes on the map, by OpenStreetMap id."""
    how = {"resolution": NO_CUT, "tolerance": 0.0, "osm_type": "drive", **options}
    ctx = loaded(graph_from_file(path, **how))
    columns = ctx.graph.columns()
    osmids = columns.node_attributes["osmid"]
    row_of = {id: row for row, id in enumerate(columns.edge_ids.tolist())}
    found = set()
    for edges in list_forbidden_paths(columns).get(how["osm_type"], []):
        rows = [row_of[id] for id in edges]
        found.add((osmids[columns.sources[rows[0]]], *(osmids[row] for row in columns.targets[rows].tolist())))
    return found


@pytest.mark.parametrize(
    ("tags", "drive", "bike"),
    [
        ({"value": "no_left_turn"}, True, True),
        ({"value": "no_left_turn", "except": "bicycle"}, True, False),
        ({"value": "no_left_turn", "except": "psv;motorcar"}, False, True),
        ({"value": "no_left_turn", "except": "hgv"}, True, True),
        ({"value": "", "restriction:motorcar": "no_left_turn"}, True, False),
        ({"value": "", "restriction:motor_vehicle": "no_left_turn"}, True, False),
        ({"value": "", "restriction:bicycle": "no_left_turn"}, False, True),
        ({"value": "", "restriction:hgv": "no_left_turn"}, False, False),
        ({"value": "no_left_turn", "type": "restriction:motorcar"}, True, False),
        ({"value": "no_left_turn", "type": "restriction:hgv"}, False, False),
        ({"value": "", "restriction:conditional": "no_left_turn @ (Mo-Fr)"}, False, False),
        ({"value": "no_left_turn", "hour_on": "07:00", "hour_off": "09:00"}, False, False),
        ({"value": "no_left_turn_on_red"}, False, False),
        ({"value": " No_Left_Turn "}, True, True),
        ({"value": "give_way"}, False, False),
    ],
)
def test_a_sign_holds_for_the_vehicles_that_it_names(signed, tags, drive, bike):
    value = tags.pop("value") if "value" in tags else ""
    tags = dict(tags)
    path = signed(CROSSING, ARMS, sign(value, [100], [2], [102], **tags))
    tags["value"] = value
    held = {mode: turns(path, osm_type=mode) == {(1, 2, 4)} for mode in ("drive", "bike", "walk")}
    assert held == {"drive": drive, "bike": bike, "walk": False}
    found = report(graph_from_file(path, osm_type="drive"), path)
    assert (found.turn_restrictions, found.turn_restrictions_ignored) == (int(drive), int(not drive))
    is_timed = "restriction:conditional" in tags or "hour_on" in tags
    assert found.turn_restrictions_conditional == int(is_timed and not drive)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (("no_left_turn", [100], [2], [102]), {(1, 2, 4)}),
        (("no_entry", [100, 103], [2], [102]), {(1, 2, 4), (5, 2, 4)}),
        (("no_exit", [100], [2], [101, 102]), {(1, 2, 3), (1, 2, 4)}),
        (("no_u_turn", [100], [2], [100]), {(1, 2, 1)}),
        (("no_u_turn", [100], [2], [102]), {(1, 2, 4)}),
        (("only_straight_on", [100], [2], [101]), {(1, 2, 4), (1, 2, 5)}),
        (("only_right_turn", [102], [2], [100]), {(4, 2, 3), (4, 2, 5)}),
        (("no_left_turn", [100], [3], [102]), set()),
        (("no_left_turn", [100], [2], [999]), set()),
        (("only_straight_on", [100], [2], [999]), set()),
        (("no_left_turn", [100], [101], [102]), set()),
    ],
)
def test_each_sign_forbids_its_paths(signed, given, expected):
    assert turns(signed(CROSSING, ARMS, sign(*given))) == expected


def test_two_signs_of_the_only_way_on_allow_both(signed):
    both = sign("only_straight_on", [100], [2], [101]), sign("only_left_turn", [100], [2], [102])
    assert turns(signed(CROSSING, ARMS, *both)) == {(1, 2, 5)}


def test_a_way_into_a_closed_street_is_no_only_way_on(signed):
    arms = [*ARMS[:1], ([2, 3], STREET | {"access": "no"}), ([4, 2], STREET | {"oneway": "yes"}), ARMS[3]]
    signs = sign("only_straight_on", [100], [2], [101]), sign("only_left_turn", [100], [2], [102])
    assert turns(signed(CROSSING, arms, *signs), strong=False, retain_all=True) == set()


# A street in the west (1, 2), one north of node 2 to node 6 by way of 4, one in the east (6, 7), and arms at 2 and 6.
LADDER = CROSSING | {6: (60.172, 24.942), 7: (60.172, 24.944), 8: (60.172, 24.94)}
RUNGS = [([1, 2], STREET), ([2, 4, 6], STREET), ([6, 7], STREET), ([6, 8], STREET), ([2, 3], STREET), ([2, 5], STREET)]


def test_a_path_along_ways_between_is_forbidden_as_a_whole(signed):
    assert turns(signed(LADDER, RUNGS, sign("no_u_turn", [100], [101], [103]))) == {(1, 2, 6, 8)}
    only = {(1, 2, 6, 7), (1, 2, 3), (1, 2, 5)}
    assert turns(signed(LADDER, RUNGS, sign("only_left_turn", [100], [101], [103]))) == only
    halves = [*RUNGS[:1], ([2, 4], STREET), ([6, 4], STREET), *RUNGS[2:]]
    path = signed(LADDER, halves, sign("no_u_turn", [100], [102, 101], [104]))
    assert turns(path) == {(1, 2, 6, 8)}
    assert turns(path, simplify=False) == {(1, 2, 4, 6, 8)}


def test_the_state_of_traffic_is_the_path_that_it_has_driven(signed):
    ctx = loaded(
        graph_from_file(signed(LADDER, RUNGS, sign("no_u_turn", [100], [101], [103])), NO_CUT, osm_type="drive")
    )
    at = {place: node for node in ctx.graph.get_nodes() if (place := ctx.graph.node_attributes(node)["osmid"])}
    edge = {(one.source, one.target): id for id in ctx.graph.get_edges() if (one := ctx.graph.get_edge(id))}
    along = [edge[at[one], at[other]] for one, other in ((1, 2), (2, 6))]
    onward = ctx.graph.routes.edges_onward
    everything = sorted(edge[at[6], at[place]] for place in (2, 7, 8))
    assert onward(at[6], turns=True) == everything
    assert onward(at[6], driven=along[1:]) == sorted(edge[at[6], at[place]] for place in (7, 8))
    assert onward(at[6], driven=along) == [edge[at[6], at[7]]]
    assert onward(at[1], driven=[edge[at[2], at[1]]]) == [edge[at[1], at[2]]]  # a dead end
    assert ctx.graph.shortest_path(at[1], at[8], turns="drive") == [at[place] for place in (1, 2, 6, 7, 6, 8)]
    assert ctx.graph.routes.shortest_path_edges(at[6], at[8], driven=along)[0] == edge[at[6], at[7]]
    detour = ctx.graph.distance(at[1], at[8], turns="drive")
    assert detour == pytest.approx(ctx.graph.distance(at[1], at[8]) + 2 * ctx.graph.distance(at[6], at[7]))
    assert ctx.graph.distances(source=at[1], turns="drive")[at[8]] == pytest.approx(detour)
    assert ctx.graph.distances(target=at[8], turns="drive")[at[1]] == pytest.approx(detour)
    with pytest.raises(UnknownName, match="drive"):
        ctx.graph.shortest_path(at[1], at[8], turns="dive")
    with pytest.raises(BadType, match="turns"):
        ctx.graph.shortest_path(at[1], at[8], turns=3)
    with pytest.raises(BadValue, match="driven"):
        onward(at[6], driven=along[::-1])
    with pytest.raises(UnknownName, match="edge"):
        onward(at[6], driven=[99])


def test_forbidden_turns_are_saved_and_written(signed, tmp_path):
    path = signed(LADDER, RUNGS, sign("no_u_turn", [100], [101], [103]), sign("no_left_turn", [100], [2], [101]))
    ctx = loaded(graph_from_file(path, 40.0, osm_type="drive"))
    paths = list_forbidden_paths(ctx.graph.columns())
    ctx.graph.save(tmp_path / "map.gamms")
    other = gamms.create_context()
    other.graph.load(tmp_path / "map.gamms")
    assert list_forbidden_paths(other.graph.columns()) == paths
    nx.write_graphml(ctx.graph.to_networkx(plain=True), tmp_path / "map.graphml")
    again = loaded(nx.relabel_nodes(nx.read_graphml(tmp_path / "map.graphml"), int))
    assert list_forbidden_paths(again.graph.columns()) == paths
    ctx.graph.close_roads([paths["drive"][0][1]])
    assert len(list_forbidden_paths(ctx.graph.columns())["drive"]) < len(paths["drive"])
    damaged = ctx.graph.to_networkx()
    next(iter(damaged.edges(data=True)))[2]["forbidden_turns"] = json.dumps({"drive": [7]})
    with pytest.raises(BadValue, match="forbidden_turns"):
        loaded(damaged).graph.shortest_path(0, 1, turns="drive")


@pytest.mark.parametrize("cut", [resample_columns, process_osm_graph])
def test_forbidden_turns_stay_when_a_graph_is_cut_again(signed, cut):
    path = signed(LADDER, RUNGS, sign("no_u_turn", [100], [101], [103]), sign("no_left_turn", [100], [2], [101]))
    whole = graph_from_file(path, NO_CUT, osm_type="drive")
    given = loaded(whole).graph.columns() if cut is resample_columns else whole
    cut_at_once = loaded(graph_from_file(path, 40.0, osm_type="drive"))
    cut_again = loaded(cut(given, 40.0, bidirectional=False))
    ends = [[ctx.graph.nearest_node(lat=60.17, lon=24.94) for ctx in (cut_at_once, cut_again)]]
    ends.append([ctx.graph.nearest_node(lat=60.172, lon=24.94) for ctx in (cut_at_once, cut_again)])
    far = [ctx.graph.distance(a, b, turns="drive") for ctx, a, b in zip((cut_at_once, cut_again), *ends, strict=True)]
    assert far[0] == pytest.approx(far[1])
    assert far[0] > cut_at_once.graph.distance(ends[0][0], ends[1][0])


def test_a_sign_on_a_road_without_a_junction_closes_it_there(signed):
    line = [([1, 2], STREET), ([2, 3], STREET)]
    path = signed(CROSSING, line, sign("no_straight_on", [100], [2], [101]))
    assert turns(path) == {(1, 2, 3)}
    ctx = loaded(graph_from_file(path, NO_CUT, osm_type="drive"))
    with pytest.raises(NoPath):
        ctx.graph.shortest_path(0, 2, turns=True)
    assert ctx.graph.shortest_path(2, 0, turns=True) == [2, 1, 0]


# Two carriageways of a street from west to east, 9 m apart, crossed by a street from south (11) to north (12).
DUAL = {
    1: (60.17, 24.94),
    2: (60.17, 24.942),
    3: (60.17, 24.944),  # to the east
    4: (60.17008, 24.944),
    5: (60.17008, 24.942),
    6: (60.17008, 24.94),  # to the west
    11: (60.169, 24.942),
    12: (60.171, 24.942),
}
ONE_WAY = STREET | {"oneway": "yes"}
CARRIAGEWAYS = [([1, 2], ONE_WAY), ([2, 3], ONE_WAY), ([4, 5], ONE_WAY), ([5, 6], ONE_WAY)]
CARRIAGEWAYS += [([11, 2], STREET), ([2, 5], STREET), ([5, 12], STREET), ([3, 4], ONE_WAY), ([6, 1], ONE_WAY)]


@pytest.mark.parametrize(
    ("given", "forbidden"),
    [
        (("no_left_turn", [100], [2], [105]), {(1, 12), (1, 6)}),
        (("no_u_turn", [100], [105], [103]), {(1, 6)}),
        (("no_left_turn", [105], [5], [103]), {(1, 6), (11, 6)}),
        (("no_right_turn", [100], [2], [104]), {(1, 11)}),
        (("only_straight_on", [100], [2], [101]), {(1, 12), (1, 6), (1, 11)}),
        (("no_straight_on", [104], [105], [106]), {(11, 12)}),
    ],
)
def test_a_merged_junction_keeps_its_forbidden_paths(signed, given, forbidden):
    path = signed(DUAL, CARRIAGEWAYS, sign(*given))
    ctx = loaded(graph_from_file(path, NO_CUT, osm_type="drive", tolerance=10.0))
    assert len([*ctx.graph.get_nodes()]) == 7  # one for the crossing, two ends, two cuts of each loop
    between = {}
    for id in ctx.graph.get_edges():
        one = ctx.graph.get_edge(id)
        between[id] = one.source, one.target
    middle = ctx.graph.nearest_node(lat=60.17004, lon=24.942)
    found = set()
    for begin in (1, 4, 11, 12):
        for end in (3, 6, 11, 12):
            entering = [id for id, (a, b) in between.items() if b == middle and _is_arm(ctx, id, begin)]
            leaving = [id for id, (a, b) in between.items() if a == middle and _is_arm(ctx, id, end)]
            onward = ctx.graph.routes.edges_onward(middle, driven=entering, turns="drive")
            if begin != end and leaving[0] not in onward:
                found.add((begin, end))
    assert found == forbidden


def _is_arm(ctx, id, place):
    """Return whether an edge has a vertex at a node of the map, by its tags: arms are ways of their own."""
    ways = {1: 100, 3: 101, 4: 102, 6: 103, 11: 104, 12: 106}
    osmids = ctx.graph.edge_attributes(id)["osmid"]
    return ways[place] in (osmids if isinstance(osmids, list) else [osmids])


def drives(path, seed, count, **options):
    """Yield drives as node ids of the map, and whether they obey turns, for a referee; at a tolerance of 0."""
    ctx = loaded(graph_from_file(path, osm_type="drive", tolerance=0.0, **options))
    columns = ctx.graph.columns()
    row_of = {id: row for row, id in enumerate(columns.edge_ids.tolist())}
    fastest = {}
    for id in columns.edge_ids.tolist():
        fastest[ctx.graph.get_edge(id).source, ctx.graph.get_edge(id).target] = id
    referee = Referee(path)

    def places(edges):
        lines = [
            columns.polylines.get(row_of[id], columns.xy[[columns.sources[row_of[id]], columns.targets[row_of[id]]]])
            for id in edges
        ]
        lat, lon = ctx.graph.to_latlon(*np.concatenate(lines).T) if lines else ([], [])
        return referee.nodes_along(np.asarray(lat).tolist(), np.asarray(lon).tolist())

    referee.judge({pair for id in columns.edge_ids.tolist() for pair in pairwise(places([id]))})
    draw = random.Random(seed)
    ids = columns.node_ids.tolist()
    for _ in range(count):
        source, target = draw.sample(ids, 2)
        if ctx.graph.distance(source, target, "travel_time", turns="drive") < np.inf:
            free = [fastest[pair] for pair in pairwise(ctx.graph.shortest_path(source, target, "travel_time"))]
            obeying = ctx.graph.routes.shortest_path_edges(source, target, "travel_time")
            yield referee.forbidden_turns(places(obeying)), referee.forbidden_turns(places(free))


@pytest.mark.parametrize("resolution", [NO_CUT, 10.0])
def test_no_fastest_drive_in_kluuvi_makes_a_turn_that_a_referee_forbids(tmp_path, resolution):
    signs = add_signs(KLUUVI, tmp_path / "signs.osm", seed=2, count=25)
    found = [*drives(signs, 1, 150, resolution=resolution)]
    assert len(found) > 60
    assert not any(obeying for obeying, _ in found)
    assert any(free for _, free in found)


@pytest.mark.parametrize("tolerance", [0.0, 10.0])
def test_a_graph_of_several_modes_has_the_turns_of_each(signed, tolerance):
    ways = [*CARRIAGEWAYS, ([11, 1], {"highway": "footway"}), ([12, 4], STREET | {"bicycle": "no"})]
    signs = sign("no_left_turn", [100], [2], [105]), sign("no_u_turn", [102], [105], [101], **{"except": "bicycle"})
    path = signed(DUAL, ways, *signs)
    how = {"resolution": NO_CUT, "simplify": False, "tolerance": tolerance}
    both = loaded(graph_from_file(path, osm_type=["walk", "drive", "bike"], **how))
    far = {}
    for mode in ("drive", "bike"):
        alone = loaded(graph_from_file(path, osm_type=mode, **how))
        places = [(lat, lon) for lat, lon in DUAL.values() if lat != 60.17008]
        pairs = [(a, b) for a in places for b in places]
        for ctx in (alone, both):
            at = {place: ctx.graph.nearest_node(lat=place[0], lon=place[1]) for place in places}
            far[ctx, mode] = [ctx.graph.distance(at[a], at[b], turns=mode) for a, b in pairs]
        assert far[both, mode] == pytest.approx(far[alone, mode])
    assert far[both, "drive"] != far[both, "bike"]
    with pytest.raises(BadValue, match="several modes"):
        both.graph.distance(0, 1, turns=True)


def test_games_in_kluuvi_make_no_turn_that_a_referee_forbids(tmp_path):
    signs = add_signs(KLUUVI, tmp_path / "signs.osm", seed=2, count=40)
    wrong = {}
    for mode in ({"attribute": "drive", "turns": True}, "drive"):
        ctx = loaded(graph_from_file(signs, NO_CUT, osm_type=["drive", "walk"], tolerance=0.0))
        columns = ctx.graph.columns()
        row_of = {id: row for row, id in enumerate(columns.edge_ids.tolist())}
        referee = Referee(signs)

        def places(edges, ctx=ctx, columns=columns, row_of=row_of, referee=referee):
            rows = [row_of[id] for id in edges]
            ends = columns.xy[np.stack((columns.sources[rows], columns.targets[rows]), axis=1)]
            lines = [columns.polylines.get(row, pair) for row, pair in zip(rows, ends, strict=True)]
            lat, lon = ctx.graph.to_latlon(*np.concatenate(lines).T)
            return referee.nodes_along(np.asarray(lat).tolist(), np.asarray(lon).tolist())

        may_drive = [id for id in row_of if ctx.graph.edge_attributes(id)["drive"] > 0]
        referee.judge({pair for id in may_drive for pair in pairwise(places([id]))})
        drives = []
        now = {}
        nodes = ctx.graph.place(24, mode="drive", rng=np.random.default_rng(5))
        for number, node in enumerate(nodes):
            going = gamms.strategies.random_waypoints(ctx) if number % 2 else gamms.strategies.random_walk
            now[f"car {number}"] = []
            ctx.agent.create_agent(f"car {number}", start_node_id=node, mode=mode, strategy=going)
        for turn in range(45):
            ctx.game.step()
            for name, edges in now.items():
                path, _, legs = ctx.game.tracks([name])[0]
                if len(path) > 1:
                    find_edge = ctx.game.internals.parts.turns.legality.find_edge
                    edges.append(legs[0].edge if legs else find_edge("drive", *path))
                else:  # it waits, or the signs leave no way: it begins elsewhere
                    drives.append(edges)
                    now[name] = []
                    ctx.agent.get_agent(name).current_node_id = nodes[turn % len(nodes)]
        assert not ctx.game.errors
        drives += now.values()
        assert sum(map(len, drives)) > 700
        wrong[str(mode)] = [turn for edges in drives if edges for turn in referee.forbidden_turns(places(edges))]
        ctx.terminate()
    assert wrong.pop("{'attribute': 'drive', 'turns': True}") == []
    assert len(wrong["drive"]) > 5


def test_a_mode_turns_back_where_only_other_modes_go_on(signed):
    ways = [*ARMS, ([3, 6], {"highway": "footway"})]
    path = signed(CROSSING | {6: (60.17, 24.946)}, ways, sign("no_left_turn", [100], [2], [102]))
    ctx = loaded(graph_from_file(path, NO_CUT, osm_type=["walk", "drive"]))
    at = {place: ctx.graph.nearest_node(lat=lat, lon=lon) for place, (lat, lon) in CROSSING.items()}
    assert ctx.graph.shortest_path(at[1], at[4], turns="drive") == [at[place] for place in (1, 2, 3, 2, 4)]
    driven = ctx.graph.routes.select_mode("drive")
    assert driven.shortest_path(at[1], at[4], turns="drive") == [at[place] for place in (1, 2, 3, 2, 4)]


def test_a_sign_with_very_many_members_is_unclear(signed):
    path = signed(CROSSING, ARMS, sign("no_exit", [100], [2], [101] * 100))
    assert turns(path) == set()
    assert report(graph_from_file(path, osm_type="drive"), path).turn_restrictions_ignored == 1


def test_signs_at_one_node_that_forbid_absurdly_many_turns_are_refused(signed):
    arms = range(2, 152)
    nodes = {1: (60.17, 24.94), **{arm: (60.171, 24.94 + 1e-4 * arm) for arm in arms}}
    signs = [sign("only_straight_on", [98 + arm], [1], [99 + arm]) for arm in arms[:-1]]
    path = signed(nodes, [([1, arm], STREET) for arm in arms], *signs)
    with pytest.raises(BadFile, match="more than 11200 ways to go on 150 pieces of road"):
        graph_from_file(path, osm_type="drive")


def test_very_many_ways_between_are_taken_in_their_order(signed):
    places = {id: (60.17, 24.94 + id * 0.001) for id in range(1, 12)}
    line = [([id, id + 1], STREET) for id in range(1, 11)]
    arms = [([id, id + 20], STREET) for id in range(2, 11)]
    places |= {id + 20: (60.171, 24.94 + id * 0.001) for id in range(2, 11)}
    path = signed(places, [*line, *arms], sign("no_straight_on", [100], [*range(101, 109)], [109]))
    assert turns(path) == {tuple(range(1, 12))}
    path = signed(places, [*line, *arms], sign("no_straight_on", [100], [*range(108, 100, -1)], [109]))
    assert turns(path) == set()


def test_a_strategy_can_ask_for_routes_with_turns(signed):
    path = signed(LADDER, RUNGS, sign("no_u_turn", [100], [101], [103]))
    ctx = loaded(graph_from_file(path, NO_CUT, osm_type="drive"))
    at = {place: node for node in ctx.graph.get_nodes() if (place := ctx.graph.node_attributes(node)["osmid"])}
    asked = []

    def drive(state):
        asked.append(ctx.graph.shortest_path(at[1], at[8], turns="drive"))
        asked.append(ctx.graph.graph.shortest_path(at[1], at[8], turns=True))
        state["action"] = state["curr_pos"]

    ctx.agent.create_agent("car", start_node_id=at[1], strategy=drive)
    ctx.game.step()
    assert not ctx.game.errors
    assert asked == 2 * [ctx.graph.shortest_path(at[1], at[8], turns="drive")]


ONE_WAY = {**STREET, "oneway": "yes"}
# A loop 1, 2, 3, 4, and a street from 2 to 5 that leads nowhere.
LOOP = {1: (0.0, 0.0), 2: (0.0, 0.001), 3: (0.001, 0.001), 4: (0.001, 0.0), 5: (0.0, 0.002), 6: (0.0, 0.003)}
LOOP_WAYS = [([1, 2], ONE_WAY), ([2, 3], ONE_WAY), ([3, 4], STREET), ([4, 1], STREET), ([2, 5, 6], ONE_WAY)]


def find_edges_without_turn(graph):
    """Return the edges from which `edges_onward` leads nowhere."""
    ctx = loaded(graph)
    ids = [edge for edge in ctx.graph.graph.get_edges() if ctx.graph.edge_attributes(edge).get("drive", 1.0) > 0.0]
    ends = {edge: ctx.graph.graph.get_edge(edge).target for edge in ids}
    routes = ctx.graph.routes
    return [edge for edge, end in ends.items() if not routes.edges_onward(end, driven=[edge], turns="drive")]


@pytest.mark.parametrize("osm_type", ["drive", ["walk", "drive"]])
@pytest.mark.parametrize("value", ["only_straight_on", "only_straight_on;no_left_turn"])
def test_a_sign_that_permits_only_a_way_which_is_left_out_does_not_hold(signed, osm_type, value):
    path = signed(LOOP, LOOP_WAYS, sign(value, [100], [2], [104]))
    graph = graph_from_file(path, NO_CUT, osm_type=osm_type, tolerance=0.0)
    assert find_edges_without_turn(graph) == []
    found = report(graph, path)
    assert (found.turn_restrictions, found.turn_restrictions_ignored) == (0, 1)
    assert found.edges_without_turn == 0
    assert "1 unclear or for roads left out" in str(found)
    everything = graph_from_file(path, NO_CUT, osm_type=osm_type, tolerance=0.0, retain_all=True)
    assert report(everything, path).turn_restrictions == 1


def test_a_sign_before_the_edge_of_a_clip_does_not_hold(signed):
    path = signed(LOOP, LOOP_WAYS, sign("only_straight_on", [100], [2], [104]))
    graph = graph_from_file(path, NO_CUT, osm_type="drive", tolerance=0.0, clip=(-0.0005, -0.0005, 0.0015, 0.0015))
    assert find_edges_without_turn(graph) == []
    assert report(graph, path).turn_restrictions_ignored == 1


def test_a_sign_with_ways_between_that_leads_out_does_not_hold(signed):
    nodes = LOOP | {7: (-0.001, 0.0)}
    ways = [*LOOP_WAYS, ([7, 1], ONE_WAY), ([1, 7], {**STREET, "oneway": "-1"}), ([4, 7], STREET)]
    path = signed(nodes, ways, sign("only_straight_on", [105], [100], [104]))
    graph = graph_from_file(path, NO_CUT, osm_type="drive", tolerance=0.0)
    assert (find_edges_without_turn(graph), report(graph, path).turn_restrictions_ignored) == ([], 1)


def test_a_sign_of_which_one_way_stays_holds(signed):
    path = signed(LOOP, LOOP_WAYS, sign("only_straight_on", [100], [2], [104, 101]))
    graph = graph_from_file(path, NO_CUT, osm_type="drive", tolerance=0.0)
    found = report(graph, path)
    assert (found.turn_restrictions, found.turn_restrictions_ignored, find_edges_without_turn(graph)) == (1, 0, [])


@pytest.mark.parametrize("osm_type", ["drive", ["walk", "drive"]])
def test_edges_after_which_no_turn_is_legal_are_counted(signed, osm_type):
    path = signed(LOOP, LOOP_WAYS, sign("no_left_turn", [100], [2], [101]))
    graph = graph_from_file(path, NO_CUT, osm_type=osm_type, tolerance=0.0)
    assert len(find_edges_without_turn(graph)) == 1
    for one in (graph, loaded(graph).graph):
        found = report(one, path, resolution=NO_CUT, tolerance=0.0, osm_type=osm_type)
        assert found.edges_without_turn == 1
        assert "no legal turn" in str(found)
    graph.nodes  # noqa: B018 # fills the graph
    assert report(graph, path).edges_without_turn == 1


@pytest.mark.parametrize("value", ["no_", "only_", "no_;only_", "only_ ", "no__", "restrictions"])
def test_a_sign_with_nothing_behind_no_or_only_is_unclear(signed, value):
    path = signed(CROSSING, ARMS, sign(value, [100], [2], [102]))
    assert turns(path) == set()
    found = report(graph_from_file(path, osm_type="drive"), path)
    assert (found.turn_restrictions, found.turn_restrictions_ignored) == (0, 1)
    assert "0 of others" in str(found)


def test_a_key_that_only_begins_like_a_sign_is_unclear(signed):
    path = signed(CROSSING, ARMS, sign("", [100], [2], [102], restrictions="no_left_turn"))
    found = report(graph_from_file(path, osm_type="drive"), path)
    assert (found.turn_restrictions_ignored, found.turn_restrictions_of_others) == (1, 0)


def test_a_sign_with_a_node_and_ways_between_counts_as_ignored(signed):
    path = signed(CROSSING, ARMS, sign("no_left_turn", [100], [2, 101, 3], [102]))
    assert turns(path) == set()
    found = report(graph_from_file(path, osm_type="drive"), path)
    assert (found.turn_restrictions, found.turn_restrictions_ignored) == (0, 1)
