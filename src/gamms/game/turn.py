"""One turn: all agents observe the same state of the world, decide, and move simultaneously."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import itemgetter
from threading import get_ident
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

from gamms.deciding import DecidePhase
from gamms.game.conflicts import MovePlaces, MovesOf, TurnConflicts
from gamms.game.decisions import Decisions
from gamms.game.facts import PrivateForks
from gamms.game.messages import Inboxes, Outboxes
from gamms.game.movement.arrivals import WAITS, ArrivingAgents
from gamms.game.movement.legality import Legality
from gamms.game.movement.moves import Refusals, TurnMoves
from gamms.game.movement.travel import GamePaths, ResolvedAction
from gamms.game.order import TurnOrder, TurnPart, left_out, note_lost
from gamms.game.random_streams import DrawTable
from gamms.game.settings import RuleSet, Settings, refuse_unused
from gamms.game.slots import AgentSlot, SlotMaker, own_copy
from gamms.ir.agents import AgentBlock
from gamms.ir.game_state import GameState, in_conflict
from gamms.limits import GarbagePause
from gamms.readonly import ReadOnlyMapping
from gamms.text import as_code
from gamms.typing.agent_engine import DeletedAgent, IAgent
from gamms.typing.context import HostContext
from gamms.typing.game import AerialState, IConflicts, Move, State

if TYPE_CHECKING:
    from gamms.game.awaiting import EventLoop

CLOSED = "its way was closed"
"""Why an agent stays whose way a rule has closed."""
Observer = Callable[[list[Any], list[dict[str, Any]]], None]  # called with the agents and their states


def closed_edge(source: int, target: int) -> str:
    """Return the reason why an agent is back on a node: the edge that it was on was closed."""
    return f"the edge from node {source} to node {target} was closed"


class TurnEngine:
    """Plays the turns of one game.

    Args:
        ctx: the context, for its agents and graph.
        settings: the settings of the game.
        state: the state of the game.
        phase: the phase of the context, shared by its engines.

    Attributes:
        is_deciding: whether agents are observing and deciding now.
        is_moving: whether agents are deciding and moving now.
        part: the number of the current part, in the order of play.
        refusals: collects refusals of rules during their checks; else None.
        travel: moves by metres.
        inboxes: messages that agents hear.
        outboxes: messages that agents send.
        seed_changes: the number of changes of the context's seed.
        asked: the number of times that the agents of a part were asked to decide.
        asked_part: the order and the agents of the last time; None: there was none.
        prepared: the count of strategy changes at which strategies were last prepared; -1: prepare them again.
    """

    def __init__(self, ctx: HostContext, settings: Settings, state: GameState, phase: DecidePhase) -> None:
        self._ctx = ctx
        self._settings = settings
        self._state = state
        self._phase = phase
        self._legality = Legality(ctx, settings)
        self.travel = self._legality.travel
        self._slots = SlotMaker(ctx, state, ReadOnlyMapping(state.facts), settings, PrivateForks(ctx))
        self._decisions = Decisions(settings, state, phase, self._legality, self.observation, self.sensed)
        self._loop: EventLoop | None = None
        self._order: TurnOrder | None = None
        self._order_key: tuple[Any, ...] = ()
        self._departure: DeletedAgent | None = None  # the last deleted agent that is noted
        self._near: Mapping[int, tuple[int, ...]] = {}  # node -> the nodes legal along one edge, of `_order`
        self.is_deciding = False
        self.is_moving = False
        self.part = 0
        self.seed_changes = 0
        self.prepared = -1
        self.asked = 0
        self.asked_part: tuple[TurnOrder, TurnPart] | None = None
        self._groups: Sequence[Sequence[Any]] | None = None  # the order of play of the current turn
        self.refusals: Refusals | None = None
        self._conflicts = TurnConflicts()
        self._last_arriving: dict[int, ArrivingAgents] = {}  # by the number of the part of a turn
        self.inboxes = Inboxes(ctx, state)
        self.outboxes = Outboxes(ctx, settings)

    @property
    def is_playing(self) -> bool:
        """Whether a turn is being played, including its rules, by the thread that has set this."""
        return self._phase.player is not None

    @is_playing.setter
    def is_playing(self, is_playing: bool) -> None:
        self._phase.player = get_ident() if is_playing else None

    @property
    def sensor_changes(self) -> int:
        """The number of changes of sensor settings, and of added and removed sensors."""
        return self._phase.sensor_changes

    def order(self) -> TurnOrder:
        """Return the living agents in the order of a turn."""
        if self._order is not None and self._phase.agent is not None:
            return self._order  # nothing changes while agents decide
        state = self._state
        block = self._ctx.agent.block
        if block.flyers:
            block.locate()
        is_public = not (state.agent_facts or state.team_facts)
        key = block, self._phase.setting_changes, state.stream_version, is_public, block.structure.version
        if self._order is None or self._order_key != key:
            with GarbagePause():  # NOTE: slots stay; to look for garbage among them takes half of the time (w9 alone)
                self._order = self._new_order(block, key)
            self._order_key = key
            self._near = self._ctx.graph.graph.neighborhoods
        return self._order

    def _new_order(self, block: AgentBlock, key: tuple[Any, ...]) -> TurnOrder:
        """Return a new order of turns; `key` has the versions of the data it depends on, that of the agents last."""
        settings = self._settings
        refuse_unused(settings)
        before = None if self._order_key[:-1] != key[:-1] else self._order
        version = 0 if before is None else before.structure_version
        slots, change = self._slots.of_living(None if before is None else before.slots, version)
        self.note_departed()
        if change is None:
            self.update_counts()
        groups = self._groups if self.is_moving else settings.order
        return TurnOrder(slots, block, settings, groups, before, change)

    def take_order(self, order: TurnOrder) -> None:
        """Reuse an earlier order whose agents are alive again."""
        state = self._state
        version = self._ctx.agent.block.structure.version
        is_public = not (state.agent_facts or state.team_facts)
        order.structure_version = version
        self._order = order
        self._order_key = order.block, self._phase.setting_changes, state.stream_version, is_public, version
        self._near = self._ctx.graph.graph.neighborhoods

    @property
    def draw_table(self) -> DrawTable:
        """The seed and the clock of the agents' draws."""
        return self.order().slots.table

    def living(self) -> list[IAgent]:
        """Return the living agents in the order of names."""
        agents = self._ctx.agent
        order = self._order
        if order is not None and self._phase.agent is not None:
            return [*order.living]
        block = agents.block
        if order is not None and order.block is block and order.structure_version == block.structure.version:
            return [*order.living]
        if block.has_teams:
            return [slot.agent for slot in self.order().slots]
        # NOTE: a changed set of agents does not require a new order here, which costs more (decision 0057).
        return [one for _, one in sorted(agents.agents.items(), key=itemgetter(0)) if one.alive]

    def legal(self, names: Iterable[str]) -> dict[str, tuple[int, ...]]:
        """Return name -> the nodes that will be legal at the start of the next turn, for living agents."""
        node = self._ctx.agent.block.node
        order = self.order()
        slots = [order.slots[order.index_of[name]] for name in names if name in order.index_of]
        return {slot.name: self._legality.reachable(slot, node[slot.row]) for slot in slots}

    def looks(self, agent: IAgent, names: Iterable[str]) -> dict[str, Any]:
        """Return the current data of an agent's sensors as in its state; these calls are not counted."""
        found = {}
        with self._phase.suspended(changes_world=False):
            block = self._ctx.agent.block
            progress = block.on_edge(block.row_of(agent.name))
            place = None if progress is None else self.travel.roads.located(progress)
            for name in names:
                sensor: Any = agent.sensors[name]
                node = agent.current_node_id
                if not hasattr(sensor, "data_from"):  # of a class of the user's own
                    found[name] = sensor.sense_many([node])[0][0]
                elif place is None or not getattr(sensor, "looks_from_points", False):
                    found[name] = sensor.data_from(node, agent.name)
                else:
                    found[name] = sensor.data_from(place[2], agent.name)
        return found

    def restart_streams(self) -> None:
        """Make agents draw by the current seed of the context."""
        self.seed_changes += 1
        if self._order is not None:
            self._order.slots.table.rekey(self._ctx.seed)

    def close(self) -> None:
        """Close the event loop, if there is one."""
        if self._loop is not None:
            self._loop.close()

    def update_counts(self) -> None:
        """Add the moves of the last turns to the counts of the agents, and note deleted agents."""
        self.note_departed()
        if self._order is not None:
            self._order.update_counts()

    def note_departed(self) -> None:
        """Record the agents that were deleted since the last call, if the game had begun."""
        if self._phase.agent is not None:
            return  # nothing changes while agents decide
        state = self._state
        since = self._departure
        self._departure = self._ctx.agent.storage.last_departure
        if state.has_begun or state.turn:
            while since is not None and (since := since.next) is not None:
                state.departed[since.agent.name] = since.team, since.node

    def restart_counts(self) -> None:
        """Drop the moves that are not in the counts of the agents yet."""
        if self._order is not None:
            self._order.restart_counts()

    def show_blocked(self) -> None:
        """Update the reasons in the states of agents why their last actions were not executed."""
        for slot in () if self._order is None else self._order.slots.made():
            slot.show_blocked()

    def list_counts(self) -> None:
        """Add conflicts, and agents whose slots are not made, to the counts."""
        if self._order is not None:
            self._order.list_counts()

    def snapshot(self) -> dict[str, tuple[Any, Any]]:
        """Return the positions of random streams that were used in this turn, for `restore`."""
        self.update_counts()
        if self._order is None or self._order.slots.table.turn != self._state.turn:
            return {}
        each = {slot.name: slot.marks() for slot in self._order.slots.made()}
        return {name: marks for name, marks in each.items() if marks != (None, None)}

    def restore(self, drawn: dict[str, tuple[Any, Any]], *, shows_blocked: bool = True) -> None:
        """Continue from a restored state.

        Args:
            drawn: the result of `snapshot`.
            shows_blocked: whether an agent is blocked now, or was before.
        """
        self._departure = self._ctx.agent.storage.last_departure  # the state says who has left
        order = self.order() if drawn else self._order
        if order is None:
            return
        order.restart_counts()
        order.slots.table.begin_again()
        if shows_blocked:
            self.show_blocked()
        for name, marks in drawn.items():
            if name in order.index_of:
                order.slots[order.index_of[name]].go_to(marks)

    def observation(self, slot: AgentSlot) -> dict[str, Any]:
        """Return the current state of an agent; its sensors are called."""
        sensed = self.sensed(slot)
        return self.observed(slot, self._ctx.agent.block.node[slot.row], sensed, self._decisions, self.inboxes)

    def sensed(self, slot: AgentSlot) -> dict[str, Any]:
        """Return the current data of the sensors of an agent."""
        sensed: dict[str, Any] = slot.agent.sense()
        for name in slot.foreign:
            sensed[name] = own_copy(name, *sensed[name])
        return sensed

    def observed(
        self, slot: AgentSlot, here: int, sensed: dict[str, Any], decisions: Decisions, inboxes: Inboxes
    ) -> dict[str, Any]:
        """Return the state of an agent at a node with its sensed data, ready for a decision."""
        block = self._ctx.agent.block
        row = slot.row
        game = decisions.state
        state: dict[str, Any] = (AerialState if slot.flies else State)(slot.template)
        state["sensor"] = sensed
        if slot.flies:
            state["curr_pos"] = block.position[row]
            state["quat"] = block.quat[row]
        else:
            state["curr_pos"] = here
            state["legal"] = self._legality.reachable(slot, here)
        if slot.travels:
            self.travel.show(state, here, block.on_edge(row))
        if "time" in state:
            state["time"] = self._legality.travel.now
        state["turn"] = game.turn
        known = game.team_memories.get(slot.team)  # read in any case: batches know by it who looks at observations
        if self._settings.team_memory:
            state["team_memory"] = decisions.team_memory(slot.team) if known else {}
        if self._settings.channels:
            state["inbox"] = inboxes.of(slot.name)
            state["outbox"] = []
        return state

    def play(self, observers: list[Observer], rules: RuleSet) -> None:
        """Play the moves of a turn: all agents observe, decide and move, part by part.

        Args:
            observers: called before the agents of a part decide.
            rules: the rules of the game; those of the phase "deeds" are applied before the moves of each part.

        Raises:
            BadValue: the order of play lacks a team.
            MissingKey (KeyError): the priorities of `by_priority` lack a team.
        """
        order = self.order()
        if order.unlisted is not None:
            raise left_out(order.unlisted.name, order.unlisted.team)
        if self._settings.conflicts is not None:
            self._conflicts.check_teams(self._settings.conflicts, order)
        self._groups = order.groups
        self.is_moving = True
        order.block.placed.clear()
        try:
            self._play_in_parts(order, observers, rules)
        except BaseException as error:  # the same numbers are drawn when the turn is repeated
            note_lost(error, self._ctx)
            self.outboxes.outgoing = []
            latest = self._order or order
            latest.slots.table.begin_again()
            raise
        finally:
            self.is_moving = False
            if self._order is not order and self._settings.order is not order.groups:
                self._order_key = ()  # a rule has changed the order of play

    def _play_in_parts(self, order: TurnOrder, observers: list[Observer], rules: RuleSet) -> None:
        """Play all parts of the turn, and send messages."""
        state = self._state
        first = self._state.parts_played or 0
        turn = self._play_part(order, first, observers, rules)
        if order.has_parts:
            state.moves = self._play_later_parts(turn, first, observers, rules)
        if self.outboxes.outgoing:
            state.messages += self.outboxes.sent([slot.agent for slot in self.order().slots], state.turn)

    def _play_later_parts(self, turn: TurnMoves, first: int, observers: list[Observer], rules: RuleSet) -> TurnMoves:
        """Play all parts after the first one; return the moves of the whole turn."""
        parts = len(turn.order.parts)
        turn.go_in_part(first, parts, turn.order.parts[first].members)
        for number in range(first + 1, parts):
            if self._state.over is None:
                self._state.moves = turn  # for those that decide now
                later = self._play_part(self.order(), number, observers, rules)
                later.go_in_part(number, parts, later.order.parts[number].members)
                turn = turn.on(later.order)
                turn.then(later, number)
        return turn

    def _play_part(self, order: TurnOrder, number: int, observers: list[Observer], rules: RuleSet) -> TurnMoves:
        part = order.parts[number]
        self.part = number
        spent = self._state.timings
        began = perf_counter()
        ask = self._ask_at_arrivals if part.decides_at_arrivals else self._ask
        turn = ask(order, part, observers)
        self._state.moves = turn
        if order.whole.paced:
            turn.let_stand(order.whole.paced, self._legality.travel)
        now = perf_counter()
        spent["decide"] += now - began
        if order.has_deeds or rules.now.act_before_moves:
            turn = self._do_deeds(turn, part, rules)
            part = turn.order.parts[number]
            began = now
            now = perf_counter()
            spent["rules"] += now - began
        if self._settings.conflicts is not None and not part.decides_at_arrivals:
            self._resolve(turn)
            began = now
            now = perf_counter()
            spent["resolve"] += now - began
        self._apply(turn, part)
        spent["apply"] += perf_counter() - now
        return turn

    def _do_deeds(self, turn: TurnMoves, part: TurnPart, rules: RuleSet) -> TurnMoves:
        """Call the rules that refuse moves and deeds, log the remaining deeds, and call the rules that execute deeds.

        Return the moves of the current agents. An agent that a rule has placed elsewhere stays there, and an agent
        whose path was closed stays on its node.
        """
        for i, kind, why in self.refused(turn, part.members, rules):
            if kind is None:
                self._block(turn.slots[i], why)
            else:
                self._note_illegal(turn.slots[i], why)
        deeds = turn.deeds
        number = self._state.turn + 1
        revision = self._ctx.graph.graph.revision
        self._state.deeds += [
            {"turn": number, "agent": deed.agent, "deed": deed.kind, "at": deed.at, **deed.values} for deed in deeds
        ]
        if not rules.apply("deeds", self._state):
            return turn
        turn = turn.on(self.order())
        self._state.moves = turn
        turn.give_up(self._ctx.agent.block)
        if self._ctx.graph.graph.revision != revision:
            for i in self.cut_off(turn):
                self._block(turn.slots[i], CLOSED)
        return turn

    def refused(self, turn: TurnMoves, members: Iterable[int], rules: RuleSet) -> Iterable[tuple[int, str | None, str]]:
        """Call the rules that refuse moves and deeds, for the agents of some slots; see `Refusals.take_back`."""
        if not rules.now.checks:
            return ()
        refusals = Refusals(turn)
        self.refusals = refusals
        try:
            rules.check(self._state)
        finally:
            self.refusals = None
        return refusals.take_back(members)

    def cut_off(self, turn: TurnMoves) -> list[int]:
        """Keep the agents where they are whose way was closed; return their slots."""
        closed = [i for i in range(len(turn.slots)) if not self._legality.is_open(turn.track(i))]
        return [i for i in closed if turn.stop(i)]

    def _block(self, slot: AgentSlot, why: str) -> None:
        slot.set_blocked(self._state.blocked.add(slot.name, why))

    def _ask(
        self, order: TurnOrder, part: TurnPart, observers: list[Observer], paths: GamePaths | None = None
    ) -> TurnMoves:
        """Return the moves that the agents of a part choose; `paths` receives paths by metres.

        Agents do not see each other's decisions: while a strategy runs, nothing can change, so all agents observe the
        same state even though each observes just before it decides. If a sensor may look at more than the world, all
        agents observe first.
        """
        decisions = self.decide(order, part, observers, paths)
        blocked = self._state.blocked
        # NOTE: no call in each turn (benchmarks: turns)
        if order.has_channels or blocked.known or blocked.stopped or decisions.failures or decisions.written:
            self._publish(order, part, decisions)
        ends = decisions.ends_to_write()
        return TurnMoves(order, decisions.starts, ends, decisions.actions, decisions.moves, decisions.paths)

    def decide(
        self, order: TurnOrder, part: TurnPart, observers: Sequence[Observer] = (), paths: GamePaths | None = None
    ) -> Decisions:
        """Return the decisions of the agents of a part, without publishing them; `paths` receives paths by metres."""
        phase = self._phase
        decisions = self._decisions.begin(order.slots, *order.begin())
        decisions.paths = paths
        if part.paced:
            self._leave_closed_edges(order, part)
            self.travel.prepare(len(order.block))
        self.asked += 1
        self.asked_part = order, part
        self.is_deciding = True
        phase.moment = object() if part.see_world_only else None
        try:
            sees_first = observers or not part.see_world_only
            self._ask_part(order, part, decisions, self._observe_first(order, part, observers) if sees_first else None)
            if decisions.awaited:
                if self._loop is None:
                    from gamms.game.awaiting import EventLoop  # it loads asyncio

                    self._loop = EventLoop()
                decisions.collect(self._loop)
        except BaseException:
            decisions.drop()
            raise
        finally:
            phase.agent = None
            phase.moment = None
            self.is_deciding = False
        return decisions

    def _publish(self, order: TurnOrder, part: TurnPart, decisions: Decisions) -> None:
        """Publish errors, team memories and messages, after all agents have decided."""
        unsent: Iterable[tuple[AgentSlot, str]] = ()
        if order.has_channels:
            failed = decisions.failed
            unsent = self.outboxes.take([order.slots[i] for i in part.observing if i not in failed], self._state.turn)
        self._forget_blocked(order, part)
        for i, why in decisions.close():
            self._block(order.slots[i], why)
        for slot, why in unsent:
            self._note_illegal(slot, why)

    def _ask_part(self, order: TurnOrder, part: TurnPart, decisions: Decisions, seen: dict[int, Any] | None) -> None:
        """Call the strategies of the agents of a part, and the plans of its teams.

        Args:
            order: all agents.
            part: the agents.
            decisions: collects the decisions.
            seen: slot -> the state of the agent; None: each agent observes when it decides.
        """
        slots = decisions.slots
        observe = decisions.observe
        if seen is None and part.individuals:
            decisions.ask_each(part, self._near, order.moving)
            self._phase.agent = None
        else:
            for i in part.asked:
                decisions.ask(i, None if seen is None else seen[i])
        for commanded in part.commanded:
            if commanded.plan.arrays:
                decisions.ask_arrays(commanded, self._ctx.seed)
            else:
                indices = commanded.indices
                decisions.ask_plan(commanded, [observe(slots[i]) if seen is None else seen[i] for i in indices])

    def _ask_at_arrivals(self, order: TurnOrder, part: TurnPart, observers: list[Observer]) -> TurnMoves:
        """Return the moves of a part whose agents decide first if they are not under way, then on each arrival."""
        travel = self._legality.travel
        slots = order.slots
        self._leave_closed_edges(order, part)
        arrivals = self._arriving(order, part)
        turn = self._ask(order, TurnPart(slots, arrivals.begin(), self._settings), observers, arrivals.chosen)
        try:
            self._set_out(turn, {}, arrivals)
            while arrivals.arrive():
                travel.now = arrivals.now
                actions: Mapping[int, ResolvedAction] = {}
                if arrivals.now < 1.0:
                    here = TurnPart(slots, arrivals.here, self._settings)
                    actions = self._ask(order, here, [], arrivals.chosen).actions
                self._set_out(turn, actions, arrivals)
        finally:
            travel.now = 0.0
            arrivals.close()
        arrivals.end(turn)
        return turn

    def _arriving(self, order: TurnOrder, part: TurnPart) -> ArrivingAgents:
        """Return the agents of a part that decide at arrivals, in the form of the core; the same if possible."""
        known = self._last_arriving.get(self.part)
        roads = self._legality.travel.roads
        has_end = self._settings.conflicts is not None
        if known is None or known.order is not order or known.roads is not roads or known.has_end != has_end:
            known = ArrivingAgents(order, part.members, roads, has_end=has_end)
            self._last_arriving[self.part] = known
        return known

    def _set_out(self, turn: TurnMoves, actions: Mapping[int, ResolvedAction], arrivals: ArrivingAgents) -> None:
        """Let agents go on that have decided, unless they lose conflicts or have arrived too often.

        Args:
            turn: the moves of the turn.
            actions: slot -> the action of an agent at its arrival, if it turns or does deeds.
            arrivals: the agents.
        """
        arrivals.choose([i for i, action in actions.items() if action.deeds])
        stopped = dict[int, Any]()
        if self._settings.conflicts is not None:
            before, after = arrivals.places()
            losers = self.losers_between(turn.order, before, after)
            stopped = {i: before[i] for i, _ in losers}
            for i, place in losers:
                turn.order.blocked[i] += 1
                self._block(turn.slots[i], in_conflict(place))
        for i, why in arrivals.go_on(stopped):
            self._note_illegal(turn.slots[i], why)
            if why == WAITS:
                stopped[i] = why
        for i, action in actions.items():
            if i not in stopped and action.heading != ():
                turn.turn_to(i, action.heading)

    def losers_between(self, order: TurnOrder, before: list[Any], after: list[Any]) -> list[tuple[int, Any]]:
        """Return the slots of the agents that lose conflicts of moves between places, and where they wanted to go."""
        slots = order.slots

        def named(indices: list[int]) -> dict[str, Move]:
            ends = {i: (before[i], after[i]) for i in indices}
            return {slots[i].name: Move(slots[i].name, slots[i].team, *ends[i], ends[i]) for i in indices}

        losers = self._losers(order, (before, after), named)
        return [(i, after[i]) for i in losers if before[i] != after[i]]

    def _leave_closed_edges(self, order: TurnOrder, part: TurnPart) -> None:
        """Move agents on removed edges to the node that they passed last."""
        block = self._ctx.agent.block
        travel = self._legality.travel
        for i in part.paced:
            slot = order.slots[i]
            place = block.on_edge(slot.row) if slot.travels else None
            if place is not None and travel.roads.on(place.edge) is None:
                block.set_progress(slot.row, None)
                self._block(slot, closed_edge(place.source, place.target))

    def _note_illegal(self, slot: AgentSlot, message: str) -> None:
        slot.counts["illegal"] += 1
        error = {"turn": self._state.turn, "agent": slot.name, "kind": "illegal", "message": message}
        self._state.errors.append(error)
        self._block(slot, message)

    def _forget_blocked(self, order: TurnOrder, part: TurnPart) -> None:
        blocked = self._state.blocked
        slots = order.slots
        members = part.members
        if len(members) == len(slots):
            blocked.drop_conflicts(order.names)
        indices = members if isinstance(members, range) else frozenset(members)
        number = order.index_of
        forgotten = [name for name in blocked if number.get(name, -1) in indices]
        for name in forgotten:
            del blocked[name]
        for i in [number[name] for name in forgotten]:
            slots.set_blocked(i, None)

    def _observe_first(
        self, order: TurnOrder, part: TurnPart, observers: Sequence[Observer]
    ) -> dict[int, dict[str, Any]]:
        """Return slot -> state, for parts in which all agents have to observe before any decides."""
        seen = {i: self.observation(order.slots[i]) for i in part.observing}
        for observe in observers:
            observe([order.slots[i].agent for i in seen], list(seen.values()))
        return seen

    def _resolve(self, turn: TurnMoves) -> None:
        """Resolve conflicts, and stop the losers."""
        stopped, places = self.lost(turn)
        if len(stopped):
            self._state.blocked.add_conflicts(turn.order.names, stopped, places)
            turn.slots.show_blocked(stopped)

    def lost(self, turn: TurnMoves) -> tuple[Sequence[int], Sequence[Any]]:
        """Keep the agents where they are that lose conflicts; return their slots, and where they wanted to go."""
        places = turn.in_core() if turn.paths is None else turn.places()
        return turn.stop_each(self._losers(turn.order, places, turn.named))

    def _losers(
        self,
        order: TurnOrder,
        places: MovePlaces,
        named: MovesOf,
    ) -> memoryview:
        """Return the slots of the agents that lose conflicts of moves between these places."""
        conflicts = cast("IConflicts", self._settings.conflicts)
        turn = self._state.turn
        try:
            return self._conflicts.losers(conflicts, order, turn, places, named, self._ctx)
        except Exception as error:
            error.add_note(f"In the conflicts {as_code(conflicts)}, in turn {turn}.")
            raise

    def _apply(self, turn: TurnMoves, part: TurnPart) -> None:
        """Write the moves of a part to the columns of the agents."""
        order = turn.order
        ends = turn.ends
        block = turn.order.block
        block.move_all(part.ground, ends if part.on_ground is None else part.of_ground(ends))
        order.count_moves(turn.in_core(), ends)
        if part.paced or turn.actions:
            self._apply_actions(turn, part, block)
        if block.placed:
            rows = order.selection.rows
            block.placed.difference_update([rows[i] for i in part.members])
        if turn.paths is not None and not (block.placed or order.has_parts or block.flyers):
            turn.applied = block.version

    def _apply_actions(self, turn: TurnMoves, part: TurnPart, block: AgentBlock) -> None:
        """Write positions on edges, headings and flights of a part to the columns of the agents."""
        for i in part.paced:
            block.set_progress(turn.slots[i].row, turn.progress(i))
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
