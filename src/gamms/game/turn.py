"""The turns of one game: all agents observe the same state of the world, decide, and move simultaneously.

`core.turn` has the phases of a turn and their order.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from threading import get_ident
from time import perf_counter
from typing import TYPE_CHECKING, Any

from gamms.core.turn import GameTurn, ShippedDecisions, TurnPlan
from gamms.deciding import DecidePhase
from gamms.game.conflicts import MovePlaces, MovesOf, TurnConflicts, make_ranking
from gamms.game.decisions import Decisions
from gamms.game.deeds import list_lasting, list_performed
from gamms.game.facts import PrivateForks
from gamms.game.lasting import find_doing
from gamms.game.messages import GameMessages
from gamms.game.movement.arrivals import WAITS, ArrivingAgents
from gamms.game.movement.legality import Legality
from gamms.game.movement.moves import Refusals, TurnMoves
from gamms.game.movement.travel import ResolvedAction
from gamms.game.order import TurnOrder, TurnPart, make_left_out_error, note_lost
from gamms.game.result import Collectors
from gamms.game.settings import RuleSet, Settings, refuse_unused
from gamms.game.slots import AgentSlot, SlotMaker, copy_data
from gamms.ir.agents import AgentBlock, show_numbers
from gamms.ir.deeds import PlainDeeds
from gamms.ir.game_state import BlockedAgents, GameState, describe_conflict
from gamms.progress import delay_interrupts
from gamms.readonly import ReadOnlyMapping
from gamms.text import as_code
from gamms.typing.agent_engine import DeletedAgent, IAgent
from gamms.typing.context import HostContext
from gamms.typing.game import AerialState, Move, State
from gamms.typing.sensor_engine import find_place_of_look

if TYPE_CHECKING:
    from gamms.game.awaiting import EventLoop

_FEWEST_DECIDED = 2  # agents for which to let the core decide takes no longer than asking them, if it decides for all
_FEWEST_BESIDE = 4  # and if others are asked
CLOSED = "its way was closed"
"""Why an agent stays whose way a rule has closed."""
Observer = Callable[[list[Any], list[dict[str, Any]]], None]
"""Called with the agents and their states. Agents are not asked for states if it has a method `observe_agents` that is
called with the agents alone and returns True; with False, the observer is called, too."""


def describe_closed_edge(source: int, target: int) -> str:
    """Return the reason why an agent is back on a node: the edge that it was on was closed."""
    return f"the edge from node {source} to node {target} was closed"


class TurnEngine(GameTurn):
    """Plays the turns of one game.

    Args:
        ctx: the context, for its agents and graph.
        settings: the settings of the game.
        state: the state of the game.
        phase: the phase of the context, shared by its engines.
        rules: the rules of the game.
        collectors: the collectors of the game.

    Attributes:
        legality: says which nodes and edges are legal for agents.
        begun: the phase in which the game goes on that has left a batch; None: turns begin as usual.
        refusals: collects refusals of rules during their checks; else None.
        messages: the messages that agents send and hear.
        read_inbox: returns the messages that an agent hears, by its name.
        prepared: the count of strategy changes at which strategies were last prepared; -1: prepare them again.
        find_shipped: returns the decisions of the agents of an order in the core, see `native.ShippedFinder`; None:
            they are always asked.
        seen: slot -> state, in the last part of a turn in which all observed before any decided.
        loop_owner: the engine whose event loop awaits answers, for the games of a batch; None: this one.
        departed_teams: team -> the number of names of deleted agents that were in it when they were deleted last.
    """

    def __init__(
        self,
        ctx: HostContext,
        settings: Settings,
        state: GameState,
        phase: DecidePhase,
        rules: RuleSet,
        collectors: Collectors,
    ) -> None:
        super().__init__(phase, state, TurnMoves)
        self._ctx = ctx
        self._host: Any = ctx  # whose engines may be of the user's classes
        self._settings = settings
        self.rules = rules
        self.collectors = collectors
        self.observers = list[Observer]()
        self.phases = {
            "decide": ("decide", self.play_decisions),
            "act": ("rules", self._act),
            "give way": ("resolve", self.give_way),
            "move": ("apply", self.move),
            "join": ("apply", self._join),
            "send": ("apply", self._send),
        }
        self.legality = Legality(ctx, settings, state)
        self.travel = self.legality.travel
        self._slots = SlotMaker(ctx, state, ReadOnlyMapping(state.facts), settings, PrivateForks(ctx))
        self.answers = Decisions(settings, state, phase, self.legality, self.make_observation, self.sense)
        self._loop: EventLoop | None = None
        self.loop_owner: TurnEngine | None = None
        self.find_shipped: Callable[[TurnOrder], tuple[ShippedDecisions | None, int]] | None = None
        self._order_of: tuple[Any, ...] = ()  # the data that the order depends on, besides the agents
        self._epoch = -1  # of the order
        self._checked_epoch = -1  # of `_changes_early`
        self._changes_early = False  # see `_may_change_early`
        self._earlier = list[TurnOrder]()  # those of the present turn that others have replaced
        self._departure: DeletedAgent | None = None  # the last deleted agent that is noted
        self.departed_teams = Counter[Any]()
        self._counted: object = None  # the deleted agents of these teams
        self.prepared = -1
        self.refusals: Refusals | None = None
        self._conflicts = TurnConflicts()
        self.seen: dict[int, dict[str, Any]] = {}
        self._last_arriving: dict[int, ArrivingAgents] = {}  # by the number of the part of a turn
        self.messages = GameMessages(ctx, settings, state)
        self.read_inbox: Callable[[str], list[dict[str, Any]]] = self.messages.get_received

    @property
    def is_playing(self) -> bool:
        """Whether a turn is being played, including its rules, by the thread that has set this."""
        return self.phase.player is not None

    @is_playing.setter
    def is_playing(self, is_playing: bool) -> None:
        self.phase.player = get_ident() if is_playing else None

    def get_order(self) -> TurnOrder:
        """Return the agents in the order of a turn, dead or alive."""
        order: TurnOrder | None = self.order_now
        if order is not None and self.phase.is_deciding:
            return order  # nothing changes while agents decide
        block = self._ctx.agent.block
        if block.flyers:
            block.locate()
        if order is None or self._epoch != self.phase.epoch or order.block is not block:
            made_of = self._get_order_key(block)
            if order is None or self._order_of != made_of or order.entries != block.structure.entries:
                order = self._make_order(block, order if self._order_of == made_of else None)
                self.order_now = order
                self._order_of = made_of
                self._follow_graph()
            self._epoch = self.phase.epoch
        return order

    def _get_order_key(self, block: AgentBlock) -> tuple[Any, ...]:
        """Return what an order depends on besides the agents, to compare."""
        return block, self.phase.setting_changes, self.state.stream_version, self._is_public()

    def _is_public(self) -> bool:
        """Return whether all facts are known to all agents."""
        return not (self.state.agent_facts or self.state.team_facts)

    def _make_order(self, block: AgentBlock, before: TurnOrder | None) -> TurnOrder:
        """Return a new order of turns; `before` is the last one, if only the agents have changed."""
        settings = self._settings
        refuse_unused(settings)
        if before is None:
            self.update_counts()
        if self.order_now is not None and self.is_moving:
            self._earlier.append(self.order_now)
        self.note_departed()
        slots = self._slots.make(*((None, 0) if before is None else (before.slots, before.entries)))
        slots.table.before_draws = self.read_states_of_turn
        for slot in slots.list_made():
            slot.show_blocked()
        return TurnOrder(slots, block, settings, self.groups if self.is_moving else settings.order)

    def make_order(self) -> TurnOrder:
        """Return a new order of the agents, whatever is known of others."""
        self.order_now = None
        return self.get_order()

    def take_order(self, order: TurnOrder) -> None:
        """Reuse an earlier order, whose agents are those of the context again."""
        order.entries = order.block.structure.entries
        self.order_now = order
        self._order_of = self._get_order_key(order.block)
        self._epoch = self.phase.epoch
        self._follow_graph()

    def _follow_graph(self) -> None:
        """Use the present graph."""
        graph = self._ctx.graph.graph
        self.near = graph.neighborhoods
        self.revised = getattr(graph, "revised", graph)

    def list_legal(self, names: Iterable[str]) -> dict[str, tuple[int, ...]]:
        """Return name -> the nodes that will be legal at the start of the next turn, for living agents."""
        block = self._ctx.agent.block
        order = self.get_order()
        known = [i for name in names if (i := order.index_of.get(name)) is not None]
        slots = [order.slots[i] for i in known if block.alive[order.selection.rows[i]]]
        return {slot.name: self.legality.list_reachable(slot, block.get_node(slot.row)) for slot in slots}

    @property
    def needs_checkpoint(self) -> bool:
        """Whether the next turn may change the game, or a recording, before a function raises in it."""
        if self._checked_epoch != self.phase.epoch:
            self._changes_early = self._may_change_early()
            self._checked_epoch = self.phase.epoch
        return self._changes_early or self.rules.now.act_before_moves or len(self.observers) > 0

    def _may_change_early(self) -> bool:
        """Return whether functions are called in a turn after something has changed, or sensors count their looks."""
        settings = self._settings
        begins_with_rules = "before" in self.rules.now.phases
        has_parts = settings.decide == "arrival" or len(settings.order or ()) > 1
        resolves = settings.conflicts is not None and make_ranking(settings.conflicts) is None
        return begins_with_rules or has_parts or resolves or self._host.sensor.storage.have_memories

    def read_sensors(self, agent: IAgent, names: Iterable[str]) -> dict[str, Any]:
        """Return the current data of an agent's sensors as in its state; these calls are not counted."""
        found = {}
        with self.phase.suspend(changes_world=False):
            block = self._ctx.agent.block
            progress = block.get_edge_position(block.find_row(agent.name))
            place = None if progress is None else self.travel.roads.locate(progress)
            for name in names:
                sensor: Any = agent.sensors[name]
                node = agent.current_node_id
                if not hasattr(sensor, "data_from"):  # of a class of the user's own
                    found[name] = sensor.sense_many([node])[0][0]
                else:
                    on_edge = None if place is None else place[2]
                    found[name] = sensor.data_from(find_place_of_look(sensor, node, on_edge), agent.name)
        return found

    def restart_streams(self) -> None:
        """Make agents draw by the current seed of the context."""
        self.seed_changes += 1
        self._conflicts.forget()
        self.conflicting = None
        if self.order_now is not None:
            self.order_now.slots.table.rekey(self._ctx.seed)

    def close(self) -> None:
        """Close the event loop, if there is one."""
        if self._loop is not None:
            self._loop.close()

    def update_counts(self) -> None:
        """Add the moves of the last turns to the counts of the agents, and note deleted agents."""
        with delay_interrupts():
            self.note_departed()
            for order in self.orders:
                order.update_counts()

    @property
    def orders(self) -> list[TurnOrder]:
        """The orders that may have moves that are not in the counts of agents yet."""
        return self._earlier if self.order_now is None else [*self._earlier, self.order_now]

    def note_departed(self) -> None:
        """Record the agents that were deleted since the last call, if the game had begun."""
        if self.phase.is_deciding:
            return  # nothing changes while agents decide
        last = self._ctx.agent.storage.last_departure
        if last is not self._departure or self._counted is not self.state.departed:
            with delay_interrupts():
                self._note_departed_until(last)

    def _note_departed_until(self, last: DeletedAgent | None) -> None:
        state = self.state
        since = self._departure
        self._departure = last
        if state.has_begun or state.turn:
            while since is not None and (since := since.next) is not None:
                name = since.agent.name
                if name in state.departed:
                    self.departed_teams[state.departed[name][0]] -= 1
                state.departed[name] = since.team, since.node
                self.departed_teams[since.team] += 1
        if self._counted is not state.departed:  # another state was restored
            self._counted = state.departed
            self.departed_teams = Counter(team for team, _ in state.departed.values())

    def restart_counts(self) -> None:
        """Drop the moves that are not in the counts of the agents yet."""
        self._earlier.clear()
        for order in self.orders:
            order.slots.restart_counts()

    def show_blocked(self) -> None:
        """Update the reasons in the states of agents why their last actions were not executed."""
        for slot in () if self.order_now is None else self.order_now.slots.list_made():
            slot.show_blocked()

    def list_counts(self) -> None:
        """Add conflicts, and agents that have none yet, to the counts."""
        self.get_order()  # the core may have played all turns
        with delay_interrupts():
            for order in self.orders:
                order.list_counts()

    def snapshot(self) -> dict[str, tuple[Any, Any]]:
        """Return the positions of random streams that were used in this turn, for `restore`."""
        if self.order_now is None or self.order_now.slots.table.turn != self.state.turn:
            return {}
        each = {slot.name: slot.get_marks() for slot in self.order_now.slots.list_made()}
        return {name: marks for name, marks in each.items() if marks != (None, None)}

    def restore(self, drawn: dict[str, tuple[Any, Any]], *, shows_blocked: bool = True) -> None:
        """Continue from a restored state.

        Args:
            drawn: the result of `snapshot`.
            shows_blocked: whether an agent is blocked now, or was before.
        """
        self._departure = self._ctx.agent.storage.last_departure  # the state says who has left
        self.ask_until = 0
        self.look_again = 0
        if self._order_of and self._order_of[-1] != self._is_public():
            self.phase.drop_plans()
        order = self.get_order() if drawn else self.order_now
        if order is None:
            return
        self.restart_counts()
        order.slots.table.begin_again()
        if shows_blocked:
            self.show_blocked()
        for name, marks in drawn.items():
            if name in order.index_of:
                order.slots[order.index_of[name]].go_to(marks)

    def make_observation(self, slot: AgentSlot) -> dict[str, Any]:
        """Return the current state of an agent; its sensors are called."""
        sensed = self.sense(slot)
        return self.complete_observation(slot, self._ctx.agent.block.get_node(slot.row), sensed, self.answers)

    def sense(self, slot: AgentSlot) -> dict[str, Any]:
        """Return the current data of the sensors of an agent."""
        sensed: dict[str, Any] = slot.agent.sense()
        for name in slot.foreign:
            sensed[name] = copy_data(name, *sensed[name])
        return sensed

    def complete_observation(
        self, slot: AgentSlot, here: int, sensed: dict[str, Any], decisions: Decisions
    ) -> dict[str, Any]:
        """Return the state of an agent at a node with its sensed data, ready for a decision."""
        block = self._ctx.agent.block
        row = slot.row
        game = decisions.state
        state: dict[str, Any] = (AerialState if slot.flies else State)(slot.template)
        state["sensor"] = sensed
        if slot.flies:
            state["curr_pos"] = block.flights.get_position(row)
            state["quat"] = block.flights.get_rotation(row)
        else:
            state["curr_pos"] = here
            state["legal"] = self.legality.list_reachable(slot, here)
        if slot.travels:
            self.legality.get_for_agent(slot).travel.show(state, here, block.get_edge_position(row))
        if "time" in state:
            state["time"] = self.legality.travel.now
        state["turn"] = game.turn
        state["memory"] = game.get_memory(slot.name)  # in batches that of another game than the template has
        known = game.team_memories.get(slot.team)  # read in any case: batches know by it who looks at observations
        if self._settings.team_memory:
            state["team_memory"] = decisions.get_team_memory(slot.team) if known else {}
        if "doing" in state:
            state["doing"] = find_doing(slot.name, slot.team, game, self._settings, self.legality.travel.now)
        if self._settings.channels:
            state["inbox"] = self.read_inbox(slot.name)
            state["outbox"] = []
        return state

    # -- the phases of a turn ---------------------------------------------------------------------------------------

    def plan(self) -> TurnPlan:
        """Return the phases of a turn; the same until the epoch rises."""
        plan: TurnPlan | None = self.plan_now
        if plan is None or plan.epoch != self.phase.epoch or plan.order is not self.get_order():
            plan = self._make_plan(self.get_order())
            self.plan_now = plan
        return plan

    def _make_plan(self, order: TurnOrder) -> TurnPlan:
        """Return the phases that turns of these agents need."""
        self.conflicting = None
        acts = order.has_deeds or self.rules.now.may_act_before_moves
        conflicts = self._settings.conflicts
        if order.plan is not None and order.acts == acts and order.conflicts is conflicts:
            order.plan.epoch = self.phase.epoch
            return order.plan
        needed = []
        for part in order.parts:
            gives_way = conflicts is not None and not part.decides_at_arrivals
            phases = {"decide": True, "act": acts, "give way": gives_way, "move": True, "join": order.has_parts}
            needed.append({phase for phase, is_needed in phases.items() if is_needed})
        order.plan = self.make_plan(order, needed, order.has_channels)
        order.acts = acts
        order.conflicts = conflicts
        return order.plan

    def _check(self, plan: TurnPlan) -> None:
        """Refuse to play a plan if a team is left out.

        Raises:
            BadValue: the order of play lacks a team.
            MissingKey (KeyError): the priorities of `by_priority` lack a team.
        """
        order: TurnOrder = plan.order
        unlisted = order.moving.select_present(order.unlisted)
        if unlisted:
            raise make_left_out_error(order.names[unlisted[0]], order.list_teams()[unlisted[0]])
        if self._settings.conflicts is not None:
            self._conflicts.check_teams(self._settings.conflicts, order)
        order.may_be_refused = bool(order.unlisted or order.unranked)

    def lose_moves(self, error: BaseException) -> None:
        """Undo what a turn has begun that an error has ended: the same numbers are drawn when it is repeated."""
        note_lost(error, self._ctx)
        self.messages.begin_turn()
        latest: TurnOrder = self.order_now or self.moves_of
        latest.slots.table.begin_again()

    def _follow_order(self) -> None:
        """Notice that a rule has changed the order of play, and count the moves of orders that were replaced."""
        for order in self._earlier:
            order.update_counts()
        self._earlier.clear()
        if self._settings.order is not self.groups:  # the next order has other parts
            self._forget_order()

    def _forget_order(self) -> None:
        """Make the order and the plan again when they are needed next."""
        self._order_of = ()
        self._epoch = -1
        self.plan_now = None

    def _show(self) -> None:
        """Show the end of the turn in pictures, windows and recordings."""
        self._host.visual_engine.simulate()

    def _show_missed(self) -> None:
        """Show the end of the turn, unless that has begun; an engine of a program does not tell."""
        drawing = getattr(self._host.visual_engine, "drawing", None)
        if drawing is not None and not drawing.turns.has_ended(self.state.turn):
            self._show()

    def _collect(self) -> None:
        """Collect the values of the turn."""
        turn = self.state.turn
        self.collectors.collect(turn, self._ctx, self.list_living)
        self.state.collected = self.collectors.list_last_numbers(turn)

    def _act(self, number: int) -> None:
        """Let rules refuse moves and deeds, and execute deeds."""
        turn: TurnMoves = self.state.moves
        if turn.order.has_deeds or self.rules.now.act_before_moves:
            self._do_deeds(turn, number)

    def _join(self, number: int) -> None:
        """Add the moves of a part to those of the whole turn."""
        turn: TurnMoves = self.state.moves
        parts = turn.order.parts
        turn.go_in_part(number, len(parts), parts[number].members)
        if number > self.first:
            whole: TurnMoves = self.whole.fit_to_order(turn.order)
            whole.add_part(turn, number)
            turn = whole
        self.whole = turn
        self.state.moves = turn

    def _send(self, number: int) -> None:  # noqa: ARG002 - as all phases
        """Send the messages of the turn."""
        if self.messages.is_sending:
            self.messages.send_all(self.list_living())

    def _apply_rules(self, phase: str) -> None:
        began = perf_counter()
        may_close = phase == "after" and self._settings.speed_unit != "edges"
        revision = self._get_revision() if may_close else -1
        self.rules.apply(phase, self.state)
        if may_close and self._get_revision() not in (None, revision):
            self._leave_closed_edges(self.get_order(), range(len(self.get_order().slots)))
        self.state.timings["rules"] += perf_counter() - began

    def _get_revision(self) -> int | None:
        """Return the revision of the map; None: it is unknown, or the context has ended."""
        return None if self._ctx.is_terminated() else self._ctx.graph.graph.revision

    def _do_deeds(self, turn: TurnMoves, number: int) -> None:
        """Call the rules that refuse moves and deeds, log the remaining deeds, and call the rules that execute deeds.

        An agent that a rule has placed elsewhere stays there, and an agent whose path was closed stays on its node.
        """
        rules = self.rules
        log = self.state.deed_log
        self._collect_wanted_deeds(turn, number)
        log.do(number, is_first=number == self.first)
        for i, kind, why in self.list_refused(turn, turn.order.parts[number].members, rules):
            if kind is None:
                self._block_agent(turn.slots[i], why)
            else:
                log.refuse(self.state.row, i, kind)
                self._note_illegal(turn.slots[i], why)
        self._call_deeds(turn)

    def _call_deeds(self, turn: TurnMoves) -> None:
        """Log the deeds that were not refused, and call the rules that execute them."""
        self.state.deed_log.note(list_lasting(self._settings.deeds))
        revision = self._ctx.graph.graph.revision
        if self.rules.apply("deeds", self.state):
            self._follow_deeds(turn, may_be_closed=self._ctx.graph.graph.revision != revision)

    def _follow_deeds(self, turn: TurnMoves, *, may_be_closed: bool) -> None:
        """Let agents stay that rules of the phase "deeds" have placed elsewhere, or whose way they have closed."""
        order = self.get_order()
        order.take_lives()
        turn = turn.fit_to_order(order)
        self.state.moves = turn
        turn.give_up(self._ctx.agent.block)
        for i in self.cut_off(turn) if may_be_closed else ():
            self._block_agent(turn.slots[i], CLOSED)

    def _collect_wanted_deeds(self, turn: TurnMoves, number: int) -> None:
        """Collect the deeds that agents want to do in a part of the turn; the numbers of agents are their slots."""
        wanted = PlainDeeds(number, [])
        names = turn.slots.names
        now = self.state.turn + 1
        for i, action in sorted(turn.actions.items()):
            if action.deeds:
                wanted.add(0, i, names[i], now, turn.starts[i], action.deeds)
        if wanted.given:
            self.state.deed_log.request_deeds(wanted)

    def list_refused(
        self, turn: TurnMoves, members: Iterable[int], rules: RuleSet
    ) -> Iterable[tuple[int, str | None, str]]:
        """Call the rules that refuse moves and deeds, for the agents of some slots; see `Refusals.take_back`."""
        if not rules.now.checks:
            return ()
        refusals = Refusals(turn, partial(list_performed, self.state, is_moving=True))
        self.refusals = refusals
        self.phase.judge = "A check"
        try:
            rules.check(self.state)
        finally:
            self.phase.judge = ""
            self.refusals = None
        return refusals.take_back(members)

    def cut_off(self, turn: TurnMoves) -> list[int]:
        """Keep the agents where they are whose way was closed; return their slots."""
        closed = [i for i in range(len(turn.slots)) if not self.legality.is_open(turn.find_track(i))]
        return [i for i in closed if turn.stop(i)]

    def _block_agent(self, slot: AgentSlot, why: str) -> None:
        slot.set_blocked(self.state.blocked.add(slot.name, why))

    def _get_drawn(self, order: TurnOrder) -> list[tuple[AgentSlot, Any]]:
        """Return agents whose random streams were used in this turn, and the positions of these."""
        if order.slots.table.turn != self.state.turn:
            return []
        each = [(slot, slot.get_marks()) for slot in order.slots.list_made()]
        return [(slot, marks) for slot, marks in each if marks != (None, None)]

    def _draw_again(self, order: TurnOrder, drawn: list[tuple[AgentSlot, Any]]) -> None:
        """Let random streams continue from earlier positions in this turn."""
        order.slots.table.begin_again()
        for slot, marks in drawn:
            slot.go_to(marks)

    def _copy_team_memories(self) -> dict[Any, Any]:
        """Return a copy of the memories of teams."""
        return {team: self.answers.get_team_memory(team) for team in self.state.team_memories}

    def _split(self, order: TurnOrder, part: TurnPart) -> tuple[TurnPart | None, TurnPart | None]:
        """Return the agents of a part that are asked, None: there are none; and those for which the core decides."""
        shipped = self.shipped
        assert shipped is not None  # noqa: S101 - it decides
        known = order.split
        if known is None or known[0] is not shipped:
            known = shipped, *self._split_part(order, part, list(map(bool, shipped.decides)))
            order.split = known
        _, rest, own = known
        return rest, own if rest is None or rest.see_world_only else None

    def _split_part(
        self, order: TurnOrder, part: TurnPart, decides: list[bool]
    ) -> tuple[TurnPart | None, TurnPart | None]:
        if sum(decides) < (_FEWEST_DECIDED if all(decides) else _FEWEST_BESIDE):
            return part, None
        if all(decides):
            return None, part
        members = [[i for i, is_own in enumerate(decides) if is_own == wanted] for wanted in (False, True)]
        asked, own = [order.make_part(some, is_whole=False) for some in members]
        return asked, own

    def _find_shipped(self, order: TurnOrder) -> None:
        """Set `shipped` and `look_again` for the agents of an order."""
        before = self.shipped
        if self.find_shipped is not None:
            self.shipped, self.look_again = self.find_shipped(order)
        if before is not self.shipped:
            order.split = None  # it would keep the old columns

    def _show_row(self, order: TurnOrder, memory: bytes, turn: int, blocked: BlockedAgents | None) -> None:
        """Show the game of another moment: the number columns of the agents, and why they are blocked."""
        show_numbers(order.block, memory)
        state = self.state
        state.turn = turn
        before = state.blocked
        state.blocked = BlockedAgents() if blocked is None else blocked
        if before or blocked:
            both = {*before, *state.blocked}
            order.slots.show_blocked([order.index_of[name] for name in both if name in order.index_of])

    def _read_states(self) -> None:
        """Make the states of the last turn that the core has decided; Ctrl-C waits until they are made."""
        with delay_interrupts():
            self.make_states()

    def make_state_of(self, name: str) -> None:
        """Make the state of an agent in the last turn, after which it takes part in no turn."""
        unread = self.unread
        if unread is None or self.phase.read_turn is not self.reader:
            self.phase.read_last_turn()
            return
        i = unread.order.index_of.get(name)
        if i is not None and i in unread.part.members:
            self.make_states(unread.order.make_part([i], is_whole=False))

    def _publish(self, order: TurnOrder, part: TurnPart, decisions: Decisions) -> None:
        """Publish errors, team memories and messages, after all agents have decided."""
        unsent: Iterable[tuple[AgentSlot, str]] = ()
        if order.has_channels:
            failed = decisions.failed
            asked = [i for i in order.moving.select_present(part.observing) if i not in failed]
            unsent = self.messages.take([order.slots[i] for i in asked], order.names)
        self._forget_blocked(order, part)
        for i, why in decisions.close():
            self._block_agent(order.slots[i], why)
        for slot, why in unsent:
            self._note_illegal(slot, why)

    def _ask_part(self, decisions: Decisions, part: TurnPart, seen: dict[int, Any] | None) -> None:
        """Call the strategies of the agents of a part, and the plans of its teams.

        Args:
            decisions: collects the decisions.
            part: the agents.
            seen: slot -> the state of the agent; None: each agent observes when it decides.
        """
        for i in part.select_present(part.asked):
            decisions.ask(i, None if seen is None else seen[i])
        self._ask_plans(decisions, part, seen)

    def _ask_plans(self, decisions: Decisions, part: TurnPart, seen: dict[int, Any] | None) -> None:
        """Call the plans of the teams of a part; see `_ask_part`."""
        slots = decisions.slots
        for commanded in part.commanded:
            if commanded.plan.arrays:
                decisions.ask_arrays(commanded, self._ctx.seed)
            else:
                indices = commanded.indices
                states = [decisions.observe(slots[i]) if seen is None else seen[i] for i in indices]
                decisions.ask_plan(commanded, states)

    def _await_answers(self, decisions: Decisions) -> None:
        """Wait for the answers of awaitables."""
        clock = self._settings.clock
        owner = self.loop_owner or self
        if owner._loop is None or owner._loop.clock is not clock:
            from gamms.game.awaiting import EventLoop  # it loads asyncio

            owner.close()
            owner._loop = EventLoop(clock)
        decisions.collect(owner._loop)

    def _ask_at_arrivals(self, order: TurnOrder, part: TurnPart, observers: Sequence[Observer]) -> TurnMoves:
        """Return the moves of a part whose agents decide first, then on each arrival."""
        self._leave_closed_edges(order, part.select_present(part.paced))
        self.legality.keep_map(keeps=True)
        arrivals = self._make_arriving_agents(order, part)
        try:
            turn: TurnMoves = self.ask(order, order.make_part(arrivals.begin()), observers, arrivals.chosen)
            self._set_out(turn, {}, arrivals)
            while arrivals.arrive():
                self._decide_here(turn, arrivals)
        finally:
            with delay_interrupts():
                self.legality.keep_map(keeps=False)
                self.legality.set_time(0.0)
                arrivals.close()
        arrivals.end(turn)
        return turn

    def _decide_here(self, turn: TurnMoves, arrivals: ArrivingAgents) -> None:
        """Ask the agents that arrive now, unless the turn is over, and let them go on."""
        order = turn.order
        self.legality.set_time(arrivals.now)
        actions: Mapping[int, ResolvedAction] = {}
        if arrivals.now < 1.0:
            here = order.make_part(arrivals.here)
            actions = self.ask(order, here, [], arrivals.chosen).actions
        self._set_out(turn, actions, arrivals)

    def _make_arriving_agents(self, order: TurnOrder, part: TurnPart) -> ArrivingAgents:
        """Return the agents of a part that decide at arrivals, in the form of the core; the same if possible."""
        known = self._last_arriving.get(self.part)
        roads = self.legality.travel.roads
        has_end = self._settings.conflicts is not None
        if known is None or known.order is not order or known.roads is not roads or known.has_end != has_end:
            modes = dict.fromkeys(slot.mode for slot in order.slots if slot.mode is not None)
            of_modes = {mode: self.legality.get_for_mode(mode).travel.roads for mode in modes}
            known = ArrivingAgents(order, part.members, roads, of_modes, has_end=has_end)
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
        losers = list[int]()
        if self._settings.conflicts is not None:
            losers = [i for i, _ in self.find_losers(turn.order, *arrivals.list_places())]
        headings = {i: action.heading for i, action in actions.items() if action.heading != ()}
        for i in losers:
            turn.order.blocked[i] += 1
            self._block_agent(turn.slots[i], describe_conflict(arrivals.find_goal(i)))
        stopped = {*losers}
        for i, why in arrivals.go_on(losers):
            self._note_illegal(turn.slots[i], why)
            if why == WAITS:
                stopped.add(i)
        for i, heading in headings.items():
            if i not in stopped:
                turn.set_heading(i, heading)

    def find_losers(self, order: TurnOrder, before: list[Any], after: list[Any]) -> list[tuple[int, Any]]:
        """Return the slots of the agents that lose conflicts of moves between places, and where they wanted to go."""
        slots = order.slots

        def named(indices: list[int]) -> dict[str, Move]:
            ends = {i: (before[i], after[i]) for i in indices}
            return {slots[i].name: Move(slots[i].name, slots[i].team, *ends[i], ends[i]) for i in indices}

        losers = self._find_losers(order, (before, after), order.moving.lives, named)
        return [(i, after[i]) for i in losers if before[i] != after[i]]

    def _prepare_first(self, order: TurnOrder, part: TurnPart) -> None:
        """Compute the neighborhoods of agents that are asked."""
        if hasattr(self.near, "learn"):  # that of a user's graph may be any mapping
            rows = order.selection.rows
            self.near.learn([order.block.get_node(rows[i]) for i in part.select_present(part.asked)])

    def _leave_closed_edges(self, order: TurnOrder, indices: Iterable[int]) -> None:
        """Move agents of some slots that are on removed edges to the nodes that they passed last."""
        block = self._ctx.agent.block
        travel = self.legality.travel
        if not block.travellers:
            return
        roads = travel.roads
        rows = order.selection.rows
        for i in [i for i in indices if rows[i] in block.travellers and block.alive[rows[i]]]:
            slot = order.slots[i]
            place = block.get_edge_position(slot.row) if slot.travels else None
            if place is not None and roads.get_row_of_edge(place.edge) is None:
                block.set_progress(slot.row, None)
                order.blocked[i] += 1
                self._block_agent(slot, describe_closed_edge(place.source, place.target))

    def _note_illegal(self, slot: AgentSlot, message: str) -> None:
        slot.counts["illegal"] += 1
        error = {"turn": self.state.turn, "agent": slot.name, "kind": "illegal", "message": message}
        self.state.errors.append(error)
        self._block_agent(slot, message)

    def _forget_blocked(self, order: TurnOrder, part: TurnPart) -> None:
        blocked = self.state.blocked
        slots = order.slots
        members = part.members
        if len(members) == len(slots):
            moving = order.moving
            blocked.drop_conflicts(order.names, None if moving.are_all else moving.takes_part)
        present = part.select_present(members)
        indices = present if isinstance(present, range) else frozenset(present)
        number = order.index_of
        forgotten = [name for name in blocked if number.get(name, -1) in indices]
        for name in forgotten:
            del blocked[name]
        for i in [number[name] for name in forgotten]:
            slots.set_blocked(i, None)

    def _tell_observers(self, order: TurnOrder, part: TurnPart, observers: Sequence[Observer]) -> Sequence[Observer]:
        """Return the observers that need the states of the agents of a part; the others observe now."""
        if part.paced or order.block.flyers:  # they may still move before they observe
            return observers
        agents = order.list_agents(self._ctx.agent.agents)
        observing = [agents[i] for i in part.select_present(part.observing)]
        return [one for one in observers if not (hasattr(one, "observe_agents") and one.observe_agents(observing))]

    def _observe_first(
        self, order: TurnOrder, part: TurnPart, observers: Sequence[Observer]
    ) -> dict[int, dict[str, Any]]:
        """Return slot -> state, for parts in which all agents have to observe before any decides."""
        seen = {i: self.make_observation(order.slots[i]) for i in part.select_present(part.observing)}
        self.seen = seen
        for observe in observers:
            observe([order.slots[i].agent for i in seen], list(seen.values()))
        return seen

    def stop_losers(self, turn: TurnMoves) -> tuple[Sequence[int], Sequence[Any]]:
        """Keep the agents where they are that lose conflicts; return their slots, and where they wanted to go."""
        if turn.paths is not None:
            places: MovePlaces = turn.list_places()
        else:
            places = turn.get_core_columns() if turn.columns is None else turn.columns
        losers = self._find_losers(turn.order, places, turn.took_part, turn.select_by_slot)
        self.conflicting = self._conflicts.in_core
        return turn.stop_each(losers) if len(losers) else (losers, losers)

    def _find_losers(
        self,
        order: TurnOrder,
        places: MovePlaces,
        took_part: bytes,
        named: MovesOf,
    ) -> memoryview:
        """Return the slots of the agents that lose conflicts of moves between these places."""
        conflicts: Any = self._settings.conflicts  # there are some
        turn = self.state.turn
        self.phase.judge = "A function of conflicts"
        try:
            return self._conflicts.find_losers(conflicts, order, turn, places, took_part, named, self._ctx)
        except Exception as error:
            error.add_note(f"In the conflicts {as_code(conflicts)}, in turn {turn}.")
            raise
        finally:
            self.phase.judge = ""

    def _apply_actions(self, turn: TurnMoves, part: TurnPart, block: AgentBlock) -> None:
        """Write positions on edges, headings, flights and named edges of a part to the agents and the game."""
        rows = turn.order.selection.rows
        paths = turn.paths
        for i in part.select_present(part.paced):
            block.set_progress(rows[i], None if paths is None else paths.get_progress(i))
        for i, action in turn.actions.items():
            slot = turn.slots[i]
            if action.heading != ():
                block.set(slot.row, "heading", action.heading)
            if slot.obeys_turns:
                edges = [leg.edge for leg in turn.find_track(i).legs if leg.end == 1.0]
                self.legality.drive_on(slot, edges, self.state.driven)
            if slot.flies:
                slot.counts["moves"] += action.position not in (None, block.flights.get_position(slot.row))
                if action.position is not None:
                    block.fly(slot.row, action.position)
                if action.quat is not None:
                    block.set_rotation(slot.row, action.quat)
        named = turn.find_named_edges()
        if named:
            self.state.note_named_edges(named)
