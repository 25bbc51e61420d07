"""What was downloaded once is there offline; the settings are the user's, and OSMnx's count where it is used."""

import json
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import networkx as nx
import pytest
from server import SOUTH, WEST, changes, is_busy, says

import gamms.osm.servers as transport
from gamms import limits
from gamms.errors import GammsError, MissingExtra, NetworkError, PlaceError, TooLarge
from gamms.folders import cache_folder, write_whole
from gamms.osm import OSMType, create_osm_graph, graph_from_bbox, graph_from_point
from gamms.osm.overpass import download_features_of_place

PLACE = "Kluuvi, Helsinki"
DRIVE = OSMType.DRIVE  # the fewest streets
OSMNX = "OSMnx Python package (https://github.com/gboeing/osmnx)"  # how it names itself


def files_in(folder):
    return sorted(Path(folder).rglob("*.json"))


@pytest.fixture
def no_network(monkeypatch):
    """Whatever would open a socket, or look for a server, is an error."""

    def refuse(*_, **__):
        raise AssertionError("the network was used")

    for name in ("socket", "create_connection", "getaddrinfo", "gethostbyname"):
        monkeypatch.setattr(socket, name, refuse)


def test_a_second_call_asks_no_server(server):
    first = create_osm_graph(PLACE, DRIVE)
    assert server.asked == ["search", "interpreter"]
    server.asked.clear()
    assert nx.utils.graphs_equal(create_osm_graph(PLACE, DRIVE), first)
    assert server.asked == []


def test_answers_are_kept_in_the_users_cache_folder(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    create_osm_graph(PLACE, DRIVE)
    assert len(files_in(tmp_path / "caches" / "gamms" / "places")) == 2
    assert not (tmp_path / "cache").exists()


@pytest.mark.parametrize(
    ("platform", "environment", "folder"),
    [
        ("linux", {}, "home/.cache/gamms/places"),
        ("linux", {"XDG_CACHE_HOME": "there"}, "there/gamms/places"),
        ("darwin", {}, "home/Library/Caches/gamms/places"),
        ("win32", {"LOCALAPPDATA": "local"}, "local/gamms/places"),
        ("win32", {}, "home/AppData/Local/gamms/places"),
    ],
)
def test_every_system_has_its_own_cache_folder(monkeypatch, platform, environment, folder):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(Path, "home", lambda: Path("home"))
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert cache_folder("places") == Path(folder)


@pytest.fixture
def no_network_later(request):
    return lambda: request.getfixturevalue("no_network")


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: create_osm_graph(PLACE, DRIVE, offline=True), "'Kluuvi, Helsinki'"),
        (lambda: create_osm_graph({"city": "Turku"}, offline=True), "{'city': 'Turku'}"),
        (lambda: graph_from_bbox(24.9, 60.1, 24.95, 60.15, offline=True), r"the box \(24.9, 60.1, 24.95, 60.15\)"),
        (lambda: graph_from_point(60.1, 24.9, 99.0, offline=True), "the circle of 99.0 m around lat=60.1, lon=24.9"),
        (lambda: download_features_of_place(PLACE, {"building": True}, offline=True), "'Kluuvi, Helsinki'"),
    ],
)
def test_offline_an_unknown_place_is_named_and_nothing_is_asked(server, no_network, call, name):
    with pytest.raises(PlaceError, match=f"no map of {name} on this computer.*Download it once, without offline=True"):
        call()
    assert server.asked == []


def test_offline_a_place_without_its_streets_is_not_enough(server, no_network_later):
    create_osm_graph(PLACE, OSMType.WALK)
    no_network_later()
    with pytest.raises(PlaceError, match="never downloaded"):
        create_osm_graph(PLACE, DRIVE, offline=True)


def test_a_cache_that_is_switched_off_keeps_nothing(server, settings, monkeypatch, tmp_path):
    monkeypatch.setattr(settings, "use_cache", False)
    create_osm_graph(PLACE, DRIVE)
    create_osm_graph(PLACE, DRIVE)
    assert server.asked == ["search", "interpreter"] * 2
    assert files_in(tmp_path) == []


