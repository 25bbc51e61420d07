"""Measure the duration of search steps, and decide whether another step fits into the remaining time."""

from collections.abc import Mapping
from math import inf
from time import perf_counter
from typing import Any

from gamms.typing.game import State, Strategy

_RESERVE = 1.05  # factor by which the whole decision may take longer than planned
_MARGIN = 4.0  # mean deviations by which a step may take longer than usual


class StepTime:
    """The duration of steps of one kind: mean and mean deviation, over about the last dozen.

    The estimator that TCP has for round trips (Jacobson: Congestion avoidance and control, SIGCOMM 1988).
    """

    def __init__(self) -> None:
        self.mean = 0.0
        self._deviation = 0.0
        self.least = inf

    def note(self, seconds: float) -> None:
        """Add the duration of a step."""
        if self.least == inf:
            self.mean = seconds
            self._deviation = seconds / 2.0
        error = seconds - self.mean
        self.mean += error / 8.0
        self._deviation += (abs(error) - self._deviation) / 4.0
        self.least = min(self.least, seconds)

    def estimate_most(self) -> float:
        """Return an upper estimate of the next step's duration; 0 before the first one."""
        return self.mean + _MARGIN * self._deviation


class SearchPace:
    """The duration of search steps across decisions, and the policies of agents that have no time to search.

    Attributes:
        costs: the duration of a model, a world, a turn, a value, and a whole iteration.
    """

    def __init__(self) -> None:
        self.costs = {kind: StepTime() for kind in ("model", "world", "turn", "value", "iteration")}
        self._game: Any = None
        self._policies: Mapping[str, Strategy] = {}

    def follow(self, game: object, policies: Mapping[str, Strategy]) -> None:
        """Set the policies that agents of a game follow if there is no time for a model.

        Args:
            game: the context of the game, or "fork" in its states.
            policies: agent -> strategy.
        """
        self._game = game
        self._policies = policies

    def has_policies(self, states: Mapping[str, State]) -> bool:
        """Return whether it has policies for these agents of this game."""
        fork: Any = next(iter(states.values()))["fork"]
        return (fork is self._game or fork.is_of(self._game)) and states.keys() <= self._policies.keys()

    def has_followed(self, states: Mapping[str, State], limit: float) -> bool:
        """If there is no time for a model, call the agents' policies and return True."""
        cost = self.costs["model"]
        if _RESERVE * cost.estimate_most() <= limit or not self.has_policies(states):
            return False
        cost.note(cost.least)  # otherwise one slow model would be the last
        for name, state in states.items():
            self._policies[name](state)
        fork: Any = next(iter(states.values()))["fork"]
        fork.note_search(dict.fromkeys(states, False))
        return True


class SearchTimer:
    """Decides whether there is time for another step of a search.

    Args:
        seconds: the time for the decision from now on.
        pace: the duration of steps in earlier decisions.
    """

    def __init__(self, seconds: float, pace: SearchPace) -> None:
        self._began = perf_counter()
        self._last = self._began
        self._iteration = self._began
        self._end = self._began + seconds / _RESERVE
        self._costs = pace.costs
        self._kind: str | None = "model"
        self._is_first = True

    def has_time(self, kind: str, *, then: str | None = None) -> bool:
        """End the current step, and return whether there is time for a step of another kind and its follower.

        Args:
            kind: the kind of the step that begins now: "world", "turn" or "value".
            then: the kind of a step that has to follow.
        """
        now = self.end()
        needed = self._costs[kind].estimate_most() + (0.0 if then is None else self._costs[then].estimate_most())
        if kind == "world":
            self._iteration = now
            # An iteration that does not fit is lost. The first one is always tried: it may be shorter than others.
            needed = needed if self._is_first else max(needed, self._costs["iteration"].mean)
        if now + needed > self._end:
            return False
        self._kind = kind
        return True

    def end(self) -> float:
        """End the current step, and return the time."""
        now = perf_counter()
        if self._kind is not None:
            self._costs[self._kind].note(now - self._last)
        self._last = now
        self._kind = None
        return now

    def end_iteration(self) -> None:
        """End a complete iteration, and record its duration."""
        self._costs["iteration"].note(self.end() - self._iteration)
        self._is_first = False

    def is_past(self, share: float) -> bool:
        """Return whether more than a share of the time has passed."""
        return self._last > self._began + share * (self._end - self._began)
