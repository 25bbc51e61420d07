"""Settings of map servers, with the names of OSMnx: `gamms.osm.settings.overpass_url = "http://…/api"`.

A setting with its default value follows `osmnx.settings`, if the program has imported OSMnx and changed it.
"""

import sys
from pathlib import Path
from typing import Any

from gamms.osm.network import KEPT_TAGS

nominatim_url: str = "https://nominatim.openstreetmap.org/"
nominatim_key: str | None = None
overpass_url: str = "https://overpass-api.de/api"
overpass_rate_limit: bool = True  # ask for a free slot before each query
overpass_memory: int | None = None  # bytes that a query may take on the server; None: the server's default
max_query_area_size: float = 2.5e9  # square meters; a larger area becomes several queries
requests_timeout: float = 180.0  # seconds in which an answer must begin
requests_kwargs: dict[str, Any] = {}  # further arguments for `requests.request`, such as proxies, auth or verify
http_user_agent: str = "GAMMS 2 (Python package gamms)"
http_referer: str = ""
http_accept_language: str = "en"
cache_folder: str | Path | None = None  # None: gamms/places in the user's cache folder
use_cache: bool = True
useful_tags_way: list[str] = [*KEPT_TAGS]  # the tags of a way that its edges get

_DEFAULTS = {name: globals()[name] for name in sys.modules[__name__].__annotations__}
_OSMNX = "OSMnx Python package (https://github.com/gboeing/osmnx)"
_DEFAULTS_OF_OSMNX = {"cache_folder": "./cache", "http_user_agent": _OSMNX, "http_referer": _OSMNX}


def get_setting(name: str) -> Any:
    """Return the value of a setting: changed here, changed in OSMnx, or the default."""
    own = globals()[name]
    if own != _DEFAULTS[name] or "osmnx" not in sys.modules:
        return own
    theirs = getattr(getattr(sys.modules["osmnx"], "settings", None), name, own)
    return own if theirs == _DEFAULTS_OF_OSMNX.get(name) else theirs
