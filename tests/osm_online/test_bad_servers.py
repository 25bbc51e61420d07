"""Servers that are away, busy or talk nonsense: one clear error each, soon, and nothing of it is kept."""

import os
import signal
import socket
import threading
import time
from pathlib import Path

import pytest
import server as map_server
from server import (
    breaks_off,
    changes,
    cuts_its_json,
    drips,
    drips_its_head,
    drips_slowly,
    hangs,
    hangs_up,
    is_busy,
    is_busy_once,
    says,
)

from gamms.errors import BadValue, GammsError, NetworkError, PlaceError
from gamms.osm import OSMType, create_osm_graph
from gamms.osm.overpass import download_features_of_place, read_areas

PLACE = "Kluuvi, Helsinki"
SOON_S = 15.0


def is_refused(error, words, place=PLACE, osm_type=OSMType.DRIVE, **options):
    """The call ends soon in this error, with these words and without a sign of the internals of a library."""
    begin = time.monotonic()
    with pytest.raises(error, match=words) as caught:
        create_osm_graph(place, osm_type, **options)
    assert time.monotonic() - begin < SOON_S
    assert isinstance(caught.value, GammsError)
    assert "object at 0x" not in str(caught.value)
    assert len(str(caught.value)) < 700


def nothing_is_kept(folder):
    return not list(Path(folder).rglob("*.json"))


def of_element(kind, change):
    return changes(lambda data: change(next(one for one in data["elements"] if one["type"] == kind)))


ANYWHERE = {  # what either server may do
    "html": (
        says(b"<html><b>Log in</b> to the hotel</html>", kind="text/html"),
        "'Log in to the hotel'.*login page",
    ),
    "nothing": (says(b""), "instead of JSON"),
    "broken JSON": (says(b'{"elements": [}'), "instead of JSON"),
    "truncated JSON": (cuts_its_json, "instead of JSON"),
    "no text": (says(b"\xff\xfe\x00\x01"), "instead of JSON"),
    "deep JSON": (says(b"[" * 200_000), "instead of JSON"),
    "a number": (says(b"7"), "cannot be used"),
    "null": (says(b"null"), "cannot be used"),
    "numbers": (says(b"[1, 2, 3]"), "cannot be used"),
    "an error in JSON": (says(b'{"error": "down"}'), "cannot be used"),
    "breaks off": (breaks_off, "cannot be reached, or the connection was lost"),
    "hangs up": (hangs_up, "cannot be reached, or the connection was lost"),
    "429": (is_busy(429), "answers 429 Too Many Requests, saying 'Too busy'.*busy, after 3 tries"),
    "503": (is_busy(503), "answers 503 .* busy, after 3 tries"),
    "504": (is_busy(504), "answers 504 .* busy, after 3 tries"),
    "500": (says(b"oh", 500), "answers 500 Internal Server Error, saying 'oh'"),
    "403": (says(b"<p>blocked</p>", 403, "text/html"), "answers 403 Forbidden, saying 'blocked'"),
    "404": (says(b"", 404), r"answers 404 .*Check the address"),
}


@pytest.mark.parametrize("where", ["search", "interpreter"])
@pytest.mark.parametrize("what", ANYWHERE)
def test_a_server_that_misbehaves_is_one_clear_error(server, tmp_path, where, what):
    server.misbehaviour[where], words = ANYWHERE[what]
    is_refused(NetworkError, rf"127\.0\.0\.1:\d+.*{words}")
    assert server.asked.count(where) == (3 if "busy" in words else 1)
    assert nothing_is_kept(tmp_path)


@pytest.mark.skipif(os.name == "nt", reason="signals for one thread are of Unix")
def test_ctrl_c_that_does_not_wake_who_waits_for_an_answer_ends_the_wait(server):
    def interrupts(handler, answer):
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)  # the main thread waits on
        hangs(handler, answer)

    server.misbehaviour["search"] = interrupts
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        create_osm_graph(PLACE, OSMType.DRIVE)
    assert time.monotonic() - began < SOON_S


@pytest.mark.parametrize("where", ["search", "interpreter"])
@pytest.mark.parametrize("how", [hangs, drips, drips_slowly, drips_its_head], ids=lambda how: how.__name__)
def test_a_server_that_takes_too_long_is_left(server, settings, monkeypatch, tmp_path, where, how):
    monkeypatch.setattr(settings, "requests_timeout", 0.15)
    server.misbehaviour[where] = how
    is_refused(
        NetworkError, r"127\.0\.0\.1:\d+ timed out.*begin within 0\.15 s .*\(gamms\.osm\.settings\.requests_timeout\)"
    )
    assert server.asked.count(where) == 1
    assert nothing_is_kept(tmp_path)


