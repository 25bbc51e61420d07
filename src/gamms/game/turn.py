"""One turn: all agents observe the same world, decide, and move at once."""

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from functools import lru_cache
from operator import itemgetter
from time import perf_counter
from typing import TYPE_CHECKING, Any

from gamms.deciding import DecidePhase
from gamms.errors import BadValue
from gamms.game.channels import Channel, Outgoing, checked_outbox, unknown_in
from gamms.game.decisions import Decisions, memory_copy
from gamms.game.facts import FactsOf
from gamms.game.messages import Inboxes, sent
from gamms.game.order import AgentSlot, IllegalAction, Legality, Part, ResolvedAction, TurnOrder
from gamms.game.settings import RuleSet, Settings
from gamms.ir.game_state import GameState
from gamms.readonly import ReadOnlyMapping, copied
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext
from gamms.typing.game import Deed, Move, Track
from gamms.typing.sensor_engine import SensorType

if TYPE_CHECKING:
    from gamms.game.awaiting import EventLoop

Observer = Callable[[list[Any], list[dict[str, Any]]], None]  # called with the agents and their states


class TurnEngine:
    """Plays the turns of one game.

    Args:
        ctx: the context, whose agents and graph count.
        settings: of the game.
        state: of the game.
        phase: of the context, shared by its engines.

    Attributes:
        is_deciding: whether agents observe and decide right now.
        is_playing: whether a turn is under way, rules included.
        is_moving: whether agents are asked and moved right now.
        refusals: what rules refuse, while they may; else None.
    """

    def __init__(self, ctx: HostContext, settings: Settings, state: GameState, phase: DecidePhase) -> None:
        self._ctx, self._settings, self._state, self._phase = ctx, settings, state, phase
        self._legality = Legality(ctx, settings)
        self._facts = ReadOnlyMapping(state.facts)
        self._loop: EventLoop | None = None
        self._order: TurnOrder | None = None
        self._order_key: tuple[Any, ...] = ()
        self.is_deciding = self.is_playing = self.is_moving = False
        self._groups: Sequence[Sequence[Any]] | None = None  # the order of play of the turn under way
        self.refusals: Refusals | None = None
        self._inboxes = Inboxes(ctx, state)
        self._outgoing: list[Outgoing] = []  # of this turn
        self._known_channels: list[Channel] = []  # of which it was checked whom they name

    def order(self) -> TurnOrder:
        """Return the living agents, as they are asked in a turn."""
        if self._order is not None and self._phase.agent is not None:
            return self._order  # nothing changes while agents decide
        agents, state = self._ctx.agent, self._state
        block = agents.block
        block.locate()
        settings = self._settings
        is_public = not state.agent_facts and not state.team_facts
        key = (block, block.structure_version, settings.changes, state.stream_version, is_public)
        if self._order is None or self._order_key != key:
            self.update_counts()
            living = sorted([(name, agent) for name, agent in agents.agents.items() if agent.alive], key=itemgetter(0))
            access_of = agents.storage.turn_access
            groups = self._groups if self.is_moving else settings.order
            slots = [AgentSlot(one, access_of(one), state, self._ctx.seed, self._facts, settings) for _, one in living]
            self._order, self._order_key = TurnOrder(slots, block.progress, settings.plans, groups), key
            state.players.update((slot.name, slot.agent) for slot in slots)
        return self._order

    def close(self) -> None:
        """Close the event loop, if one was opened."""
        if self._loop is not None:
            self._loop.close()

    def update_counts(self) -> None:
        """Add the moves of the last turns to the counts of the agents."""
        if self._order is not None:
            self._order.update_counts()

    def snapshot(self) -> dict[str, tuple[Any, Any]]:
        """Return what agents have drawn in this turn outside of it, for `restore`."""
        self.update_counts()
        slots = () if self._order is None else self._order.slots
        drawn = {}
        for slot in slots:
            marks = slot.draws.mark(), slot.rng.mark()
            if marks != (None, None):
                drawn[slot.name] = marks
        return drawn

    def restore(self, drawn: dict[str, tuple[Any, Any]]) -> None:
        """Continue from a state that was restored."""
        order = self.order() if drawn else self._order
        if order is not None:
            order.restart_counts()
            for slot in order.slots:
                slot.template["blocked"] = self._state.blocked.get(slot.name)
                draws, rng = drawn.get(slot.name, (None, None))
                slot.draws.go_to(draws)
                slot.rng.go_to(rng)

    def observation(self, slot: AgentSlot) -> dict[str, Any]:
        """Return the state that an agent gets now; its sensors are asked."""
        agents, row = self._ctx.agent, slot.row
        block = agents.block
        state = slot.template.copy()
        state["sensor"] = sensed = slot.agent.sense()
        for name in slot.foreign:
            sensed[name] = _own_copy(name, *sensed[name])
        here = block.node[row]
        if slot.flies:
            state["curr_pos"], state["quat"] = block.position[row], block.quat[row]
        else:
            state["curr_pos"] = here
            state["legal"] = self._legality.reachable(slot, here)
        state["turn"] = self._state.turn
        if self._settings.team_memory:
            known = self._state.team_memories.get(slot.team)
            state["team_memory"] = memory_copy(known) if known else {}
        if self._settings.channels:
            state["inbox"], state["outbox"] = self._inboxes.of(slot.name), []
        return state

    def play(self, observers: list[Observer], rules: RuleSet) -> None:
        """Let all agents observe, decide and move, those of one part after those of another.

        Args:
            observers: called before the agents of a part decide.
            rules: of the game; those of the phase "deeds" are applied before each part moves.

        Raises:
            BadValue: the order of play leaves out a team.
        """
        self._groups, self.is_moving, self._outgoing = self._settings.order, True, []
        try:
            order = self.order()
            if order.unlisted is not None:
                raise BadValue(
                    f"ctx.game.order leaves out team {shown(order.unlisted.team)}, of which agent "
                    f"{order.unlisted.name!r} is. Add the team to one of its lists."
                )
            turn, parts = self._play_part(order, 0, observers, rules), len(order.parts)
            if parts > 1:
                turn = turn.between(0, parts)
            for number in range(1, parts):
                if self._state.over is None:
                    later = self._play_part(self.order(), number, observers, rules).between(number, parts)
                    turn = turn.on(later.order).then(later)
            self._state.moves = turn
            if self._outgoing:
                agents = [slot.agent for slot in self.order().slots]
                self._state.messages += sent(self._ctx, agents, self._outgoing, self._state.turn)
        finally:
            self.is_moving = False
            if self._settings.order is not self._groups:  # a rule has set another one, which counts from now on
                self._order_key = ()

    def _play_part(self, order: TurnOrder, number: int, observers: list[Observer], rules: RuleSet) -> "TurnMoves":
        part = order.parts[number]
        began = perf_counter()
        turn = self._state.moves = self._ask(order, part, observers)
        asked = decided = perf_counter()
        if self._settings.deeds or rules.act_before_moves:
            turn = self._do_deeds(turn, part, rules)
            part = turn.order.parts[number]
            self._state.timings["rules"] += perf_counter() - decided
            decided = perf_counter()
        if self._settings.conflicts is not None:
            self._resolve(turn)
        resolved = perf_counter()
        self._apply(turn, part)
        applied = perf_counter()
        spent = self._state.timings
        spent["decide"] += asked - began
        spent["resolve"] += resolved - decided
        spent["apply"] += applied - resolved
        return turn

    def _do_deeds(self, turn: "TurnMoves", part: Part, rules: RuleSet) -> "TurnMoves":
        """Let rules refuse moves and deeds, note the deeds that remain, and let rules carry them out.

        Return the moves of the agents that there are now; one that was put elsewhere stays there, and one whose way
        was closed stays where it is.
        """
        self.refusals = Refusals(turn)
        try:
            if rules.check(self._state):
                self._refuse(turn, part)
        finally:
            self.refusals = None
        deeds = turn.deeds
        number, revision = self._state.turn + 1, self._ctx.graph.graph.revision
        self._state.deeds += [
            {"turn": number, "agent": deed.agent, "deed": deed.kind, "at": deed.at, **deed.values} for deed in deeds
        ]
        if not rules.apply("deeds", self._state):
            return turn
        turn = self._state.moves = turn.on(self.order())
        turn.give_up(turn.order.selection.of(self._ctx.agent.block.node))
        if self._ctx.graph.graph.revision != revision:
            closed = [i for i in range(len(turn.slots)) if not self._legality.is_open(turn.path(i))]
            self._stop(turn, closed, "its way was closed")
        return turn

    def _refuse(self, turn: "TurnMoves", part: Part) -> None:
        """Take back the moves and deeds that rules have refused."""
        refusals = self.refusals
        assert refusals is not None  # noqa: S101 - set by the only caller
        slots = turn.slots
        for i in part.members:
            name = slots[i].name
            why = refusals.moves.get(name)
            if why:
                self._stop(turn, [i], "; ".join(sorted(why)))
            for kind, reasons in sorted(refusals.deeds.get(name, {}).items()):
                message = f"{kind}: {'; '.join(sorted(reasons))}"
                self._note_illegal(slots[i], message)
                turn.refuse_deed(i, kind)

    def _stop(self, turn: "TurnMoves", indices: Iterable[int], why: str) -> None:
        """Keep agents where they are."""
        for i in indices:
            if turn.stop(i):
                self._block(turn.slots[i], why)

    def _block(self, slot: AgentSlot, why: str) -> None:
        known = self._state.blocked.get(slot.name)
        slot.template["blocked"] = self._state.blocked[slot.name] = why if known is None else f"{known}; {why}"

    def _ask(self, order: TurnOrder, part: Part, observers: list[Observer]) -> "TurnMoves":
        """Ask the agents of a part what they do.

        No agent sees what others decide: while a strategy runs, nothing can be changed, so what is seen right before an
        agent decides is what all see. Where a sensor may look at more than the world, all observe first.
        """
        starts, state = order.selection.of(self._ctx.agent.block.node), self._state
        decisions = Decisions(order.slots, starts, self._settings, state, self._phase, self._legality, self.observation)
        self.is_deciding = True
        try:
            seen = self._observe_first(order, part, observers)
            settings, has_channels = self._settings, bool(self._settings.channels)
            is_usual = settings.team_memory and not state.team_memories and settings.time_budget is None
            if seen is not None or has_channels or not is_usual:
                for i, *_ in part.individuals:
                    decisions.ask(i, self.observation(order.slots[i]) if seen is None else seen[i])
            else:
                self._ask_individuals(order, part, starts, decisions)
            for commanded in part.commanded:
                if commanded.plan.arrays:
                    decisions.ask_arrays(commanded, self._ctx.seed, FactsOf(state, commanded.team, None))
                else:
                    slots = [(i, order.slots[i]) for i in commanded.indices]
                    states = [self.observation(slot) if seen is None else seen[i] for i, slot in slots]
                    decisions.ask_plan(commanded, states)
            if decisions.are_awaited:
                if self._loop is None:
                    from gamms.game.awaiting import EventLoop  # which loads asyncio

                    self._loop = EventLoop()
                decisions.collect(self._loop)
        finally:
            self._phase.agent, self.is_deciding = None, False
            decisions.drop()
        unsent = self._take_outboxes(order, part, decisions.failed) if has_channels else []
        if state.blocked:
            self._forget_blocked(order, part)
        for i, why in decisions.close():
            self._block(order.slots[i], why)
        for slot, why in unsent:
            self._note_illegal(slot, why)
        return TurnMoves(order, starts, decisions.ends, decisions.actions)

    def _take_outboxes(self, order: TurnOrder, part: Part, failed: set[int]) -> list[tuple[AgentSlot, str]]:
        """Take what agents send whose decisions count, and return what cannot be sent: by whom, and why."""
        channels, teams = self._settings.channels, {one.name: one.team for one in self._ctx.agent.create_iter()}
        self._warn_of_unknown_names()
        unsent = []
        for i in part.observing:
            slot = order.slots[i]
            outbox = slot.last[0].get("outbox", ())
            if i in failed or (type(outbox) is list and not outbox):
                continue
            messages, flaws = checked_outbox(outbox, slot, channels, teams)
            self._outgoing += messages
            if flaws and self._settings.on_illegal == "raise":
                raise IllegalAction(f"Agent {shown(slot.name)} in turn {self._state.turn}: {flaws[0]}")
            unsent += [(slot, flaw) for flaw in flaws]
        return unsent

    def _warn_of_unknown_names(self) -> None:
        for channel in self._settings.channels.values():
            if channel not in self._known_channels:
                for flaw in unknown_in(channel, self._ctx):
                    self._ctx.logger.warning(f"{channel.name}: {flaw}")
        self._known_channels = list(self._settings.channels.values())

    def _note_illegal(self, slot: AgentSlot, message: str) -> None:
        slot.counts["illegal"] += 1
        error = {"turn": self._state.turn, "agent": slot.name, "kind": "illegal", "message": message}
        self._state.errors.append(error)
        self._block(slot, message)

    def _forget_blocked(self, order: TurnOrder, part: Part) -> None:
        for i in part.members:
            if self._state.blocked.pop(order.slots[i].name, None) is not None:
                order.slots[i].template["blocked"] = None

    def _ask_individuals(self, order: TurnOrder, part: Part, starts: list[int], decisions: Decisions) -> None:
        """Ask agents one by one, where neither memories of teams nor a time budget count."""
        near, phase, turn = self._ctx.graph.graph.neighborhoods, self._phase, self._state.turn
        ends, note, wait_for = decisions.ends, decisions.note, decisions.wait_for
        for i, agent, template, carried, last in part.individuals:
            strategy: Callable[[Any], Any] | None = agent.strategy
            if template is None or strategy is None:
                decisions.ask(i, self.observation(order.slots[i]))
                continue
            # NOTE: the usual agent is served in line (benchmarks/README.md, turns); `Decisions.ask` does the same.
            here = starts[i]
            sensed = {}
            for key, sense, sensor, result in carried:
                sense(here)
                sensed[key] = (sensor.type, result[0])
            last[0] = state = template.copy()
            state["curr_pos"], state["sensor"], state["turn"] = here, sensed, turn
            state["legal"] = legal = near[here]
            noted: dict[Any, Any] = {}
            state["team_memory"] = noted
            phase.agent = agent
            try:
                answer = strategy(state)
                phase.agent = None
                if answer is not None and hasattr(type(answer), "__await__"):
                    wait_for(i, state, answer)
                    continue
                action = state["action"]
            except Exception as error:  # noqa: BLE001 - a strategy is the caller's code
                phase.agent = None
                decisions.fail(i, state, error)
                continue
            if type(action) is int and action in legal:
                ends[i] = action
            else:
                decisions.take(i, state)
            if noted:
                note(i, noted)

    def _observe_first(
        self, order: TurnOrder, part: Part, observers: list[Observer]
    ) -> dict[int, dict[str, Any]] | None:
        """Return the states of all by slot, where none may decide before all have observed; else None."""
        if part.see_world_only and not observers:
            return None
        seen = {i: self.observation(order.slots[i]) for i in part.observing}
        for observe in observers:
            observe([order.slots[i].agent for i in seen], list(seen.values()))
        return seen

    def _resolve(self, turn: "TurnMoves") -> None:
        """Stop the agents that the conflict resolver stops."""
        whole, conflicts = turn.order.whole, self._settings.conflicts
        ground = whole.on_ground
        involved = getattr(conflicts, "involved", None)
        if involved is None:
            few = list(range(len(turn.slots))) if ground is None else ground
        else:
            few = involved(whole.of_ground(turn.starts), whole.of_ground(turn.ends))
            few = few if ground is None else [ground[i] for i in few]
        if few:
            names = conflicts.resolve(turn.named(few), self._ctx)  # type: ignore[union-attr] # asked where there is one
            for i in few:
                if turn.slots[i].name in names:
                    end = turn.ends[i]
                    if turn.stop(i):
                        self._block(turn.slots[i], f"in conflict with other agents on the way to node {end}")

    def _apply(self, turn: "TurnMoves", part: Part) -> None:
        """Write the moves of a part into the columns of the agents."""
        block = self._ctx.agent.block
        block.move_all(part.ground, part.of_ground(turn.ends))
        turn.order.count_moves(turn.starts, turn.ends)
        for i in part.paced:
            block.set_progress(turn.slots[i].row, turn.actions[i].progress if i in turn.actions else None)
        for i, action in turn.actions.items():
            slot = turn.slots[i]
            if action.heading != ():
                block.set(slot.row, "heading", action.heading)
            if slot.flies:
                slot.counts["moves"] += action.position not in (None, block.position[slot.row])
                if action.position is not None:
                    block.fly(slot.row, action.position)
                if action.quat is not None:
                    block.turn(slot.row, action.quat)


