"""Buildings of a place by its name: the walls that a file of the same area gives, where the streets are."""

from pathlib import Path

import pytest

import gamms
from gamms.errors import BadType, BadValue
from gamms.ir.scenery import SceneryKind
from gamms.osm import create_osm_graph, obstacle_from_file, obstacle_from_osm, scenery_from_file, scenery_from_osm
from gamms.scenario import Scenario

DATA = Path(__file__).parent / "data" / "kluuvi.osm.gz"
PLACE = "Kluuvi, Helsinki"


def edges_of(faces):
    """Ends and height of each wall, to the centimetre and whatever its direction."""
    ends = [(frozenset(tuple(round(c, 2) for c in face[k][:2]) for k in ("tr", "tl")), face["tr"][2]) for face in faces]
    return set(ends)


@pytest.mark.usefixtures("server")
def test_the_buildings_of_a_place_are_those_of_a_file_of_it():
    named, in_file = (edges_of(faces) for faces in (obstacle_from_osm(PLACE), obstacle_from_file(DATA)))
    assert len(named) > 100
    # Where both start a ring at another point, simplification keeps other corners.
    assert len(named & in_file) > 0.9 * len(named)


def test_earlier_answers_are_available_without_a_network(server):
    before = list(obstacle_from_osm(PLACE))
    asked = len(server.asked)
    assert list(obstacle_from_osm(PLACE, offline=True)) == before
    assert len(server.asked) == asked


def test_a_bad_argument_is_refused_before_any_server_is_asked(server):
    for options, error in (({"tags": ["building"]}, BadType), ({"crs": "EPSG:4326"}, BadValue)):
        with pytest.raises(error):
            obstacle_from_osm(PLACE, **options)
    assert len(server.asked) == 0


@pytest.mark.usefixtures("server")
def test_the_scenery_of_a_place_is_that_of_a_file_of_it():
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(create_osm_graph(PLACE))
        named, in_file = scenery_from_osm(PLACE, ctx), scenery_from_file(DATA, ctx)
        assert len(named.buildings.ids) > 400
        assert set(in_file.kinds.tolist()) >= set(named.kinds.tolist())
        assert SceneryKind.GREEN in named.kinds
        assert len(scenery_from_osm(PLACE, ctx, buildings=False).buildings.ids) == 0


def test_a_scenario_is_played_in_a_place_with_its_walls_and_scenery(server):
    place = {"location": PLACE, "osm_type": "drive", "buildings": True, "barriers": True, "scenery": True}
    scenario = Scenario(map={"place": place}, teams={"red": {"count": 1}})
    with scenario.build() as ctx:
        streets, crs, scenery = ctx.graph.columns(), ctx.graph.crs, ctx.graph.graph.scenery
        x, y = streets.xy.mean(axis=0)
        asked = len(server.asked)
        walls = obstacle_from_osm(PLACE, crs=crs, barriers=True)
        assert len(list(ctx.graph.get_obstacle_faces(1e5, x, y))) == len(list(walls))
        assert len(scenery.buildings.ids) == 0  # they are walls
    with scenario.replace(**{"map.place.offline": True}).build() as ctx:
        assert ctx.graph.columns().node_ids.tolist() == streets.node_ids.tolist()
    assert len(server.asked) == asked
