"""One turn: everybody observes the same world, decides, and moves at once."""

from collections.abc import Iterable
from functools import lru_cache
from time import perf_counter
from typing import TYPE_CHECKING, Any

from gamms.errors import GammsError
from gamms.game import memory
from gamms.game.errors import IllegalAction
from gamms.game.judge import Plan, judged, reach, why_not
from gamms.game.seats import Seat, Seating
from gamms.readonly import copied
from gamms.typing.game import Move, Track

if TYPE_CHECKING:
    from gamms.game.game import Game


def play_turn(game: "Game") -> None:
    """Observe, decide, resolve, apply."""
    began = perf_counter()
    turn = game._turn_moves = _ask(game, game.seating())
    decided = perf_counter()
    if game.conflicts is not None:
        _resolve(game, turn)
    resolved = perf_counter()
    _apply(game, turn)
    applied = perf_counter()
    spent = game.timings
    spent["decide"] += decided - began
    spent["resolve"] += resolved - decided
    spent["apply"] += applied - resolved


class TurnMoves:
    """The moves of one turn by seat: as lists for the engine, by name for rules and resolvers that ask."""

    def __init__(self, seating: Seating, starts: list[int], ends: list[int], plans: dict[int, Plan]) -> None:
        self.seating, self.starts, self.ends, self.plans = seating, starts, ends, plans
        self.seats = seating.seats
        self._by_name: dict[str, Move] | None = None

    def by_name(self) -> dict[str, Move]:
        """Agent -> its move, of all on the ground, in the order of the names."""
        if self._by_name is None:
            self._by_name = self.named(self.seating.of_ground(list(range(len(self.seats)))))
        return self._by_name

    def named(self, places: list[int]) -> dict[str, Move]:
        """Agent -> its move, of these seats."""
        moves = {}
        for i in places:
            seat = self.seats[i]
            moves[seat.name] = Move(seat.name, seat.team, self.starts[i], self.ends[i], self._track(i)[0])
        return moves

    def tracks(self, agents: Iterable[Any]) -> list[Track]:
        """How agents came to where they are; those that were put there since, or flew there, are there only at 1."""
        place_of, seats, ends, track = self.seating.place_of, self.seats, self.ends, self._track
        tracks: list[Track] = []
        for agent in agents:
            node, i = agent.current_node_id, place_of.get(agent.name)
            if i is None or ends[i] != node or seats[i].agent is not agent or (seats[i].flies and self._flew(i)):
                tracks.append(((node,), (1.0,)))
            else:
                tracks.append(track(i))
        return tracks

    def _track(self, i: int) -> Track:
        """The nodes of a move, and when an agent is at each."""
        plan = self.plans.get(i)
        if plan is not None:
            return plan.path, plan.times or _evenly(len(plan.path))
        start, end = self.starts[i], self.ends[i]
        return ((start,), (0.0,)) if start == end else ((start, end), (0.0, 1.0))

    def _flew(self, i: int) -> bool:
        """Whether a flyer has changed its position."""
        plan = self.plans.get(i)
        return plan is not None and plan.position not in (None, self.seats[i].agent.prev_position)

    def stop(self, names: set[str], among: list[int]) -> None:
        """Let these agents stay; they sit in some of the seats given."""
        for i in among:
            seat = self.seats[i]
            if seat.name in names and self.ends[i] != self.starts[i]:
                seat.counts["blocked"] += 1
                self.ends[i] = self.starts[i]
                if i in self.plans:
                    self.plans[i] = self.plans[i]._replace(
                        end=self.starts[i], path=(self.starts[i],), times=(), progress=None
                    )
        self._by_name = None


@lru_cache(maxsize=256)
def _evenly(nodes: int) -> tuple[float, ...]:
    """When an agent is at each of so many nodes if all edges take equally long."""
    return tuple(k / max(1, nodes - 1) for k in range(nodes))


