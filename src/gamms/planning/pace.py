"""How long the parts of a search take, and whether another one fits into what is left of its time."""

from collections.abc import Mapping
from math import inf
from time import perf_counter
from typing import Any

from gamms.typing.game import State, Strategy

_RESERVE = 1.05  # by how much longer than planned all of a decision may take
_MARGIN = 4.0  # mean deviations, by which a step may take longer than usual


class Cost:
    """How long steps of one kind take: their mean, and their mean deviation from it, both of the last dozen.

    The estimator that TCP has for round trips (Jacobson: Congestion avoidance and control, SIGCOMM 1988).
    """

    def __init__(self) -> None:
        self.mean, self._deviation, self.least = 0.0, 0.0, inf

    def note(self, seconds: float) -> None:
        """Take in how long a step took."""
        if self.least == inf:
            self.mean, self._deviation = seconds, seconds / 2.0
        error = seconds - self.mean
        self.mean += error / 8.0
        self._deviation += (abs(error) - self._deviation) / 4.0
        self.least = min(self.least, seconds)

    def most(self) -> float:
        """Return how long the next step probably takes at most; 0 before the first one."""
        return self.mean + _MARGIN * self._deviation


class Pace:
    """How long the parts of a search take, from one decision to the next, and what agents do that have no time.

    Attributes:
        costs: of a model, a world, a turn, a value, and a whole iteration.
    """

    def __init__(self) -> None:
        self.costs = {kind: Cost() for kind in ("model", "world", "turn", "value", "iteration")}
        self._game: Any = None
        self._policies: Mapping[str, Strategy] = {}

    def follow(self, game: object, policies: Mapping[str, Strategy]) -> None:
        """Set what agents do in a game if there is no time for a model.

        Args:
            game: its context, or what its states have as "fork".
            policies: agent -> strategy.
        """
        self._game, self._policies = game, policies

    def knows(self, states: Mapping[str, State]) -> bool:
        """Return whether it has policies for these agents of this game."""
        fork: Any = next(iter(states.values()))["fork"]
        return (fork is self._game or fork.is_of(self._game)) and states.keys() <= self._policies.keys()

    def has_followed(self, states: Mapping[str, State], limit: float) -> bool:
        """Let agents follow their policies if there is no time for a model; return whether that is so."""
        cost = self.costs["model"]
        if _RESERVE * cost.most() <= limit or not self.knows(states):
            return False
        cost.note(cost.least)  # or one that took long would be the last
        for name, state in states.items():
            self._policies[name](state)
        fork: Any = next(iter(states.values()))["fork"]
        fork.note_search(dict.fromkeys(states, False))
        return True


class Timer:
    """Says whether there is time for another step of a search.

    Args:
        seconds: that the decision may take from now on.
        pace: of the decisions before.
    """

    def __init__(self, seconds: float, pace: Pace) -> None:
        self._began = self._last = self._iteration = perf_counter()
        self._end, self._costs = self._began + seconds / _RESERVE, pace.costs
        self._kind: str | None = "model"
        self._is_first = True

    def fits(self, kind: str, *, then: str | None = None) -> bool:
        """End the step under way, and return whether there is time for one of another kind, and one behind it.

        Args:
            kind: of the step that begins now: "world", "turn" or "value".
            then: of a step that has to follow.
        """
        now = self.end()
        needed = self._costs[kind].most() + (0.0 if then is None else self._costs[then].most())
        if kind == "world":
            self._iteration = now
            # An iteration that does not fit is lost. The first is begun all the same: it may be shorter than others.
            needed = needed if self._is_first else max(needed, self._costs["iteration"].mean)
        if now + needed > self._end:
            return False
        self._kind = kind
        return True

    def end(self) -> float:
        """End the step under way, and return the time."""
        now = perf_counter()
        if self._kind is not None:
            self._costs[self._kind].note(now - self._last)
        self._last, self._kind = now, None
        return now

    def end_iteration(self) -> None:
        """End an iteration that counts."""
        self._costs["iteration"].note(self.end() - self._iteration)
        self._is_first = False

    def is_past(self, share: float) -> bool:
        """Return whether more than a share of the time is over."""
        return self._last > self._began + share * (self._end - self._began)
