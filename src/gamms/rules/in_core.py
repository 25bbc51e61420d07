"""Translations of the rules that the core plays in batches, one function per rule."""

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gamms.core import contacts, rules
from gamms.errors import BadValue
from gamms.game.block.columns import kept_in
from gamms.game.block.in_core import ONE_THAT_SHOWS, CompiledRule, RuleBuilder, floats, ints, memory_of
from gamms.game.block.state import Arrays
from gamms.game.conflicts import flat
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rules.meetings import ContactOptions, Near, ask, reach_of, search_for

_NOTHING = ints(0)
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


def fits_core(points: float) -> bool:
    """Return whether the core adds these points exactly as Python does."""
    return abs(points) <= _MOST_EXACT


def tag(taggings: Sequence[Any], making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.tag` from all such rules of a game."""
    roster = making.state.roster
    state = making.state
    purpose = np.zeros(1, np.uint64).data
    turn = ints(1)
    behind: rules.Tagging | None = None
    for one in reversed(taggings):
        sides = ints(len(roster.names))
        nearness = one.nearness
        tracks = making.tracks(sides, at_end=not nearness.passing)
        near = _near(nearness, making)
        found = contacts.Contacts(making.pieces)
        ask(
            found,
            nearness,
            near,
            tracks,
            making.legs,
            flat(roster.keys, np.uint64),
            purpose,
            turn,
            by_metres=making.by_metres,
        )
        taggers, tagged = (roster.plays_for([side]) & (nearness.air | ~roster.flies) for side in one.sides)
        behind = rules.Tagging(
            found,
            search_for(near, nearness, by_metres=making.by_metres),
            nearness.limit,
            flat(taggers + 2 * tagged, np.int64),
            sides,
            mutual=one.mutual,
            owners=_owners(one.ground, making),
            then=rules.THEN[one.then],
            points=one.score,
            behind=behind,
        )
    if behind is None:
        raise BadValue("A tag rule needs at least one pair of sides.")
    number = making.number(*(CompiledRule(bool(one.score), isinstance(one.score, float)) for one in taggings))
    tags = rules.Tags(ints(len(roster.names)))
    purposes = memory_of(state.purposes("contacts"))
    return rules.TagRule(making.games, making.events, number, behind, tags, making.steps, purpose, turn, purposes)


def _near(nearness: ContactOptions, making: RuleBuilder) -> Near:
    """Return the distances between agents that count as contacts; None: agents must be on the same node."""
    state = making.state
    unit, limit, *_ = nearness
    if unit is None:
        return None
    if unit != "euclid":
        weight = None if unit == "hops" else "length"

        def make() -> contacts.NearNodes:
            near = reach_of(state.streets.ways(weight), limit)
            state.roads.searches.append((weight, near))
            return near

        return kept_in(state.shared, ("reach", unit, limit, making.thread), make)
    return contacts.NodePositions(
        making.columns[0], flat(np.insert(state.streets.columns.xy, 2, 0.0, axis=1), np.float64)
    )


def capture_flag(flags: FlagArguments, making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.capture_flag`."""
    state = making.state
    roster = making.state.roster
    kept = state.keep(("capture_flag", flags.key), partial(flags.start, len(roster.teams)))
    making.agents_in.append(kept["carriers"])
    purposes = state.several_purposes(*(("capture_flag", flags.key, str(team)) for team in flags.bases))
    ground = np.where(roster.flies, -1, roster.team_of)
    core = flags_in_core(
        flags,
        roster.teams,
        ground,
        state.streets.rows([*flags.bases.values()]),
        owners=_owners(flags.ground, making),
        names=flat(roster.keys, np.uint64),
        purposes=flat(purposes, np.uint64),
        carriers=memory_of(kept["carriers"]),
        stops=memory_of(kept["stops"]),
        captures=memory_of(kept["captures"]),
        starts=memory_of(making.home),
        members=flat(ground, np.int64),
    )
    played = CompiledRule(True, isinstance(flags.score, float), tuple(flags.bases), "flags captured")
    return rules.FlagRule(
        making.games,
        making.events,
        making.number(played),
        flags=core,
        visitors=making.visitors(at_end=not flags.passing),
    )


def flags_in_core(
    flags: FlagArguments, teams: Sequence[Hashable], team_of: IntArray, bases: IntArray, **columns: memoryview
) -> rules.Flags:
    """Return flags in the form of the core.

    Args:
        flags: the arguments of the rule.
        teams: the teams of the game.
        team_of: (agents,) the number of each agent's team; -1: it flies.
        bases: (flags,) the node of each flag.
        columns: the columns of games and agents, see `core.rules.Flags`.
    """
    number_of = {team: number for number, team in enumerate(teams)}
    owners = np.array([number_of.get(team, -1) for team in flags.bases])
    home = np.full(len(teams), -1)
    home[owners[owners >= 0]] = bases[owners >= 0]
    takes = np.where(team_of == number_of.get(None, -1), -1, team_of)
    return rules.Flags(
        len(flags.bases),
        team=flat(owners, np.int64),
        base=flat(bases, np.int64),
        home=flat(home, np.int64),
        takes=flat(takes, np.int64),
        taken=floats(len(flags.bases)),
        goal=flags.goal or 0,
        points=flags.score,
        **columns,
    )


def respawn(
    key: str, teams: Collection[Hashable] | None, wait: int, most: int | None, making: RuleBuilder
) -> rules.Rule:
    """Make `gamms.rules.respawn`."""
    shape = making.state.node.shape[1:]

    def make(games: int) -> dict[str, IntArray]:
        return {"out": np.full((games, *shape), -1), "times": np.zeros((games, *shape), np.int64)}

    kept = making.state.keep(("respawn", key), make)
    return rules.RespawnRule(
        making.games,
        making.events,
        making.number(CompiledRule()),
        plays=making.plays(teams),
        out=memory_of(kept["out"]),
        times=memory_of(kept["times"]),
        wait=wait,
        most=-1 if most is None else most,
    )


def time_limit(last: int, winner: object, making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.time_limit`; the winner is a team or `ONE_THAT_SHOWS`."""
    number = making.number(CompiledRule(reason="time limit", winner=winner, truncated=True))
    return rules.TimeLimitRule(making.games, making.events, number, last=last, winner=_code(winner))


def none_left(team: Hashable, reason: str, winner: object, making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.none_left`; for a team without agents, a rule that does nothing."""
    if team not in making.state.roster.teams:
        return _nothing(making)
    number = making.number(CompiledRule(reason=reason, winner=winner))
    return rules.NoneLeftRule(making.games, making.events, number, team=making.team(team), winner=_code(winner))


def reach(
    goals: Mapping[Hashable, Collection[int] | str], winner: object, score: float, passing: bool, making: RuleBuilder
) -> rules.Rule:
    """Make `gamms.rules.reach`; the winner is a team or `ONE_THAT_SHOWS`."""
    roster = making.state.roster
    is_goal = np.zeros((making.state.streets.num_nodes, len(roster.teams)), np.int64)
    starters = np.zeros((len(roster.teams), len(roster.names)), np.int64)
    order = []
    for team, goal in goals.items():
        number = making.team(team)
        if number >= 0:
            order.append(number)
            if isinstance(goal, str):
                starters[number] = _starters(goal, making)
            else:
                is_goal[making.rows(goal), number] = 1
    return rules.ReachRule(
        making.games,
        making.events,
        making.number(CompiledRule(bool(score), isinstance(score, float), winner=winner)),
        visitors=making.visitors(at_end=not passing),
        goals=flat(is_goal, np.int64),
        starters=flat(starters, np.int64) if starters.any() else _NOTHING,
        order=flat(np.array(order, np.int64), np.int64),
        winner=rules.WINNERS["its team" if winner is ONE_THAT_SHOWS else "nobody"],
        points=score,
    )


def arrive(
    team: Hashable, goal: Collection[int] | str, points: float, passing: bool, making: RuleBuilder
) -> rules.Rule:
    """Make `gamms.rules.arrive`; for a team without agents, a rule that does nothing."""
    if team not in making.state.roster.teams:
        return _nothing(making)
    owners = np.full(making.state.streets.num_nodes, -1)
    starters = _NOTHING
    if isinstance(goal, str):
        starters = flat(_starters(goal, making), np.int64)
    else:
        owners[making.rows(goal)] = making.team(team)
    return rules.ArriveRule(
        making.games,
        making.events,
        making.number(CompiledRule(True, isinstance(points, float))),
        visitors=making.visitors(at_end=not passing),
        team=making.team(team),
        owners=flat(owners, np.int64),
        starters=starters,
        points=points,
    )


def _starters(team: str, making: RuleBuilder) -> BoolArray:
    """Return a mask (agents,) of the agents on the ground that are on the team named in a text."""
    roster = making.state.roster
    return roster.plays_for([one for one in roster.teams if str(one) == team]) & ~roster.flies


def _owners(ground: Any, making: RuleBuilder) -> Any:
    """Return the numbers of the teams that own the nodes, (nodes,); empty without a territory."""
    state = making.state
    if ground is None:
        return _NOTHING
    owners = ground.of(state.facts)

    def make() -> tuple[object, IntArray]:
        return owners, ground.rows(state.facts, state.streets, state.roster.teams)

    return flat(kept_in(state.shared, ("territory", id(owners)), make)[1], np.int64)


def last_team(making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.last_team`."""
    number = making.number(CompiledRule(reason="last team"))
    return rules.LastTeamRule(making.games, making.events, number)


def published(fact: str, nodes: Mapping[int, Hashable], making: RuleBuilder) -> rules.Rule:
    """Make `gamms.rules.territory.published`, which does nothing during a turn."""
    making.state.facts.setdefault(fact, nodes)
    return _nothing(making)


def _nothing(making: RuleBuilder) -> rules.Rule:
    return rules.Rule(making.games, making.events, making.number(CompiledRule()))


def _code(winner: object) -> int:
    return rules.WINNERS["leader" if winner is ONE_THAT_SHOWS else "nobody"]


FORMS: Mapping[str, Callable[..., rules.Rule]] = {
    one.__name__: one
    for one in (tag, capture_flag, reach, arrive, respawn, time_limit, none_left, last_team, published)
}
"""Rule name -> function that makes it for the core."""