@pytest.fixture
def osmnx(monkeypatch):
    """OSMnx, as a program that uses it has it in memory."""
    osmnx = SimpleNamespace(settings=SimpleNamespace(cache_folder="./cache", http_user_agent=OSMNX, http_referer=OSMNX))
    monkeypatch.setitem(sys.modules, "osmnx", osmnx)
    return osmnx


def test_settings_of_osmnx_count_where_the_program_uses_it(server, settings, monkeypatch, osmnx, tmp_path):
    osmnx.settings.cache_folder = tmp_path / "theirs"
    osmnx.settings.overpass_url = settings.overpass_url
    monkeypatch.setattr(settings, "overpass_url", settings._DEFAULTS["overpass_url"])
    create_osm_graph(PLACE, DRIVE)
    assert len(files_in(tmp_path / "theirs")) == 2
    monkeypatch.setattr(settings, "cache_folder", tmp_path / "mine")
    create_osm_graph(PLACE, DRIVE)
    assert len(files_in(tmp_path / "mine")) == 2


def test_servers_hear_of_gamms_even_where_osmnx_is_in_use(settings, osmnx):
    assert settings.get_setting("http_user_agent").startswith("GAMMS")
    assert settings.get_setting("cache_folder") is None
    osmnx.settings.http_user_agent = "my game"
    assert settings.get_setting("http_user_agent") == "my game"


def test_an_installed_osmnx_has_the_settings_that_are_read(settings):
    osmnx = pytest.importorskip("osmnx")
    assert set(settings._DEFAULTS) <= set(vars(osmnx.settings))
    assert {name: getattr(osmnx.settings, name) for name in settings._DEFAULTS_OF_OSMNX} == settings._DEFAULTS_OF_OSMNX


def test_osmnx_is_never_loaded():
    code = "import gamms.osm.overpass, gamms.osm.servers, requests, sys; sys.exit('osmnx' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_damaged_answer_in_the_cache_is_asked_for_again(server, tmp_path):
    first = create_osm_graph(PLACE, DRIVE)
    for file in files_in(tmp_path):
        file.write_text(file.read_text(encoding="utf-8")[:100], encoding="utf-8")
    with pytest.raises(PlaceError, match="is damaged"):
        create_osm_graph(PLACE, DRIVE, offline=True)
    server.asked.clear()
    assert nx.utils.graphs_equal(create_osm_graph(PLACE, DRIVE), first)
    assert server.asked == ["search", "interpreter"]
    assert nx.utils.graphs_equal(create_osm_graph(PLACE, DRIVE, offline=True), first)


def test_a_foreign_answer_in_the_cache_is_asked_for_again(server, tmp_path):
    first = create_osm_graph(PLACE, DRIVE)
    for file in files_in(tmp_path):
        file.write_text(
            json.dumps({"elements": [{"type": "node", "id": 1, "lat": 999.0, "lon": 1.0}]}), encoding="utf-8"
        )
    assert nx.utils.graphs_equal(create_osm_graph(PLACE, DRIVE), first)


def test_an_empty_answer_is_not_kept_where_it_ends_in_an_error(server, tmp_path):
    server.misbehaviour["interpreter"] = says(b'{"elements": []}')
    with pytest.raises(PlaceError):
        create_osm_graph(PLACE, DRIVE)
    assert files_in(tmp_path) == []
    server.misbehaviour.clear()
    create_osm_graph(PLACE, DRIVE)
    assert len(files_in(tmp_path)) == 2


def test_an_empty_corner_of_a_large_area_is_kept(server, settings, monkeypatch, no_network_later):
    monkeypatch.setattr(settings, "max_query_area_size", 1.5e6)
    area = (WEST - 0.03, SOUTH, WEST + 0.005, SOUTH + 0.002)
    online = graph_from_bbox(*area)
    assert server.asked.count("interpreter") > 1
    no_network_later()
    assert nx.utils.graphs_equal(graph_from_bbox(*area, offline=True), online)


