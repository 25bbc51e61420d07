"""Capture the flag: an agent takes the flag of another team and brings it home."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from functools import partial
from typing import Annotated, Any

from gamms.arguments import as_count, as_flag, as_float, as_name, show_as_call
from gamms.context import Context
from gamms.core import rules as core
from gamms.errors import BadType
from gamms.game.block.state import Arrays, GameArrays, GameRow
from gamms.game.roles import as_teams_and_roles
from gamms.game.settings import RuleSpec, declared
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray, as_node_id
from gamms.readonly import make_shareable
from gamms.rules.endings import disclose_to_all, refuse_unknown
from gamms.rules.in_core import FlagArguments, in_core, is_exact_in_core
from gamms.rules.meetings import GameRule, make_player
from gamms.rules.territory import Colors, Territory, as_territory, list_fact_names, list_owners, list_roles
from gamms.text import shown
from gamms.typing import NodeId, Rule
from gamms.typing.game import OWNERS, TEAMS
from gamms.visual.drawers.rules import FlagsDrawer

_NOBODY = core.CARRIERS["nobody"]
_GONE = core.CARRIERS["gone"]


@show_as_call
def capture_flag(  # noqa: PLR0913 - all that a rule is, in one call
    flags: Annotated[Mapping[Any, NodeId], OWNERS],
    *,
    territory: Territory | str | None = None,
    goal: int | None = 1,
    score: float = 1,
    announce: bool = True,
    key: str = "flags",
    colors: Colors | None = None,
    passing: bool = True,
    teams: Annotated[Iterable[Hashable] | None, TEAMS] = None,
) -> Rule:
    """Make a rule that lets agents on the ground take the flags of other teams and bring them home.

    At the beginning of each turn a carrier that is dead, or was tagged, respawned or eliminated since, drops its flag,
    which returns to its base at once. Then, at each time at which agents reach nodes (see `contacts`), in this order:
    (1) a carrier that is at home captures its flag, which returns to its base; (2) an agent at the base of another
    team's flag that is there takes it, one flag per agent. If several agents could take a flag, one is drawn. Agents
    without a team (`team=None`) take no flags. Add rules that tag before this one.

    Events: `take`, `drop` and `capture`, each with `agent`, `flag` (the team that owns it) and `node`.

    Args:
        flags: team -> node of the base of its flag. Teams without a flag may take other flags.
        territory: node -> team or role, or the name of a fact with this mapping: home is every node of the carrier's
            team, or of a role that the carrier has.
        None: home is the base of the team's own flag; for a team without a flag, any node on which one of its agents
            began.
        goal: number of captures that wins the game; if two teams reach it at the same time, the game is a draw. None:
            captures do not end it.
        score: points for the carrier's team for each capture.
        announce: whether strategies see the flags: `state["facts"][key]` is team -> {"node": base, "carrier": name or
            None}, as of the end of the last turn.
        key: the key of the rule's state in `ctx.game.data`: `bases`, `carriers` and `captures` by team; also the name
            of the artist that draws the flags.
        colors: team -> color of its flag; None: the colors of the agents if none are declared elsewhere.
        passing: whether agents also take flags, and bring them home, on nodes that they only pass; False: only on nodes
            at the end of the turn.
        teams: teams or roles whose agents take flags and bring them home, one or several; None: all.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule is added to a game, a base is not on the map.
    """
    given: object = flags
    if not isinstance(given, Mapping) or not given:
        raise BadType(f"flags must be a mapping from teams to nodes, not {shown(flags)}.")
    as_float(score, "score")
    game = _FlagRule(
        {team: as_node_id(flags[team], f"The base of the flag of {shown(team)}") for team in sorted(flags, key=str)},
        as_territory(territory),
        None if goal is None else as_count(goal, "goal", hint=". None never ends the game."),
        score,
        as_flag(announce, "announce"),
        as_name(key, "the state of the rule"),
        as_flag(passing, "passing"),
        as_teams_and_roles(teams),
    )

    def capture_flag(ctx: Context) -> None:
        player(ctx)()

    form = in_core("capture_flag", game)
    player = partial(make_player, form=form, play=game.play)
    return declared(
        capture_flag,
        RuleSpec(
            prepare=game.prepare,
            teams=[*sorted(game.teams or (), key=str), *list_roles(game.ground)],
            owners=[*dict.fromkeys((*game.bases, *list_owners(game.ground)))],
            drawer=FlagsDrawer(game.key, colors),
            disclose=disclose_to_all(game.key),
            key=game.key,
            uses_scores=True,
            core_form=form if is_exact_in_core(score) else None,
            player=player,
            prepare_arrays=game.prepare_arrays,
            facts_of=game.list_facts if game.announce else None,
            begin_arrays=game.begin_arrays,
            show_arrays=game.show_arrays,
            reads_owners=list_fact_names([game.ground]),
        ),
    )


class _FlagRule(FlagArguments):
    """The rule with its checked arguments. The state of a game is in `ctx.game.data`."""

    def prepare(self, ctx: Context) -> None:
        """Check the bases against the map, and publish the positions of the flags."""
        refuse_unknown(ctx, self.bases.values())
        self._publish(ctx, self._get_state(ctx.game.internals.state)["carriers"])

    def prepare_arrays(self, state: GameArrays) -> None:
        """Publish the positions of the flags of many games, from the carriers (games,) as agent numbers."""
        kept = state.keep(("capture_flag", self.key), partial(self.start, len(state.roster.teams)))
        if self.announce:
            columns = zip(self.bases.items(), kept["carriers"].T, strict=True)
            state.facts[self.key] = {team: {"node": base, "carrier": carriers} for (team, base), carriers in columns}

    def list_facts(self, state: GameArrays, games: IntArray) -> list[Any]:
        """Return where the flags are in some games of a batch, as `_publish` publishes it."""
        facts = state.shared.setdefault(("facts", self.key), {})  # NOTE: carriers seldom change (w8_games.py rule)
        rows = [*map(tuple, state.kept["capture_flag", self.key]["carriers"][games].tolist())]
        for new in set(rows).difference(facts):
            names = state.roster.names
            carriers = {team: names[row] if row >= 0 else None for team, row in zip(self.bases, new, strict=True)}
            facts[new] = make_shareable(self.key, self._make_fact(carriers))
        return [facts[one] for one in rows]

    def begin_arrays(self, ctx: Context, state: GameArrays) -> dict[Hashable, Arrays]:
        """Return the state of the rule in a game as arrays; see `start`."""
        known = ctx.game.data.get(self.key)
        first = self.start(len(state.roster.teams), 1)
        if known is not None:
            numbers = {name: number for number, name in enumerate(state.roster.names)}
            fresh = ctx.game.events[known["seen"] :]
            self._take(known, first, state.roster.teams, numbers, state.stops[0], fresh)
        return {("capture_flag", self.key): first}

    def show_arrays(
        self, ctx: Context, state: GameArrays | GameRow, events: list[dict[str, Any]], later: int | None
    ) -> None:
        """Write the state of the rule in the core into the context; see `RuleSpec.show_arrays`."""
        kept = state.kept["capture_flag", self.key]
        data = self._get_state(ctx.game.internals.state)
        roster = state.roster
        for team, carrier in zip(self.bases, kept["carriers"][0].tolist(), strict=True):
            data["carriers"][team] = roster.names[carrier] if carrier >= 0 else None
        captures = dict(zip(roster.teams, kept["captures"][0].tolist(), strict=True))
        team_of = dict(zip(roster.names, roster.list_teams(), strict=True))
        captured = [team_of[one["agent"]] for one in events if one["kind"] == "capture" and one["flag"] in self.bases]
        for team in dict.fromkeys((*data["captures"], *captured, *captures)):  # in the order of their first captures
            if captures.get(team):
                data["captures"][team] = captures[team]
        if later is None:
            each = zip(kept["carriers"][0].tolist(), kept["stops"][0].tolist(), strict=True)
            stops = {i: int(state.stops[0, i]) - known for i, known in each if i >= 0}
            later = _count_later(events, {roster.names[i]: number for i, number in stops.items()})
        data["seen"] = len(ctx.game.events) - later
        self._publish(ctx, data["carriers"])

    def _take(
        self,
        known: Mapping[str, Any],
        kept: Arrays,
        teams: Sequence[Hashable],
        numbers: Mapping[str, int],
        stops: Sequence[int],
        fresh: list[dict[str, Any]],
    ) -> None:
        """Write the state of the rule to arrays of one game; see `start`.

        Args:
            known: the state.
            kept: the arrays.
            teams: the teams of the game.
            numbers: name -> number of the agent.
            stops: (agents,) how often the agents were stopped.
            fresh: the events since the last turn of the rule.
        """
        stopped = _find_stopped_agents(fresh)
        for flag, name in enumerate(map(known["carriers"].get, self.bases)):
            carrier = _NOBODY if name is None else numbers.get(name, _GONE)
            kept["carriers"][0, flag] = carrier
            if carrier >= 0:
                kept["stops"][0, flag] = stops[carrier] - (name in stopped)
        for number, team in enumerate(teams):
            kept["captures"][0, number] = known["captures"].get(team, 0)

    def _get_state(self, game: GameState) -> dict[str, Any]:
        """Return the state of the rule in this game."""
        data = game.data
        if self.key not in data:
            carriers = dict.fromkeys(self.bases)
            data[self.key] = {"bases": dict(self.bases), "carriers": carriers, "captures": {}, "seen": 0}
        state: dict[str, Any] = data[self.key]
        return state

    def play(self, made: GameRule, ctx: Context) -> None:
        """Play a turn of one game by the rule of the core."""
        key = self.key
        game = made.makes.turn.game.state
        data = game.data.get(key) or self._get_state(game)
        carriers: dict[Hashable, str | None] = data["carriers"]
        captures = data["captures"]
        events = game.events
        fresh = events[data["seen"] :]
        is_read = made.read == (carriers, captures, game.facts.get(key))
        roster = made.makes.turn.roster
        if fresh or not is_read:
            self._take(data, made.kept, roster.table.teams, roster.number, roster.no_stops, fresh)
            made.carriers = [*map(carriers.get, self.bases)]
        happened = made.play(ctx)
        for kind, name, flag in happened:
            carriers[[*self.bases][flag]] = name if kind == "take" else None
            if kind == "capture":
                team = roster.teams[roster.number[name]]
                captures[team] = captures.get(team, 0) + 1
        data["seen"] = len(events)
        if happened or not is_read:
            self._publish(ctx, carriers)
            made.read = dict(carriers), dict(captures), game.facts.get(key)

    def _publish(self, ctx: Context, carriers: Mapping[Any, str | None]) -> None:
        if self.announce:
            flags = self._make_fact(carriers)
            if ctx.game.facts.get(self.key) != flags:
                ctx.game.publish(**{self.key: flags})

    def _make_fact(self, carriers: Mapping[Any, str | None]) -> dict[Hashable, dict[str, Any]]:
        return {team: {"node": base, "carrier": carriers[team]} for team, base in self.bases.items()}


def _count_later(events: list[dict[str, Any]], stops: Mapping[str, int]) -> int:
    """Return the least number of last events in which agents were stopped as often as given, by name."""
    left = dict(stops)
    later = 0
    while any(number > 0 for number in left.values()) and later < len(events):
        later += 1
        for name in _find_stopped_agents(events[-later : len(events) - later + 1]):
            left[name] = left.get(name, 0) - 1
    return later


def _find_stopped_agents(events: list[dict[str, Any]]) -> set[str]:
    """Return the names of agents that were tagged, respawned or eliminated."""
    tagged = {event["other"] for event in events if event["kind"] == "tag" and "other" in event}
    back = {event["agent"] for event in events if event["kind"] in ("respawned", "eliminated")}
    return tagged | back