def _ask(game: "Game", seating: Seating) -> TurnMoves:
    """Let everybody observe and decide.

    Nobody sees what others decide: while a strategy runs, nothing can be changed, so what is seen right before an agent
    decides is what all see. Where a sensor may look at more than the world, all observe first.
    """
    asked, seen, usual = _Asked(game, seating), _seen_before(game, seating), seating.usual
    if seen is not None or game.time_budget is not None or game.team_memories:
        usual = [(agent, None) for agent, _ in usual]
    starts, near, turn = seating.who.of(game.columns.node), game.ctx.graph.graph.neighborhoods, game.turn
    end, note, phase = asked.ends.append, asked.note, game._phase
    game.is_deciding = True
    try:
        for here, (agent, template) in zip(starts, usual, strict=True):
            strategy = agent.strategy
            if template is None or strategy is None:
                end(asked.ask(here, seen))
                continue
            # NOTE: the usual agent is served in line (benchmarks/README.md, turns); `_Asked.ask` does the same.
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
            except Exception as error:  # noqa: BLE001 - a strategy is anybody's code
                phase.agent = None
                end(asked.failed(here, state, error))
                continue
            if type(action) is not int or action not in legal:
                action = asked.judge(here, state)
            if noted:
                note(noted)
            end(action)
    finally:
        phase.agent, game.is_deciding = None, False
    asked.close()
    return TurnMoves(seating, starts, asked.ends, asked.plans)


def _seen_before(game: "Game", seating: Seating) -> list[dict[str, Any]] | None:
    """The states of all, where nobody may decide before all have observed; else None."""
    if seating.see_world_only and not game.after_observing:
        return None
    seen = [observed(game, seat) for seat in seating.seats]
    for tell in game.after_observing:
        tell([seat.agent for seat in seating.seats], seen)
    return seen


class _Asked:
    """What has been asked and answered in a turn so far; the next to be asked has as many ends before it."""

    def __init__(self, game: "Game", seating: Seating) -> None:
        self.game, self.seats = game, seating.seats
        self.ends: list[int] = []
        self.plans: dict[int, Plan] = {}
        self.written: list[tuple[Seat, Any]] = []
        self.noted: list[tuple[Seat, str, str]] = []  # what went wrong: not told before all have decided

    def close(self) -> None:
        """Tell what went wrong, and make one memory of each team's, once all have decided."""
        for seat, kind, message in self.noted:
            _note(self.game, seat, kind, message)
        if self.written:
            _share(self.game, self.written)

    def ask(self, here: int, seen: list[dict[str, Any]] | None) -> int:
        """Let one agent of any kind decide; where it goes."""
        game, seat = self.game, self._seat
        agent = seat.agent
        agent._last[0] = state = observed(game, seat) if seen is None else seen[len(self.ends)]
        if agent.strategy is None:
            return here
        begun = perf_counter()
        game._phase.agent = agent
        try:
            agent.strategy(state)
        except Exception as error:  # noqa: BLE001 - a strategy is anybody's code
            game._phase.agent = None
            return self.failed(here, state, error)
        finally:
            game._phase.agent = None
        if game.time_budget is not None and perf_counter() - begun > game.time_budget:
            self.noted.append((seat, "overrun", f"took longer than {game.time_budget} s"))
            end = here
        else:
            end = self.judge(here, state)
        if state.get("team_memory") or seat.team in game.team_memories:
            self.note(state.get("team_memory"))
        return end

    def note(self, team_memory: Any) -> None:
        """Keep what an agent has left as the memory of its team."""
        self.written.append((self._seat, team_memory))

    def judge(self, here: int, state: dict[str, Any]) -> int:
        """Where an agent goes by what its strategy has set."""
        game, seat = self.game, self._seat
        try:
            if "action" not in state:
                raise IllegalAction(f"its strategy set no state['action']; legal are {list(_legal(game, seat, here))}")
            plan = judged(game, seat, here, state["action"])
        except GammsError as error:
            if game.on_illegal == "raise":
                raise IllegalAction(f"Agent {seat.name!r} in turn {game.turn}: {error}") from error
            self.noted.append((seat, "illegal", why_not(error)))
            return here
        self.plans[len(self.ends)] = plan
        return plan.end

    def failed(self, here: int, state: dict[str, Any], error: Exception) -> int:
        """Stay, because a strategy raised; or raise, because the game is set so."""
        game, seat = self.game, self._seat
        if isinstance(error, KeyError) and "action" not in state and error.args == ("action",):
            return self.judge(here, state)  # not the strategy's error: it has set no action
        if game.on_error == "raise":
            error.add_note(f"In the strategy of agent {seat.name!r}, in turn {game.turn}.")
            raise error
        self.noted.append((seat, "error", f"{type(error).__name__}: {error}"))
        return here

    @property
    def _seat(self) -> Seat:
        """Whose turn it is."""
        return self.seats[len(self.ends)]


