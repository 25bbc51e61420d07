"""The front of the turn engine: `ctx.game`, which plays turns in which all agents move at once."""

from collections.abc import Callable, Hashable, Iterable
from time import perf_counter
from types import EllipsisType
from typing import TYPE_CHECKING, Any, Literal, overload

from gamms import kernels
from gamms.arguments import as_bool, as_choice, as_count, as_int, as_key, as_name
from gamms.deciding import phase_of, refused_while_deciding
from gamms.errors import BadType, BadValue, ContextTerminated, IllegalMutation, UnknownName
from gamms.game.decisions import ArrayPlan
from gamms.game.facts import Information, PrivateFork
from gamms.game.global_random import seeded_for_run
from gamms.game.private import copy_known
from gamms.game.result import Collectors, Result, misspelt_names, what_went_wrong
from gamms.game.rule_verbs import RuleVerbs
from gamms.game.settings import PHASES, NamedRule, Plan, RuleSet
from gamms.game.slots import COUNTED
from gamms.game.snapshots import GameInternals, Snapshot, SnapshotError, SnapshotTaker, Start, copy_game, own
from gamms.game.turn import TurnEngine
from gamms.ir.game_state import GameState
from gamms.progress import progress as progress_line
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing.actions import plan_in
from gamms.typing.context import HostContext
from gamms.typing.game import Rule, TeamPlan, strategy_name
from gamms.versions import versions

if TYPE_CHECKING:
    from gamms.game.batch import Batch
    from gamms.game.batch.games import MostAgents


