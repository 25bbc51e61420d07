"""The public interface of the game engine: `ctx.game`, which plays turns of simultaneous moves."""

import os
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import ExitStack
from copy import copy
from functools import cache, partial
from operator import itemgetter
from threading import RLock, get_ident
from types import EllipsisType
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, cast, overload

from gamms import kernels
from gamms.arguments import as_bool, as_choice, as_count, as_int, as_key, as_name, explain_call_errors
from gamms.compat import Surface
from gamms.deciding import ContextPart, get_phase, leave_last_turn, refuse_to_judges, refuse_while_deciding
from gamms.errors import BadType, BadValue, ContextTerminated, IllegalMutation, UnknownName
from gamms.game.decisions import ArrayPlan
from gamms.game.deeds import list_lasting
from gamms.game.facts import Information, PrivateFork
from gamms.game.lasting import LASTING_RULES
from gamms.game.random_streams import seed_for_run
from gamms.game.result import (
    MANY_TURNS,
    Collectors,
    Result,
    find_misspelled_names,
    list_opponents,
    summarize_errors,
    warn_of_no_end,
)
from gamms.game.rule_verbs import RuleVerbs
from gamms.game.settings import PHASES, NamedRule, Plan, RuleSet
from gamms.game.slots import COUNTED
from gamms.game.snapshots import (
    ForkSource,
    GameInternals,
    GameStart,
    Snapshot,
    SnapshotError,
    SnapshotTaker,
    copy_known,
    get_counterpart,
)
from gamms.game.turn import TurnEngine
from gamms.ir.game_state import GameState
from gamms.progress import delay_interrupts
from gamms.progress import show_progress as progress_line
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing.actions import plan_in
from gamms.typing.context import HostContext
from gamms.typing.game import Rule, TeamPlan, find_strategy_name
from gamms.versions import versions

if TYPE_CHECKING:
    from gamms.game.batch import Batch, MostAgents
    from gamms.game.native import GameInCore


_MAKING = RLock()  # held while a fork is made that is first read


