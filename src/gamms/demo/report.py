"""How a game of capture the flag looks, and what happened in it: as lines of text."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

from gamms.context import Context
from gamms.game.result import Result
from gamms.visual import Artist, legend_of_teams
from gamms.visual.appearance import team_colors
from gamms.visual.drawing import drawing_of

_SENTENCES = {
    "take": "{agent} takes the {flag} flag",
    "capture": "{agent} brings it home: {score}",
    "drop": "{agent} is tagged, and the {flag} flag is saved",
}


def headline(ctx: Context, played: Result) -> str:
    """Return the score in one line."""
    end = f"{played.winner} wins" if played.winner else "a draw"
    return f"{_score(list(sides(ctx)), Counter(played.scores))} after {played.turns} turns ({played.reason}): {end}"


def story(ctx: Context, played: Result) -> Iterator[tuple[int, str]]:
    """Turn and sentence of everything that moved a flag."""
    score: Counter[str] = Counter()
    for event in played.events:
        if event["kind"] in _SENTENCES:
            score[ctx.agent.get_agent(event["agent"]).team] += event["kind"] == "capture"
            yield event["turn"], _SENTENCES[event["kind"]].format(score=_score(list(sides(ctx)), score), **event)


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


_LABEL_PX = 19
_LABEL = 0.09, 0.016, 0.01  # how broad and high a name is, and half a disc, in widths of what is seen
_ASIDE = "\u00a0" * 2  # as wide as the disc of an agent, for text is placed in world units only


def declare(ctx: Context) -> None:
    """Declare streets, agents and their names ; territory and flags are drawn by their rules."""
    ctx.visual.set_graph_visual(node_size=0.0, edge_color=(120, 124, 130))
    teams = sides(ctx)
    colors = team_colors(teams)
    for team, agents in teams.items():
        for agent in agents:
            ctx.visual.set_agent_visual(agent.name, color=colors[str(team)], size=12)
    artist = Artist(ctx, draw_names, 45)
    artist.data = {"names": list(ctx.agent.agents)}
    ctx.visual.add_artist("names", artist)
    ctx.visual.add_artist("legend", legend_of_teams(ctx))


def draw_names(ctx: Context, data: Mapping[str, Any]) -> None:
    """Write each agent's name right of it, where it would be neither upon another name nor upon an agent."""
    wide, high, disc = (share * drawing_of(ctx).extent() for share in _LABEL)
    share = data.get("_alpha", 1.0)
    hidden = drawing_of(ctx).hidden_agents(share)
    places = {name: ctx.visual.position_of(name, share) for name in data["names"] if name not in hidden}
    written: list[tuple[float, float]] = []
    for name, (x, y) in places.items():
        agents = [other_x - x for other_x, other_y in places.values() if abs(other_y - y) < high]
        names = [other_x - x for other_x, other_y in written if abs(other_y - y) < high]
        if not any(disc < way < wide for way in agents) and not any(abs(way) < wide for way in names):
            ctx.visual.render_text(_ASIDE + name, x, y + 0.4 * high, (30, 30, 30), font_size=_LABEL_PX)
            written.append((x, y))
