"""One turn: all agents observe the same world, decide, and move at once."""

from collections.abc import Callable, Iterable
from functools import lru_cache
from operator import add, ne
from time import perf_counter
from typing import Any

from gamms.arguments import as_range
from gamms.deciding import DecidePhase
from gamms.errors import GammsError
from gamms.game import memory
from gamms.game.legality import IllegalAction, Legality, ResolvedAction
from gamms.game.random_streams import Draws, TurnGenerator
from gamms.game.settings import Settings
from gamms.ir.agents import Selection
from gamms.ir.game_state import GameState
from gamms.readonly import ReadOnlyMapping, copied
from gamms.text import shown
from gamms.typing import AgentType
from gamms.typing.game import Move, Track

COUNTED = ("moves", "blocked", "illegal", "errors", "overruns")

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

    def __init__(self, ctx: Any, settings: Settings, state: GameState, phase: DecidePhase) -> None:
        self._ctx, self._settings, self._state, self._phase = ctx, settings, state, phase
        self._legality = Legality(ctx, settings)
        self._facts = ReadOnlyMapping(state.facts)
        self._order: TurnOrder | None = None
        self._order_key: tuple[Any, ...] = ()
        self.is_deciding = self.is_playing = False

    def order(self) -> "TurnOrder":
        """Return the living agents, as they are asked in a turn."""
        if self._order is not None and self._phase.agent is not None:
            return self._order  # nothing changes while agents decide
        agents, state = self._ctx.agent, self._state
        agents.settle()
        columns = agents.columns
        key = (columns, columns.roster, self._settings.legal, state.stream_version)
        if self._order is None or self._order_key != key:
            self.update_counts()
            living = [agent for agent in agents.agents.values() if agent.alive]
            slots = [self._slot(agent) for agent in sorted(living, key=lambda agent: agent.name)]
            self._order, self._order_key = TurnOrder(slots, columns.progress), key
            state.players.update((slot.name, slot.agent) for slot in slots)
        return self._order

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
        """Let the next turn be played from a state that was restored."""
        order = self.order() if drawn else self._order
        if order is not None:
            order.restart_counts()
            for slot in order.slots:
                draws, rng = drawn.get(slot.name, (None, None))
                slot.draws.go_to(draws)
                slot.rng.go_to(rng)

    def observation(self, slot: "AgentSlot") -> dict[str, Any]:
        """Return the state that an agent gets now; its sensors are asked."""
        agents, row = self._ctx.agent, slot.row
        columns = agents.columns
        state = slot.template.copy()
        state["sensor"] = sensed = slot.agent.sense()
        for name in slot.foreign:
            sensed[name] = _own_copy(name, *sensed[name])
        here = columns.node[row]
        if slot.flies:
            state["curr_pos"], state["quat"] = columns.position[row], columns.quat[row]
        else:
            state["curr_pos"] = here
            state["legal"] = self._legality.reachable(slot, here)
        state["turn"] = self._state.turn
        known = self._state.team_memories.get(slot.team)
        state["team_memory"] = memory.copied(known) if known else {}
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

    def _slot(self, agent: Any) -> "AgentSlot":
        return AgentSlot(agent, self._state, self._ctx.seed, self._facts, follows_edges=self._settings.legal == "edges")

    def _ask(self, order: "TurnOrder", observers: list[Observer]) -> "TurnMoves":
        """Let all agents observe and decide.

        No agent sees what others decide: while a strategy runs, nothing can be changed, so what is seen right before an
        agent decides is what all see. Where a sensor may look at more than the world, all observe first.
        """
        decisions = _Decisions(self, order.slots)
        seen, usual = self._observe_first(order, observers), order.usual
        if seen is not None or self._settings.time_budget is not None or self._state.team_memories:
            usual = [(agent, None) for agent, _ in usual]
        starts, turn = order.selection.of(self._ctx.agent.columns.node), self._state.turn
        near, phase = self._ctx.graph.graph.neighborhoods, self._phase
        end, note = decisions.ends.append, decisions.note
        self.is_deciding = True
        try:
            for here, (agent, template) in zip(starts, usual, strict=True):
                strategy = agent.strategy
                if template is None or strategy is None:
                    end(decisions.ask(here, seen))
                    continue
                # NOTE: the usual agent is served in line (benchmarks/README.md, turns); `_Decisions.ask` does the same.
                sensed = {}
                for key, sensor in agent._carried:
                    sensor.sense(here)
                    sensed[key] = (sensor.type, sensor._last[0])
                agent._last[0] = state = template.copy()
                state["curr_pos"], state["sensor"], state["turn"] = here, sensed, turn
                state["legal"] = legal = near[here]
                noted: dict[Any, Any] = {}
                state["team_memory"] = noted
                phase.agent = agent
                try:
                    strategy(state)
                    phase.agent = None
                    action = state["action"]
                except Exception as error:  # noqa: BLE001 - a strategy is the caller's code
                    phase.agent = None
                    end(decisions.failed(here, state, error))
                    continue
                if type(action) is not int or action not in legal:
                    action = decisions.resolve(here, state)
                if noted:
                    note(noted)
                end(action)
        finally:
            phase.agent, self.is_deciding = None, False
        decisions.close()
        return TurnMoves(order, starts, decisions.ends, decisions.actions)

    def _observe_first(self, order: "TurnOrder", observers: list[Observer]) -> list[dict[str, Any]] | None:
        """Return the states of all, where none may decide before all have observed; else None."""
        if order.see_world_only and not observers:
            return None
        seen = [self.observation(slot) for slot in order.slots]
        for observe in observers:
            observe([slot.agent for slot in order.slots], seen)
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
        columns, writer, order = self._ctx.agent.columns, self._ctx.agent.moves, turn.order
        writer.act_together(columns, order.ground, order.of_ground(turn.ends))
        order.count_moves(turn.starts, turn.ends)
        for i in order.paced:
            columns.set_progress(turn.slots[i].row, turn.actions[i].progress if i in turn.actions else None)
        for i, action in turn.actions.items():
            slot = turn.slots[i]
            if action.heading != ():
                writer.turn(columns, slot.row, action.heading)
            if slot.flies:
                slot.counts["moves"] += action.position not in (None, columns.position[slot.row])
                writer.land(columns, slot.row, action.position, action.quat)