class Game(RuleVerbs):
    """The turn engine of one context; see `Settings` for what can be set, and `RuleVerbs` for what rules call.

    Attributes:
        facts: what was published.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._phase = phase_of(ctx)
        super().__init__()
        self.ctx: Any = ctx
        self._state = GameState()
        self._ruleset = RuleSet(ctx)
        self._collectors = Collectors()
        self._turns = TurnEngine(ctx, self, self._state, self._phase)
        self._snapshots = SnapshotTaker(ctx, self._state, self, self._ruleset, self._collectors, self._turns)
        self.facts = ReadOnlyMapping(self._state.facts)
        self._internals = GameInternals(self._snapshots, self._phase)
        self._unchecked_plans: list[Any] = []  # teams that were given one since the last turn
        self._is_closed = True

    def __repr__(self) -> str:
        """Show how far it is."""
        state, rules = self._state, ", ".join(rule.name for rule in self._ruleset.rules)
        end = "" if state.over is None else f", over: {state.over['reason']}"
        return f"Game(turn={state.turn}, rules=[{rules}], scores={shown(dict(state.scores))}{end})"

    @property
    def internals(self) -> GameInternals:
        """What engines and clients do with the game; not for strategies."""
        if self._phase.agent is not None and not getattr(self._phase.agent, "is_maker", False):
            self._phase.refuse("use ctx.game.internals")
        return self._internals

    # -- what it is played by -----------------------------------------------------------------------------------

    @overload
    def add(self, rule: Rule, *, phase: str = "after", name: str | None = None) -> Rule: ...
    @overload
    def add(self, *, phase: str = "after", name: str | None = None) -> Callable[[Rule], Rule]: ...
    @refused_while_deciding
    def add(self, rule: Rule | EllipsisType = ..., *, phase: str = "after", name: str | None = None) -> Any:
        """Add a rule that is applied in every turn; also a decorator, with or without keywords.

        A rule may have seven attributes: `prepare(ctx)` is called at once, to look at the map and to publish facts;
        `check(ctx)` is called in every turn when agents have decided, and may `refuse` moves and deeds;
        `teams` are those that it names, and one without agents is warned about at the next turn;
        `drawer(ctx, data)` draws it, as an artist called `drawer.artist` unless there is one of that name, and on layer
        `drawer.layer` (12); `disclose(data, names)` returns what agents of these names know of `data`, for planners;
        `rank`: a rule of a higher one is called later in its phase (0); `key` names its state in `data`, so that no
        other rule may have the same.

        Args:
            rule: called with the context; rules are called in the order in which they were added. Without one, a
                decorator is returned.
            phase: "after" all agents have moved, "before" any observes, or "deeds": when they have decided, before
                conflicts and moves.
            name: of the rule, for `rules`, `remove` and errors; None: that of the function, with a number where it is
                taken.

        Raises:
            BadType: it is no function of the context, or makes one and was not called.
            BadValue: there is no such phase.
            Duplicate: there is a rule of this name or key.
        """
        as_choice(phase, "phase", PHASES)
        if rule is ...:
            return lambda one: self.add(one, phase=phase, name=name)
        self._ruleset.add(rule, phase, name)
        return rule

    @refused_while_deciding
    def remove(self, rule: str | Rule | NamedRule) -> None:
        """Remove a rule, given by its name or itself, and the artist that drew it.

        What it has published and kept in `data` stays. A rule that was added twice is removed once.

        Raises:
            UnknownName (KeyError): there is no such rule.
        """
        self._ruleset.remove(rule)

    @property
    def rules(self) -> tuple[NamedRule, ...]:
        """The rules in the order in which they are applied: each with `name`, `rule` and `phase`."""
        return self._ruleset.rules

    @overload
    def command(self, team: Hashable, plan: TeamPlan | None) -> None: ...
    @overload
    def command(self, team: Hashable, plan: ArrayPlan | None, *, arrays: Literal[True]) -> None: ...
    @refused_while_deciding
    def command(self, team: Hashable, plan: TeamPlan | ArrayPlan | None, *, arrays: bool = False) -> None:
        """Set the function that decides for all agents of a team instead of their strategies; None removes it.

        It is called once in every turn, and may be an `async def`. Like a strategy, it changes nothing but what it is
        given.

        Args:
            team: the team.
            plan: called with a dict from the names of the living agents to their states, in the order of the names;
                it sets `state["action"]` in each. Or a function that makes a plan or a strategy from the context, or a
                strategy of `gamms.strategies`; a strategy decides for one agent after the other.
            arrays: the plan is called with `gamms.game.TeamArrays` instead, and returns the ids of nodes (agents,). No
                sensor is asked, and the agents have no states.

        Raises:
            BadType: the plan cannot be called with one argument.
        """
        as_key(team, "A team")
        if plan is not None and not arrays:
            plan = plan_in(self.ctx, plan)
        others = {one: known for one, known in self.plans.items() if one != team}
        self.plans = others if plan is None else {**others, team: Plan(plan, arrays)}
        self._unchecked_plans.append(team)
        self._turns.prepared = -1

    @refused_while_deciding
    def collect(self, name: str, fn: Callable[[Any], Any], every: int = 1, per: str = "game") -> None:
        """Collect a value after the rules of every turn, or of every few; the result has it as a table.

        Args:
            name: of the table, whose columns are `turn`, `agent` (where it is per agent) and `value`.
            fn: called with the context, or with each living agent; what it returns is copied.
            every: how many turns lie between two values.
            per: "game" or "agent".

        Raises:
            BadValue, BadType: an argument is impossible.
            Duplicate: the name is taken.
        """
        self._collectors.add(as_name(name, "a collector"), fn, as_count(every, "every"), per)

    # -- playing ------------------------------------------------------------------------------------------------

    @property
    def last_turn(self) -> int | None:
        """The turn after which the game ends at the latest: by `run`, the settings or a time limit; None: not known."""
        limits = [self._state.last_turn, self.max_turns, *(one.spec.last_turn for one in self.rules)]
        return min((limit for limit in limits if isinstance(limit, int)), default=None)

    def step(self) -> bool:
        """Play one turn; return whether the game goes on. Once it is over, nothing happens.

        If a rule of "before" ends the game, the turn is not played. If something raises before the agents have moved,
        the turn is not played either, and the next call begins it again; if a rule raises after they have moved, the
        turn is played, without the rules that follow. `random` and `numpy.random` are not seeded, as they are by `run`.

        Raises:
            IllegalAction, IllegalMutation, or whatever a strategy or rule raises: see the settings.
        """
        # NOTE: without the decorator: a turn of two agents takes 10 us (benchmarks: turns).
        if self._phase.agent is not None:
            self._phase.refuse("call ctx.game.step")
        return self._take_turn()

    def _take_turn(self) -> bool:
        state, turns = self._state, self._turns
        if self.ctx.is_terminated() or state.over is not None:
            return False
        if self._turns.prepared != self._phase.strategy_changes:
            self._prepare_strategies()
        if not state.has_begun:
            self._begin()
        if self._ruleset.unchecked:
            self._ruleset.warn()
        if self._unchecked_plans:
            self._warn_of_unknown_teams()
        turns.is_playing = True
        try:
            self._play()
        finally:
            turns.is_playing = False
        return state.over is None

    def _warn_of_unknown_teams(self) -> None:
        """Warn about the teams that plans were set for and no agent plays for."""
        while self._unchecked_plans:
            team, teams = self._unchecked_plans.pop(0), dict.fromkeys(self.ctx.agent.block.teams)
            if team in self.plans and team not in teams:
                self.ctx.logger.warning(f"command: {UnknownName('team', team, teams)} Its plan decides for no agent.")

    def _prepare_strategies(self) -> None:
        """Call `prepare(ctx)` of the strategies and plans that have it, as of rules."""
        changes = self._phase.strategy_changes
        found = self.ctx.agent.storage.strategies()
        strategies = dict(zip(map(id, found), found, strict=True))
        strategies |= {id(plan.function): plan.function for plan in self.plans.values()}
        for strategy in strategies.values():
            prepare = getattr(strategy, "prepare", None)
            if prepare is not None and not isinstance(strategy, type):
                prepare(self.ctx)
        self._turns.prepared = changes

    def _begin(self) -> None:
        """Take the snapshot to which `reset` returns."""
        state, snapshot = self._state, self._snapshots.take()
        seeds = (self.ctx.seed, self.ctx.rng_state()) if state.start is None else state.start.first_seed
        state.start, state.has_begun = Start(snapshot, self.ctx.rng_state(), seeds), True

    def _play(self) -> None:
        state, rules = self._state, self._ruleset
        if "before" in rules.now.phases and state.parts_played is None:
            self._apply_rules("before")
            if state.over is not None:
                return
            if not state.has_begun:  # a rule has reset the game
                self._begin()
        self._turns.play(self._internals.after_observing, rules)
        state.turn += 1
        state.parts_played = None
        try:
            if "after" in rules.now.phases:
                self._apply_rules("after")
            if self._collectors.by_name:
                self._collectors.collect(state.turn, self.ctx, lambda: self.agents)
        finally:  # the agents have moved: the turn counts for recordings and windows, too
            began = perf_counter()
            self.ctx.visual_engine.simulate()
            state.timings["draw"] += perf_counter() - began

    @refused_while_deciding
    def run(self, max_turns: int | None = None, progress: bool = False) -> Result:
        """Play until a rule ends the game, or for so many turns; warn if strategies have erred or scores look misspelt.

        With a seed given to the context or to `reset`, the global `random` and `numpy.random` are seeded for the turns
        of this call, too, and afterwards as they were before.

        Args:
            max_turns: so many turns from now on; None: until there were as many as the settings say.
            progress: show how far it is on a line of stderr, where that is a terminal.

        Raises:
            BadValue: nothing could ever end this game.
            IllegalAction, IllegalMutation, or whatever a strategy or rule raises: see the settings.
        """
        if self.ctx.is_terminated():
            raise ContextTerminated("ctx.game")
        turns = None if max_turns is None else as_count(max_turns, "max_turns", 0)
        last = self._state.last_turn = self.max_turns if turns is None else self.turn + turns
        if last is None and not self.rules:
            raise BadValue("This game has no rule that could end it: give run(max_turns=…) or add a rule.")
        known, scored = len(self.errors), set(self._state.scores)
        of = "" if last is None else f" of {last}"
        with seeded_for_run(self.ctx, self._state.turn), progress_line() as show:
            while (last is None or self._state.turn < last) and self._take_turn():
                if progress:
                    show(f"turn {self._state.turn}{of}")
        if len(self.errors) > known:
            self.ctx.logger.warning(what_went_wrong(self.errors[known:]))
        self._warn_of_misspelt(self._state.scores.keys() - scored)
        return self.result()

    def _warn_of_misspelt(self, scored: set[object]) -> None:
        """Warn of new keys of scores, and a winner, that are nearly names of teams or agents."""
        winner = (self._state.over or {}).get("winner")
        is_unknown = isinstance(winner, str) and winner not in self.ctx.agent.block.teams
        if scored or is_unknown:
            for sentence in misspelt_names(
                scored, winner, [*self.ctx.agent.teams, *self.ctx.agent.agents, *self._state.departed]
            ):
                self.ctx.logger.warning(sentence)

    @refused_while_deciding
    def result(self) -> Result:
        """Return the result of the game so far; not for strategies, as it has the seed."""
        state = self._state
        self._turns.update_counts()
        over = state.over or {"reason": self._reason_so_far(), "winner": None, "truncated": True}
        agents = self.ctx.agent.agents
        ends = {name: (team, False, node) for name, (team, node) in state.departed.items()}
        ends |= {name: (one.team, one.alive, one.current_node_id) for name, one in agents.items()}
        summaries = {
            name: {
                **dict(zip(("team", "alive", "node"), ends[name], strict=True)),
                **(state.counts.get(name) or dict.fromkeys(COUNTED, 0)),
            }
            for name in sorted(ends)
        }
        return Result(
            turns=self.turn,
            scores=dict(self.scores),
            events=[dict(event) for event in self.events],
            agents=summaries,
            errors=[dict(error) for error in self.errors],
            deeds=[dict(deed) for deed in self._state.deeds],
            messages=[dict(message) for message in self.messages],
            timings=dict(self.timings),
            seed=self.ctx.seed,
            collected=self._collectors.tables(),
            provenance={
                **versions(),
                "scenario": self._internals.scenario,
                "strategies": {name: strategy_name(self._decider(one)) for name, one in sorted(agents.items())},
                **({} if self.information == "private" else {"information": self.information}),
            },
            **over,
        )

    def _decider(self, agent: Any) -> object:
        """Return the plan of an agent's team, or its strategy."""
        plan = self.plans.get(agent.team)
        return agent.strategy if plan is None else plan.function

    def _reason_so_far(self) -> str:
        """Return why no more turns were played of a game that no rule has ended."""
        if self._internals.is_time_up:
            return "max_turns"
        return "closed" if self.ctx.is_terminated() else "unfinished"

    @refused_while_deciding
    def reset(self, seed: int | None = None) -> None:
        """Begin the game again, as it was before its first turn: agents, map, rules, settings, data, scores, streams.

        What is changed before the first turn is part of the start, also between a reset and the turn that follows; what
        is changed later, by rules or between turns, is taken back. What strategies and rules keep elsewhere than in
        `state["memory"]` and `ctx.game.data` stays as it is.

        Args:
            seed: all random streams follow from it; None repeats the game.
        """
        wanted = None if seed is None else as_int(seed, "seed")
        state, start = self._state, self._state.start
        if state.has_begun and start is not None:
            self._snapshots.restore(start.snapshot, forget=True)
            state.start, state.has_begun, state.last_turn = start, False, None
            self._reseed(start.snapshot.seed)
        elif wanted is None:
            return
        try:
            if wanted == self.ctx.seed:
                self.ctx.is_seeded = True
            elif wanted is not None:
                self._begin_with(wanted)
        finally:
            for after_reset in self._internals.after_reset:
                after_reset()

    @refused_while_deciding
    def snapshot(self) -> Snapshot:
        """Return the game as it is now, for `restore`: state, agents, map, rules, settings and random streams.

        Raises:
            SnapshotError: a turn is being played.
            ContextTerminated: the context has ended.
        """
        self._snapshots.refuse_in_turn("taken")
        return self._snapshots.take()

    @refused_while_deciding
    def restore(self, snapshot: Snapshot) -> None:
        """Restore a snapshot of this game, any number of times, in any order.

        Agents that were deleted since are back, as the same objects; those that came since are deleted. State that
        strategies and rules hold elsewhere than in `state["memory"]`, `ctx.game.data` and attributes of agents stays.

        Raises:
            BadType: it is not a snapshot.
            BadValue: it is of another context.
            SnapshotError: a turn is being played, or the game is being recorded or replayed.
            ContextTerminated: the context has ended.
        """
        if not isinstance(snapshot, Snapshot):
            raise BadType(f"ctx.game.restore needs what ctx.game.snapshot() gave, not {shown(snapshot)}.")
        self._snapshots.refuse_in_turn("restored")
        if not self._snapshots.belongs_here(snapshot):
            raise BadValue("This snapshot is of another context; it can only be restored in its own.")
        if self.ctx.is_recording:
            raise SnapshotError("A snapshot cannot be restored while the game is being recorded or replayed.")
        self._snapshots.restore_streams(snapshot)
        self._snapshots.restore(snapshot)

    @refused_while_deciding
    def fork(self, seed: int) -> "Game":
        """Return a detached game that goes on from here, with other random numbers.

        They follow from the seed and from that of this game. The fork has a context of its own (`ctx`), without
        recorder and window. The map is shared until one of both games changes it; agents, sensors, data, memories,
        rules, settings and collectors are copies. Nothing that happens in the fork changes this game. `reset` of the
        fork returns to where it began.

        Functions that close over the context or an agent get those of the fork; whatever else they hold is shared. So
        is what cannot be copied.

        Raises:
            BadType, BadValue: the seed is no integer of 64 bits.
            SnapshotError: a turn is being played.
            ContextTerminated: the context has ended.
        """
        own_seed = kernels.purpose_key(self.ctx.seed, "fork", as_int(seed, "seed")) >> 1
        ctx, _ = self._internals.fork(own_seed)
        game: Game = ctx.game
        return game

    def fork_for_deciders(self, seed: int, information: Information = "private") -> PrivateFork:
        """Return a copy of the game for the agents whose strategy or plan is running; they call `state["fork"](seed)`.

        See `PrivateForks`.

        Raises:
            BadType, BadValue: the seed is no integer of 64 bits, or the game does not allow full information.
            IllegalMutation: no agent decides.
        """
        if self._phase.agent is None:
            raise IllegalMutation(
                "state['fork'] is for strategies and plans while they decide: the copy has what their agents know. "
                "Between two turns use ctx.game.fork(seed)."
            )
        if information == "full" and self.information != "full":
            raise BadValue(
                "information='full' shows what agents do not know, and this game does not allow it. Set `settings: "
                "{information: full}` in the scenario file, or ctx.game.information = 'full'."
            )
        own_seed = kernels.purpose_key(as_int(seed, "seed"), "private fork") >> 1
        names = tuple(sorted(self._phase.names()))
        with self._phase.suspended():
            ctx, memo = self.ctx.fork(own_seed)
            game: Game = ctx.game
            memo |= {id(self): game, id(self._state): game._state}
            if information == "full":
                copy_game(self._snapshots, game._snapshots, memo)
                game.configure({"plans": {}, "time_budget": None, "deadline_s": None})
                game._state.began = self._internals.starts
            else:
                copy_known(self._snapshots, game._snapshots, memo, frozenset(names), self._internals.starts)
            ctx.is_seeded = True
            game._state.parts_played = self._turns.part
            game._internals.digests = self._internals.digests
            game._begin()
        return PrivateFork(game, names, lambda value: own(value, memo))

    @refused_while_deciding
    def batch(
        self,
        num_games: int | None = None,
        *,
        seed: int = 0,
        seeds: Iterable[int] | None = None,
        record: bool = False,
        most_agents: "MostAgents | None" = None,
    ) -> "Batch":
        """Return many games that go on from here, each with another seed: game i is that of `reset(seed=seeds[i])`.

        They are detached, as `fork` says. See docs/batches.md.

        Args:
            num_games: how many.
            seed: of the first game; those of the others follow.
            seeds: of each game, instead of both.
            record: only batches of scenarios can be recorded, `scenario.batch(…, record=True)`: True is refused.
            most_agents: how many agents each team may come to have, or team -> number: rows are reserved for those
                that rules create, named `red_3`, `red_4`, … where `red` begins with three; or team -> their names.

        Raises:
            BadType, BadValue: there is no game, a seed is no integer, or `record` is True.
            SnapshotError: a turn is being played.
        """
        from gamms.game.batch.columns import as_seeds  # which few programs need
        from gamms.game.batch.games import Batch, BatchSource

        if as_bool(record, "record"):
            raise BadValue(
                "Games that go on from here cannot be recorded, for recordings begin at the start: leave record= out, "
                "or play scenario.batch(…, record=True)."
            )
        chosen = as_seeds(num_games, seed, seeds)
        self._ruleset.warn()
        return Batch([BatchSource(self.fork(0), None, None, None)], chosen, record=False, most_agents=most_agents)

    # -- inside -------------------------------------------------------------------------------------------------

    def _reseed(self, seed: int) -> None:
        """Key every stream by a seed, and continue that of the context as at the start with this seed."""
        start = self._state.start
        self.ctx.reseed(seed, None if start is None else start.rng_of(seed))

    def _begin_with(self, seed: int) -> None:
        """Key everything by another seed, the start too; by the last one again if that fails."""
        if self._internals.draw_start is None:
            self._reseed(seed)
            return
        last, chance = self.ctx.seed, self.ctx.rng_state()
        self.ctx.reseed(seed)
        try:
            self._internals.draw_start()
            self._turns.prepared = -1
        except BaseException:
            self.ctx.reseed(last, chance)
            raise

    def _apply_rules(self, phase: str) -> None:
        began = perf_counter()
        self._ruleset.apply(phase, self._state)
        self._state.timings["rules"] += perf_counter() - began
