"""What engines and clients do with a game and programs don't: `ctx.game.internals`."""

from collections.abc import Callable, Sequence
from typing import Any

from gamms.deciding import DecidePhase, Guarded, refused_while_deciding
from gamms.game.ruleset import NamedRule
from gamms.game.snapshots import SnapshotTaker
from gamms.game.turn import Observer
from gamms.ir.agents import Position
from gamms.ir.game_state import GameState
from gamms.typing.agent_engine import IAgent


class GameInternals(Guarded):
    """The parts of a game that the recorder, scenarios and the context use; not for strategies.

    Args:
        parts: of the game.
        phase: of the context.

    Attributes:
        state: the state of the game.
        draw_start: called by `reset` with another seed, to draw what the start has from the seed; None: nothing.
        after_reset: called after each reset, in order.
        after_observing: called in every turn with the agents and their states before any agent decides, in order.
        scenario: what the game was built from, as plain values, for the recorder; None: by a program.
    """

    _called = "ctx.game.internals"

    def __init__(self, parts: SnapshotTaker, phase: DecidePhase) -> None:
        self._parts, self._phase = parts, phase
        self.state: GameState = parts.state
        self.draw_start: Callable[[], None] | None = None
        self.after_reset: list[Callable[[], None]] = []
        self.after_observing: list[Observer] = []
        self.scenario: dict[str, Any] | None = None

    @property
    def starts(self) -> dict[str, int | Position]:
        """Agent -> where it began, once the game has begun."""
        began = self.state.began
        if self.state.start is None:
            return dict(began)
        return {name: self.start_of(agent) for name, agent in self._parts.ctx.agent.agents.items()} | began

    def start_of(self, agent: IAgent) -> int | Position:
        """Return where an agent began: a node id, or (x, y, z)."""
        state, start = self.state, self.state.start
        place: int | Position
        if agent.name in state.began:
            place = state.began[agent.name]
        elif state.has_begun and start is not None:
            place = start.snapshot.place_of(agent)
        else:
            place = getattr(agent, "position", agent.current_node_id)
        return place

    @refused_while_deciding
    def restore_rules(self, rules: Sequence[NamedRule]) -> None:
        """Replace all rules; nothing is prepared again."""
        self._parts.rules.restore(tuple(rules))

    @property
    def is_time_up(self) -> bool:
        """Whether all turns of `run` or of the settings were played."""
        return self.state.turn in (self.state.last_turn, self._parts.settings.max_turns)

    @refused_while_deciding
    def close(self) -> None:
        """End the game, because its context ends, if that is in the middle of a turn which is not the last one."""
        turns, state = self._parts.turns, self.state
        turns.close()
        if turns.is_playing and state.over is None and not self.is_time_up:
            state.over = {"reason": "closed", "winner": None, "truncated": True}