class Refusals:
    """What rules refuse in a turn, and why.

    Args:
        turn: the moves and deeds of the turn.

    Attributes:
        moves: agent -> why it may not move.
        deeds: agent -> deed -> why it may not do that.
    """

    def __init__(self, turn: "TurnMoves") -> None:
        self._turn = turn
        self.moves: dict[str, set[str]] = {}
        self.deeds: dict[str, dict[str, set[str]]] = {}

    def add(self, agent: str, why: str, deed: str | None) -> None:
        """Refuse the move of an agent, or a deed of it."""
        if deed is None:
            self.moves.setdefault(agent, set()).add(why)
        elif any(one.agent == agent and one.kind == deed for one in self._turn.deeds):
            self.deeds.setdefault(agent, {}).setdefault(deed, set()).add(why)


class TurnMoves:
    """The moves of one turn by slot: as lists for the engine, by name for rules and resolvers."""

    def __init__(
        self, order: TurnOrder, starts: list[int], ends: list[int], actions: dict[int, ResolvedAction]
    ) -> None:
        self.order, self.starts, self.ends, self.actions = order, starts, ends, actions
        self.slots = order.slots
        self._by_name: dict[str, Move] | None = None

    @property
    def deeds(self) -> list[Deed]:
        """What agents do besides moving, in the order of their names."""
        slots, starts = self.slots, self.starts
        return [
            Deed(slots[i].name, slots[i].team, kind, starts[i], values)
            for i, action in sorted(self.actions.items())
            if action.deeds is not None
            for kind, values in action.deeds.items()
        ]

    def of_agents(self, twin_of: Callable[[IAgent], IAgent]) -> "TurnMoves":
        """Return the same moves of other agents, of which each takes the place of one of these."""
        order = copy(self.order)
        order.slots = [copy(slot) for slot in self.slots]
        for slot in order.slots:
            slot.agent = twin_of(slot.agent)
        return TurnMoves(order, self.starts, self.ends, self.actions)

    def by_name(self) -> dict[str, Move]:
        """Return agent -> its move, of all on the ground, in the order of the names."""
        if self._by_name is None:
            self._by_name = self.named(self.order.whole.of_ground(list(range(len(self.slots)))))
        return self._by_name

    def named(self, indices: list[int]) -> dict[str, Move]:
        """Return agent -> its move, of these slots."""
        moves = {}
        for i in indices:
            slot = self.slots[i]
            moves[slot.name] = Move(slot.name, slot.team, self.starts[i], self.ends[i], self._track(i)[0])
        return moves

    def tracks(self, agents: Iterable[IAgent]) -> list[Track]:
        """Return how agents reached their nodes; those that were placed or flew there are there only at 1."""
        index_of, slots, ends, track = self.order.index_of, self.slots, self.ends, self._track
        tracks: list[Track] = []
        for agent in agents:
            node, i = agent.current_node_id, index_of.get(agent.name)
            if i is None or ends[i] != node or slots[i].agent is not agent or (slots[i].flies and self._flew(i)):
                tracks.append(((node,), (1.0,)))
            else:
                tracks.append(track(i))
        return tracks

    def path(self, i: int) -> tuple[int, ...]:
        """Return the nodes of the move of a slot."""
        return self._track(i)[0]

    def _track(self, i: int) -> Track:
        """Return the nodes of a move, and when the agent is at each."""
        action = self.actions.get(i)
        if action is not None:
            return action.path, action.times or _evenly(len(action.path))
        start, end = self.starts[i], self.ends[i]
        return ((start,), (0.0,)) if start == end else ((start, end), (0.0, 1.0))

    def _flew(self, i: int) -> bool:
        """Return whether a flyer has changed its position."""
        action = self.actions.get(i)
        return action is not None and action.position not in (None, self.slots[i].agent.prev_position)

    def stop(self, i: int) -> bool:
        """Keep the agent of a slot where it is; return whether it was about to go elsewhere."""
        slot, here, action = self.slots[i], self.starts[i], self.actions.get(i)
        goes = self.ends[i] != here
        if action is not None:
            goes = goes or len(action.path) > 1 or action.progress is not None or action.position is not None
        if goes:
            slot.counts["blocked"] += 1
            self._stay(i, here)
        return goes

    def give_up(self, nodes: list[int]) -> None:
        """Let agents that are on other nodes than those where their moves begin stay there."""
        for i, (start, node) in enumerate(zip(self.starts, nodes, strict=True)):
            if start != node:
                self.starts[i] = node
                self._stay(i, node)

    def refuse_deed(self, i: int, kind: str) -> None:
        """Take back a deed of the agent of a slot."""
        action = self.actions[i]
        self.actions[i] = action._replace(deeds={one: of for one, of in (action.deeds or {}).items() if one != kind})

    def _stay(self, i: int, node: int) -> None:
        self.ends[i] = node
        if i in self.actions:
            self.actions[i] = self.actions[i]._replace(end=node, path=(node,), times=(), progress=None, position=None)
        self._by_name = None

    # -- turns of several parts -----------------------------------------------------------------------------------

    def on(self, order: TurnOrder) -> "TurnMoves":
        """Return the moves of the agents of another order; those that are new in it stay."""
        if order is self.order:
            return self
        old = {id(slot.agent): i for i, slot in enumerate(self.slots)}
        pairs = [(i, old[id(slot.agent)]) for i, slot in enumerate(order.slots) if id(slot.agent) in old]
        starts = [slot.agent.current_node_id for slot in order.slots]
        ends = starts.copy()
        for i, j in pairs:
            starts[i], ends[i] = self.starts[j], self.ends[j]
        return TurnMoves(order, starts, ends, {i: self.actions[j] for i, j in pairs if j in self.actions})

    def between(self, number: int, parts: int) -> "TurnMoves":
        """Return the same moves, made in that one of several equal parts of the turn."""
        actions = dict(self.actions)
        for i, (start, end) in enumerate(zip(self.starts, self.ends, strict=True)):
            path, times = self._track(i)
            if len(path) > 1 or start != end:
                action = actions.get(i, ResolvedAction(end, path))
                scaled = tuple([(number + time) / parts for time in times])
                waits = ((path[0],), (0.0,)) if number else ((), ())
                actions[i] = action._replace(path=waits[0] + path, times=waits[1] + scaled)
        return TurnMoves(self.order, self.starts, self.ends, actions)

    def then(self, later: "TurnMoves") -> "TurnMoves":
        """Return these moves and later ones of other agents, as one turn; both are of the same order."""
        starts, ends, actions = self.starts.copy(), self.ends.copy(), {**self.actions, **later.actions}
        for i, (start, end) in enumerate(zip(later.starts, later.ends, strict=True)):
            if start != end or i in later.actions:
                if start != self.ends[i]:  # it was put there before it moved
                    action, starts[i] = later.actions[i], start
                    actions[i] = action._replace(path=action.path[1:] or action.path, times=action.times[1:])
                ends[i] = end
        return TurnMoves(self.order, starts, ends, actions)


@lru_cache(maxsize=256)
def _evenly(nodes: int) -> tuple[float, ...]:
    """Return when an agent is at each of its nodes if all edges take equally long."""
    return tuple(k / max(1, nodes - 1) for k in range(nodes))


def _own_copy(name: str, kind: SensorType, data: object) -> tuple[SensorType, Any]:
    """Copy what a sensor of the caller's class shows, which may show the same to several agents."""
    try:
        return kind, copied(data)
    except Exception as error:
        error.add_note(f"What the sensor {name!r} shows is copied: every agent gets its own.")
        raise
