"""Which of the agents in view a sensor reports: by team, and at random."""

from abc import abstractmethod
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from typing import Any, Self

import numpy as np

from gamms import kernels
from gamms.deciding import UNDECIDED, DecidePhase, Guarded, refused_while_deciding
from gamms.errors import BadValue
from gamms.ir.chances import as_chances, chances_at
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.sensed import Coverage
from gamms.sensor.sensor import Sensor
from gamms.text import shown
from gamms.typing import IContext

Chance = Callable[[FloatArray], FloatArray]  # distances -> probabilities
Detection = float | Sequence[tuple[float, float]] | Chance | None


class DetectionModel(Guarded):
    """Which of the agents in view one sensor reports; all, unless something is set.

    Attributes:
        team: a team, or several in a list, tuple or set: only their agents are reported; None: of all teams.
        exclude: likewise, of agents that are not reported; None: no team.
        detection: how probable it is that an agent in view is noticed: a number, pairs `(distance, probability)` with
            straight lines between them, or a function from distances (agents,) to probabilities (agents,). None:
            always. What is drawn follows from the seed of the context, the sensor, its owner, the turn of the game, how
            many looks there were in it before, and the agent's name.
    """

    _called = "sensor.notice"

    def __init__(self, sensor_id: str, phase: DecidePhase = UNDECIDED) -> None:
        self._sensor_id = sensor_id
        self.team: object = None
        self.exclude: object = None
        self._detection: Detection = None
        self._chance: Chance | None = None
        self._looks: dict[str | None, tuple[int, int]] = {}  # by owner: the turn of the last look, and which of it
        self._phase = phase

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute; refused while a strategy is running."""
        super().__setattr__(name, value)
        if name[0] != "_":
            self._phase.sensor_changes += 1

    @property
    def needs_chance(self) -> bool:
        """Whether distances matter."""
        return self._chance is not None

    @property
    def detection(self) -> Detection:
        """See above; settable."""
        return self._detection

    @detection.setter
    def detection(self, detection: Detection) -> None:
        self._chance = _chance_of(detection, f"detection of {self._sensor_id!r}")
        self._detection = detection

    @refused_while_deciding
    def reset(self) -> None:
        """Forget how many looks there were."""
        self._looks.clear()

    def repeated(self) -> "DetectionModel":
        """Return a copy whose next look draws what the last one of this turn drew, and changes nothing here."""
        twin = copy(self)
        twin._looks = {owner: (turn, look - 1) for owner, (turn, look) in self._looks.items()}
        return twin

    @contextmanager
    def rolled_back(self) -> Iterator[None]:
        """Undo what looks of a running strategy change, so that they do not decide what the sensor notices later."""
        if self._phase.agent is None:
            yield
            return
        looks = self._looks.copy()
        try:
            with self._phase.suspended():
                yield
        finally:
            self._looks = looks

    def wanted(self, rows: list[int], teams: Sequence[Any]) -> list[int]:
        """Return those rows whose agents are of a team that is reported; `teams` by row."""
        if self.team is None and self.exclude is None:
            return rows
        others = () if self.exclude is None else _teams(self.exclude)
        known = None if self.team is None else _teams(self.team)
        return [row for row in rows if (known is None or teams[row] in known) and teams[row] not in others]

    @refused_while_deciding
    def is_noticed(
        self, ctx: IContext, owner: str | None, names: list[str], distances: FloatArray
    ) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
        """Draw which agents are noticed (agents,): one more look of this owner's."""
        turn = 0 if (game := ctx.current_game) is None else game.turn
        last, look = self._looks.get(owner, (turn, 0))
        look = look + 1 if last == turn else 1
        self._looks[owner] = turn, look
        chances = self.chances(distances)
        purpose = kernels.purpose_key(ctx.seed, "detection", self._sensor_id, "" if owner is None else owner)
        bits = kernels.draw_bits_many(purpose, kernels.name_keys(names), turn, look - 1)
        noticed: np.ndarray[tuple[int, ...], np.dtype[np.bool_]] = kernels.fraction_many(bits) < chances
        return noticed

    def chances(self, distances: FloatArray) -> FloatArray:
        """Return how probable it is that agents at some distances are noticed (agents,)."""
        if self._chance is None:
            return np.ones(len(distances))
        chances = np.asarray(self._chance(distances), np.float64)
        if chances.shape != distances.shape or not ((chances >= 0.0) & (chances <= 1.0)).all():
            raise BadValue(
                f"detection of {self._sensor_id!r} must give a probability from 0 to 1 for each of "
                f"{len(distances)} distances, not {shown(chances)}."
            )
        return chances


class DetectingSensor(Sensor):
    """Mix-in: senses agents, which it may miss.

    Attributes:
        notice: which of the agents in view it reports: by team, and at random.
    """

    __slots__ = ()

    _notice: DetectionModel | None

    @property
    def notice(self) -> DetectionModel:
        """Which of the agents in view are reported: by team, and at random."""
        if self._notice is None:  # NOTE: made when asked for, so that a look touches less memory (see `NearbyAgents`)
            self._notice = DetectionModel(self.sensor_id, self._phase)
        return self._notice

    def coverage(self, node_id: int | None = None, owner: str | None = None) -> Coverage:
        """Return on which nodes it would show agents on the ground now; a class of the user's own is not asked."""
        if not self._is_ours:
            return super().coverage(node_id, owner)
        looking = self._copy_for_view()
        looking._owner = self._owner if owner is None else owner
        with self._phase.suspended():
            node_ids, distances = looking._covered(node_id)
            positions, living = self.ctx.agent.positions, self.ctx.agent.positions.living.tolist()
        shown_rows = set(living if self._notice is None else self._notice.wanted(living, positions.teams))
        not_shown = tuple(name for row, name in enumerate(positions.names) if row not in shown_rows)
        chances = np.ones(len(distances)) if self._notice is None else self._notice.chances(distances)
        return Coverage(node_ids, chances, not_shown)

    @abstractmethod
    def _covered(self, node_id: int | None) -> tuple[IntArray, FloatArray]:
        """Return the ids of the nodes in view (nodes,), and how far away they are (nodes,)."""

    def reset(self) -> None:
        """Forget what was sensed, and how often."""
        super().reset()
        if self._notice is not None:
            self._notice.reset()

    def _snapshot(self) -> tuple[Any, ...]:
        """Return what was sensed and how often, for `_restore`."""
        return tuple(self._last), {} if self._notice is None else self._notice._looks.copy()

    def _restore(self, before: tuple[Any, ...]) -> None:
        """Restore what was sensed and how often."""
        self._last[:], looks = before
        if self._notice is not None:
            self._notice._looks = looks.copy()

    def _copy_for_view(self) -> Self:
        twin = super()._copy_for_view()
        twin._notice = None if self._notice is None else self._notice.repeated()
        return twin


def _teams(given: object) -> Collection[Any]:
    return given if isinstance(given, list | tuple | set | frozenset) else (given,)


def _chance_of(detection: Detection, name: str) -> Chance | None:
    if detection is None or callable(detection):
        return detection
    points = as_chances(detection, name, or_function=True)
    return lambda distances: chances_at(distances, points)