class _Decisions:
    """What has been decided in a turn so far; the next agent to be asked has as many ends before it."""

    def __init__(self, engine: TurnEngine, slots: list["AgentSlot"]) -> None:
        self._engine, self._slots = engine, slots
        self._settings, self._state, self._phase = engine._settings, engine._state, engine._phase
        self.ends: list[int] = []
        self.actions: dict[int, ResolvedAction] = {}
        self._written: list[tuple[AgentSlot, Any]] = []
        self._failures: list[tuple[AgentSlot, str, str]] = []  # not published before all have decided

    def close(self) -> None:
        """Publish what went wrong and merge the team memories, once all have decided."""
        for slot, kind, message in self._failures:
            slot.counts[{"error": "errors", "overrun": "overruns"}.get(kind, kind)] += 1
            error = {"turn": self._state.turn, "agent": slot.name, "kind": kind, "message": message}
            self._state.errors.append(error)
        if self._written:
            self._merge_team_memories()

    def ask(self, here: int, seen: list[dict[str, Any]] | None) -> int:
        """Let one agent of any kind decide; return the node it goes to."""
        slot, budget = self._slot, self._settings.time_budget
        agent = slot.agent
        agent._last[0] = state = self._engine.observation(slot) if seen is None else seen[len(self.ends)]
        if agent.strategy is None:
            return here
        began = perf_counter()
        self._phase.agent = agent
        try:
            agent.strategy(state)
        except Exception as error:  # noqa: BLE001 - a strategy is the caller's code
            self._phase.agent = None
            return self.failed(here, state, error)
        finally:
            self._phase.agent = None
        if budget is not None and perf_counter() - began > budget:
            self._failures.append((slot, "overrun", f"took longer than {budget} s"))
            end = here
        else:
            end = self.resolve(here, state)
        if state.get("team_memory") or slot.team in self._state.team_memories:
            self.note(state.get("team_memory"))
        return end

    def note(self, team_memory: Any) -> None:
        """Take what an agent has made of its copy of the team's memory."""
        self._written.append((self._slot, team_memory))

    def resolve(self, here: int, state: dict[str, Any]) -> int:
        """Return the node to which the action of an agent leads."""
        slot, legality = self._slot, self._engine._legality
        try:
            if "action" not in state:
                legal = list(legality.reachable(slot, here))
                raise IllegalAction(f"its strategy set no state['action']; legal are {legal}")
            action = legality.resolve(slot, here, state["action"])
        except GammsError as error:
            if self._settings.on_illegal == "raise":
                raise IllegalAction(f"Agent {shown(slot.name)} in turn {self._state.turn}: {error}") from error
            self._failures.append((slot, "illegal", f"{type(error).__name__}: {error}"))
            return here
        self.actions[len(self.ends)] = action
        return action.end

    def failed(self, here: int, state: dict[str, Any], error: Exception) -> int:
        """Let an agent stay whose strategy raised; or raise, by the settings."""
        slot = self._slot
        if isinstance(error, KeyError) and "action" not in state and error.args == ("action",):
            return self.resolve(here, state)  # not the strategy's error: it has set no action
        if self._settings.on_error == "raise":
            error.add_note(f"In the strategy of agent {slot.name!r}, in turn {self._state.turn}.")
            raise error
        self._failures.append((slot, "error", f"{type(error).__name__}: {error}"))
        return here

    def _merge_team_memories(self) -> None:
        """Make one memory of what the members of each team have written."""
        shared = self._state.team_memories
        writes: dict[Any, memory.Writes] = {}
        for slot, copy in self._written:
            writes.setdefault(slot.team, []).append((slot.name, copy if isinstance(copy, dict) else {}))
        for team, copies in writes.items():
            before = shared.get(team, {})
            if any(memory.differs(copy, before) for _, copy in copies):
                shared[team] = memory.copied(memory.merged(before, copies))

    @property
    def _slot(self) -> "AgentSlot":
        """The agent that is asked now."""
        return self._slots[len(self.ends)]


