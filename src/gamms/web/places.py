"""Make a page of a map, on which people choose places and copy them in the format of scenario files.

The page contains the map, the attributes of nodes and streets, and the start nodes of the agents of a scenario, for its
seed and up to a hundred other seeds. It needs no server.
"""

import os
from collections import ChainMap
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from gamms import osm
from gamms.arguments import as_path
from gamms.context import create_context
from gamms.errors import BadValue, GammsError, MissingFile
from gamms.scenario import Scenario, ScenarioError, load
from gamms.scenario.spec import LatLon, Rule, Team
from gamms.text import shown
from gamms.visual.appearance import assign_team_colors
from gamms.visual.themes import THEMES
from gamms.web.bundle import VIEWER_THEMES, format_css
from gamms.web.columns import encode_drawn_map
from gamms.web.pages import as_json, as_text_of, fill_page

_SCENARIOS = (".yaml", ".yml", ".json")
_TEAMS = ("red", "blue")  # the teams of a map without a scenario
_SEEDS = 100  # the maximum number of other seeds
_MOST_PLACES = 100_000  # the maximum number of start nodes, for all seeds


def map_page(source: str | os.PathLike[str] | Scenario, *, title: str = "", theme: str | None = None) -> bytes:
    """Return a self-contained UTF-8 HTML page on which places of a map can be chosen.

    Args:
        source: an OpenStreetMap, GeoJSON or `.gamms` file, a scenario file, or a scenario.
        title: the title; by default the name of the scenario or of the file.
        theme: "light", "dark", or None: the theme of the browser.

    Raises:
        BadValue: the theme does not exist.
        ScenarioError (ValueError): the file cannot be loaded.
        OSError: the file cannot be read.
    """
    if theme not in (None, "light", "dark"):
        raise BadValue(f"Unknown theme {shown(theme)} of a page; there are: light, dark, and None.")
    game, is_scenario = _open_scenario(source)
    options = _make_options(game, is_scenario=is_scenario)
    if title:
        options["title"] = title
    if theme is not None:
        options["theme"] = theme
    packed = as_text_of(_encode_map(game))
    data = f'<script type="application/json" id="options">{as_json(options)}</script>\n'
    words = {"title": escape(options["title"]), "still": "This page needs JavaScript.", "connect": "'none'"}
    return fill_page("places", words, f'{data}<script type="application/x-gamms-map" id="map">{packed}</script>')


def _open_scenario(source: str | os.PathLike[str] | Scenario) -> tuple[Scenario, bool]:
    """Return a scenario with the map, and whether the source was a scenario.

    Raises:
        ScenarioError: the scenario is invalid.
        OSError: the file cannot be read.
    """
    if isinstance(source, Scenario):
        return source, True
    file = as_path(source, "source")
    if not file.exists():
        raise MissingFile("a map", file)
    with file.open("rb"):
        pass  # raises the most precise error
    is_geojson = file.suffix == ".geojson" or (file.suffix == ".json" and osm.is_geojson(file))
    if file.suffix.lower() in _SCENARIOS and not is_geojson:
        return load(file), True
    drawn = {} if is_geojson or file.suffix == ".gamms" else {"scenery": True}
    map = {"file": {"path": file.name, **drawn}}
    teams = {name: {"count": 1} for name in _TEAMS}  # the page lets people add agents
    return Scenario(folder=file.absolute().parent, name=file.name, map=map, teams=teams), False


def _find_starts(game: Scenario, seeds: Sequence[int]) -> dict[str, Any]:
    """Return the `names` of agents, and `seeds`: seed -> their start nodes, or the error message of the placement."""
    try:
        found = game.starts(seeds)
        columns = np.array(list(found.values()), np.int64).reshape(len(found), len(seeds)).T
        return {"names": list(found), "seeds": dict(zip(map(str, seeds), columns.tolist(), strict=True))}
    except ScenarioError as error:
        if len(seeds) == 1:
            return {"names": [], "seeds": {str(seeds[0]): str(error)}}
    each = [_find_starts(game, [seed]) for seed in seeds]
    names = max((one["names"] for one in each), key=len)
    return {"names": names, "seeds": dict(ChainMap(*(one["seeds"] for one in reversed(each))))}


def _make_options(game: Scenario, *, is_scenario: bool) -> dict[str, Any]:
    """Return the options of the page: title, teams, rules with nodes, and start nodes."""
    plain = game.to_dict()
    spec = game.spec
    found: dict[str, Any] = {"title": spec.name or ("A scenario" if game.file is None else game.file.name)}
    if not is_scenario:
        teams = [{"name": name, "count": 0, "agents": []} for name in _TEAMS]
        return found | {"map": {"file": plain["map"]["file"]["path"]}, "teams": _add_colors(teams)}
    found["teams"] = _add_colors([_describe_team(game, name, team) for name, team in spec.teams.items()])
    rules = [(number, one) for number, one in enumerate(spec.rules) if isinstance(one, Rule) and "nodes" in one.with_]
    found["rules"] = [{"path": f"rules.{number}.with.nodes", "name": one.name or one.rule} for number, one in rules]
    agents = sum(team.count + len(team.agents) for team in spec.teams.values())
    own = 0 if spec.seed is None else spec.seed
    others = [seed for seed in range(min(_SEEDS, _MOST_PLACES // max(agents, 1))) if seed != own]
    return found | {"seed": own, "starts": _find_starts(game, [own, *others])}


def _add_colors(teams: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return teams with their colors in each theme."""
    names = [team["name"] for team in teams]
    by_theme = {theme: assign_team_colors(names, palette=THEMES[theme].teams) for theme in VIEWER_THEMES}
    return [
        {**team, "colors": {theme: format_css(colors[str(team["name"])]) for theme, colors in by_theme.items()}}
        for team in teams
    ]


def _describe_team(game: Scenario, name: str, team: Team) -> dict[str, Any]:
    """Return the name, the agents and the placement area of a team."""
    found: dict[str, Any] = {"name": name, "count": team.count, "agents": [one.name for one in team.agents]}
    if team.near is not None and team.within is not None:
        place = team.near
        if not isinstance(place, tuple):
            columns = game.columns()
            given = {"lat": place.lat, "lon": place.lon} if isinstance(place, LatLon) else place
            place = tuple(columns.xy[int(np.flatnonzero(columns.node_ids == game.node_at(given))[0])].tolist())
        found |= {"near": list(place), "within": team.within}
    return found


def _encode_map(game: Scenario) -> bytes:
    """Encode the map of a scenario with all attributes, and with latitude and longitude if the map has a CRS."""
    with create_context(logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.storage.copy_from(game.map_snapshot())
        packed, _ = ctx.graph.storage.pack_savable()
        try:
            xy = ctx.graph.columns().xy
            lat_lon = np.column_stack(ctx.graph.to_latlon(xy[:, 0], xy[:, 1]))
        except GammsError:  # the map has no CRS, or the library for its CRS is not installed
            lat_lon = None
    return encode_drawn_map(packed, lat_lon=lat_lon)


__all__ = ["map_page"]
