"""One turn: everybody observes the same world, decides, and moves at once."""

from time import perf_counter
from typing import TYPE_CHECKING, Any

from gamms.errors import GammsError
from gamms.game import memory
from gamms.game.errors import IllegalAction, Meddling
from gamms.game.judge import Plan, judged, reach, why_not
from gamms.game.seats import Seat
from gamms.typing.game import Move

if TYPE_CHECKING:
    from gamms.game.game import Game

States = list[dict[str, Any]]


def play_turn(game: "Game") -> None:
    """Observe, decide, resolve, apply."""
    seats = game.seats()
    began = perf_counter()
    starts, states = _observe(game, seats)
    observed = perf_counter()
    ends, plans = _decide(game, seats, starts, states)
    decided = perf_counter()
    turn = TurnMoves(seats, starts, ends, plans)
    game.turn_moves = turn
    if game.conflicts is not None:
        _resolve(game, turn)
    resolved = perf_counter()
    _apply(game, turn)
    applied = perf_counter()
    spent = game.timings
    spent["observe"] += observed - began
    spent["decide"] += decided - observed
    spent["resolve"] += resolved - decided
    spent["apply"] += applied - resolved


class TurnMoves:
    """The moves of one turn by seat: as lists for the engine, by name for rules and resolvers that ask."""

    def __init__(self, seats: list[Seat], starts: list[int], ends: list[int], plans: dict[int, Plan]) -> None:
        self.seats, self.starts, self.ends, self.plans = seats, starts, ends, plans
        self._by_name: dict[str, Move] | None = None

    def by_name(self) -> dict[str, Move]:
        """Agent -> its move, of all on the ground, in the order of the names."""
        if self._by_name is None:
            moves = {}
            for i, seat in enumerate(self.seats):
                if not seat.flies:
                    start, end, plan = self.starts[i], self.ends[i], self.plans.get(i)
                    path = plan.path if plan else (start,) if start == end else (start, end)
                    moves[seat.name] = Move(seat.name, seat.team, start, end, path)
            self._by_name = moves
        return self._by_name

    def stop(self, names: set[str]) -> None:
        """Let these agents stay."""
        for i, seat in enumerate(self.seats):
            if seat.name in names and self.ends[i] != self.starts[i]:
                seat.counts["blocked"] += 1
                self.ends[i] = self.starts[i]
                if i in self.plans:
                    self.plans[i] = self.plans[i]._replace(end=self.starts[i], path=(self.starts[i],), carry=0.0)
        self._by_name = None


def _observe(game: "Game", seats: list[Seat]) -> tuple[list[int], States]:
    node, position, quat = game.columns.node, game.columns.position, game.columns.quat
    near, turn, shared = game.ctx.graph.graph.neighborhoods, game.turn, game.team_memories
    starts, states = [], []
    for seat in seats:
        state = seat.template.copy()
        state["sensor"] = seat.agent.sense()
        row = seat.row
        here = node[row]
        if seat.flies:
            state["curr_pos"], state["quat"] = position[row], quat[row]
        else:
            state["curr_pos"] = here
            state["legal"] = near[here] if seat.speed is None and game.legal == "edges" else reach(game, seat, here)
        state["turn"] = turn
        known = shared.get(seat.team) if shared else None
        state["team_memory"] = memory.copied(known) if known else {}
        starts.append(here)
        states.append(state)
    return starts, states


def _decide(game: "Game", seats: list[Seat], starts: list[int], states: States) -> tuple[list[int], dict[int, Plan]]:
    """Where everybody wants to go: node ids, and more of it for those whose action says more than that."""
    ends, plans = list(starts), {}
    touched = _Watch(game)
    game.is_deciding = True
    try:
        for i, seat in enumerate(seats):
            agent, state = seat.agent, states[i]
            agent._state = state
            strategy = agent.strategy
            if strategy is None:
                continue
            begun = perf_counter() if game.time_budget else 0.0
            try:
                strategy(state)
                if touched.rows:
                    touched.undo(seat.name)
            except Exception as error:  # a strategy is anybody's code
                if game.on_error == "raise":
                    error.add_note(f"In the strategy of agent {seat.name!r}, in turn {game.turn}.")
                    raise
                _note(game, seat, "error", f"{type(error).__name__}: {error}")
                continue
            if game.time_budget and perf_counter() - begun > game.time_budget:
                _note(game, seat, "overrun", f"took longer than {game.time_budget} s")
                continue
            # NOTE: a legal node id comes first and in line: it is every move of most games (benchmarks/README.md).
            action = state.get("action")
            if type(action) is int and action in state["legal"] and seat.speed is None:
                ends[i] = action
            elif (plan := _planned(game, seat, starts[i], state)) is not None:
                ends[i], plans[i] = plan.end, plan
    finally:
        game.is_deciding = False
        touched.restore()
    touched.check_world()
    _share(game, seats, states)
    return ends, plans


