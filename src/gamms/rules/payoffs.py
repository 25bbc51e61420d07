"""Payoffs: a table of the points that teams get for events; optionally zero-sum."""

from collections.abc import Hashable, Mapping
from typing import Any

from gamms.arguments import as_flag, as_float, as_known, as_mapping, as_name, show_as_call
from gamms.context import Context
from gamms.errors import BadType, BadValue
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.rules.endings import disclose_to_all, get_state
from gamms.text import shown
from gamms.typing import Rule

_PAYOFFS = "payoffs"  # in `ctx.game.data`: key -> number of events already paid
_AGENTS = ("agent", "other")  # fields that always name agents; other fields may name teams


@show_as_call
def payoff(table: Mapping[str, Mapping[str, float]], *, zero_sum: bool = False, key: str = "payoff") -> Rule:
    """Make a rule that pays teams for events: kind of event -> field that names who is paid -> points.

    `payoff({"tag": {"agent": 3, "other": -3}, "capture": {"agent": 10}})` gives 3 points to the team of the agent that
    tags, and takes 3 from the team of the tagged agent. A field names an agent or a team. The rule pays for all events
    that other rules emit in a turn, in whatever order the rules were added. Agents without a team get nothing. Set
    `score=0` in rules whose events the table also pays for.

    Args:
        table: the payoffs.
        zero_sum: whether all other teams pay in equal parts for the points of a team, so that the scores always add up
            to 0. If there is only one team, nothing is paid.
        key: key of the rule's state; a second payoff rule needs another key.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule pays, an event does not have the field.
        BadType: when the rule pays, the field of an event has a value that cannot name an agent or a team.
    """
    checked = {
        as_name(kind, "a kind of event"): _check_points(kind, of) for kind, of in as_mapping(table, "table").items()
    }
    if not checked:
        raise BadValue("table is empty: give kinds of events, for example {'tag': {'agent': 1}}.")
    balanced = as_flag(zero_sum, "zero_sum")
    state_key = as_name(key, "the state of the rule")

    def prepare(ctx: Context) -> None:
        get_state(ctx, _PAYOFFS, state_key, {"seen": len(ctx.game.events)})

    def payoff(ctx: Context) -> None:
        state = get_state(ctx, _PAYOFFS, state_key, {"seen": 0})
        new = ctx.game.events[state["seen"] :]
        teams = [team for team in ctx.agent.teams if team is not None] if new else []
        for event in new:
            for role, points in checked.get(event["kind"], {}).items():
                as_known(role, f"field of an event {event['kind']!r}:", event)
                team = _find_team(ctx, event["kind"], role, event[role])
                others = [one for one in teams if one != team] if balanced else []
                if team is None or (balanced and not others):
                    continue
                ctx.game.scores[team] += points
                for other in others:
                    ctx.game.scores[other] -= points / len(others)
        state["seen"] = len(ctx.game.events)

    return declared(
        payoff,
        RuleSpec(
            prepare=prepare,
            rank=Rank.PAYOFFS,
            key=state_key,
            disclose=disclose_to_all(_PAYOFFS, state_key),
        ),
    )


def _check_points(kind: object, given: object) -> dict[str, float]:
    """Return the points for a kind of event: field -> points."""
    roles = as_mapping(given, f"table[{shown(kind)}]")
    return {
        as_name(role, "a field of an event"): as_float(points, f"table[{shown(kind)}][{shown(role)}]")
        for role, points in roles.items()
    }


def _find_team(ctx: Context, kind: str, role: str, named: Any) -> Hashable:
    """Return the team named by a field of an event, or the team of the agent it names; None if there is none."""
    if getattr(type(named), "__hash__", None) is None:
        raise BadType(f"The field {role!r} of an event {kind!r} must name an agent or a team, not {shown(named)}.")
    if role not in _AGENTS and named in ctx.agent.teams:
        team: Hashable = named
        return team
    agent = ctx.agent.agents.get(named)
    return None if agent is None else agent.team