class TurnMoves:
    """The moves of one turn by slot: as lists for the engine, by name for rules and resolvers."""

    def __init__(
        self, order: "TurnOrder", starts: list[int], ends: list[int], actions: dict[int, ResolvedAction]
    ) -> None:
        self.order, self.starts, self.ends, self.actions = order, starts, ends, actions
        self.slots = order.slots
        self._by_name: dict[str, Move] | None = None

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

    def tracks(self, agents: Iterable[Any]) -> list[Track]:
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
        """Let the agents with these names stay, which are among the slots given."""
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


class AgentSlot:
    """What the turn engine holds of one living agent.

    Args:
        agent: the agent.
        state: of the game.
        seed: of the game.
        facts: a read-only view of what was published.
        follows_edges: whether moves must follow edges.

    Attributes:
        agent: the agent; Any: the agent engine's own class.
        name, team, row: its own.
        flies: whether it is in the air.
        speed: how far it may go in a turn, in the unit of the game; None for one edge.
        is_plain: whether it moves along one edge, on the ground.
        draws, rng: its random numbers.
        template: its state, but for what changes from turn to turn.
        sees_world_only: whether all its sensors are built-in ones, which look at nothing but the graph and the agents.
        foreign: the names of its sensors of the caller's own classes.
        counts: how often it moved, was blocked, and so on; see `COUNTED`.
    """

    __slots__ = (
        "agent",
        "counts",
        "draws",
        "flies",
        "foreign",
        "is_plain",
        "name",
        "rng",
        "row",
        "sees_world_only",
        "speed",
        "team",
        "template",
    )

    def __init__(self, agent: Any, state: GameState, seed: int, facts: Any, *, follows_edges: bool) -> None:
        self.agent = agent
        self.name, self.team, self.row = agent.name, agent.team, agent._row
        self.flies = agent.type is AgentType.AERIAL
        self.speed = None if self.flies else _speed(agent)
        self.is_plain = not self.flies and self.speed is None and follows_edges
        self.draws, self.rng = Draws(seed, state, self.name), TurnGenerator(seed, state, self.name)
        self.template: dict[str, Any] = _with_shared_keys(
            {
                "curr_pos": None,
                **({"quat": None} if self.flies else {}),
                "sensor": None,
                "name": self.name,
                "team": self.team,
                "turn": 0,
                "legal": (),
                "draw": self.draws,
                "rng": self.rng,
                "memory": state.memory_of(self.name),
                "team_memory": None,
                "facts": facts,
            }
        )
        sensors = agent._sensor_list.items()
        self.foreign = [name for name, sensor in sensors if not type(sensor).__module__.startswith("gamms.sensor.")]
        self.sees_world_only = all(_sees_world_only(type(sensor)) for _, sensor in sensors)
        self.counts = state.counts.setdefault(self.name, dict.fromkeys(COUNTED, 0))


