"""Tagging: an agent that meets a tagger goes back to its start, is eliminated, or what the game says; coming back."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Annotated, NamedTuple, cast

from gamms.agent import BaseAgent
from gamms.arguments import as_count, as_flag, as_float
from gamms.context import Context
from gamms.core import rules as core
from gamms.errors import BadType, BadValue, nearest
from gamms.game.batch.state import Arrays, GameArrays
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.rules.contacts import as_nearness, as_side
from gamms.rules.endings import all_know, as_teams, state_of
from gamms.rules.in_core import fits_core, in_core
from gamms.rules.meetings import InTurn, Nearness, Side, turn_of
from gamms.rules.territory import NO_TERRITORY, Ground, Territory, as_territory
from gamms.text import shown, shown_as_called
from gamms.typing.game import TEAMS, Rule
from gamms.visual.drawers.marks import render_tags

Then = Callable[[Context, BaseAgent, BaseAgent], object]  # called with the context, the tagger and the tagged agent


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

    The pairs of all such rules of a game are matched with each other, so that their order does not matter: an agent is
    in one pair of all of them at most.

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
    then_checked, ground = _as_then(then), as_territory(territory)
    as_float(score, "score")
    return _rule_of([_Tagging(*sides, nearness, then_checked, score, ground, mutual=as_flag(mutual, "mutual"))])


class _Tagging(NamedTuple):
    """The arguments of a rule; see `tag`."""

    taggers: Side
    tagged: Side
    nearness: Nearness
    then: str | Then
    score: float
    ground: Ground | None
    mutual: bool

    @property
    def sides(self) -> tuple[Side, Side]:
        """Taggers and tagged."""
        return self.taggers, self.tagged

    @property
    def has_core_form(self) -> bool:
        """Whether the core plays it in batches."""
        return isinstance(self.then, str) and not any(map(callable, self.sides)) and fits_core(self.score)

    def collect(self, ctx: Context, turn: InTurn, number: int) -> None:
        """Add the contacts of a turn that make tags to `turn.roster.tags`, as those of a tagging of a number."""
        found, roster = turn.find(ctx, self.taggers, self.tagged, self.nearness), turn.roster
        owners = NO_TERRITORY if self.ground is None else self.ground.in_turn(ctx, turn)
        if found is not None:
            roster.tags.add(found, number, self.mutual, owners, roster.team)


def _rule_of(taggings: Sequence[_Tagging]) -> Rule:
    def tag(ctx: Context) -> None:
        _tag(ctx, taggings)

    core_form = in_core("tag", taggings) if all(tagging.has_core_form for tagging in taggings) else None
    return declared(
        tag,
        RuleSpec(
            drawer=render_tags,
            teams=[side for tagging in taggings for side in tagging.sides if not callable(side)],
            act_as_one=_rule_of,
            parts=taggings,
            core_form=core_form,
        ),
    )


def _tag(ctx: Context, taggings: Sequence[_Tagging]) -> None:
    """Let agents tag in a turn of one game."""
    turn = turn_of(ctx)
    tags = turn.roster.tags
    tags.begin()
    for number, tagging in enumerate(taggings):
        tagging.collect(ctx, turn, number)
    if tags.count == 0:
        return
    tags.match()
    game, agents, names = ctx.game, ctx.agent, turn.roster.names
    done = list[tuple[_Tagging, BaseAgent, BaseAgent]]()
    for number, tagger, other, node in tags.made(turn.numbers):
        tagging, one = taggings[number], agents.get_agent(names[tagger])
        done.append((tagging, one, agents.get_agent(names[other])))
        game.emit("tag", agent=names[tagger], other=names[other], node=node)
        if tagging.score:
            game.scores[one.team] += tagging.score
    for tagging, one, another in done:
        (_THEN[tagging.then] if isinstance(tagging.then, str) else tagging.then)(ctx, one, another)


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
        out, done, block, agents = state["out"], state["times"], ctx.agent.block, ctx.agent.agents
        for name in sorted({*out, *[block.names[row] for row in block.inactive]}):
            agent = agents.get(name)
            if agent is None:
                continue
            if agent.alive or not (those is None or agent.team in those):
                out.pop(name, None)
                continue
            gone, before = out.setdefault(name, ctx.game.turn), done.get(name, 0)
            if core.comes_back(gone, wait, ctx.game.turn, before, -1 if most is None else most):
                done[name] = before + 1
                del out[name]
                ctx.game.respawn(agent)

    def begin_arrays(ctx: Context, state: GameArrays) -> dict[Hashable, Arrays]:
        known, column = ctx.game.data.get("respawns", {}).get(key, {}), state.roster.column
        return {("respawn", key): {"out": column(known.get("out", {}), -1), "times": column(known.get("times", {}), 0)}}

    core_form = in_core("respawn", key, those, wait, most)
    return declared(
        respawn,
        RuleSpec(
            teams=named,
            rank=Rank.RESPAWNS,
            key=key,
            brings_back=True,
            disclose=all_know("respawns", key),
            core_form=core_form,
            begin_arrays=begin_arrays,
        ),
    )