def _planned(game: "Game", seat: Seat, here: int, state: dict[str, Any]) -> Plan | None:
    """What an action that is not a plain legal node leads to; None where the agent stays for its fault."""
    try:
        if "action" not in state:
            raise IllegalAction(f"its strategy set no state['action']; legal are {list(state['legal'])}")
        return judged(game, seat, here, state["action"])
    except GammsError as error:
        if game.on_illegal == "raise":
            raise IllegalAction(f"Agent {seat.name!r} in turn {game.turn}: {error}") from error
        _note(game, seat, "illegal", why_not(error))
        return None


def _share(game: "Game", seats: list[Seat], states: States) -> None:
    """Make one memory of what the members of each team have written."""
    writes: dict[Any, memory.Writes] = {}
    for seat, state in zip(seats, states, strict=True):
        written = state.get("team_memory")
        if written or seat.team in game.team_memories:
            writes.setdefault(seat.team, []).append((seat.name, written if isinstance(written, dict) else {}))
    for team, written_by in writes.items():
        before = game.team_memories.get(team, {})
        if any(memory.differs(written, before) for _, written in written_by):
            game.team_memories[team] = memory.copied(memory.merged(before, written_by))


def _resolve(game: "Game", turn: TurnMoves) -> None:
    stopped = game.conflicts.resolve(turn.by_name(), game.ctx)  # type: ignore[union-attr] # asked where there is one
    if stopped:
        turn.stop(stopped)


def _apply(game: "Game", turn: TurnMoves) -> None:
    columns, writer = game.columns, game.ctx.agent.moves
    rows, ends = [], []
    for seat, start, end in zip(turn.seats, turn.starts, turn.ends, strict=True):
        if not seat.flies:
            rows.append(seat.row)
            ends.append(end)
            if end != start:
                seat.counts["moves"] += 1
    writer.act_together(columns, rows, ends)
    for i, plan in turn.plans.items():
        seat = turn.seats[i]
        columns.carry[seat.row] = plan.carry
        if plan.heading != ():
            writer.turn(columns, seat.row, plan.heading)
        if seat.flies:
            seat.counts["moves"] += plan.position != columns.position[seat.row] and plan.position is not None
            writer.land(columns, seat.row, plan.position, plan.quat)


def _note(game: "Game", seat: Seat, kind: str, message: str) -> None:
    seat.counts[{"error": "errors", "overrun": "overruns"}.get(kind, kind)] += 1
    game.errors.append({"turn": game.turn, "agent": seat.name, "kind": kind, "message": message})


class _Watch:
    """Sees to it that nobody changes the world while strategies decide."""

    def __init__(self, game: "Game") -> None:
        columns = game.columns
        game.ctx.agent.standing()  # which settles what was touched before
        self._game, self._columns = game, columns
        self._own, self.rows = columns.touched, set[int]()
        columns.touched = self.rows
        self._before = {name: list(getattr(columns, name)) for name in ("node", "position", "quat", "teams", "alive")}
        self._world = self._seen()

    def undo(self, name: str) -> None:
        """Put everything back that a strategy has moved.

        Raises:
            Meddling: always: it was not for the strategy to do.
        """
        for column, values in self._before.items():
            getattr(self._columns, column)[:] = values
        self.rows.clear()
        raise Meddling(f"The strategy of agent {name!r} changed the agents; it may only set state['action'].")

    def restore(self) -> None:
        """Let changes be noted by the columns again."""
        self._columns.touched = self._own
        self._own |= self.rows

    def check_world(self) -> None:
        """Raise Meddling if the graph, the obstacles or who is there have changed."""
        if self._seen() != self._world:
            raise Meddling("A strategy changed the graph, the obstacles or the agents while others were deciding.")

    def _seen(self) -> tuple[Any, ...]:
        room = self._game.ctx.graph
        return room.graph.revision, room.obstacle_revision, tuple(self._game.ctx.agent.agents)
