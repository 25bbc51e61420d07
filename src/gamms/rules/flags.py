"""Capture the flag: an agent takes the flag of another team and brings it home."""

from collections.abc import Callable, Hashable, Mapping
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.arguments import as_count, as_flag, as_float, as_int, as_name
from gamms.context import Context
from gamms.core import rules as core
from gamms.errors import BadType
from gamms.game.batch.columns import Roster
from gamms.game.batch.state import Arrays, GameArrays
from gamms.game.settings import RuleSpec, declared
from gamms.ir.game_state import GameState
from gamms.rules.endings import all_know, refuse_unknown
from gamms.rules.in_core import fits_core, in_core
from gamms.rules.meetings import InTurn, column, turn_of
from gamms.rules.territory import NO_TERRITORY, Colors, Ground, Territory, as_territory
from gamms.text import shown, shown_as_called
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
    """Make a rule by which agents on the ground take the flags of other teams and bring them home.

    At the beginning of each turn a carrier that is dead, or that was tagged, respawned or eliminated since, drops its
    flag, which is back on its base at once. Then, moment by moment as agents reach nodes on their way (see `contacts`
    for the moments of a turn), in this order: (1) a carrier that comes home has captured its flag, which is back, too;
    (2) an agent on the base of another team's flag that is there takes it, one flag per agent. Of several one is drawn.
    Agents of no team (`team=None`) take none. Rules that tag should be added before this one.

    Events: `take`, `drop` and `capture`, each with `agent`, `flag` (the team that owns it) and `node`.

    Args:
        flags: team -> the node that is the base of its flag. Teams without one may take those of others.
        territory: node -> team, or the name of the fact that has this: home is every node of the carrier's team. None:
            the base of its own flag; where its team has none, any node on which one of its agents began.
        goal: so many captures end the game, and that team wins; two at one moment draw. None: they never end it.
        score: points for the carrier's team for a capture.
        announce: whether strategies know: `state["facts"][key]` is team -> {"node": base, "carrier": name or
            None}, as of the end of the last turn.
        key: the name of its state in `ctx.game.data`: `bases`, `carriers` and `captures` by team; also the name of
            the artist that draws it.
        colors: team -> colour of its flag; None: those of the agents where nothing else is declared.
        passing: whether flags are taken and brought home on nodes that are passed, too; False: only where agents are at
            the end of the turn.

    Raises:
        BadType, BadValue: an argument is not one of these.
        UnknownName (KeyError): when it is added to a game, a base is not a node of the map.
    """
    given: object = flags
    if not isinstance(given, Mapping) or not given:
        raise BadType(f"flags must be a mapping from teams to nodes, not {shown(flags)}.")
    as_float(score, "score")
    game = _Flags(
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
            begin_arrays=game.begin_arrays,
        ),
    )


