"""The shipped rules in the form of the core, for one game and for batches: one function per rule."""

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gamms.core import contacts, rules
from gamms.errors import BadValue
from gamms.game.block.in_core import (
    ONE_THAT_SHOWS,
    CompiledRule,
    ContactOptions,
    Ground,
    Near,
    RuleBuilder,
    get_memory,
    make_floats,
    make_int_buffer,
)
from gamms.game.block.state import Arrays
from gamms.game.conflicts import flatten
from gamms.game.roles import Role
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rules.meetings import Side, ask, search_for

_NOTHING = make_int_buffer(0)
_TAGGED = "an agent was tagged"
_MOST_EXACT = 1 << 53  # of integers as floats


class FlagArguments(NamedTuple):
    """The checked arguments of `gamms.rules.capture_flag`."""

    bases: dict[Hashable, int]
    ground: Any  # a `territory.TerritorySource`; its module imports this one
    goal: int | None
    score: float
    announce: bool
    key: str
    passing: bool
    teams: frozenset[Hashable] | None

    def start(self, teams: int, games: int) -> Arrays:
        """Return the state of the rule at the start of games with a number of teams.

        The state is `carriers` and `stops` (games, flags): the numbers of the agents that carry flags, -1 for none, and
        how often these agents had been tagged or relocated before; and `captures` (games, teams).
        """
        carriers = np.full((games, len(self.bases)), -1)
        captures = np.zeros((games, teams), np.int64)
        return {"carriers": carriers, "stops": np.zeros_like(carriers), "captures": captures}


def in_core(name: str, *args: object) -> Callable[[RuleBuilder], rules.Rule]:
    """Return a function that makes the named rule of the core with these arguments."""
    return partial(FORMS[name], *args)


def is_exact_in_core(points: float) -> bool:
    """Return whether the core adds these points exactly as Python does."""
    return abs(points) <= _MOST_EXACT


