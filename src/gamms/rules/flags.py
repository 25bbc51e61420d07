"""Capture the flag: an agent takes the flag of another team and brings it home."""

from collections.abc import Hashable, Mapping
from functools import partial
from typing import Annotated, Any, cast

import numpy as np

from gamms import kernels
from gamms.arguments import as_count, as_flag, as_float, as_int, as_name, shown_as_called
from gamms.context import Context
from gamms.core import rules as core
from gamms.errors import BadType
from gamms.game.block.state import Arrays, GameArrays
from gamms.game.settings import RuleSpec, declared
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray
from gamms.readonly import published
from gamms.rules.endings import all_know, refuse_unknown
from gamms.rules.in_core import FlagArguments, fits_core, flags_in_core, in_core
from gamms.rules.meetings import TurnContacts, column, turn_of
from gamms.rules.territory import NO_TERRITORY, Colors, Territory, as_territory
from gamms.text import shown
from gamms.typing import AgentType, NodeId, Rule
from gamms.typing.game import OWNERS
from gamms.visual.drawers.rules import FlagsDrawer


@shown_as_called
def capture_flag(
    flags: Annotated[Mapping[Any, NodeId], OWNERS],
    *,
    territory: Territory | str | None = None,
    goal: int | None = 1,
    score: float = 1,
    announce: bool = True,
    key: str = "flags",
    colors: Colors | None = None,
    passing: bool = True,
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
        territory: node -> team, or the name of a fact with this mapping: home is every node of the carrier's team.
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

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule is added to a game, a base is not on the map.
    """
    given: object = flags
    if not isinstance(given, Mapping) or not given:
        raise BadType(f"flags must be a mapping from teams to nodes, not {shown(flags)}.")
    as_float(score, "score")
    game = _FlagRule(
        {team: as_int(flags[team], f"The base of the flag of {shown(team)}") for team in sorted(flags, key=str)},
        as_territory(territory),
        None if goal is None else as_count(goal, "goal", hint=". None never ends the game."),
        score,
        as_flag(announce, "announce"),
        as_name(key, "the state of the rule"),
        as_flag(passing, "passing"),
    )

    def capture_flag(ctx: Context) -> None:
        game.play(ctx)

    core_form = in_core("capture_flag", game) if fits_core(score) else None
    return declared(
        capture_flag,
        RuleSpec(
            prepare=game.prepare,
            drawer=FlagsDrawer(game.key, colors),
            disclose=all_know(game.key),
            key=game.key,
            core_form=core_form,
            prepare_arrays=game.prepare_arrays,
            facts_of=game.facts_of if game.announce else None,
            begin_arrays=game.begin_arrays,
        ),
    )


class _FlagRule(FlagArguments):
    """The rule with its checked arguments. The state of a game is in `ctx.game.data`."""

    def prepare(self, ctx: Context) -> None:
        """Check the bases against the map, and publish the positions of the flags."""
        refuse_unknown(ctx, self.bases.values())
        self._publish(ctx, self._state(ctx.game.internals.state)["carriers"])

    def prepare_arrays(self, state: GameArrays) -> None:
        """Publish the positions of the flags of many games, from the carriers (games,) as agent numbers."""
        kept = state.keep(("capture_flag", self.key), partial(self.start, len(state.roster.teams)))
        if self.announce:
            columns = zip(self.bases.items(), kept["carriers"].T, strict=True)
            state.facts[self.key] = {team: {"node": base, "carrier": carriers} for (team, base), carriers in columns}

    def facts_of(self, state: GameArrays, games: IntArray) -> list[Any]:
        """Return where the flags are in some games of a batch, as `_publish` publishes it."""
        facts = state.shared.setdefault(("facts", self.key), {})  # NOTE: carriers seldom change (w8_games.py rule)
        rows = [*map(tuple, state.kept["capture_flag", self.key]["carriers"][games].tolist())]
        for new in set(rows).difference(facts):
            names = state.roster.names
            carriers = {team: names[row] if row >= 0 else None for team, row in zip(self.bases, new, strict=True)}
            facts[new] = published(self.key, self._fact(carriers))
        return [facts[one] for one in rows]

    def begin_arrays(self, ctx: Context, state: GameArrays) -> dict[Hashable, Arrays]:
        """Return the state of the rule in a game as arrays; see `start`."""
        known = ctx.game.data.get(self.key, {})
        roster = state.roster
        first = self.start(len(roster.teams), 1)
        stopped = _stopped(ctx.game.events[known.get("seen", 0) :]) if known else set()
        for number, flag in enumerate(self.bases):
            name = known.get("carriers", {}).get(flag)
            if name is not None:
                carrier = roster.names.index(name)
                first["carriers"][0, number] = carrier
                first["stops"][0, number] = state.stops[0, carrier] - (name in stopped)
        for team, times in known.get("captures", {}).items():
            first["captures"][0, roster.teams.index(team)] = times
        return {("capture_flag", self.key): first}

    def _state(self, game: GameState) -> dict[str, Any]:
        """Return the state of the rule in this game."""
        data = game.data
        if self.key not in data:
            carriers = dict.fromkeys(self.bases)
            data[self.key] = {"bases": dict(self.bases), "carriers": carriers, "captures": {}, "seen": 0}
        state: dict[str, Any] = data[self.key]
        return state

    def play(self, ctx: Context) -> None:
        turn = turn_of(ctx)
        key = self.key
        game = turn.game.state
        data = game.data.get(key) or self._state(game)
        events = game.events
        carriers: dict[Hashable, str | None] = data["carriers"]
        known = turn.roster.kept.get(key)
        fresh = events[data["seen"] :]
        # All other agents that carried flags at the end of the last turn are alive and were not stopped.
        may_drop = fresh or known is None or known.told != carriers
        if may_drop and any(carriers.values()):
            self._drop(ctx, carriers, _stopped(fresh))
        if known is None or not known.take(self):
            known = _CoreFlags(self, turn)
            turn.roster.kept[key] = known
        if known.seed != turn.seed:
            known.draw_by(turn.seed)
        if known.concern(turn, carriers):
            known.play(ctx, turn, data)
        data["seen"] = len(events)
        if known.fact is not game.facts.get(key) or known.told != carriers:
            self._publish(ctx, carriers)
            known.told = dict(carriers)
            known.fact = game.facts.get(key)

    def _drop(self, ctx: Context, carriers: dict[Hashable, str | None], stopped: set[str]) -> None:
        for flag, name in carriers.items():
            carrier = None if name is None else ctx.agent.agents.get(name)
            if name is not None and (carrier is None or not carrier.alive or name in stopped):
                node = self.bases[flag] if carrier is None else carrier.current_node_id
                ctx.game.emit("drop", agent=name, flag=flag, node=node)
                carriers[flag] = None

    def _publish(self, ctx: Context, carriers: Mapping[Any, str | None]) -> None:
        if self.announce:
            flags = self._fact(carriers)
            if ctx.game.facts.get(self.key) != flags:
                ctx.game.publish(**{self.key: flags})

    def _fact(self, carriers: Mapping[Any, str | None]) -> dict[Hashable, dict[str, Any]]:
        return {team: {"node": base, "carrier": carriers[team]} for team, base in self.bases.items()}


class _CoreFlags:
    """The flags of one game in the core, for a fixed set of agents.

    Args:
        flags: the checked arguments of the rule.
        turn: the turn in which these agents play.

    Attributes:
        flags, seed: the present arguments; see `take` and `draw_by`.
        told: the carriers when they were published last.
        fact: the fact that was published last.
    """

    _taken: dict[Hashable, str | None] | None = None  # flag -> carrier, as last set in the core
    told: dict[Hashable, str | None] | None = None
    fact: object = None

    def __init__(self, flags: _FlagRule, turn: TurnContacts) -> None:
        roster = turn.roster
        count = len(flags.bases)
        teams = list(turn.roster.teams)
        self.flags = flags
        self._purposes = column("Q", [0] * count)
        self.draw_by(turn.seed)
        self._teams = [] if flags.ground is not None else [team for team in teams if team not in flags.bases]
        ground = np.array(roster.team)
        if roster.fly is not None:
            ground[roster.fly] = -1
        self._carriers = column("q", [-1] * count)
        self._captures = column("q", [0] * len(teams))
        self._events = core.Events(0)
        self._core = flags_in_core(
            flags,
            teams,
            ground,
            np.array([*map(turn.numbers.number, flags.bases.values())]),
            owners=NO_TERRITORY,
            names=roster.keys,
            purposes=self._purposes,
            carriers=self._carriers,
            stops=column("q", [0] * count),
            captures=self._captures,
            starts=NO_TERRITORY,
            members=NO_TERRITORY,
        )

    def take(self, flags: _FlagRule) -> bool:
        """Switch to the arguments of another game's rule if they are equal; return whether they are."""
        if flags is not self.flags and (flags != self.flags or [*flags.bases] != [*self.flags.bases]):
            return False
        self.flags = flags
        return True

    def draw_by(self, seed: int) -> None:
        """Use the random draws of another seed, for another game, and forget the carriers."""
        self.seed = seed
        self.told = None
        for flag, team in enumerate(self.flags.bases):
            self._purposes[flag] = kernels.purpose_key(seed, "capture_flag", self.flags.key, str(team))

    def concern(self, turn: TurnContacts, carriers: Mapping[Hashable, str | None]) -> bool:
        """Set the carriers; return whether any flag may be taken or captured in this turn."""
        if carriers != self._taken:
            number = turn.roster.number
            for flag, team in enumerate(self.flags.bases):
                name = carriers[team]
                self._carriers[flag] = -1 if name is None else number[name]
            self._taken = dict(carriers)
        return not turn.are_steps or self._core.concern(turn.roster.games, 0)

    def play(self, ctx: Context, turn: TurnContacts, data: dict[str, Any]) -> None:
        """Score flags that come home, note taken flags, and update the data of the rule."""
        flags = self.flags
        roster = turn.roster
        captures = data["captures"]
        self._taken = None
        for number, team in enumerate(roster.teams):
            self._captures[number] = captures.get(team, 0)
        if flags.ground is not None:
            self._core.owners = flags.ground.in_turn(ctx, turn)
        elif self._teams:
            self._take_starts(ctx, turn)
        tracks = turn.visits(passing=flags.passing)
        self._core.pass_turn(roster.games, self._events, 0, 0, tracks, turn.legs, turn.scratch())
        for kind, agent, flag, node in self._happened():
            if kind == "end":
                won = [team for team, number in captures.items() if number >= cast("int", flags.goal)]
                ctx.game.end("flags captured", winner=won[0] if len(won) == 1 else None)
                return
            name = roster.names[agent]
            owner = [*flags.bases][flag]
            ctx.game.emit(kind, agent=name, flag=owner, node=turn.numbers.ids[node])
            data["carriers"][owner] = name if kind == "take" else None
            if kind == "capture":
                team = roster.team_of[agent]
                ctx.game.scores[team] += flags.score
                captures[team] = captures.get(team, 0) + 1

    def _happened(self) -> list[tuple[str, int, int, int]]:
        """Return (kind, agent, flag, node) of each event."""
        events = self._events
        columns = (events.kinds, events.agents, events.others, events.nodes) if events.count else ()
        rows = zip(*[column[: events.count] for column in columns], strict=True)
        happened = [(core.KINDS[kind], agent, flag, node) for kind, agent, flag, node in rows]
        events.count = 0
        return happened

    def _take_starts(self, ctx: Context, turn: TurnContacts) -> None:
        """Set the start nodes of agents whose team has no base."""
        agents = [
            (turn.roster.teams[team], agent)
            for team in self._teams
            for agent in ctx.agent.teams[team]
            if agent.type is not AgentType.AERIAL
        ]
        self._core.members = column("q", [team for team, _ in agents])
        nodes = [cast("int", ctx.game.start_node(agent)) for _, agent in agents]
        self._core.starts = column("q", map(turn.numbers.number, nodes))


def _stopped(events: list[dict[str, Any]]) -> set[str]:
    """Return the names of agents that were tagged, respawned or eliminated."""
    tagged = {event["other"] for event in events if event["kind"] == "tag" and "other" in event}
    back = {event["agent"] for event in events if event["kind"] in ("respawned", "eliminated")}
    return tagged | back