class _Flags(NamedTuple):
    """The arguments of the rule, checked. What happens in a game is in `ctx.game.data`."""

    bases: dict[Hashable, int]
    ground: Ground | None
    goal: int | None
    score: float
    announce: bool
    key: str
    passing: bool

    def prepare(self, ctx: Context) -> None:
        """Check the bases against the map, and publish where the flags are."""
        refuse_unknown(ctx, self.bases.values())
        self._publish(ctx, self._state(ctx.game.internals.state)["carriers"])

    def prepare_arrays(self, state: GameArrays) -> None:
        """Publish where the flags of many games are: the carriers as numbers of agents, (games,)."""
        kept = state.keep(("capture_flag", self.key), self.start_of(state.roster))
        if self.announce:
            columns = zip(self.bases.items(), kept["carriers"].T, strict=True)
            state.facts[self.key] = {team: {"node": base, "carrier": carriers} for (team, base), carriers in columns}

    def begin_arrays(self, ctx: Context, state: GameArrays) -> dict[Hashable, Arrays]:
        """Return the state of the rule in a game as arrays; see `start_of`."""
        known, first, roster = ctx.game.data.get(self.key, {}), self.start_of(state.roster)(1), state.roster
        stopped = _stopped(ctx.game.events[known.get("seen", 0) :]) if known else set()
        for number, flag in enumerate(self.bases):
            name = known.get("carriers", {}).get(flag)
            if name is not None:
                first["carriers"][0, number] = carrier = roster.names.index(name)
                first["stops"][0, number] = state.stops[0, carrier] - (name in stopped)
        for team, times in known.get("captures", {}).items():
            first["captures"][0, roster.teams.index(team)] = times
        return {("capture_flag", self.key): first}

    def start_of(self, roster: Roster) -> Callable[[int], Arrays]:
        """Return what makes the state of the rule in many games.

        It is `carriers` and `stops` (games, flags), the numbers of the agents that carry flags, -1 for none, and how
        often these had been tagged or put back before; and `captures` (games, teams).
        """

        def make(games: int) -> Arrays:
            carriers = np.full((games, len(self.bases)), -1)
            captures = np.zeros((games, len(roster.teams)), np.int64)
            return {"carriers": carriers, "stops": np.zeros_like(carriers), "captures": captures}

        return make

    def _state(self, game: GameState) -> dict[str, Any]:
        """Return the state of the rule in this game."""
        data = game.data
        if self.key not in data:
            carriers = dict.fromkeys(self.bases)
            data[self.key] = {"bases": dict(self.bases), "carriers": carriers, "captures": {}, "seen": 0}
        state: dict[str, Any] = data[self.key]
        return state

    def play(self, ctx: Context) -> None:
        turn, key = turn_of(ctx), self.key
        game = turn.game.state
        data, events = game.data.get(key) or self._state(game), game.events
        carriers: dict[Hashable, str | None] = data["carriers"]
        known, fresh = turn.roster.kept.get(key), events[data["seen"] :]
        # Else those that carried flags at the end of the last turn live, and were not stopped.
        may_drop = fresh or known is None or known.told != carriers
        if may_drop and any(carriers.values()):
            self._drop(ctx, carriers, _stopped(fresh))
        if known is None or not known.take(self):
            known = turn.roster.kept[key] = _FlagsOfAgents(self, turn)
        if known.seed != turn.seed:
            known.draw_by(turn.seed)
        if known.concern(turn, carriers):
            known.play(ctx, turn, data)
        data["seen"] = len(events)
        if known.fact is not game.facts.get(key) or known.told != carriers:
            self._publish(ctx, carriers)
            known.told, known.fact = dict(carriers), game.facts.get(key)

    def _drop(self, ctx: Context, carriers: dict[Hashable, str | None], stopped: set[str]) -> None:
        for flag, name in carriers.items():
            carrier = None if name is None else ctx.agent.agents.get(name)
            if name is not None and (carrier is None or not carrier.alive or name in stopped):
                node = self.bases[flag] if carrier is None else carrier.current_node_id
                ctx.game.emit("drop", agent=name, flag=flag, node=node)
                carriers[flag] = None

    def _publish(self, ctx: Context, carriers: Mapping[Any, str | None]) -> None:
        if self.announce:
            flags = {team: {"node": base, "carrier": carriers[team]} for team, base in self.bases.items()}
            if ctx.game.facts.get(self.key) != flags:
                ctx.game.publish(**{self.key: flags})