class Game(Surface, RuleVerbs):
    """The turn engine of one context; `Settings` describes its settings, and `RuleVerbs` the methods for rules.

    Attributes:
        facts: the facts published to everybody; read-only.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._phase = get_phase(ctx)
        super().__init__()
        self.ctx: Any = ctx
        self._state = GameState()
        self._ruleset = RuleSet(ctx)
        self._collectors = Collectors()
        self._turns = TurnEngine(ctx, self, self._state, self._phase, self._ruleset, self._collectors)
        self._snapshots = SnapshotTaker(ctx, self._state, self, self._ruleset, self._collectors, self._turns)
        self.facts = ReadOnlyMapping(self._state.facts)
        self._internals = GameInternals(self._snapshots, self._phase)
        self._in_core: GameInCore | None = None  # of the last run; None: Python took part in its turns
        self._ready_at = -1  # the epoch in which a turn was begun last
        self._draws_in = -1, True  # an epoch, and whether functions of the program take part in its turns
        self._unchecked_plans: list[Any] = []  # teams that got a plan since the last turn
        self._is_closed = True

    def __repr__(self) -> str:
        """Return the turn, the rules, the scores and the end."""
        state = self._state
        rules = ", ".join(rule.name for rule in self._ruleset.rules)
        end = "" if state.over is None else f", over: {state.over['reason']}"
        return f"Game(turn={state.turn}, rules=[{rules}], scores={shown(dict(state.scores))}{end})"

    @property
    def internals(self) -> GameInternals:
        """The interface for engines and clients; not for strategies."""
        if self._phase.agent is not None and not getattr(self._phase.agent, "is_maker", False):
            self._phase.refuse_look("use ctx.game.internals")
        return self._internals

    def _follow_deeds(self) -> None:
        known = {one.rule for one in self._ruleset.rules}
        for phase, rule in LASTING_RULES if list_lasting(self.deeds) else ():
            if rule not in known:
                self._ruleset.add(rule, phase, None)

    # -- rules, plans and collectors ------------------------------------------------------------------------------

    @overload
    def add(self, rule: Rule, *, phase: str = "after", name: str | None = None) -> Rule: ...
    @overload
    def add(self, *, phase: str = "after", name: str | None = None) -> Callable[[Rule], Rule]: ...
    @refuse_to_judges
    def add(self, rule: Rule | EllipsisType = ..., *, phase: str = "after", name: str | None = None) -> Any:
        """Add a rule that is applied in every turn; also usable as a decorator, with or without keywords.

        A rule may have seven attributes: `prepare(ctx)` is called at once, to look at the map and to publish facts;
        `check(ctx)` is called in every turn after agents have decided, and may `refuse` moves and deeds; `teams` are
        the teams that it mentions (checked when the game begins, see docs/rules.md); `drawer(ctx, data)` draws it, as
        an artist called `drawer.artist` unless this name is taken, on layer `drawer.layer` (12); `disclose(data,
        names)` returns the part of `data` that agents of these names know, for planners; `rank` orders the rules of a
        phase: higher ranks are called later (0); `key` names its state in `data` and must be unique. They may be set
        until the game begins, `check` also later.

        Args:
            rule: called with the context; rules of one rank are called in the order in which they were added. Without
                it, a decorator is returned.
            phase: "after": after all agents have moved; "before": before any agent observes; "deeds": after all have
                decided, before conflicts and moves.
            name: the name of the rule for `rules`, `remove` and errors; None: the name of the function, with a number
                if it is taken.

        Raises:
            BadType: the rule is not a function of the context, or it is a function that makes a rule and was not
                called.
            BadValue: the phase does not exist.
            Duplicate: a rule with this name or key exists.
        """
        as_choice(phase, "phase", PHASES)
        if rule is ...:
            return lambda one: self.add(one, phase=phase, name=name)
        self._ruleset.add(rule, phase, name)
        return rule

    @refuse_to_judges
    def remove(self, rule: str | Rule | NamedRule) -> None:
        """Remove a rule, given by its name or itself, and its artist.

        Facts that it has published and its entries in `data` remain. Only one rule is removed if it was added twice.

        Raises:
            UnknownName (KeyError): there is no such rule.
        """
        self._ruleset.remove(rule)

    @property
    def rules(self) -> tuple[NamedRule, ...]:
        """The rules in the order of their calls, each with `name`, `rule` and `phase`."""
        return self._ruleset.rules

    @overload
    def command(self, team: Hashable, plan: TeamPlan | None) -> None: ...
    @overload
    def command(self, team: Hashable, plan: ArrayPlan | None, *, arrays: Literal[True]) -> None: ...
    @refuse_to_judges
    def command(self, team: Hashable, plan: TeamPlan | ArrayPlan | None, *, arrays: bool = False) -> None:
        """Set a plan: a function that decides for all agents of a team instead of their strategies. None removes it.

        A plan is called once in every turn, and may be an `async def`. Like a strategy, it can change only its
        arguments.

        Args:
            team: the team.
            plan: called with a dict from the names of the living agents to their states, in the order of names; it sets
                `state["action"]` in each state. Alternatives: a function that makes a plan or a strategy from the
                context, or a strategy of `gamms.strategies`; a strategy is called for one agent after the other.
            arrays: call the plan with `gamms.game.TeamArrays` instead; it returns node ids, (agents,). Sensors are not
                called, and the agents have no states.

        Raises:
            BadType: the plan cannot be called with one argument, or `arrays` is not a boolean.
        """
        as_key(team, "A team")
        if not as_bool(arrays, "arrays") and plan is not None:
            plan = plan_in(self.ctx, plan)
        others = {one: known for one, known in self.plans.items() if one != team}
        self.plans = others if plan is None else {**others, team: Plan(plan, arrays)}
        self._unchecked_plans.append(team)
        self._turns.prepared = -1

    @refuse_to_judges
    def collect(self, name: str, fn: Callable[[Any], Any], every: int = 1, per: str = "game") -> None:
        """Collect a value after the rules of every turn, or every few turns; it becomes a table of the result.

        Args:
            name: the name of the table; its columns are `turn`, `agent` (if collected per agent) and `value`.
            fn: called with the context, or with each living agent; its result is copied. `ctx.game.agents` are the
                living agents; `ctx.agent.create_iter()` has the eliminated ones, too.
            every: the number of turns between two values.
            per: "game" or "agent".

        Raises:
            BadValue, BadType: an argument is impossible.
            Duplicate: the name is taken.
        """
        self._collectors.add(as_name(name, "a collector"), fn, as_count(every, "every"), per)
        self._phase.drop_plans()

    # -- playing ------------------------------------------------------------------------------------------------

    @property
    def last_turn(self) -> int | None:
        """The last turn that can be played, by `run`, the settings or a time limit; None: not known."""
        limits = [self._state.last_turn, self.max_turns, *(one.spec.last_turn for one in self.rules)]
        return min((limit for limit in limits if isinstance(limit, int)), default=None)

    def step(self) -> bool:
        """Play one turn; return whether the game goes on. After the end of the game, do nothing.

        If a rule of the phase "before" ends the game, no moves are made. If an error is raised before all agents have
        moved, the turn is taken back, but for what functions have written into memories, data, facts and attributes,
        and the next call starts it again. If a rule raises an error after the moves, the turn is counted, and later
        rules are skipped. Unlike `run`, `step` does not seed `random` and `numpy.random`.

        Raises:
            IllegalAction, IllegalMutation, or any error of a strategy or rule, depending on the settings.
        """
        # NOTE: without the decorator: a turn of two agents takes 10 us (benchmarks: turns).
        phase = self._phase
        if phase.agent is not None or phase.player is not None:
            phase.refuse_look("call ctx.game.step")
            self._refuse_in_turn("step")
        if self._internals.shown_as is not None:
            self._refuse_shown("step")
        return self._take_turn()

    def _refuse_in_turn(self, verb: str) -> None:
        """Raise an error if a turn is being played: a rule, a collector or a drawer calls the engine."""
        if self._turns.is_playing:
            raise IllegalMutation(
                f"ctx.game.{verb} was called in the middle of a turn, for example by a rule. Play and reset a game "
                "between two turns. A rule ends it with ctx.game.end(…)."
            )

    def _refuse_shown(self, verb: str) -> None:
        """Raise an error if a batch plays this game, and the context shows it."""
        number = self._internals.shown_as
        if number is not None:
            raise BadValue(
                f"This context shows game {number} of a batch, which plays it: ctx.game.{verb} would play it twice. "
                f"Call games.{verb}(), or play a copy: copy.deepcopy(ctx)."
            )

    def _begin_turn(self) -> bool:
        """Prepare the next turn; return whether there is one."""
        state = self._state
        if self.ctx.is_terminated() or state.over is not None:
            return False
        if not state.has_begun:
            self._ruleset.renew()
        if self._ruleset.unchecked:
            self._ruleset.check_new()
        if not state.has_begun:
            self._begin()
        if self._turns.find_shipped is None:
            from gamms.game.native import ShippedFinder  # to import a game takes no longer

            self._turns.find_shipped = ShippedFinder(self).find
        if self._turns.prepared != self._phase.strategy_changes:
            self._prepare_strategies()
        if self._unchecked_plans:
            self._warn_of_unknown_teams()
        self._ready_at = self._phase.epoch
        return True

    def _take_turn(self) -> bool:
        """Play a turn, unless the game is over; return whether it goes on."""
        state = self._state
        phase = self._phase
        # NOTE: once for each epoch, because each look at parts of the context costs (benchmarks: turns)
        is_ready = self._ready_at == phase.epoch and state.has_begun and state.over is None
        if not (is_ready or self._begin_turn()):
            return False
        take_back = self._snapshots.checkpoint() if self._turns.needs_checkpoint else None
        turn = state.turn
        try:
            phase.player = get_ident()
            self._turns.play_turn()
        except BaseException:
            phase.player = None
            if take_back is not None and state.turn == turn:
                take_back()
            raise
        finally:
            phase.player = None
        return state.over is None

    def _warn_of_unknown_teams(self) -> None:
        """Log a warning for each new plan whose team has no agents."""
        while self._unchecked_plans:
            team = self._unchecked_plans.pop(0)
            teams = dict.fromkeys(self.ctx.agent.block.teams)
            if team in self.plans and team not in teams:
                self.ctx.logger.warning(f"command: {UnknownName('team', team, teams)} Its plan decides for no agent.")

    def _prepare_strategies(self) -> None:
        """Call `prepare(ctx)` of all strategies and plans that have it."""
        changes = self._phase.strategy_changes
        found = self.ctx.agent.storage.list_strategies()
        strategies = dict(zip(map(id, found), found, strict=True))
        strategies |= {id(plan.function): plan.function for plan in self.plans.values()}
        for strategy in strategies.values():
            prepare = getattr(strategy, "prepare", None)
            if prepare is not None and not isinstance(strategy, type):
                prepare(self.ctx)
        self._turns.prepared = changes

    def _begin(self) -> None:
        """Take the snapshot that `reset` restores."""
        state = self._state
        self._phase.read_last_turn()  # of a fork, whose start the snapshot is
        earlier = state.start
        state.start = None  # a snapshot with the earlier start would keep all earlier games
        try:
            snapshot = self._snapshots.take()
        except BaseException:
            state.start = earlier
            raise
        seeds = (self.ctx.seed, self.ctx.rng_state()) if earlier is None else earlier.first_seed
        state.start = GameStart(snapshot, self.ctx.rng_state(), seeds)
        state.has_begun = True

    @leave_last_turn
    @explain_call_errors
    def run(
        self,
        max_turns: int | None = None,
        progress: bool = False,
        *,
        record: str | os.PathLike[str] | BinaryIO | None = None,
        sensed: bool | None = None,
    ) -> Result:
        """Play until a rule ends the game, or for a number of turns; log errors of strategies and suspicious names.

        If the context or `reset` was given a seed, and functions of the program take part, the global generators
        `random` and `numpy.random` are seeded during this call, and restored afterwards.

        Args:
            max_turns: the number of turns to play; None: until the total of the settings is reached.
            progress: show the progress on stderr, if it is a terminal.
            record: the file of a recording of these turns; an existing file is replaced. None: nothing is recorded.
            sensed: whether the recording contains the sensor reports of agents; see `ctx.record.start`.

        Raises:
            BadValue: nothing can ever end this game, or `sensed` is True without `record`.
                IllegalAction, IllegalMutation, or any error of a strategy or rule, depending on the settings.
        """
        if self.ctx.is_terminated():
            raise ContextTerminated("ctx.game")
        self._refuse_in_turn("run")
        self._refuse_shown("run")
        turns = None if max_turns is None else as_count(max_turns, "max_turns", 0)
        if sensed is not None and as_bool(sensed, "sensed") and record is None:
            raise BadValue("Sensor reports are part of a recording: give record=, too, or leave sensed= out.")
        last = self.max_turns if turns is None else self.turn + turns
        self._state.last_turn = last
        if last is None and not self.rules:
            raise BadValue("This game has no rule that could end it: give run(max_turns=…) or add a rule.")
        known = len(self.errors)
        scored = set(self._state.scores)
        with ExitStack() as stack:
            stack.callback(self._leave_last_turn)
            if self._phase.are_moves_unread:
                self._phase.leave_unread(None)  # the run may replace it, see `native`
            self._internals.warn_of_idle_teams()
            if not self.turn:
                self._internals.warn_of_stuck_agents()
            if record is not None:
                if self._in_core is not None:
                    self._in_core.make_last_turn()
                self.ctx.record.start(record, sensed=sensed, overwrite=True)
                stack.callback(self.ctx.record.stop)
            seeding = seed_for_run(self.ctx, self._state.turn)
            with ExitStack() as seeded, progress_line() as show:
                self._play_until(last, show if progress else None, cache(partial(seeded.enter_context, seeding)))
            if len(self.errors) > known:
                self.ctx.logger.warning(summarize_errors(self.errors[known:]))
            self._warn_of_misspelt(self._state.scores.keys() - scored)
            return self.result()

    def _play_until(self, last: int | None, show: Callable[[str], None] | None, seed: Callable[[], object]) -> None:
        """Play until the last turn, or the end of the game; `show` gets the progress.

        `seed` is called before Python functions may draw, perhaps several times; see `seed_for_run`.
        """
        of = "" if last is None else f" of {last}"
        warn_at = self._state.turn + MANY_TURNS if self.last_turn is None else None

        def after_turns(turn: int) -> None:
            nonlocal warn_at
            if show is not None:
                show(f"turn {turn}{of}")
            if warn_at is not None and turn >= warn_at:
                warn_at = None
                warn_of_no_end(self.ctx.logger)

        if self._ready_at != self._phase.epoch or not self._state.has_begun:
            seed()  # strategies and rules prepare the game
        ahead = self._step_turns(last, after_turns)
        while (last is None or self._state.turn < last) and self._begin_turn() and next(ahead):
            if self._may_draw():
                seed()
            if not self._take_turn():
                return
            after_turns(self._state.turn)

    def _may_draw(self) -> bool:
        """Return whether a function of the program takes part in the next turn, and may draw random numbers."""
        if self._in_core is not None:
            return False
        epoch = self._phase.epoch
        if self._draws_in[0] != epoch:
            from gamms.game.native import calls_functions  # as in `_step_turns`

            self._draws_in = epoch, calls_functions(self)
        return self._draws_in[1] or self.ctx.visual_engine.quiet_turns() is None

    def _step_turns(self, last: int | None, after_turns: Callable[[int], None]) -> Iterator[bool]:
        """Yield whether the turn engine has to play the next turn; the core plays the others, see `native`."""
        from gamms.game.native import find_game_in_core  # few programs need it

        self._in_core = find_game_in_core(self, last, self._in_core)
        if self._in_core is not None:
            yield from self._in_core.play_ahead(last, after_turns)
        while self._in_core is None:
            yield True

    def _leave_last_turn(self) -> None:
        """Let the end of the last turn be made when it is read, if the core has played it."""
        if self._in_core is not None and self._in_core.read_turn is not None:
            self._phase.leave_unread(self._in_core.read_turn, with_moves=True)

    def _forget_last_turn(self, snapshot: Snapshot) -> None:
        """Do not make the end of the last turn, which a snapshot replaces, unless it lacks some of the agents."""
        if not self.ctx.agent.agents.keys() <= {*snapshot.agents.names}:
            self._phase.read_last_turn()
        self._phase.leave_unread(None)
        self._turns.unread = None
        if self._in_core is not None:
            self._in_core.forget_last_turn()

    def _warn_of_misspelt(self, scored: set[object]) -> None:
        """Log a warning for each new key of scores, and for a winner, that resembles the name of a team or agent."""
        winner = (self._state.over or {}).get("winner")
        is_unknown = isinstance(winner, str) and winner not in self.ctx.agent.block.teams
        if scored or is_unknown:
            for sentence in find_misspelled_names(
                scored, winner, [*self.ctx.agent.teams, *self.ctx.agent.agents, *self._state.departed]
            ):
                self.ctx.logger.warning(sentence)

    @leave_last_turn
    def result(self) -> Result:
        """Return the result of the game so far; not for strategies, because it contains the seed."""
        state = self._state
        self._turns.update_counts()
        over = state.over or {"reason": self._describe_reason(), "winner": None, "truncated": True}
        found = Result(
            turns=self.turn,
            scores=dict(self.scores),
            events=[dict(event) for event in self.events],
            agents={},
            errors=[dict(error) for error in self.errors],
            deeds=[dict(deed) for deed in self._state.deeds],
            messages=[dict(message) for message in self.messages],
            timings=dict(self.timings),
            seed=self.ctx.seed,
            collected=self._collectors.get_tables(),
            **over,
        )
        found._make_later(self._summarize_later())
        return found

    def _summarize_later(self) -> Callable[[], dict[str, Any]]:
        """Return a function that makes the agents of the result, and its provenance, whatever happens until then."""
        state = self._state
        block = self.ctx.agent.block
        block.locate()
        departed = dict(state.departed)
        columns = [[*one] for one in (block.names, block.teams, block.alive, block.get_ids(block.node))]
        counts = {name: dict(one) for name, one in state.counts.items()}
        deciders = [(name, one.team, self._find_decider(one)) for name, one in self.ctx.agent.agents.items()]
        seed = self.ctx.seed
        scenario = self._internals.scenario
        information = {} if self.information == "private" else {"information": self.information}

        def summarize() -> dict[str, Any]:
            ends = {name: (team, False, node) for name, (team, node) in departed.items()}
            ends |= {name: (team, alive, node) for name, team, alive, node in zip(*columns, strict=True)}
            called = {id(one): find_strategy_name(one) for one in {id(one): one for *_, one in deciders}.values()}
            deciders.sort(key=itemgetter(0))
            return {
                "agents": {
                    name: {
                        **dict(zip(("team", "alive", "node"), ends[name], strict=True)),
                        **(counts.get(name) or dict.fromkeys(COUNTED, 0)),
                    }
                    for name in sorted(ends)
                },
                "provenance": {
                    **versions(),
                    "scenario": scenario,
                    "strategies": {name: called[id(one)] for name, _, one in deciders},
                    **information,
                    **list_opponents([(team, one) for _, team, one in deciders], seed),
                },
            }

        return summarize

    def _find_decider(self, agent: Any) -> object:
        """Return the plan of the agent's team, or the agent's strategy."""
        plan = self.plans.get(agent.team)
        return agent.strategy if plan is None else plan.function

    def _describe_reason(self) -> str:
        """Return the reason in the result of a game that no rule has ended."""
        if self._internals.is_time_up:
            return "max_turns"
        return "closed" if self.ctx.is_terminated() else "unfinished"

    @leave_last_turn
    def reset(self, seed: int | None = None) -> None:
        """Restore the game to its start: agents, map, rules, settings, data, scores and random streams.

        Changes before the first turn belong to the start, also changes between a reset and the next turn; later
        changes, by rules or between turns, are undone. State that strategies and rules hold elsewhere than in
        `state["memory"]` and `ctx.game.data` is not restored.

        Args:
            seed: the seed of all random streams; None repeats the game.

        Raises:
            IllegalMutation: a turn is being played.
        """
        wanted = None if seed is None else as_int(seed, "seed")
        self._refuse_in_turn("reset")
        if self._internals.left_as is not None:
            raise BadValue(
                f"This context was made from a game of a batch that was under way, and has not its start: "
                f"games.reset([{self._internals.left_as}]) begins it again."
            )
        with delay_interrupts(at_most_once=True):
            self._restart(wanted)

    def _restart(self, wanted: int | None) -> None:
        """Restore the start of the game, and draw it again with another seed."""
        state = self._state
        start = self._state.start
        if state.has_begun and start is not None:
            self._forget_last_turn(start.snapshot)
            self._snapshots.restore(start.snapshot, forget=True)
            state.start = start
            state.has_begun = False
            state.last_turn = None
            self._turns.prepared = -1
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

    @refuse_while_deciding
    def snapshot(self) -> Snapshot:
        """Return a snapshot for `restore`: state, agents, map, rules, settings and random streams.

        Raises:
            SnapshotError: a turn is being played.
            ContextTerminated: the context has ended.
        """
        self._snapshots.refuse_in_turn("taken")
        return self._snapshots.take()

    @leave_last_turn
    def restore(self, snapshot: Snapshot) -> None:
        """Restore a snapshot of this game; any number of times, in any order.

        Agents deleted since then return as the same objects; agents created since then are deleted. State that
        strategies and rules hold elsewhere than in `state["memory"]`, `ctx.game.data` and attributes of agents is not
        restored.

        Raises:
            BadType: the argument is not a snapshot.
            BadValue: the snapshot belongs to another context.
            SnapshotError: a turn is being played, or the game is being recorded or replayed.
            ContextTerminated: the context has ended.
        """
        if not isinstance(snapshot, Snapshot):
            raise BadType(f"ctx.game.restore needs what ctx.game.snapshot() gave, not {shown(snapshot)}.")
        self._snapshots.refuse_in_turn("restored")
        if not self._snapshots.is_own(snapshot):
            raise BadValue("This snapshot is of another context; it can only be restored in its own.")
        if self.ctx.is_recording:
            raise SnapshotError("A snapshot cannot be restored while the game is being recorded or replayed.")
        with delay_interrupts(at_most_once=True):
            self._forget_last_turn(snapshot)
            self._snapshots.restore_streams(snapshot)
            self._snapshots.restore(snapshot)

    @refuse_while_deciding
    def fork(self, seed: int) -> "Game":
        """Return an independent copy of the game that continues from here with other random numbers.

        These depend on the seed and on the seed of this game. The fork has its own context (`ctx`), without recorder
        and window. The map is shared until either game changes it; agents, sensors, data, memories, rules, settings and
        collectors are copied. The fork never changes this game. `reset` of the fork returns to the moment of the fork.
        Its context, engines and agents are made when the fork is first read, from the game as it is now.

        Functions that close over the context or an agent get the counterparts in the fork; other objects that they
        hold, and objects that cannot be copied, are shared.

        Raises:
            BadType, BadValue: the seed is not a 64-bit integer.
            SnapshotError: a turn is being played.
            ContextTerminated: the context has ended.
        """
        own_seed = kernels.compute_purpose_key(self.ctx.seed, "fork", as_int(seed, "seed")) >> 1
        source = self._internals.capture()
        if source is not None:
            return cast("Game", UnreadFork(source, own_seed))
        ctx, _ = self._internals.fork(own_seed)
        fork: Game = ctx.game
        return fork

    def fork_for_deciders(self, seed: int, information: Information = "private") -> PrivateFork:
        """Return a copy of the game for the agents that are deciding; strategies call it as `state["fork"](seed)`.

        See `PrivateForks`.

        Raises:
            BadType, BadValue: the seed is not a 64-bit integer, or the game does not allow full information.
            IllegalMutation: no agent is deciding.
        """
        if not self._phase.is_deciding:
            raise IllegalMutation(
                "state['fork'] is for strategies and plans while they decide: the copy has what their agents know. "
                "Between two turns use ctx.game.fork(seed)."
            )
        self._turns.show_memories()
        if information == "full" and self.information != "full":
            raise BadValue(
                "information='full' shows what agents do not know, and this game does not allow it. Set `settings: "
                "{information: full}` in the scenario file, or ctx.game.information = 'full'."
            )
        own_seed = kernels.compute_purpose_key(as_int(seed, "seed"), "private fork") >> 1
        names = tuple(sorted(self._phase.list_names()))
        with self._phase.suspend():
            known = None if information == "full" else names
            source = ForkSource(self._snapshots, only_plain=False, names=known)
            ctx, memo = source.make_context(own_seed)
            game: Game = ctx.game
            if information == "full":
                source.copy_game(game._snapshots, memo)
                game.configure({"plans": {}, "time_budget": None, "deadline_s": None})
            else:
                copy_known(source, self._snapshots, game._snapshots, memo, frozenset(names))
            ctx.is_seeded = True
            game._state.parts_played = self._turns.part
            game._begin()
        return PrivateFork(game, names, lambda value: get_counterpart(value, memo))

    @refuse_while_deciding
    @explain_call_errors
    def batch(
        self,
        num_games: int | None = None,
        *,
        seed: int = 0,
        seeds: Iterable[int] | None = None,
        record: bool = False,
        most_agents: "MostAgents | None" = None,
    ) -> "Batch":
        """Return a batch of games that continue from here; game i is a `fork` after `reset(seed=seeds[i])`.

        Agents start where they are, also where a scenario has placed them at random. See docs/batches.md.

        Args:
            num_games: the number of games.
            seed: the seed of the first game; the others get the following numbers.
            seeds: the seed of each game, as an alternative to both.
            record: must be False; only batches of scenarios can be recorded, by `scenario.batch(…, record=True)`.
            most_agents: the maximum number of agents per team, or team -> number: rows are reserved for agents that
                rules create, named `red_3`, `red_4`, … if `red` begins with three; or team -> their names.

        Raises:
            BadType, BadValue: there is no game, a seed is not an integer, or `record` is True; or a node where an agent
                started, or was before, is no longer on the map.
            SnapshotError: a turn is being played.
            TooLarge: the games would not fit into memory.
        """
        from gamms.game.batch import Batch, BatchSource
        from gamms.game.block.columns import as_seeds  # few programs need it

        if as_bool(record, "record"):
            raise BadValue(
                "Games that go on from here cannot be recorded, for recordings begin at the start: leave record= out, "
                "or play scenario.batch(…, record=True)."
            )
        chosen = as_seeds(num_games, seed, seeds)
        self._ruleset.renew()
        self._ruleset.check_new()
        fork = self.fork(0)
        fork._phase.read_last_turn()
        try:
            return Batch([BatchSource(fork, None, None, None, None)], chosen, record=False, most_agents=most_agents)
        except BaseException:
            fork.ctx.terminate()
            raise

    # -- inside -------------------------------------------------------------------------------------------------

    def _reseed(self, seed: int) -> None:
        """Set the seed of all streams; the stream of the context continues as at the start with this seed."""
        start = self._state.start
        self.ctx.reseed(seed, None if start is None else start.get_rng_state(seed))

    def _begin_with(self, seed: int) -> None:
        """Start with another seed, and draw the start again; on failure, restore the previous seed."""
        if self._internals.draw_start is None:
            self._reseed(seed)
            return
        last = self.ctx.seed
        chance = self.ctx.rng_state()
        self.ctx.reseed(seed)
        try:
            self._internals.draw_start()
            self._turns.prepared = -1
            self._phase.drop_plans()
        except BaseException:
            self.ctx.reseed(last, chance)
            raise


class UnreadFork(Surface, ContextPart):
    """A fork that no program has read yet. It becomes a `Game` when an attribute is first read or set.

    Args:
        source: the game that was forked, at that moment.
        seed: the seed of the fork.
    """

    def __init__(self, source: ForkSource, seed: int) -> None:
        object.__setattr__(self, "_source", source)
        object.__setattr__(self, "_seed", seed)

    def __getattribute__(self, name: str) -> Any:
        """Become a game, and return its attribute."""
        if name == "__class__":  # of `isinstance`
            return Game
        with _MAKING:  # other threads wait
            kind = type(self)
            if kind is UnreadFork:
                parts = object.__getattribute__(self, "__dict__")
                ctx, _ = parts["_source"].make_fork(parts["_seed"], self)
                object.__setattr__(self, "__dict__", vars(ctx.game))  # its engines have them, too
                object.__setattr__(self, "__class__", Game)
                ctx.use_game(self)
        return getattr(self, name)

    def __setattr__(self, name: str, value: object) -> None:
        """Become a game, and set its attribute."""
        setattr(self.ctx.game, name, value)

    def __delattr__(self, name: str) -> None:
        """Become a game, and delete its attribute."""
        delattr(self.ctx.game, name)

    def __copy__(self) -> Any:  # Any: a `Game`, which it has become
        return copy(self.ctx.game)

    def __repr__(self) -> str:
        return repr(self.ctx.game)

    def __dir__(self) -> list[str]:
        return dir(self.ctx.game)
