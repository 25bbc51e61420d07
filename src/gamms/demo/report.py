"""What happened in a game, as plain data and as lines of text; the same game gives the same bytes."""

import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

from gamms.context import Context
from gamms.game.result import Result

_TOLD = {
    "take": "{agent} takes the {flag} flag",
    "capture": "{agent} brings it home: {score}",
    "drop": "{agent} is tagged, and the {flag} flag is saved",
}


def result(ctx: Context, played: Result, map_name: str, turns: int) -> dict[str, Any]:
    """The whole game as plain data, for `result.json`."""
    columns, flags = ctx.graph.columns(), ctx.game.facts["flags"]
    return {
        "game": "capture the flag",
        "map": {
            "name": map_name,
            "nodes": len(columns.node_ids),
            "edges": len(columns.edge_ids),
            "crs": columns.crs,
            "attribution": ctx.graph.attribution,
        },
        "seed": played.seed,
        "max_turns": turns,
        "turns": played.turns,
        "reason": played.reason,
        "winner": played.winner,
        "teams": [
            {"name": team, "agents": len(agents), "flag_node": flags[team]["node"], **_counts(ctx, played, team)}
            for team, agents in sides(ctx).items()
        ],
        "agents": [{"name": name, "team": one["team"], "node": one["node"]} for name, one in played.agents.items()],
        "events": played.events,
    }


def to_json(data: dict[str, Any]) -> str:
    """`result` as text."""
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"


def headline(ctx: Context, played: Result) -> str:
    """The score in one line."""
    end = f"{played.winner} wins" if played.winner else "a draw"
    return f"{_score(list(sides(ctx)), Counter(played.scores))} after {played.turns} turns ({played.reason}): {end}"


def story(ctx: Context, played: Result) -> Iterator[tuple[int, str]]:
    """Turn and sentence of everything that moved a flag."""
    score: Counter[str] = Counter()
    for event in played.events:
        if event["kind"] in _TOLD:
            score[ctx.agent.get_agent(event["agent"]).team] += event["kind"] == "capture"
            yield event["turn"], _TOLD[event["kind"]].format(score=_score(list(sides(ctx)), score), **event)


def table(ctx: Context, played: Result) -> list[tuple[str, ...]]:
    """One row per team: name, agents, then how often what happened."""
    rows: list[tuple[str, ...]] = [("team", "agents", "captures", "flags taken", "tags", "flags saved")]
    for team, agents in sides(ctx).items():
        rows.append((team, str(len(agents)), *map(str, _counts(ctx, played, team).values())))
    return rows


def sides(ctx: Context) -> dict[str, list[Any]]:
    """The teams in the order of the scenario, with their agents."""
    order = dict.fromkeys(agent.team for agent in ctx.agent.create_iter())
    return {team: ctx.agent.teams[team] for team in order}


def _score(teams: list[str], captures: Counter[str]) -> str:
    first, second = teams
    return f"{first} {captures[first]} : {captures[second]} {second}"


def _counts(ctx: Context, played: Result, team: str) -> dict[str, int]:
    own = Counter(event["kind"] for event in played.events if ctx.agent.get_agent(event["agent"]).team == team)
    saved = sum(event["kind"] == "drop" and event["flag"] == team for event in played.events)
    return {"captures": own["capture"], "flags_taken": own["take"], "tags": own["tag"], "flags_saved": saved}
