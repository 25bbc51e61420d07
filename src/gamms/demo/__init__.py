"""The demo: capture the flag between two teams on the streets of a city.

A client of clients: it plays a scenario. The game is a file, `data/gallery/capture_the_flag.yaml`, with other teams
or on another map if that is asked for; `headline`, `key_events` and `table` tell what happened. Read
`strategies.py` next.
"""

from collections import Counter
from collections.abc import Iterator
from itertools import groupby
from math import isfinite
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gamms.context import Context
from gamms.errors import BadValue
from gamms.game.result import Result
from gamms.ir.game_state import describe_reason
from gamms.ir.graph import GraphColumns
from gamms.osm import is_geojson
from gamms.scenario import Scenario, load
from gamms.visual.captions import write_captions

__all__ = ["FILE", "Team", "capture_the_flag", "check_ways", "headline", "key_events", "table"]

FILE = Path(__file__).parent.parent / "data" / "gallery" / "capture_the_flag.yaml"

_DEFENDERS = 1  # of five
_FLAG_AT = 0.12  # how far from either end of the map, as a share of all nodes
_LEAST_NODES = 50
_START_NODES = 10  # nodes for each agent to start on, if the map has so many


class Team(NamedTuple):
    """A side of the game."""

    name: str
    size: int


def capture_the_flag(teams: tuple[Team, Team], max_turns: int, map: Path | None = None) -> Scenario:
    """Return the game between two teams, on the streets of Helsinki or of a map file.

    Raises:
        BadValue: the map is too small.
        ScenarioError: it cannot be read.
    """
    raw = load(FILE).to_dict()
    if map is not None:
        has_scenery = map.suffix != ".gamms" and not (map.is_file() and is_geojson(map))  # or keeps its own
        raw |= {"map": {"file": {"path": map.name, "scenery": has_scenery}}, "name": f"{raw['name']} in {map.name}"}
    raw["rules"][3]["with"]["turns"] = max_turns
    sides = dict(zip(raw["teams"], teams, strict=True))
    raw["teams"] = {side.name: {**raw["teams"][of], **_describe_size(side)} for of, side in sides.items()}
    _, tag, flags, _ = (rule["with"] for rule in raw["rules"])
    nodes = raw["rules"][0]["with"]["nodes"]["with"]
    tag["taggers"] = teams[0].name
    tag["tagged"] = teams[1].name
    for places, key in ((flags, "flags"), (nodes, "bases")):
        places[key] = {side.name: places[key][of] for of, side in sides.items()}
    game = Scenario(folder=None if map is None else map.absolute().parent, **raw)
    if map is not None:
        game = _move_flags(game, teams)
    return _add_start_areas(game, teams)


def check_ways(ctx: Context) -> None:
    """Check that the game can be won on this map.

    Raises:
        BadValue: one flag cannot be reached from the other.
    """
    red, blue = (flag["node"] for flag in ctx.game.facts["flags"].values())
    if not (isfinite(ctx.graph.distance(red, blue)) and isfinite(ctx.graph.distance(blue, red))):
        raise BadValue("One flag cannot be reached from the other on this map.")


def headline(ctx: Context, played: Result) -> str:
    """Return the score in one line."""
    end = f"{played.winner} wins" if played.winner else "a draw"
    score = _score(list(sides(ctx)), Counter(played.scores))
    return f"{score} after {played.turns} turns ({describe_reason(played.reason)}): {end}"


def key_events(ctx: Context, played: Result) -> Iterator[tuple[int, str]]:
    """Yield turn and sentence of all that moved a flag."""
    score: Counter[str] = Counter()
    for turn, events in groupby(played.events, itemgetter("turn")):
        of_turn = list(events)
        for words, name in write_captions(of_turn):
            own = [event["kind"] for event in of_turn if event["agent"] == name and "flag" in event]
            if name is not None and "capture" in own:
                score[ctx.agent.get_agent(name).team] += 1
                yield turn, f"{words}: {_score(list(sides(ctx)), score)}"
            elif own:
                yield turn, words


def table(ctx: Context, played: Result) -> list[tuple[str, ...]]:
    """Return one row per team: name, number of agents, and counts of events."""
    rows: list[tuple[str, ...]] = [("team", "agents", "captures", "flags taken", "tags", "flags saved")]
    for team, agents in sides(ctx).items():
        rows.append((team, str(len(agents)), *map(str, _count_results(ctx, played, team).values())))
    return rows


def sides(ctx: Context) -> dict[str, list[Any]]:
    """Return the teams in the order of the scenario, with their agents."""
    order = dict.fromkeys(agent.team for agent in ctx.agent.create_iter())
    return {team: ctx.agent.teams[team] for team in order}


def _describe_size(side: Team) -> dict[str, Any]:
    strategy = {"function": "gamms.demo.strategies:player", "with": {"defenders": side.size * _DEFENDERS // 5}}
    return {"count": side.size, "strategy": strategy}


def _move_flags(game: Scenario, teams: tuple[Team, Team]) -> Scenario:
    """Return the game with its flags near the two ends of the map."""
    columns = game.columns()
    if len(columns.node_ids) < _LEAST_NODES:
        raise BadValue(f"The map has {len(columns.node_ids)} nodes; the game needs at least {_LEAST_NODES}.")
    flags = {
        side.name: _find_flag_node(columns, share)
        for side, share in zip(teams, (_FLAG_AT, 1.0 - _FLAG_AT), strict=True)
    }
    near = {f"teams.{team}.near": node for team, node in flags.items()}
    bases = {"rules.2.with.flags": flags, "rules.0.with.nodes.with.bases": flags}
    return game.replace(**near, **bases)


def _find_flag_node(columns: GraphColumns, share: float) -> int:
    """Return the node in the middle of the strip that lies `share` of the way along the longer side of the map."""
    along = columns.xy[:, int(np.argmax(np.ptp(columns.xy, axis=0)))]
    low, high = np.quantile(along, (max(share - 0.05, 0.0), min(share + 0.05, 1.0)))
    strip = np.flatnonzero((along >= low) & (along <= high))
    middle = np.median(columns.xy[strip], axis=0)
    return int(columns.node_ids[strip[np.argmin(np.hypot(*(columns.xy[strip] - middle).T))]])


def _add_start_areas(game: Scenario, teams: tuple[Team, Team]) -> Scenario:
    """Return the game with wider circles to start in, where teams are large or nodes are few."""
    xy = game.columns().xy
    changes = {}
    for side in teams:
        flag = xy[game.columns().node_ids == game.node_at(game.spec.teams[side.name].near)]
        wanted = np.sort(np.hypot(*(xy - flag).T))[: side.size * _START_NODES][-1]
        if wanted > (game.spec.teams[side.name].within or 0.0):
            changes[f"teams.{side.name}.within"] = float(wanted)
    return game.replace(**changes) if changes else game


def _score(teams: list[str], captures: Counter[str]) -> str:
    first, second = teams
    return f"{first} {captures[first]} : {captures[second]} {second}"


def _count_results(ctx: Context, played: Result, team: str) -> dict[str, int]:
    own = Counter(event["kind"] for event in played.events if ctx.agent.get_agent(event["agent"]).team == team)
    saved = sum(event["kind"] == "drop" and event["flag"] == team for event in played.events)
    return {"captures": own["capture"], "flags_taken": own["take"], "tags": own["tag"], "flags_saved": saved}
