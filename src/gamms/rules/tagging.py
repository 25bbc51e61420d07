"""Tagging: who meets a tagger goes back to its start, is out, or whatever the game says."""

from collections.abc import Callable, Mapping
from typing import Any

from gamms.arguments import as_float
from gamms.errors import BadType, BadValue, nearest
from gamms.rules.contacts import Contact, Side, as_nearness, as_side, found, one_to_one
from gamms.rules.drawing import equipped
from gamms.rules.territory import as_territory
from gamms.text import shown
from gamms.typing.game import Rule
from gamms.visual.drawers.rules import render_tags

Then = Callable[[Any, Any, Any], Any]  # called with the context, the tagger and who was tagged
_Tag = tuple[Any, Any, Any]  # tagger, tagged, the node where the latter was


def _respawn(ctx: Any, _: Any, tagged: Any) -> None:
    ctx.game.respawn(tagged)


def _eliminate(ctx: Any, _: Any, tagged: Any) -> None:
    ctx.game.eliminate(tagged)


_THEN: dict[str, Then] = {"respawn": _respawn, "eliminate": _eliminate}


def tag(  # noqa: PLR0913 - all that a rule is, in one call
    taggers: Any,
    tagged: Any,
    *,
    hops: float | None = None,
    metres: float | None = None,
    euclid: float | None = None,
    crossing: bool | None = None,
    air: bool = False,
    passing: bool = True,
    then: str | Then = "respawn",
    score: float = 1,
    territory: Mapping[int, Any] | str | None = None,
    mutual: bool = False,
) -> Rule:
    """A rule: taggers tag those they meet on their way in a turn, one each: the earliest, of these the nearest.

    Each agent is in one pair at most, and pairs equally early and near are chosen by lot. All are found before any is
    moved; then the tags are counted; then those who were tagged are moved. Each tag is an event `tag` with `agent` (the
    tagger), `other` and `node` (where the other was then, or the node that it had passed last). See `contacts`.

    Args:
        taggers: a team, or a function of an agent that says whether it is meant.
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
        score: what the tagger's team gets.
        territory: node -> team, or the name of the fact that has this: an agent can be tagged only
            at a node of the tagger's team.
        mutual: the other side tags, too: both agents of a pair are tagged; with a territory the one on the other's.

    Raises:
        BadType, BadValue: an argument is none of these.
    """
    nearness = as_nearness(hops, metres, euclid, crossing=crossing, air=air, passing=passing)
    sides: tuple[Side, Side] = as_side(taggers), as_side(tagged)
    follow, points, ground = _as_then(then), as_float(score, "score"), as_territory(territory)
    if not isinstance(mutual, bool):
        raise BadType(f"mutual must be True or False, not {shown(mutual)}.")

    def tag(ctx: Any) -> None:
        whose = None if ground is None else ground(ctx)

        def tags_of(contact: Contact) -> list[_Tag]:
            a, b = ctx.agent.get_agent(contact.a), ctx.agent.get_agent(contact.b)
            tags = [(a, b, contact.b_node)] + [(b, a, contact.a_node)] * mutual
            return [one for one in tags if whose is None or (one[2] in whose and whose[one[2]] == one[0].team)]

        tags = {contact: some for contact in found(ctx, *sides, nearness) if (some := tags_of(contact))}
        made = [one for contact in one_to_one(tags) for one in tags[contact]]
        for tagger, other, node in made:
            ctx.game.emit("tag", agent=tagger.name, other=other.name, node=node)
            if points:
                ctx.game.scores[tagger.team] += score
        for tagger, other, _ in made:
            follow(ctx, tagger, other)

    return equipped(tag, drawer=render_tags, teams=[side for side in (taggers, tagged) if not callable(side)])


def _as_then(then: Any) -> Then:
    if isinstance(then, str):
        if then not in _THEN:
            raise BadValue(
                f"then must be 'respawn', 'eliminate' or a function, not {shown(then)}.{nearest(then, _THEN)}"
            )
        return _THEN[then]
    if not callable(then):
        raise BadType(f"then must be 'respawn', 'eliminate' or a function (ctx, tagger, tagged), not {shown(then)}.")
    follow: Then = then
    return follow