class _FlagsOfAgents:
    """The flags of a game, as the core has them, for some agents.

    Args:
        flags: the arguments of the rule.
        turn: in which these agents play.

    Attributes:
        flags, seed: as given.
        told: who carried flags when that was published last.
        fact: the fact that was published last.
    """

    _taken: dict[Hashable, str | None] | None = None  # who carries flags, as the core has it
    told: dict[Hashable, str | None] | None = None
    fact: object = None

    def __init__(self, flags: _Flags, turn: InTurn) -> None:
        roster, count, teams = turn.roster, len(flags.bases), list(turn.roster.teams)
        self.flags = flags
        self._purposes = column("Q", [0] * count)
        self.draw_by(turn.seed)
        self._teams = [] if flags.ground is not None else [team for team in teams if team not in flags.bases]
        number = turn.numbers.number
        bases = {} if flags.ground is not None else flags.bases  # that are home
        takes = [-1 if team is None else roster.teams[team] for team in roster.team_of]
        if roster.fly is not None:
            takes = [-1 if flies else team for team, flies in zip(takes, roster.fly, strict=True)]
        self._carriers, self._captures = column("q", [-1] * count), column("q", [0] * len(teams))
        self._events = core.Events(0)
        self._core = core.Flags(
            count,
            team=column("q", [roster.teams.get(team, -1) for team in flags.bases]),
            base=column("q", map(number, flags.bases.values())),
            home=column("q", [number(bases[team]) if team in bases else -1 for team in teams]),
            owners=NO_TERRITORY,
            takes=column("q", takes),
            names=roster.keys,
            purposes=self._purposes,
            carriers=self._carriers,
            stops=column("q", [0] * count),
            captures=self._captures,
            starts=NO_TERRITORY,
            members=NO_TERRITORY,
            taken=column("d", [0.0] * count),
            goal=flags.goal or 0,
            points=0.0,
        )

    def take(self, flags: _Flags) -> bool:
        """Go on with the arguments of another rule, of another game, if they are the same; return whether they are."""
        if flags is not self.flags and (flags != self.flags or [*flags.bases] != [*self.flags.bases]):
            return False
        self.flags = flags
        return True

    def draw_by(self, seed: int) -> None:
        """Derive the draws of the rule from another seed, which is that of another game: nothing is known of it."""
        self.seed = seed
        self.told = None
        for flag, team in enumerate(self.flags.bases):
            self._purposes[flag] = kernels.purpose_key(seed, "capture_flag", self.flags.key, str(team))

    def concern(self, turn: InTurn, carriers: Mapping[Hashable, str | None]) -> bool:
        """Take who carries flags; return whether something may happen to some in this turn."""
        if carriers != self._taken:
            number = turn.roster.number
            for flag, team in enumerate(self.flags.bases):
                name = carriers[team]
                self._carriers[flag] = -1 if name is None else number[name]
            self._taken = dict(carriers)
        return not turn.are_steps or self._core.concern(turn.roster.games, 0)

    def play(self, ctx: Context, turn: InTurn, data: dict[str, Any]) -> None:
        """Let agents bring flags home and take them, and note that in the data of the rule."""
        flags, roster, captures = self.flags, turn.roster, data["captures"]
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
            name, owner = roster.names[agent], [*flags.bases][flag]
            ctx.game.emit(kind, agent=name, flag=owner, node=turn.numbers.ids[node])
            data["carriers"][owner] = name if kind == "take" else None
            if kind == "capture":
                team = roster.team_of[agent]
                ctx.game.scores[team] += flags.score
                captures[team] = captures.get(team, 0) + 1

    def _happened(self) -> list[tuple[str, int, int, int]]:
        """Return the kind, agent, flag and node of what has happened."""
        events = self._events
        columns = (events.kinds, events.agents, events.others, events.nodes) if events.count else ()
        rows = zip(*[column[: events.count] for column in columns], strict=True)
        happened = [(core.KINDS[kind], agent, flag, node) for kind, agent, flag, node in rows]
        events.count = 0
        return happened

    def _take_starts(self, ctx: Context, turn: InTurn) -> None:
        """Take where the agents of teams without a base began."""
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
    """Return the names of agents that have been tagged, respawned or eliminated."""
    tagged = {event["other"] for event in events if event["kind"] == "tag" and "other" in event}
    back = {event["agent"] for event in events if event["kind"] in ("respawned", "eliminated")}
    return tagged | back
