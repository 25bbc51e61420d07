"""Tagging: an agent that meets a tagger goes back to its start, is eliminated, or what the game says; coming back."""

from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import partial
from typing import Annotated, cast

import numpy as np

from gamms.agent import BaseAgent
from gamms.arguments import as_count, as_flag, as_float
from gamms.context import Context
from gamms.errors import BadType, BadValue, nearest
from gamms.game.batch.state import Arrays, GameArrays
from gamms.game.batch.turn import ArrayTurn
from gamms.rules.contacts import Contact, Side, as_nearness, as_side, found, one_to_one
from gamms.rules.endings import Rank, all_know, as_teams, state_of, with_hooks
from gamms.rules.meetings import met_in_turn, one_to_one_of_games
from gamms.rules.territory import Territory, as_territory
from gamms.text import shown, shown_as_called
from gamms.typing.game import TEAMS, Rule
from gamms.visual.drawers.marks import render_tags

Then = Callable[[Context, BaseAgent, BaseAgent], object]  # called with the context, the tagger and the tagged agent
_Tag = tuple[BaseAgent, BaseAgent, int]  # tagger, tagged, the node where the latter was


_THEN: dict[str, Then] = {
    "respawn": lambda ctx, _, tagged: ctx.game.respawn(tagged),
    "eliminate": lambda ctx, _, tagged: ctx.game.eliminate(tagged),
}


@shown_as_called
def tag(  # noqa: PLR0913 - all that a rule is, in one call
    taggers: Side,
    tagged: Side,
    *,
    hops: float | None = None,
    metres: float | None = None,
    euclid: float | None = None,
    crossing: bool | None = None,
    air: bool = False,
    passing: bool = True,
    then: str | Then = "respawn",
    score: float = 1,
    territory: Territory | str | None = None,
    mutual: bool = False,
) -> Rule:
    """Make a rule by which taggers tag those that they meet in a turn, one each: the earliest, of these the nearest.

    Each agent is in one pair at most, and ties are decided by keyed draws. All pairs are found before any agent is
    moved; then the tags are counted; then the tagged agents are moved. Each tag is an event `tag` with `agent` (the
    tagger), `other` and `node` (where the other was then, or the node that it had passed last). See `contacts`.

    Two rules by which each side tags the other are not fair without a territory, which the first run warns of: the
    agents that the first rule tags are gone before the second one looks.

    Args:
        taggers: a team, or a function of an agent that says whether it is on that side.
        tagged: likewise.
        hops: tag from so many edges away, as for `contacts`. Without any of these three, on one node, or past each
            other on an edge.
        metres: the same by the lengths of the edges.
        euclid: the same in a straight line, map units.
        crossing: whether agents that are on one edge in opposite directions meet, too; None: where no distance is
            given.
        air: whether aerial agents take part.
        passing: whether agents meet on their way, too; False: where they are at the end of the turn.
        then: "respawn" where it began, "eliminate", or a function `(ctx, tagger, tagged)`.
        score: points for the tagger's team.
        territory: node -> team, or the name of the fact that has this: an agent can be tagged only
            at a node of the tagger's team.
        mutual: the other side tags, too: both agents of a pair are tagged; with a territory the one on the other's.

    Raises:
        BadType, BadValue: an argument is not one of these.
    """
    nearness = as_nearness(hops, metres, euclid, crossing=crossing, air=air, passing=passing)
    sides = as_side(taggers), as_side(tagged)
    follow, points, ground = _as_then(then), as_float(score, "score"), as_territory(territory)
    both = as_flag(mutual, "mutual")

    def tag(ctx: Context) -> None:
        owners = None if ground is None else ground.of(ctx.game.facts)
        met = found(ctx, *sides, nearness)
        if not met:
            return
        tags = {contact: some for contact in met if (some := _tags_of(ctx, contact, owners, both=both))}
        made = [one for contact in one_to_one(tags) for one in tags[contact]]
        for tagger, other, node in made:
            ctx.game.emit("tag", agent=tagger.name, other=other.name, node=node)
            if points:
                ctx.game.scores[tagger.team] += score
        for tagger, other, _ in made:
            follow(ctx, tagger, other)

    def in_arrays(turn: ArrayTurn) -> None:
        takes_part = nearness.air | ~turn.roster.flies
        ours, theirs = (np.flatnonzero(turn.roster.plays_for([side]) & takes_part) for side in (taggers, tagged))
        met = met_in_turn(turn, ours, theirs, nearness)
        tags = np.ones((len(met.games), 1 + both), np.bool_)  # by the agents of the one side, and of the other
        if ground is not None:
            owners, team_of = ground.in_arrays(turn), turn.roster.team_of
            pairs = [(met.b_nodes, met.a), (met.a_nodes, met.b)][: 1 + both]
            tags = np.stack([owners[node] == team_of[agent] for node, agent in pairs], axis=1)
            is_tag = np.flatnonzero(tags.any(axis=1))
            met, tags = met.those(is_tag), tags[is_tag]
        made = one_to_one_of_games(met.games, met.a, met.b, len(turn.roster.names))
        at, tagger, other, node = met.games[made], met.a[made], met.b[made], met.b_nodes[made]
        if both:
            at, node = np.repeat(at, 2), np.column_stack((node, met.a_nodes[made])).ravel()
            tagger, other = np.column_stack((tagger, other)).ravel(), np.column_stack((other, tagger)).ravel()
            done = tags[made].ravel()
            at, tagger, other, node = at[done], tagger[done], other[done], node[done]
        turn.emit("tag", at, agents={"agent": tagger, "other": other}, nodes={"node": node})
        if points:
            turn.add_scores(at, tagger, score)
        (turn.respawn if then == "respawn" else turn.eliminate)(at, other)

    has_form = isinstance(then, str) and not (callable(taggers) or callable(tagged))
    return with_hooks(
        tag,
        drawer=render_tags,
        teams=[side for side in (taggers, tagged) if not callable(side)],
        sides=sides if ground is None else None,
        warn_after=partial(_why_unfair_after, sides if ground is None else None),
        array_form=in_arrays if has_form else None,
    )