@pytest.mark.parametrize("where", ["search", "interpreter"])
@pytest.mark.parametrize("status", [429, 503, 504])
def test_a_server_that_is_busy_for_a_moment_is_asked_again(server, where, status):
    server.misbehaviour[where] = is_busy_once(status)
    assert len(create_osm_graph(PLACE, OSMType.DRIVE)) > 100
    assert server.asked.count(where) == 2


@pytest.mark.parametrize("setting", ["nominatim_url", "overpass_url"])
def test_an_unknown_host_is_named(server, settings, monkeypatch, setting):
    resolve = socket.getaddrinfo

    def resolved(host, *rest, **options):
        if host == "maps.invalid":
            raise socket.gaierror(-2, "Name or service not known")
        return resolve(host, *rest, **options)

    monkeypatch.setattr(socket, "getaddrinfo", resolved)
    monkeypatch.setattr(settings, setting, "http://maps.invalid/api")
    is_refused(NetworkError, r"maps\.invalid cannot be reached.*not known.*Check the connection")


@pytest.mark.parametrize("setting", ["nominatim_url", "overpass_url"])
def test_an_address_that_is_none_is_named(server, settings, monkeypatch, setting):
    monkeypatch.setattr(settings, setting, "nonsense")
    is_refused(BadValue, rf"gamms\.osm\.settings\.{setting} is 'nonsense', which is not the address")


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("Atlantis", "no place 'Atlantis', or its boundary is not on the map .*knows 0 places.*Check the spelling"),
        ("The station", "no place 'The station', or its boundary .*graph_from_point"),
        ("A bow tie", "boundary of 'A bow tie' cannot be used: its outline"),
        ("All of Finland", "boundary of 'All of Finland' cannot be used: it has .* km², more than 20000 km²"),
        ("The open sea", "no streets of the type 'drive' in 'The open sea'.*another osm_type"),
    ],
)
def test_a_place_without_a_map_is_one_clear_error(server, tmp_path, place, words):
    is_refused(PlaceError, words, place)
    assert nothing_is_kept(tmp_path)


def test_a_place_without_streets_of_the_type_is_one_clear_error(server, tmp_path):
    is_refused(PlaceError, "no streets of the type .*motorway.* in", custom_filter='["highway"="motorway"]')
    map_only = [map_server.place(map_server.box(24.9455, 60.1690, 24.9456, 60.1691))]
    server.places["A courtyard"] = map_only
    is_refused(PlaceError, "no streets of the type 'drive' in 'A courtyard'", "A courtyard")


def test_a_filter_that_the_server_does_not_understand_is_one_clear_error(server, tmp_path):
    server.misbehaviour["interpreter"] = says(b"<p>parse error: unexpected '['</p>", 400, "text/html")
    is_refused(PlaceError, "400 Bad Request.*parse error.*check location, custom_filter", custom_filter="[[]")
    assert nothing_is_kept(tmp_path)


REMARK = 'runtime error: Query timed out in "query" at line 1 after 180 seconds.'
MAPS = {  # nonsense in the shape of a map
    "a remark": (changes(lambda data: data.update(remark=REMARK)), "incomplete; .*Query timed out"),
    "a remark and nothing": (changes(lambda data: data.update(remark=REMARK, elements=[])), "incomplete"),
    "no elements": (changes(lambda data: data.pop("elements")), "no list of elements"),
    "an element that is none": (changes(lambda data: data["elements"].append("way")), "is not an element"),
    "a node in space": (of_element("node", lambda node: node.update(lat=612.0)), "is not an element"),
    "a node at NaN": (of_element("node", lambda node: node.update(lat=float("nan"))), "NaN is no number"),
    "a node as text": (of_element("node", lambda node: node.update(lon="24.9")), "is not an element"),
    "a node without an id": (of_element("node", lambda node: node.pop("id")), "is not an element"),
    "a way without nodes": (of_element("way", lambda way: way.pop("nodes")), "is not an element"),
    "a way to nowhere": (
        of_element("way", lambda way: way["nodes"].append(1)),
        r"lacks nodes of 1 of its \d+ ways, such as",
    ),
    "tags that are a list": (of_element("way", lambda way: way.update(tags=["highway"])), "is not an element"),
    "a tag that is a number": (of_element("way", lambda way: way["tags"].update(lanes=2)), "is not an element"),
}


