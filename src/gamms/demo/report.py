"""What happened in a game of capture the flag: as lines of text."""

from collections import Counter
from collections.abc import Iterator
from itertools import groupby
from operator import itemgetter
from typing import Any

from gamms.context import Context
from gamms.game.result import Result
from gamms.visual.captions import captions_of


def headline(ctx: Context, played: Result) -> str:
    """Return the score in one line."""
    end = f"{played.winner} wins" if played.winner else "a draw"
    return f"{_score(list(sides(ctx)), Counter(played.scores))} after {played.turns} turns ({played.reason}): {end}"


def key_events(ctx: Context, played: Result) -> Iterator[tuple[int, str]]:
    """Yield turn and sentence of all that moved a flag."""
    score: Counter[str] = Counter()
    for turn, events in groupby(played.events, itemgetter("turn")):
        of_turn = list(events)
        for words, name in captions_of(of_turn):
            own = [event["kind"] for event in of_turn if event["agent"] == name and "flag" in event]
            if name is not None and "capture" in own:
                score[ctx.agent.get_agent(name).team] += 1
                yield turn, f"{words}: {_score(list(sides(ctx)), score)}"
            elif own:
                yield turn, words


def table(ctx: Context, played: Result) -> list[tuple[str, ...]]:
    """Return one row per team: name, agents, then how often what happened."""
    rows: list[tuple[str, ...]] = [("team", "agents", "captures", "flags taken", "tags", "flags saved")]
    for team, agents in sides(ctx).items():
        rows.append((team, str(len(agents)), *map(str, _counts(ctx, played, team).values())))
    return rows


def sides(ctx: Context) -> dict[str, list[Any]]:
    """Return the teams in the order of the scenario, with their agents."""
    order = dict.fromkeys(agent.team for agent in ctx.agent.create_iter())
    return {team: ctx.agent.teams[team] for team in order}


def _score(teams: list[str], captures: Counter[str]) -> str:
    first, second = teams
    return f"{first} {captures[first]} : {captures[second]} {second}"


def _counts(ctx: Context, played: Result, team: str) -> dict[str, int]:
    own = Counter(event["kind"] for event in played.events if ctx.agent.get_agent(event["agent"]).team == team)
    saved = sum(event["kind"] == "drop" and event["flag"] == team for event in played.events)
    return {"captures": own["capture"], "flags_taken": own["take"], "tags": own["tag"], "flags_saved": saved}
