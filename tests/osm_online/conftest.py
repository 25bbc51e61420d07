"""A map server on this computer, and GAMMS told to ask it, by the settings that any program would set."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import server as map_server

import gamms.osm

pytest.importorskip("requests")


@pytest.fixture
def settings():
    return gamms.osm.settings


def use(patch, running, **more):
    addresses = {"nominatim_url": running.url, "overpass_url": f"{running.url}/api", "overpass_rate_limit": False}
    for name, value in {**addresses, **more}.items():
        patch.setattr(gamms.osm.settings, name, value)


@pytest.fixture
def server(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    with map_server.serving() as running:
        use(monkeypatch, running, requests_timeout=10)
        yield running


@pytest.fixture(scope="module")
def streets(tmp_path_factory):
    """The streets of Kluuvi for walking, cycling and driving, with a node where two junctions would become one."""
    from gamms.osm import OSMType, create_osm_graph

    with pytest.MonkeyPatch.context() as patch, map_server.serving() as running:
        use(patch, running, cache_folder=tmp_path_factory.mktemp("answers"))
        return {kind.name: create_osm_graph("Kluuvi, Helsinki", kind, tolerance=0.01) for kind in OSMType}
