"""The game room's front: `ctx.game`, which plays turns in which everybody moves at once."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from time import perf_counter
from typing import TYPE_CHECKING, Any, overload

from gamms.arguments import as_float, as_int, as_name
from gamms.deciding import Protected, phase_of, refused_while_deciding
from gamms.errors import BadValue, ContextTerminated, UnknownName
from gamms.game import chance, start, turn
from gamms.game.collectors import Collectors
from gamms.game.result import Result
from gamms.game.ruleset import NamedRule, RuleSet, check_phase
from gamms.game.seats import COUNTED, Seating
from gamms.game.settings import Settings, as_turns
from gamms.ir.agents import AgentColumns
from gamms.readonly import ReadOnlyMapping, frozen, published
from gamms.text import printable_line, shown
from gamms.typing.game import Move, Rule, Track

if TYPE_CHECKING:
    from gamms.game.turn import TurnMoves

_OVER = {"reason", "winner", "truncated"}
_PHASES = ("decide", "resolve", "apply", "rules", "draw")


class Scores(dict[Any, float]):
    """Scores by whatever the rules keep them for; one that was not set is 0."""

    def __missing__(self, key: Any) -> float:
        return 0


class Game(Settings):
    """The turn engine of one context; see `Settings` for what can be set.

    Attributes:
        ctx: the context; Any: the hall's own class, whose rooms meet here.
        turn: how many times everybody has moved.
        scores: numbers by team, agent or whatever the rules like; one that was not set is 0.
        data: what rules remember, as plain values; `reset` restores it.
        events: what was emitted, in order: dicts with `turn` and `kind`.
        errors: what strategies did wrong, in order.
        draw_start: called by `reset` with another seed, to draw what the start has from the seed; None: nothing.
        after_reset: called when the game has begun anew, in order.
        after_observing: called in every turn with the agents and their states before anybody decides, in order.
        scenario: what the game was built from, as plain values, for whoever records it; None: by a program.
        began: agent -> where it began, for a game that began before this context did; see `start_node`.
    """

    data: Protected[dict[str, Any]] = Protected()
    events: Protected[list[dict[str, Any]]] = Protected()
    errors: Protected[list[dict[str, Any]]] = Protected()
    team_memories: Protected[dict[Any, dict[Any, Any]]] = Protected()
    counts: Protected[dict[str, dict[str, int]]] = Protected()
    timings: Protected[dict[str, float]] = Protected()
    after_reset: Protected[list[Callable[[], None]]] = Protected()
    after_observing: Protected[list[Callable[[list[Any], list[dict[str, Any]]], None]]] = Protected()
    scenario: Protected[dict[str, Any] | None] = Protected()
    began: Protected[dict[str, Any]] = Protected()

    def __init__(self, ctx: Any) -> None:
        super().__init__()
        self._phase = phase_of(ctx)
        self.ctx = ctx
        self._ruleset = RuleSet(ctx)
        self._facts: dict[str, Any] = {}
        self.facts = ReadOnlyMapping(self._facts)
        self.data = {}
        self._scores = Scores()
        self._collectors = Collectors()
        self._memories: dict[str, dict[Any, Any]] = {}
        self._start: start.Start | None = None
        self._has_begun = False  # since the last reset
        self._chance = chance.GlobalChance()
        self.draw_start: Callable[[], None] | None = None
        self.after_reset = []
        self.after_observing = []
        self.scenario = None
        self.began = {}
        self.is_deciding = False
        self._is_stepping = False
        self.begin_anew()
        self._is_closed = True

    @refused_while_deciding
    def begin_anew(self) -> None:
        """Forget everything that has happened."""
        self.turn = 0
        self.events, self.errors, self.counts, self.team_memories = [], [], {}, {}
        self.timings = dict.fromkeys(_PHASES, 0.0)
        self._turn_moves: TurnMoves | None = None
        self._players: dict[str, Any] = {}  # all agents that have taken part, also those that were deleted since
        self._over: dict[str, Any] | None = None
        self._last: int | None = None  # the turn after which the latest `run` stops
        self._seating: Seating | None = None
        self._seating_key = (-1, "")
        self._lengths: tuple[int | None, dict[tuple[int, int], float]] = (None, {})

    # -- what it is played by -----------------------------------------------------------------------------------

    @overload
    def add(self, rule: Rule, *, phase: str = "after", name: str | None = None) -> Rule: ...
    @overload
    def add(self, rule: None = None, *, phase: str = "after", name: str | None = None) -> Callable[[Rule], Rule]: ...
    @refused_while_deciding
    def add(self, rule: Rule | None = None, *, phase: str = "after", name: str | None = None) -> Any:
        """Add a rule that is applied in every turn; also a decorator, with or without keywords.

        A rule may have three attributes: `prepare(ctx)` is called at once, to look at the map and to publish facts;
        `teams` are those that it names, and one that nobody plays for is warned about at the next turn;
        `drawer(ctx, data)` draws it, as an artist called `drawer.artist` unless there is one of that name, and on layer
        `drawer.layer` (12).

        Args:
            rule: called with the context; rules are called in the order in which they were added.
            phase: "after" everybody has moved, or "before" anybody observes.
            name: of the rule, for `rules`, `remove` and errors; None: that of the function, with a number where it is
                taken.

        Raises:
            BadType: it is no function of the context, or makes one and was not called.
            BadValue: there is no such phase.
            Duplicate: there is a rule of this name.
        """
        check_phase(phase)
        if rule is None:
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

    @refused_while_deciding
    def publish(self, **facts: Any) -> None:
        """Tell every strategy something: it is in `state["facts"]`, read-only all the way down."""
        self._facts.update([(name, published(name, value)) for name, value in facts.items()])

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
        self._collectors.add(as_name(name, "a collector"), fn, as_int(every, "every"), per)

    @property
    def scores(self) -> "Scores":
        """Numbers by team, agent or whatever the rules like; one that was not set is 0."""
        return self._scores if self._phase.agent is None else ReadOnlyMapping(Scores(frozen(self._scores)))  # type: ignore[return-value] # it reads like them

    # -- playing ------------------------------------------------------------------------------------------------

    @property
    def is_over(self) -> bool:
        """Whether a rule has ended the game."""
        return self._over is not None

    @property
    def over(self) -> dict[str, Any] | None:
        """Why the game is over, who has won, and whether time was up; None while it goes on."""
        return None if self._over is None else self._phase.shown(dict(self._over))

    @refused_while_deciding
    def step(self) -> bool:
        """Play one turn; False, and nothing happens, once the game is over.

        The global `random` and `numpy.random` are seeded as by `run`. If a rule of "before" ends the game, the turn is
        not played. If something raises before the agents have moved, the turn is not played either, and the next call
        begins it again; if a rule raises after they have moved, the turn is played, without the rules that follow.

        Raises:
            IllegalAction, Meddling, or whatever a strategy or rule raises: see the settings.
        """
        with self._chance.of(self.ctx):
            return self._take_turn()

    def _take_turn(self) -> bool:
        if self.ctx.is_terminated() or self._over is not None:
            return False
        if not self._has_begun:
            self._begin()
        self._ruleset.warn_of_unknown_teams()
        self._chance.begin_turn()
        self._is_stepping = True
        try:
            self._step()
        finally:
            self._is_stepping = False
        return self._over is None

    def _begin(self) -> None:
        """Keep how everything is before the first turn."""
        self._start, self._has_begun = start.taken(self, self._start), True
        self._players.update(self.ctx.agent.agents)

    def _step(self) -> None:
        self._apply_rules("before")
        if self.is_over:
            return
        if not self._has_begun:  # a rule has reset the game
            self._begin()
        turn.play_turn(self)
        self.turn += 1
        try:
            self._apply_rules("after")
            self._collectors.collect(self)
        finally:  # the agents have moved: the turn counts for recordings and windows, too
            began = perf_counter()
            self.ctx.visual.simulate()
            self.timings["draw"] += perf_counter() - began

    @refused_while_deciding
    def run(self, max_turns: int | None = None, progress: bool = False) -> Result:
        """Play until a rule ends the game, or for so many turns; warn once if strategies have erred.

        With a seed given to the context or to `reset`, the global `random` and `numpy.random` are seeded for the game,
        too, and afterwards as they were before.

        Args:
            max_turns: so many turns from now on; None: until there were as many as the settings say.
            progress: show how far it is on a line of stderr, where that is a terminal.

        Raises:
            BadValue: nothing could ever end this game.
            IllegalAction, Meddling, or whatever a strategy or rule raises: see the settings.
        """
        if self.ctx.is_terminated():
            raise ContextTerminated("ctx.game")
        turns = as_turns("max_turns", max_turns)
        last = self._last = self.max_turns if turns is None else self.turn + turns
        if last is None and not self.rules:
            raise BadValue("This game has no rule that could end it: give run(max_turns=…) or add a rule.")
        known = len(self.errors)
        with self._chance.of(self.ctx), chance.shown(self, last, is_shown=progress) as show:
            while (last is None or self.turn < last) and self._take_turn():
                show()
        self._warn_of_errors(self.errors[known:])
        return self.result()

    def result(self) -> Result:
        """What has come of the game so far."""
        self._tell_moves()
        over = self._over or {"reason": self._reason_so_far(), "winner": None, "truncated": True}
        agents = self.ctx.agent.agents
        everybody = self._players | agents
        return Result(
            turns=self.turn,
            scores=dict(self.scores),
            events=[dict(event) for event in self.events],
            agents={name: self._summary(one, is_there=name in agents) for name, one in sorted(everybody.items())},
            errors=[dict(error) for error in self.errors],
            timings=dict(self.timings),
            seed=self.ctx.seed,
            collected=self._collectors.tables(),
            **over,
        )

    def _reason_so_far(self) -> str:
        """Why no more turns were played of a game that no rule has ended."""
        if self._is_time_up:
            return "max_turns"
        return "closed" if self.ctx.is_terminated() else "unfinished"

    @property
    def _is_time_up(self) -> bool:
        return self.turn in (self._last, self.max_turns)

    @refused_while_deciding
    def close(self) -> None:
        """End the game, because its context ends, if that is in the middle of a turn which is not the last one."""
        if self._is_stepping and self._over is None and not self._is_time_up:
            self._over = {"reason": "closed", "winner": None, "truncated": True}

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
        if self._has_begun and self._start is not None:
            self._has_begun = False
            self._start.restore(self)
            self._reseed(self._start.seed)
        elif wanted is None:
            return
        try:
            if wanted == self.ctx.seed:
                self.ctx.is_seeded = True
            elif wanted is not None:
                self._begin_with(wanted)
        finally:
            for tell in self.after_reset:
                tell()

    # -- for rules ----------------------------------------------------------------------------------------------

    @property
    def agents(self) -> list[Any]:
        """The living agents, in the order of their names."""
        seating = self._seating if self._phase.agent is not None else None
        return [seat.agent for seat in (seating or self.seating()).seats]

    @property
    def moves(self) -> dict[str, Move]:
        """How the agents on the ground moved in this turn, by name; rules must not change it."""
        return {} if self._turn_moves is None else self._phase.shown(self._turn_moves.by_name())

    def tracks(self, agents: Iterable[Any]) -> list[Track]:
        """How agents came to where they are in this turn: for each, the nodes and from 0 to 1 when it was at each.

        An agent that stayed is at its node from 0 on. One that was put elsewhere since its move, or flew, is there
        only at 1.
        """
        if self._turn_moves is None:
            return [((agent.current_node_id,), (1.0,)) for agent in agents]
        return self._turn_moves.tracks(agents)

    @refused_while_deciding
    def observation(self, agent: Any) -> dict[str, Any]:
        """What an agent on the move, or the one of that name, would be told now: a state as its strategy gets it.

        Its sensors are asked for it.

        Raises:
            UnknownName (KeyError): there is no such agent, or it is out of the game.
        """
        one = self._agent(agent)
        for seat in self.seating().seats:
            if seat.agent is one:
                return turn.observed(self, seat)
        raise UnknownName("living agent", one.name, [seat.name for seat in self.seating().seats])

    @refused_while_deciding
    def emit(self, kind: str, **data: Any) -> None:
        """Note that something happened; it is in `events` and in the result. Values should be plain."""
        self.events.append({"turn": self.turn, "kind": as_name(kind, "a kind of event"), **data})

    @refused_while_deciding
    def end(self, reason: str, winner: Any = None, truncated: bool = False) -> None:
        """End the game after this turn; of several calls the first counts."""
        if self._over is None:
            self._over = {"reason": str(reason), "winner": winner, "truncated": bool(truncated)}

    @refused_while_deciding
    def eliminate(self, agent: Any) -> None:
        """Take an agent, or the one of that name, out of the game; who is out already stays so."""
        one = self._agent(agent)
        if one.alive:
            one.alive = False
            self.emit("eliminated", agent=one.name, node=one.current_node_id)

    @refused_while_deciding
    def respawn(self, agent: Any, node: int | None = None) -> None:
        """Put an agent, dead or alive, on a node, as if it had always been there; None: where it began."""
        one = self._agent(agent)
        where = self.start_node(one) if node is None else node
        if isinstance(where, tuple):
            one.position = where
        else:
            one.current_node_id = where
            one.prev_node_id = where
        if not one.alive:
            one.alive = True
        self.emit("respawned", agent=one.name, node=one.current_node_id)

    def start_node(self, agent: Any) -> Any:
        """The node an agent began on, or (x, y, z) of one that flies."""
        one = self._agent(agent)
        if one.name in self.began:
            return self.began[one.name]
        return self._place_of(one)

    # -- for the recorder ---------------------------------------------------------------------------------------

    @property
    def starts(self) -> dict[str, Any]:
        """Agent -> where it began, once the game has begun."""
        if self._start is None:
            return dict(self.began)
        return {name: self._place_of(agent) for name, agent in self.ctx.agent.agents.items()} | self.began

    @refused_while_deciding
    def begin_from_here(self) -> None:
        """Forget everything that has happened, and let `reset` come back to how things are at the next turn."""
        self.begin_anew()
        self.forget_streams()
        self._start, self._has_begun, self.draw_start = None, False, None

    @refused_while_deciding
    def publish_anew(self, facts: Mapping[str, Any]) -> None:
        """Tell every strategy this, and nothing that was published before."""
        self._facts.clear()
        self.publish(**facts)

    @refused_while_deciding
    def take_over(self, over: Any) -> None:
        """Be over for this reason, or not; for who plays a recording."""
        if over is not None and (not isinstance(over, Mapping) or set(over) != _OVER):
            raise BadValue(f"A game is over with {sorted(_OVER)}, not with {shown(over)}.")
        self._over = None if over is None else dict(over)

    @property
    def memories(self) -> Mapping[str, dict[Any, Any]]:
        """Agent -> what it remembers. While agents decide, each sees only its own."""
        agent = self._phase.agent
        return self._memories if agent is None else frozen({agent.name: self._memories.get(agent.name, {})})

    @refused_while_deciding
    def recorded(self) -> tuple[Any, ...]:
        """Give what recordings hold of a game, itself: events, scores, data, over, facts, memories, team memories."""
        # NOTE: asked in every turn; seven attributes that are checked one by one take 2 us (benchmarks/README.md, w4).
        return (
            self._events,  # type: ignore[attr-defined] # `Protected`, like two others
            self._scores,
            self._data,  # type: ignore[attr-defined]
            self._over,
            self._facts,
            self._memories,
            self._team_memories,  # type: ignore[attr-defined]
        )

    @refused_while_deciding
    def memory_of(self, name: str) -> dict[Any, Any]:
        """What an agent remembers; to be written to."""
        return self._memories.setdefault(name, {})

    # -- for the parts of the engine ----------------------------------------------------------------------------

    @property
    def columns(self) -> AgentColumns:
        """The columns of all agents."""
        columns: AgentColumns = self.ctx.agent.columns
        return columns

    @refused_while_deciding
    def seating(self) -> Seating:
        """Who is asked in a turn."""
        self.ctx.agent.settle()
        key = (self.columns.roster, self.legal)
        if self._seating is None or self._seating_key != key:
            self._tell_moves()
            self._seating, self._seating_key = Seating(self), key
            self._players.update((seat.name, seat.agent) for seat in self._seating.seats)
        return self._seating

    def length_of(self, source: int, target: int) -> float:
        """How long the shortest edge from one node to another is, map units."""
        revision, lengths = self._lengths
        graph = self.ctx.graph.graph
        if revision is None or revision != graph.revision:
            columns, lengths = graph.columns(), {}
            ends = columns.node_ids[columns.sources].tolist(), columns.node_ids[columns.targets].tolist()
            for start_id, end_id, length in zip(*ends, columns.lengths.tolist(), strict=True):
                known = lengths.get((start_id, end_id))
                lengths[start_id, end_id] = length if known is None else min(known, length)
            self._lengths = graph.revision, lengths
        return as_float(lengths[source, target], "length")

    def _reseed(self, seed: int) -> None:
        """Let every stream follow from a seed, and the context's own go on as at the start with this seed."""
        self.ctx.reseed(seed, None if self._start is None else self._start.chance_of(seed))
        self.forget_streams()

    def _begin_with(self, seed: int) -> None:
        """Let everything follow from another seed, the start too; from the last one again if that cannot be."""
        if self.draw_start is None:
            self._reseed(seed)
            return
        last, chance = self.ctx.seed, self.ctx.chance()
        self.ctx.reseed(seed)
        self.forget_streams()
        try:
            self.draw_start()
        except BaseException:
            self.ctx.reseed(last, chance)
            raise

    @refused_while_deciding
    def restore_rules(self, rules: tuple[NamedRule, ...]) -> None:
        """Let these be the rules."""
        self._ruleset.restore(rules)

    @refused_while_deciding
    def forget_streams(self) -> None:
        """Let all draws follow from the seed of the context as it is now."""
        self._seating = None  # the agents' draws live in it
        self._chance.forget()

    def _apply_rules(self, phase: str) -> None:
        began = perf_counter()
        self._ruleset.apply(phase, self)
        self.timings["rules"] += perf_counter() - began

    def _place_of(self, agent: Any) -> Any:
        """Where an agent began: a node id, or (x, y, z)."""
        if self._has_begun and self._start is not None:
            return self._start.place_of(agent)
        return getattr(agent, "position", agent.current_node_id)

    def _warn_of_errors(self, errors: list[dict[str, Any]]) -> None:
        """Say in one line what strategies did wrong."""
        if errors:
            kinds = ", ".join(f"{number} {kind}" for kind, number in sorted(Counter(e["kind"] for e in errors).items()))
            first = errors[0]
            self.ctx.logger.warning(
                f"Strategies erred ({kinds}), that of agent {first['agent']!r} first, in turn {first['turn']}: "
                f"{printable_line(first['message']):.200}. See result.errors."
            )

    def _tell_moves(self) -> None:
        if self._seating is not None:
            self._seating.tell()

    def _summary(self, agent: Any, *, is_there: bool) -> dict[str, Any]:
        counts = self.counts.get(agent.name) or dict.fromkeys(COUNTED, 0)
        return {"team": agent.team, "alive": agent.alive and is_there, "node": agent.current_node_id, **counts}

    def _agent(self, agent: Any) -> Any:
        return self.ctx.agent.get_agent(getattr(agent, "name", agent))