def _tags_of(ctx: Context, contact: Contact, owners: Mapping[int, object] | None, *, both: bool) -> list[_Tag]:
    """Return the tags that a contact makes, where nodes have these owners."""
    a, b = ctx.agent.get_agent(contact.a), ctx.agent.get_agent(contact.b)
    tags = [(a, b, contact.b_node)] + [(b, a, contact.a_node)] * both
    return [one for one in tags if owners is None or (one[2] in owners and owners[one[2]] == one[0].team)]


def _why_unfair_after(sides: tuple[Side, Side] | None, earlier: Rule) -> str | None:
    """Return why a rule that has no territory should not be called after a rule by which the other side tags."""
    if sides is None or sides[0] == sides[1] or getattr(earlier, "sides", None) != sides[::-1]:
        return None
    return (
        "tag each other's sides and have no territory. The first of them is called first in every turn, and agents "
        "that it puts back or eliminates are gone before the second one looks, so the side that tags by the first has "
        "an advantage; another order of the rules gives it to the other side. Give both a territory=, so that each "
        "side tags on its own ground, or play another game: one rule with mutual=True tags both agents of a pair."
    )


def _as_then(then: object) -> Then:
    if isinstance(then, str):
        if then not in _THEN:
            raise BadValue(
                f"then must be 'respawn', 'eliminate' or a function, not {shown(then)}.{nearest(then, _THEN)}"
            )
        return _THEN[then]
    if not callable(then):
        raise BadType(f"then must be 'respawn', 'eliminate' or a function (ctx, tagger, tagged), not {shown(then)}.")
    return cast("Then", then)


@shown_as_called
def respawn(
    after: int = 1, *, times: int | None = None, teams: Annotated[Iterable[Hashable] | None, TEAMS] = None
) -> Rule:
    """Make a rule by which agents that are out come back where they began.

    It is for rules that eliminate, such as `tag(…, then="eliminate")`. An agent that goes out in turn t is back at the
    end of turn t + `after`, and moves again in the turn behind it: it misses so many turns.

    Args:
        after: how many turns an agent misses.
        times: how often each agent comes back; None: always.
        teams: those whose agents come back, one or several; None: all.

    Raises:
        BadType, BadValue: an argument is not one of these.
    """
    wait, most, those = as_count(after, "after"), None if times is None else as_count(times, "times"), as_teams(teams)
    named = sorted(those or (), key=str)
    key = " ".join(["respawn", *map(str, named)])

    def respawn(ctx: Context) -> None:
        state = state_of(ctx, "respawns", key, {"out": {}, "times": {}})
        out, done = state["out"], state["times"]
        for name, agent in sorted(ctx.agent.agents.items()):
            if agent.alive or not (those is None or agent.team in those):
                out.pop(name, None)
            elif out.setdefault(name, ctx.game.turn) + wait <= ctx.game.turn and done.get(name, 0) != most:
                done[name] = done.get(name, 0) + 1
                del out[name]
                ctx.game.respawn(agent)

    def begin_arrays(ctx: Context, state: GameArrays) -> dict[Hashable, Arrays]:
        known, column = ctx.game.data.get("respawns", {}).get(key, {}), state.roster.column
        return {("respawn", key): {"out": column(known.get("out", {}), -1), "times": column(known.get("times", {}), 0)}}

    def in_arrays(turn: ArrayTurn) -> None:
        shape = turn.alive.shape[1:]
        kept = turn.keep(
            ("respawn", key), lambda n: {"out": np.full((n, *shape), -1), "times": np.zeros((n, *shape), np.int64)}
        )
        is_out = turn.is_out & turn.roster.plays_for(those)
        out = np.where(is_out, kept["out"][turn.games], -1)
        out = np.where(is_out & (out < 0), turn.turn[:, None], out)
        is_back = is_out & (out + wait <= turn.turn[:, None])
        if most is not None:
            is_back &= kept["times"][turn.games] != most
        at, agents = np.nonzero(is_back)
        out[at, agents] = -1
        kept["times"][turn.games[at], agents] += 1
        kept["out"][turn.games] = out
        turn.respawn(at, agents)

    return with_hooks(
        respawn,
        teams=named,
        rank=Rank.RESPAWNS,
        key=key,
        brings_back=True,
        disclose=all_know("respawns", key),
        array_form=in_arrays,
        begin_arrays=begin_arrays,
    )
