"""Tagging: an agent that meets a tagger is respawned, eliminated, or passed to a function; and respawn of agents."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from gamms.agent import BaseAgent
from gamms.arguments import as_count, as_flag, as_float, show_as_call
from gamms.context import Context
from gamms.errors import BadType, BadValue, nearest
from gamms.game.block.columns import AgentTable
from gamms.game.block.in_core import ContactOptions
from gamms.game.block.state import Arrays, GameArrays, GameRow
from gamms.game.roles import as_teams_and_roles
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.ir.graph import IntArray
from gamms.rules.contacts import as_nearness, as_side
from gamms.rules.endings import disclose_to_all, get_state
from gamms.rules.in_core import in_core, is_exact_in_core
from gamms.rules.meetings import GameRule, Side, make_player
from gamms.rules.territory import (
    Territory,
    TerritorySource,
    as_territory,
    list_fact_names,
    list_owners,
    list_roles,
)
from gamms.text import shown
from gamms.typing.game import TEAMS, Rule
from gamms.visual.drawers.marks import render_tags

Then = Callable[[Context, BaseAgent, BaseAgent], object]  # called with the context, the tagger and the tagged agent


_THEN = ("respawn", "eliminate")


@show_as_call
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
    ends: bool = False,
) -> Rule:
    """Make a rule that lets each tagger tag one agent that it meets in a turn: the earliest, then the nearest.

    Each agent is in at most one pair, and ties are decided by keyed draws. All pairs are found first; then the tags are
    counted; then the tagged agents are moved. Each tag is an event `tag` with `agent` (the tagger), `other` and `node`
    (the node of the other agent at that time, or the last node that it had passed). See `contacts`.

    The pairs of all `tag` rules of a game are matched together, so their order does not matter: an agent is in at most
    one pair of all rules. If several rules find the same pair, that with the earliest contact tags, then that with the
    smallest distance, as a number of its own unit, then the first by the text of its call.

    Args:
        taggers: a team, a role such as `{"team": "red", "names": ["truck"]}` or `{"team": "red", "where": {"kind":
            "drone"}}`, or a function that returns whether an agent is on this side.
        tagged: the other side, given in the same way.
        hops: maximum number of edges between agents; see `contacts`. Without any of these three, agents must be on the
            same node, or pass each other on an edge.
        metres: maximum length of the path between agents.
        euclid: maximum straight-line distance, map units.
        crossing: whether agents that move along one edge in opposite directions meet; None: only if no distance is
            given.
        air: whether aerial agents take part.
        passing: whether agents also meet on their way; False: only where they are at the end of the turn.
        then: "respawn" at its start, "eliminate", or a function `(ctx, tagger, tagged)`.
        score: points for the tagger's team.
        territory: node -> team or role, or the name of a fact with this mapping: an agent can be tagged only at a node
            of the tagger's team, or of a role that the tagger has.
        mutual: whether both agents of a pair are tagged; with a territory, only the agent on the other's territory.
        ends: whether a tag ends the game: the tagger's team wins; if agents of several teams tag in this turn, no team
            does.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): a key of a role is unknown; when the game begins: a team, or what a role says of its
            agents.
    """
    nearness = as_nearness(hops, metres, euclid, crossing=crossing, air=air, passing=passing)
    sides = as_side(taggers), as_side(tagged)
    then_checked = _as_then(then)
    ground = as_territory(territory)
    as_float(score, "score")
    flags = {"mutual": as_flag(mutual, "mutual"), "ends": as_flag(ends, "ends")}
    return _make_rule([_TagRule(*sides, nearness, then_checked, score, ground, **flags)])


class _TagRule(NamedTuple):
    """The checked arguments of `tag`."""

    taggers: Side
    tagged: Side
    nearness: ContactOptions
    then: str | Then
    score: float
    ground: TerritorySource | None
    mutual: bool
    ends: bool

    @property
    def sides(self) -> tuple[Side, Side]:
        """The two sides: taggers, tagged."""
        return self.taggers, self.tagged

    @property
    def has_core_form(self) -> bool:
        """Whether the core can play the rule in batches."""
        return isinstance(self.then, str) and not any(map(callable, self.sides)) and is_exact_in_core(self.score)


def _make_rule(taggings: Sequence[_TagRule]) -> Rule:
    def tag(ctx: Context) -> None:
        player(ctx)()

    form = in_core("tag", taggings)
    player = partial(make_player, form=form)
    return declared(
        tag,
        RuleSpec(
            drawer=render_tags,
            teams=[
                *(side for tagging in taggings for side in tagging.sides if not callable(side)),
                *(role for tagging in taggings for role in list_roles(tagging.ground)),
            ],
            owners=list(dict.fromkeys(owner for tagging in taggings for owner in list_owners(tagging.ground))),
            may_create_agents=any(callable(tagging.then) for tagging in taggings),
            act_as_one=_make_rule,
            parts=taggings,
            finds=[(*tagging.sides, tagging.nearness, tagging.ground) for tagging in taggings],
            core_form=form if all(tagging.has_core_form for tagging in taggings) else None,
            player=player,
            uses_scores=True,
            needs_ground=any(tagging.nearness.unit == "euclid" for tagging in taggings),
            reads_owners=list_fact_names(tagging.ground for tagging in taggings),
        ),
    )


def _as_then(then: object) -> str | Then:
    if isinstance(then, str):
        if then not in _THEN:
            raise BadValue(
                f"then must be 'respawn', 'eliminate' or a function, not {shown(then)}.{nearest(then, _THEN)}"
            )
        return then
    if not callable(then):
        raise BadType(f"then must be 'respawn', 'eliminate' or a function (ctx, tagger, tagged), not {shown(then)}.")
    return cast("Then", then)


@show_as_call
def respawn(
    after: int = 1, *, times: int | None = None, teams: Annotated[Iterable[Hashable] | None, TEAMS] = None
) -> Rule:
    """Make a rule that returns eliminated agents to their starts.

    Use it with rules that eliminate, for example `tag(…, then="eliminate")`. An agent that is eliminated in turn t
    returns at the end of turn t + `after`, and moves again in the next turn: it misses `after` turns.

    Args:
        after: number of turns that an agent misses.
        times: the maximum number of returns of each agent; None: no limit.
        teams: teams or roles whose agents return, one or several; None: all.

    Raises:
        BadType, BadValue: an argument is invalid.
    """
    wait = as_count(after, "after")
    most = None if times is None else as_count(times, "times")
    those = as_teams_and_roles(teams)
    named = sorted(those or (), key=str)
    key = " ".join(["respawn", *map(str, named)])

    def respawn(ctx: Context) -> None:
        player(ctx)()

    def play(made: GameRule, ctx: Context) -> None:
        state = get_state(ctx, "respawns", key, {"out": {}, "times": {}})
        if not (state["out"] or ctx.agent.block.inactive):
            return
        roster = made.makes.roster
        kept = {name: column[:, : len(roster.names)] for name, column in made.kept.items()}  # there is room for more
        for name, values in memory(state, roster).items():
            kept[name][:] = values
        made.play(ctx)
        show(state, kept, roster.names)

    def memory(known: Mapping[str, Any], roster: AgentTable) -> Arrays:
        return {"out": roster.column(known.get("out", {}), -1), "times": roster.column(known.get("times", {}), 0)}

    def show(state: dict[str, Any], kept: Arrays, names: Sequence[str], returned: Iterable[str] = ()) -> None:
        times = _name_values(kept["times"], names, 0)
        state["times"] |= {name: times[name] for name in dict.fromkeys((*returned, *times)) if name in times}
        state["out"] = _name_values(kept["out"], names, -1)

    def show_arrays(ctx: Context, state: GameArrays | GameRow, events: list[dict[str, Any]], _: int | None) -> None:
        known = get_state(ctx, "respawns", key, {"out": {}, "times": {}})
        show(known, state.kept["respawn", key], state.roster.names, _find_returned_agents(events, known["out"]))

    def begin_arrays(ctx: Context, state: GameArrays) -> dict[Hashable, Arrays]:
        return {("respawn", key): memory(ctx.game.data.get("respawns", {}).get(key, {}), state.roster)}

    form = in_core("respawn", key, those, wait, most)
    player = partial(make_player, form=form, play=play, follows=False)
    return declared(
        respawn,
        RuleSpec(
            teams=named,
            rank=Rank.RESPAWNS,
            key=key,
            brings_back=True,
            disclose=disclose_to_all("respawns", key),
            core_form=form,
            player=player,
            begin_arrays=begin_arrays,
            show_arrays=show_arrays,
        ),
    )


def _find_returned_agents(events: Iterable[Mapping[str, Any]], out: Iterable[str]) -> list[str]:
    """Return the agents that have returned, in order, given events and who was out before them."""
    is_out = set(out)
    found = []
    for event in events:
        if event["kind"] == "eliminated":
            is_out.add(event["agent"])
        elif event["kind"] == "respawned" and event["agent"] in is_out:
            is_out.discard(event["agent"])
            found.append(event["agent"])
    return found


def _name_values(column: IntArray, names: Sequence[str], default: int) -> dict[str, int]:
    """Return the values of agents in one game, (1, agents), by name, except for a default."""
    return {names[agent]: int(column[0, agent]) for agent in np.flatnonzero(column[0] != default).tolist()}
