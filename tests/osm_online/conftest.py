"""A map server on this computer, and OSMnx told to ask it, by the settings that any program would set."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import server as map_server


@pytest.fixture(scope="session")
def osmnx():
    return pytest.importorskip("osmnx")


@pytest.fixture
def server(osmnx, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    with map_server.serving() as running:
        for name, value in {
            "nominatim_url": running.url,
            "overpass_url": f"{running.url}/api",
            "overpass_rate_limit": False,
            "cache_folder": "./cache",
            "use_cache": True,
            "requests_timeout": 10,
        }.items():
            monkeypatch.setattr(osmnx.settings, name, value)
        yield running


@pytest.fixture(scope="module")
def streets(osmnx, tmp_path_factory):
    """The streets of Kluuvi for walking, cycling and driving, with a node where two junctions would become one."""
    from gamms.osm import OSMType, create_osm_graph

    with pytest.MonkeyPatch.context() as patch, map_server.serving() as running:
        patch.setattr(osmnx.settings, "nominatim_url", running.url)
        patch.setattr(osmnx.settings, "overpass_url", f"{running.url}/api")
        patch.setattr(osmnx.settings, "overpass_rate_limit", False)
        patch.setattr(osmnx.settings, "cache_folder", tmp_path_factory.mktemp("answers"))
        return {kind.name: create_osm_graph("Kluuvi, Helsinki", kind, tolerance=0.01) for kind in OSMType}