@pytest.mark.parametrize("what", MAPS)
def test_a_map_of_nonsense_is_one_clear_error(server, tmp_path, what):
    server.misbehaviour["interpreter"], words = MAPS[what]
    is_refused(NetworkError, words)
    assert nothing_is_kept(tmp_path)


def test_a_map_of_nodes_only_has_no_streets(server, tmp_path):
    server.misbehaviour["interpreter"] = changes(
        lambda data: data.update(elements=[one for one in data["elements"] if one["type"] == "node"])
    )
    is_refused(PlaceError, "no streets of the type 'drive'")
    assert nothing_is_kept(tmp_path)


PLACES = {  # nonsense in the shape of a place
    "no importance": lambda data: data[0].pop("importance"),
    "an importance that is no number": lambda data: data[0].update(importance="great"),
    "no type": lambda data: data[0]["geojson"].pop("type"),
    "no coordinates": lambda data: data[0]["geojson"].pop("coordinates"),
    "too few coordinates": lambda data: data[0]["geojson"].update(coordinates=[[[24, 60], [25, 61]]]),
    "coordinates in space": lambda data: data[0]["geojson"]["coordinates"][0][0].__setitem__(0, 999.0),
    "coordinates as text": lambda data: data[0]["geojson"].update(coordinates="here"),
}


@pytest.mark.parametrize("what", PLACES)
def test_a_place_of_nonsense_is_one_clear_error(server, tmp_path, what):
    server.misbehaviour["search"] = changes(PLACES[what])
    is_refused(NetworkError, "cannot be used: a place has")
    assert nothing_is_kept(tmp_path)


def test_unusual_but_readable_answers_are_accepted(server):
    def change(data):
        data.update(remark="", osm3s={})
        data["elements"] += [{"type": "way", "id": 1, "nodes": []}, {"type": "count", "id": 0}]

    server.misbehaviour["interpreter"] = changes(change)
    server.misbehaviour["search"] = changes(lambda data: data[0].update(importance="0.5", boundingbox=[60, 61, 24, 25]))
    assert len(create_osm_graph(PLACE, OSMType.DRIVE)) > 100
    assert len(download_features_of_place(PLACE, {"building": True})) > 50


def test_buildings_that_a_server_has_in_part_are_left_out(server, settings, monkeypatch):
    monkeypatch.setattr(settings, "use_cache", False)
    everything = download_features_of_place(PLACE, {"building": True})
    rings = {member["ref"] for one in map_server.elements()["relation"].values() for member in one["members"]}

    def lose_a_node_of_each_ring(data):
        for one in data["elements"]:
            if one["id"] in rings:
                one["nodes"][1] = 1  # there is no such node

    server.misbehaviour["interpreter"] = changes(lose_a_node_of_each_ring)
    rest = download_features_of_place(PLACE, {"building": True})
    assert 10 < len(rest) < len(everything)
    assert all(tags in [tags for _, tags in everything] for _, tags in rest)


@pytest.mark.parametrize("what", ["html", "429", "truncated JSON"])
def test_features_end_in_the_same_errors(server, tmp_path, what):
    server.misbehaviour["interpreter"], words = ANYWHERE[what]
    with pytest.raises(NetworkError, match=words):
        download_features_of_place(PLACE, {"building": True})
    assert nothing_is_kept(tmp_path)


def test_a_map_with_many_cut_areas_is_damaged_and_one_with_few_was_cut():
    corners = [{"type": "node", "id": n, "lat": 60.0, "lon": 25.0} for n in range(1, 5)]
    areas = [{"type": "way", "id": n, "nodes": [1, 2, 3, 4, 1]} for n in range(6)]
    cut = [{"type": "way", "id": 10 + n, "nodes": [1, 2, 99, 1]} for n in range(4)]
    assert len(read_areas({"elements": [*corners, *areas, *cut[:2]]})) == 12
    with pytest.raises(ValueError, match="it lacks nodes of 4 of its 10 ways"):
        read_areas({"elements": [*corners, *areas, *cut]})


@pytest.mark.parametrize("seconds", [None, 0, -1, "soon"])
def test_an_impossible_timeout_is_named(server, settings, monkeypatch, seconds):
    monkeypatch.setattr(settings, "requests_timeout", seconds)
    with pytest.raises((TypeError, ValueError), match="requests_timeout"):
        create_osm_graph(PLACE)
