"""One turn: all agents observe the same world, decide, and move at once."""

from collections.abc import Callable, Iterable
from copy import copy
from functools import lru_cache
from operator import itemgetter
from time import perf_counter
from typing import TYPE_CHECKING, Any

from gamms.deciding import DecidePhase
from gamms.game.decisions import Decisions, memory_copy
from gamms.game.order import AgentSlot, Legality, ResolvedAction, TurnOrder
from gamms.game.settings import Settings
from gamms.ir.game_state import GameState
from gamms.readonly import ReadOnlyMapping, copied
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext
from gamms.typing.game import Move, Track
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
    """

    def __init__(self, ctx: HostContext, settings: Settings, state: GameState, phase: DecidePhase) -> None:
        self._ctx, self._settings, self._state, self._phase = ctx, settings, state, phase
        self._legality = Legality(ctx, settings)
        self._facts = ReadOnlyMapping(state.facts)
        self._loop: EventLoop | None = None
        self._order: TurnOrder | None = None
        self._order_key: tuple[Any, ...] = ()
        self.is_deciding = self.is_playing = False

    def order(self) -> TurnOrder:
        """Return the living agents, as they are asked in a turn."""
        if self._order is not None and self._phase.agent is not None:
            return self._order  # nothing changes while agents decide
        agents, state = self._ctx.agent, self._state
        block = agents.block
        block.locate()
        plans = self._settings.plans
        key = (block, block.structure_version, self._settings.legal, plans, state.stream_version)
        if self._order is None or self._order_key != key:
            self.update_counts()
            living = sorted([(name, agent) for name, agent in agents.agents.items() if agent.alive], key=itemgetter(0))
            access_of, follows_edges = agents.storage.turn_access, self._settings.legal == "edges"
            slots = [
                AgentSlot(one, access_of(one), state, self._ctx.seed, self._facts, follows_edges=follows_edges)
                for _, one in living
            ]
            self._order, self._order_key = TurnOrder(slots, block.progress, plans), key
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
        known = self._state.team_memories.get(slot.team)
        state["team_memory"] = memory_copy(known) if known else {}
        return state

    def play(self, observers: list[Observer]) -> None:
        """Observe, decide, resolve conflicts and move; `observers` are called before any agent decides."""
        began = perf_counter()
        turn = self._state.moves = self._ask(self.order(), observers)
        decided = perf_counter()
        if self._settings.conflicts is not None:
            self._resolve(turn)
        resolved = perf_counter()
        self._apply(turn)
        applied = perf_counter()
        spent = self._state.timings
        spent["decide"] += decided - began
        spent["resolve"] += resolved - decided
        spent["apply"] += applied - resolved

    def _ask(self, order: TurnOrder, observers: list[Observer]) -> "TurnMoves":
        """Ask all agents what they do.

        No agent sees what others decide: while a strategy runs, nothing can be changed, so what is seen right before an
        agent decides is what all see. Where a sensor may look at more than the world, all observe first.
        """
        starts, state = order.selection.of(self._ctx.agent.block.node), self._state
        decisions = Decisions(order.slots, starts, self._settings, state, self._phase, self._legality, self.observation)
        self.is_deciding = True
        try:
            seen = self._observe_first(order, observers)
            if seen is not None or state.team_memories or self._settings.time_budget is not None:
                for i, *_ in order.individuals:
                    decisions.ask(i, self.observation(order.slots[i]) if seen is None else seen[i])
            else:
                self._ask_individuals(order, starts, decisions)
            for commanded in order.commanded:
                if commanded.plan.arrays:
                    decisions.ask_arrays(commanded, self._ctx.seed, self._facts)
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
        decisions.close()
        return TurnMoves(order, starts, decisions.ends, decisions.actions)

    def _ask_individuals(self, order: TurnOrder, starts: list[int], decisions: Decisions) -> None:
        """Ask agents one by one, where neither memories of teams nor a time budget count."""
        near, phase, turn = self._ctx.graph.graph.neighborhoods, self._phase, self._state.turn
        ends, note, wait_for = decisions.ends, decisions.note, decisions.wait_for
        for i, agent, template, carried, last in order.individuals:
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

    def _observe_first(self, order: TurnOrder, observers: list[Observer]) -> dict[int, dict[str, Any]] | None:
        """Return the states of all by slot, where none may decide before all have observed; else None."""
        if order.see_world_only and not observers:
            return None
        seen = {i: self.observation(order.slots[i]) for i in order.observing}
        for observe in observers:
            observe([order.slots[i].agent for i in seen], list(seen.values()))
        return seen

    def _resolve(self, turn: "TurnMoves") -> None:
        """Stop the agents that the conflict resolver stops."""
        order, ground, conflicts = turn.order, turn.order.on_ground, self._settings.conflicts
        involved = getattr(conflicts, "involved", None)
        if involved is None:
            few = list(range(len(turn.slots))) if ground is None else ground
        else:
            few = involved(order.of_ground(turn.starts), order.of_ground(turn.ends))
            few = few if ground is None else [ground[i] for i in few]
        if few:
            turn.stop(conflicts.resolve(turn.named(few), self._ctx), few)  # type: ignore[union-attr] # asked where there is one

    def _apply(self, turn: "TurnMoves") -> None:
        """Write the moves into the columns of the agents."""
        block, order = self._ctx.agent.block, turn.order
        block.move_all(order.ground, order.of_ground(turn.ends))
        order.count_moves(turn.starts, turn.ends)
        for i in order.paced:
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


class TurnMoves:
    """The moves of one turn by slot: as lists for the engine, by name for rules and resolvers."""

    def __init__(
        self, order: TurnOrder, starts: list[int], ends: list[int], actions: dict[int, ResolvedAction]
    ) -> None:
        self.order, self.starts, self.ends, self.actions = order, starts, ends, actions
        self.slots = order.slots
        self._by_name: dict[str, Move] | None = None

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
            self._by_name = self.named(self.order.of_ground(list(range(len(self.slots)))))
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

    def stop(self, names: set[str], among: list[int]) -> None:
        """Keep the agents with these names where they are; they are among the slots given."""
        for i in among:
            slot = self.slots[i]
            if slot.name in names and self.ends[i] != self.starts[i]:
                slot.counts["blocked"] += 1
                self.ends[i] = self.starts[i]
                if i in self.actions:
                    self.actions[i] = self.actions[i]._replace(
                        end=self.starts[i], path=(self.starts[i],), times=(), progress=None
                    )
        self._by_name = None


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
