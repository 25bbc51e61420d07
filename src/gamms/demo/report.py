"""What happened in a game, as plain data and as lines of text; the same game gives the same bytes."""

import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

from gamms.demo.match import Match

_TOLD = {
    "take": "{agent} takes the {enemy} flag",
    "capture": "{agent} brings it home: {score}",
    "save": "{agent} tags {other} and saves the {team} flag",
}
_COUNTED = ("capture", "take", "tag", "save")


def result(match: Match, map_name: str) -> dict[str, Any]:
    """The whole game as plain data, for `result.json`."""
    columns = match.ctx.graph.columns()
    return {
        "game": "capture the flag",
        "map": {
            "name": map_name,
            "nodes": len(columns.node_ids),
            "edges": len(columns.edge_ids),
            "crs": columns.crs,
            "attribution": match.ctx.graph.attribution,
        },
        "seed": match.ctx.seed,
        "max_turns": match.max_turns,
        "turns": match.turn,
        "reason": match.reason,
        "winner": match.winner,
        "teams": [
            {"name": team.name, "agents": team.size, "flag_node": match.world.flag[number], **_counts(match, team.name)}
            for number, team in enumerate(match.world.teams)
        ],
        "agents": [
            {"name": agent.name, "team": match.world.teams[agent.team].name, "node": agent.current_node_id}
            for agent in match.agents
        ],
        "events": match.events,
    }


def to_json(data: dict[str, Any]) -> str:
    """`result` as text."""
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


def headline(match: Match) -> str:
    """The score in one line."""
    (first, second), (a, b) = match.world.teams, match.scores
    end = f"{match.winner} wins" if match.winner else "a draw"
    return f"{first.name} {a} : {b} {second.name} after {match.turn} turns ({match.reason}): {end}"


def story(match: Match) -> Iterator[tuple[int, str]]:
    """Turn and sentence of everything that moved a flag."""
    names = [team.name for team in match.world.teams]
    score = [0, 0]
    for event in match.events:
        if event["kind"] in _TOLD:
            number = names.index(event["team"])
            score[number] += event["kind"] == "capture"
            words = {"enemy": names[1 - number], "score": f"{names[0]} {score[0]} : {score[1]} {names[1]}", **event}
            yield event["turn"], _TOLD[event["kind"]].format(**words)


def table(match: Match) -> list[tuple[str, ...]]:
    """One row per team: name, agents, then how often what happened."""
    rows: list[tuple[str, ...]] = [("team", "agents", "captures", "flags taken", "tags", "flags saved")]
    for team in match.world.teams:
        counts = _counts(match, team.name)
        rows.append((team.name, str(team.size), *(str(count) for count in counts.values())))
    return rows


def _counts(match: Match, team: str) -> dict[str, int]:
    seen = Counter(event["kind"] for event in match.events if event["team"] == team)
    return dict(zip(("captures", "flags_taken", "tags", "flags_saved"), (seen[kind] for kind in _COUNTED), strict=True))