def tag(taggings: Sequence[Any], making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.tag` from all such rules of a game."""
    purpose = np.zeros(1, np.uint64).data
    turn = make_int_buffer(1)
    behind: rules.Tagging | None = None
    for one in reversed(taggings):
        arguments = one._asdict()
        sides = arguments.pop("taggers"), arguments.pop("tagged")
        behind = tagging(making, sides, purpose, turn, **arguments, behind=behind)
    if behind is None:
        raise BadValue("A tag rule needs at least one pair of sides.")
    played = [
        CompiledRule(
            one.score or None,
            reason=_TAGGED if one.ends else "",
            then=None if isinstance(one.then, str) else one.then,
        )
        for one in taggings
    ]
    return rules.TagRule(
        making.games,
        making.events,
        making.number(*played),
        behind,
        rules.Tags(make_int_buffer(making.room)),
        making.steps,
        purpose,
        turn,
        making.make_keys(("contacts",)),
    )


def tagging(  # noqa: PLR0913 - all that a tag rule is
    making: RuleBuilder,
    sides: tuple[Side, Side],
    purpose: memoryview,
    turn: memoryview,
    *,
    nearness: ContactOptions,
    then: str | Callable[..., object] = "",
    score: float = 0,
    ground: Ground | None = None,
    mutual: bool = False,
    ends: bool = False,
    behind: rules.Tagging | None = None,
) -> rules.Tagging:
    """Make one tag rule of a game, which is followed by the rule `behind`; also used for contacts alone.

    Args:
        making: the data from which it is made.
        sides: the taggers, and the agents that can be tagged.
        purpose: (1,) the key of the draws that decide ties.
        turn: (1,) the turn.
        nearness: the distance and options.
        then: see `gamms.rules.tag`.
        score: see `gamms.rules.tag`.
        ground: the territory.
        mutual: see `gamms.rules.tag`.
        ends: see `gamms.rules.tag`.
        behind: the next tag rule; None: there is none.
    """
    of_tracks = make_int_buffer(making.room)
    tracks = making.make_tracks(of_tracks, at_end=not nearness.passing)
    keys = _make_keys(making)
    near = making.make_near(nearness)

    found = contacts.Contacts(making.pieces)

    def search(near: Near, found: contacts.Contacts) -> None:
        columns = tracks, making.legs, keys, purpose, turn
        ask(found, nearness, near, *columns, by_metres=making.by_metres)

    search(near, found)
    plays = making.mark_sides(*sides, air=nearness.air)
    made = rules.Tagging(
        found,
        search_for(near, nearness, by_metres=making.by_metres),
        nearness.limit,
        plays,
        of_tracks,
        mutual=mutual,
        ends=ends,
        ground=making.make_territory(ground),
        then=rules.THEN[then if isinstance(then, str) else "function"],
        points=score,
        behind=behind,
    )
    making.follow(made, ground)
    if nearness.unit == "euclid":
        making.follow_places(made, nearness, near, (plays, of_tracks), search)
    return made


def capture_flag(flags: FlagArguments, making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.capture_flag`."""
    roster = making.roster
    kept = making.keep(("capture_flag", flags.key), partial(flags.start, len(roster.teams)))
    number_of = {team: number for number, team in enumerate(roster.teams)}
    owners = np.array([number_of.get(team, -1) for team in flags.bases])
    bases = making.find_rows([*flags.bases.values()])
    home = np.full(len(roster.teams), -1)
    home[owners[owners >= 0]] = bases[owners >= 0]

    def ground() -> IntArray:
        return np.where(making.roster.flies, -1, making.roster.team_of)

    if flags.ground is None:
        making.read_starts(lambda: ~making.roster.flies & (home[making.roster.team_of] < 0))
    core = rules.Flags(
        len(flags.bases),
        team=flatten(owners, np.int64),
        base=flatten(bases, np.int64),
        home=flatten(home, np.int64),
        ground=making.make_territory(flags.ground),
        takes=making.list_by_agent(lambda: np.where(ground() == roster.nobody, -1, ground()), absent=-1),
        names=_make_keys(making),
        purposes=making.make_keys(*(("capture_flag", flags.key, str(team)) for team in flags.bases)),
        carriers=get_memory(kept["carriers"]),
        stops=get_memory(kept["stops"]),
        captures=get_memory(kept["captures"]),
        members=making.list_by_agent(ground, absent=-1),
        taken=make_floats(len(flags.bases)),
        goal=flags.goal or 0,
        points=flags.score,
    )
    making.follow(core, flags.ground)
    played = CompiledRule(flags.score, tuple(flags.bases), "flags captured")
    return rules.FlagRule(
        making.games,
        making.events,
        making.number(played),
        flags=core,
        visitors=making.make_visitors(flags.teams, at_end=not flags.passing),
    )


def respawn(
    key: str, teams: Collection[Hashable] | None, wait: int, most: int | None, making: RuleBuilder
) -> rules.Rule:
    """Make `gamms.rules.respawn`."""

    def make(games: int) -> dict[str, IntArray]:
        return {"out": np.full((games, making.room), -1), "times": np.zeros((games, making.room), np.int64)}

    kept = making.keep(("respawn", key), make)
    return rules.RespawnRule(
        making.games,
        making.events,
        making.number(CompiledRule()),
        plays=making.mark_players(teams),
        out=get_memory(kept["out"]),
        times=get_memory(kept["times"]),
        wait=wait,
        most=-1 if most is None else most,
    )


def time_limit(last: int, winner: object, making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.time_limit`; the winner is a team or `ONE_THAT_SHOWS`."""
    number = making.number(CompiledRule(reason="time limit", winner=winner, truncated=True))
    return rules.TimeLimitRule(making.games, making.events, number, last=last, winner=_find_code(winner, making))


def none_left(member: Hashable, reason: str, winner: object, making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.none_left` for a team or a role; for a team without agents, a rule that does nothing."""
    team = making.get_team_number(member)
    if team < 0:
        return _make_nothing(making)
    number = making.number(CompiledRule(reason=reason, winner=winner))
    return rules.NoneLeftRule(
        making.games,
        making.events,
        number,
        team=-1 if isinstance(member, Role) else team,
        members=making.mark_players([member]),
        winner=_find_code(winner, making),
    )


def reach(
    goals: Mapping[Hashable, Collection[int] | str], winner: object, score: float, passing: bool, making: RuleBuilder
) -> rules.Rule:
    """Make `gamms.rules.reach`; the goals are those of teams and roles, the winner a team or `ONE_THAT_SHOWS`."""
    roster = making.roster
    rows = {team: making.find_rows(sorted(goal)) for team, goal in goals.items() if not isinstance(goal, str)}
    is_goal = np.zeros((making.num_nodes, len(roster.teams)), np.int64)
    order = []
    starters: dict[int, Callable[[], BoolArray]] = {}
    for team, goal in goals.items():
        number = making.get_team_number(team)
        if number >= 0:
            order.append(number)
            if isinstance(goal, str):
                starters[number] = _make_starter_mask(goal, making)
            else:
                is_goal[rows[team], number] = 1

    def are_starters() -> BoolArray:
        found = np.zeros((len(making.roster.names), len(roster.teams)), np.bool_)
        for number, of_team in starters.items():
            found[:, number] = of_team()
        return found.ravel()

    return rules.ReachRule(
        making.games,
        making.events,
        making.number(CompiledRule(score or None, winner=winner)),
        visitors=making.make_visitors([*goals], at_end=not passing),
        goals=flatten(is_goal, np.int64),
        starters=making.list_by_agent(are_starters, width=len(roster.teams)) if starters else _NOTHING,
        order=flatten(np.array(order, np.int64), np.int64),
        winner=rules.WINNERS["its team" if winner is ONE_THAT_SHOWS else "nobody"],
        points=score,
    )


def arrive(
    member: Hashable, goal: Collection[int] | str, points: float, passing: bool, making: RuleBuilder
) -> rules.Rule:
    """Make `gamms.rules.arrive` for a team or a role; for a team without agents, a rule that does nothing."""
    team = making.get_team_number(member)
    if team < 0:
        return _make_nothing(making)
    starters = _NOTHING
    rows = np.zeros(0, np.int64)
    if isinstance(goal, str):
        starters = making.list_by_agent(_make_starter_mask(goal, making))
    else:
        rows = making.find_rows(sorted(goal))
    owners = np.full(making.num_nodes, -1)
    owners[rows] = team
    return rules.ArriveRule(
        making.games,
        making.events,
        making.number(CompiledRule(points)),
        visitors=making.make_visitors([member], at_end=not passing),
        team=team,
        owners=flatten(owners, np.int64),
        starters=starters,
        points=points,
    )


def _make_starter_mask(team: str, making: RuleBuilder) -> Callable[[], BoolArray]:
    """Return a function that returns a mask (agents,) of the agents on the ground on the team named in a text."""
    named = [one for one in making.roster.teams if str(one) == team]

    def found() -> BoolArray:
        return making.roster.find_players(named) & ~making.roster.flies

    making.read_starts(found)
    return found


def _make_keys(making: RuleBuilder) -> Any:
    """Return the hashes of the agents' names, (room,)."""
    return making.list_by_agent(lambda: making.roster.keys, np.uint64)


def last_team(making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.last_team`."""
    number = making.number(CompiledRule(reason="last team"))
    return rules.LastTeamRule(making.games, making.events, number)


def published(fact: str, nodes: Mapping[int, Hashable], making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.territory.published`, which does nothing during a turn."""
    making.publish(fact, nodes)
    return _make_nothing(making)


def _make_nothing(making: RuleBuilder) -> rules.Rule:
    return rules.Rule(making.games, making.events, making.number(CompiledRule()))


def _find_code(winner: object, making: RuleBuilder) -> int:
    if winner is not ONE_THAT_SHOWS:
        return rules.WINNERS["nobody"]
    making.read_scores()
    return rules.WINNERS["leader"]


FORMS: Mapping[str, Callable[..., rules.Rule]] = {
    one.__name__: one
    for one in (tag, capture_flag, reach, arrive, respawn, time_limit, none_left, last_team, published)
}
"""Rule name -> function that makes it for the core."""
