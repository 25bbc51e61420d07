"""Answers with elements that are deleted, incomplete, or given several times: the rules are those for files."""

import random

import pytest
from server import changes

from gamms.errors import NetworkError, PlaceError
from gamms.osm import OSMType, create_osm_graph, graph_from_place
from gamms.osm.overpass import download_features_of_place

PLACE = "Kluuvi, Helsinki"


def damage(data):
    """Add elements that do not count, at any place."""
    rng = random.Random(7)
    found = []
    for one in data["elements"]:
        now = {**one, "version": 5}
        old = {**one, "version": 4, "tags": {"highway": "motorway", "building": "yes"}}
        if one["type"] == "node":
            old |= {"lat": 60.17, "lon": 24.94}
        else:
            old |= {"visible": False}
        copy = {key: value for key, value in now.items() if key != "tags"}
        found += [[now], [old, now], [now, old, copy], [copy, now, now], [{**now, "visible": True}]][rng.randrange(5)]
    found += [{"type": "way", "id": id, "nodes": [1][:id], "tags": {"highway": "primary"}} for id in (0, 1)]
    found += [{"type": "relation", "id": 1, "members": [], "tags": {"type": "multipolygon", "building": "yes"}}]
    found += [{**data["elements"][-1], "id": 2, "visible": False}]
    data["elements"] = found


@pytest.mark.parametrize("mode", ["walk", "drive", OSMType.BIKE])
def test_damage_changes_no_street(server, settings, monkeypatch, mode):
    monkeypatch.setattr(settings, "use_cache", False)
    for load in (graph_from_place, create_osm_graph) if isinstance(mode, OSMType) else (graph_from_place,):
        graphs = []
        for misbehaviour in ({}, {"interpreter": changes(damage)}):
            server.misbehaviour = misbehaviour
            graphs.append(load(PLACE, osm_type=mode))
        assert [*graphs[0].edges(data="length")] == [*graphs[1].edges(data="length")]
        assert [*graphs[0].nodes(data=True)] == [*graphs[1].nodes(data=True)]


def test_damage_changes_no_building(server, settings, monkeypatch):
    monkeypatch.setattr(settings, "use_cache", False)
    found = []
    for misbehaviour in ({}, {"interpreter": changes(damage)}):
        server.misbehaviour = misbehaviour
        found.append(
            [(shape.wkt, tags) for shape, tags in download_features_of_place(PLACE, {"building": True}, ("railway",))]
        )
    assert found[0] == found[1]


def add_again(kind, **change):
    """Give an element once more, with a change."""

    def again(data):
        one = next(one for one in data["elements"] if one["type"] == kind)
        more = {"nodes": [one["nodes"][0], *one["nodes"]]} if kind == "way" else change
        data["elements"].append({**one, **more})

    return changes(again)


@pytest.mark.parametrize(
    ("kind", "change", "words"),
    [
        ("node", {"lat": 60.1699}, r"node \d+ is there several times in one version, at different places"),
        ("way", {}, r"way \d+ is there several times in one version, with different nodes"),
    ],
)
def test_elements_that_contradict_each_other_are_named(server, kind, change, words):
    server.misbehaviour["interpreter"] = add_again(kind, **change)
    with pytest.raises(NetworkError, match=words):
        graph_from_place(PLACE, osm_type="drive")


def test_a_place_without_streets_says_which_ways_are_read(server):
    server.misbehaviour["interpreter"] = changes(lambda data: data.update(elements=[]))
    with pytest.raises(
        PlaceError, match=r"Only ways with one of the tags highway, route are read.*custom_filter='\[\"railway\"\]'"
    ):
        graph_from_place(PLACE, osm_type="walk")
    with pytest.raises(PlaceError) as caught:
        graph_from_place(PLACE, osm_type="walk", custom_filter='["railway"]')
    assert "highway" not in str(caught.value)