def observed(game: "Game", seat: Seat) -> dict[str, Any]:
    """The state of an agent of any kind."""
    columns, row = game.columns, seat.row
    state = seat.template.copy()
    state["sensor"] = sensed = seat.agent.sense()
    for name in seat.foreign:
        sensed[name] = _own_copy(name, *sensed[name])
    here = columns.node[row]
    if seat.flies:
        state["curr_pos"], state["quat"] = columns.position[row], columns.quat[row]
    else:
        state["curr_pos"] = here
        state["legal"] = _legal(game, seat, here)
    state["turn"] = game.turn
    known = game.team_memories.get(seat.team)
    state["team_memory"] = memory.copied(known) if known else {}
    return state


def _own_copy(name: str, kind: Any, data: Any) -> tuple[Any, Any]:
    """What a sensor of a caller's class shows, as an agent's own: it may show the same to several."""
    try:
        return kind, copied(data)
    except Exception as error:
        error.add_note(f"What the sensor {name!r} shows is copied: every agent gets its own.")
        raise


def _legal(game: "Game", seat: Seat, here: int) -> tuple[int, ...]:
    """The nodes that an agent may move to, its own first; none for those that fly."""
    if seat.flies:
        return ()
    return game.ctx.graph.graph.neighborhoods[here] if seat.is_plain else reach(game, seat, here)


def _share(game: "Game", written: list[tuple[Seat, Any]]) -> None:
    """Make one memory of what the members of each team have written."""
    writes: dict[Any, memory.Writes] = {}
    for seat, copy in written:
        writes.setdefault(seat.team, []).append((seat.name, copy if isinstance(copy, dict) else {}))
    for team, copies in writes.items():
        before = game.team_memories.get(team, {})
        if any(memory.differs(copy, before) for _, copy in copies):
            game.team_memories[team] = memory.copied(memory.merged(before, copies))


def _resolve(game: "Game", turn: TurnMoves) -> None:
    seating, ground = turn.seating, turn.seating.on_ground
    involved = getattr(game.conflicts, "involved", None)
    if involved is None:
        few = list(range(len(turn.seats))) if ground is None else ground
    else:
        few = involved(seating.of_ground(turn.starts), seating.of_ground(turn.ends))
        few = few if ground is None else [ground[i] for i in few]
    if few:
        stopped = game.conflicts.resolve(turn.named(few), game.ctx)  # type: ignore[union-attr] # asked where there is one
        turn.stop(stopped, few)


def _apply(game: "Game", turn: TurnMoves) -> None:
    columns, writer, seating = game.columns, game.ctx.agent.moves, turn.seating
    writer.act_together(columns, seating.ground, seating.of_ground(turn.ends))
    seating.count_moves(turn.starts, turn.ends)
    for i in seating.paced:
        columns.set_progress(turn.seats[i].row, turn.plans[i].progress if i in turn.plans else None)
    for i, plan in turn.plans.items():
        seat = turn.seats[i]
        if plan.heading != ():
            writer.turn(columns, seat.row, plan.heading)
        if seat.flies:
            seat.counts["moves"] += plan.position not in (None, columns.position[seat.row])
            writer.land(columns, seat.row, plan.position, plan.quat)


def _note(game: "Game", seat: Seat, kind: str, message: str) -> None:
    seat.counts[{"error": "errors", "overrun": "overruns"}.get(kind, kind)] += 1
    game.errors.append({"turn": game.turn, "agent": seat.name, "kind": kind, "message": message})