def test_a_folder_that_cannot_be_written_costs_a_warning_not_the_map(server, settings, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(settings, "cache_folder", tmp_path / "file")
    with pytest.warns(RuntimeWarning, match="cannot be stored in .*file'") as caught:
        assert len(create_osm_graph(PLACE, DRIVE)) > 100
    assert {warning.category for warning in caught} == {RuntimeWarning}


def test_threads_take_turns(server):
    found = []

    def load(kind):
        found.append(create_osm_graph(PLACE, kind))

    threads = [threading.Thread(target=load, args=(kind,)) for kind in OSMType]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 3


def test_threads_that_write_one_file_do_not_disturb_each_other(tmp_path):
    failures = []

    def write(number):
        for _ in range(200):
            try:
                write_whole(tmp_path / "answer.json", bytes([number]) * 2000)
            except OSError as error:
                failures.append(error)

    threads = [threading.Thread(target=write, args=(number,)) for number in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert [file.name for file in tmp_path.iterdir()] == ["answer.json"]


def test_without_requests_the_error_says_what_to_install(server, monkeypatch):
    create_osm_graph(PLACE, DRIVE)
    monkeypatch.setitem(sys.modules, "requests", None)
    with pytest.raises(MissingExtra, match=r"Loading places by name .* \(extra 'osm-online'\): pip install "):
        create_osm_graph(PLACE, DRIVE)
    assert len(create_osm_graph(PLACE, DRIVE, offline=True)) > 100


def test_an_answer_of_more_memory_than_is_allowed_is_refused(server):
    with limits.allowing(200_000), pytest.raises(TooLarge, match="more than 25000 bytes"):
        create_osm_graph(PLACE, DRIVE)


def test_a_server_that_wants_a_long_pause_is_not_waited_for(server, settings, monkeypatch):
    monkeypatch.setattr(transport, "is_local", lambda url: False)
    monkeypatch.setattr(transport.time, "sleep", lambda seconds: None)
    monkeypatch.setattr(settings, "overpass_rate_limit", True)
    server.misbehaviour["status"] = says(b"a\nb\nc\nd\nCurrently running queries", kind="text/plain")
    with pytest.raises(NetworkError, match="is busy: it asks for a total wait of"):
        create_osm_graph(PLACE, DRIVE)
    server.misbehaviour = {"search": is_busy(429, **{"Retry-After": "86400"})}
    with pytest.raises(NetworkError, match="a total wait of 86401 s"):
        create_osm_graph("Helsinki-Kluuvi")


def test_the_status_of_a_server_with_slots_is_asked_for(server, settings, monkeypatch):
    monkeypatch.setattr(settings, "overpass_rate_limit", True)
    server.misbehaviour["status"] = says(b"a\nb\nc\nd\n2 slots available now.", kind="text/plain")
    create_osm_graph(PLACE, DRIVE)
    assert server.asked == ["search", "status", "interpreter"]
    server.misbehaviour["status"] = says(b"nothing of use")
    begin = time.monotonic()
    create_osm_graph(PLACE, OSMType.BIKE)
    assert time.monotonic() - begin < 50.0


@pytest.mark.parametrize(
    ("tags", "error"),
    [("building", TypeError), ({}, ValueError), ({"building": 7}, TypeError), ({7: True}, TypeError)],
)
def test_impossible_tags_are_refused_before_anything_is_asked(server, tags, error):
    with pytest.raises(error, match="tags"):
        download_features_of_place(PLACE, tags)
    assert server.asked == []


def test_a_place_without_such_features_is_an_error(server):
    with pytest.raises(PlaceError, match="nothing tagged aeroway in 'Kluuvi, Helsinki'"):
        download_features_of_place(PLACE, {"aeroway": True})
    with pytest.raises(GammsError, match="cannot be used"):
        server.misbehaviour["interpreter"] = changes(lambda data: data["elements"][0].pop("lat"))
        download_features_of_place(PLACE, {"building": True})


@pytest.mark.parametrize(
    ("status", "seconds"),
    [
        ("Rate limit: 2\n2 slots available now.", 0.0),
        ("Rate limit: 0\nCurrently running queries", 0.0),
        ("Rate limit: 2\nSlot available after: 2001-01-01T00:00:00Z, in 9 seconds.", 1.0),
        ("Rate limit: 2\nCurrently running queries", transport._STATUS_PAUSE_S),
        ("down", 0.0),
    ],
)
def test_a_status_page_says_how_long_to_wait_for_a_slot(status, seconds):
    assert transport._parse_seconds_to_slot(status) == seconds