class TurnOrder:
    """The living agents in the order of their names, and what each turn needs of them.

    Args:
        slots: of the agents, sorted by name.
        progress: by row of the agents, on the edge that one has covered part of.

    Attributes:
        slots: the slots.
        usual: per slot, what a usual turn needs, in the form that is read fastest: the agent, and its template if it
            is plain.
        selection: the rows of all.
        see_world_only: whether no agent has a sensor that may look at more than the graph and the agents.
        on_ground: the indices of the slots of agents on the ground; None: all.
        ground: the rows of these.
        index_of: name -> index of the slot.
        paced: the indices of the slots of agents on the ground that may cover part of an edge.
    """

    def __init__(self, slots: list[AgentSlot], progress: list[Any]) -> None:
        self.slots = slots
        self.usual = [(slot.agent, slot.template if slot.is_plain else None) for slot in slots]
        self.see_world_only = all(slot.sees_world_only for slot in slots)
        ground = [i for i, slot in enumerate(slots) if not slot.flies]
        self.on_ground = None if len(ground) == len(slots) else ground
        self.selection = Selection([slot.row for slot in slots])
        self.ground = self.selection if self.on_ground is None else Selection([slots[i].row for i in ground])
        self.index_of = {slot.name: i for i, slot in enumerate(slots)}
        self.paced = [i for i, slot in enumerate(slots) if slot.speed is not None or progress[slot.row]]
        self._moved = [0] * len(slots)

    def of_ground(self, values: list[Any]) -> list[Any]:
        """Return those values, one per slot, that are of agents on the ground."""
        return values if self.on_ground is None else [values[i] for i in self.on_ground]

    def count_moves(self, starts: list[int], ends: list[int]) -> None:
        """Count the agents that have moved."""
        # NOTE: in C, because all agents are counted in every turn (benchmarks/README.md, turns).
        self._moved = list(map(add, self._moved, map(ne, starts, ends)))

    def update_counts(self) -> None:
        """Add the counted moves to the counts of the agents."""
        for slot, moved in zip(self.slots, self._moved, strict=True):
            slot.counts["moves"] += moved
        self.restart_counts()

    def restart_counts(self) -> None:
        """Count moves from here."""
        self._moved = [0] * len(self.slots)


class _Layout:
    """Its instances have the keys that states share."""


def _with_shared_keys(template: dict[str, Any]) -> dict[str, Any]:
    """Return an equal dict whose copies share one table of keys, which has room for the action.

    Python has such dicts for the attributes of instances (PEP 412); without them states would be twice as large, and
    those of 1,000 agents would not stay in the cache (benchmarks/README.md, turns).
    """
    instance = _Layout()
    for key in (*template, "action"):
        setattr(instance, key, template.get(key))
    del instance.action  # type: ignore[attr-defined]
    return instance.__dict__


def _sees_world_only(kind: type) -> bool:
    return kind.__module__.startswith("gamms.sensor.") and kind.__module__ != "gamms.sensor.function"


def _own_copy(name: str, kind: Any, data: Any) -> tuple[Any, Any]:
    """Copy what a sensor of the caller's class shows, which may show the same to several agents."""
    try:
        return kind, copied(data)
    except Exception as error:
        error.add_note(f"What the sensor {name!r} shows is copied: every agent gets its own.")
        raise


def _speed(agent: Any) -> float | None:
    if agent.speed is None:
        return None
    try:
        return as_range(agent.speed, f"speed of agent {agent.name!r}")
    except GammsError as error:
        error.add_note("On the ground it is what ctx.game lets the agent move in a turn; None for one edge.")
        raise
