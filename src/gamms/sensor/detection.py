"""Detection: the team filter, detection probability and errors of a sensor of agents."""

from abc import abstractmethod
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from itertools import chain
from math import inf
from typing import Any, Self

import numpy as np

from gamms import kernels
from gamms.arguments import as_count, as_range
from gamms.deciding import UNDECIDED, DecidePhase, Guarded, refuse_while_deciding
from gamms.errors import BadValue, UnknownAttribute
from gamms.ir.chances import as_chances, compute_chances, interpolate_chances
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.sensor_results import AgentLook, Coverage, LookResults, flatten_lists
from gamms.sensor.sensor import ATTRIBUTES_OF, Sensor
from gamms.sensor.sighting_errors import MOST_FALSE_ALARMS, LookDraws, PossibleFalseAlarms, find_delayed, forget_delayed
from gamms.typing import IContext
from gamms.typing.routes import get_cached

Chance = Callable[[FloatArray], FloatArray]  # distances -> probabilities
Detection = float | Sequence[tuple[float, float]] | Chance | None


class DetectionModel(Guarded):
    """The detection settings of one sensor of agents; by default all agents in view are reported without errors.

    Attributes:
        team: a team, or several in a list, tuple or set, whose agents are reported; None: all teams.
        exclude: a team, or several, whose agents are not reported; None: no team.
        detection: probability that an agent in view is detected: a number, pairs `(distance, probability)` with linear
            interpolation, or a function from distances (agents,) to probabilities (agents,). None: always. The draws
            depend on the seed of the context, the sensor, its owner, the turn of the game, the number of earlier looks
            in the turn, and the agent's name.
        position_noise_m: standard deviation of the error of a reported position along each axis, map units; errors are
            Gaussian and independent for each agent and look. None: no error.
        false_alarm_rate: mean number of false reports per look, of agents that were not detected, on covered nodes:
            Poisson distributed, at most 100. None: no false reports.
        delay_turns: age of the reported look in turns of the game. None: the present look.
    """

    _called = "sensor.notice"

    team: object = None
    exclude: object = None
    detection: Detection = None
    position_noise_m: float | None = None
    false_alarm_rate: float | None = None
    delay_turns: int | None = None
    _chance: Chance | None = None
    _is_trial = False  # whether looks leave no trace
    _reports_all = True

    def __init__(self, sensor_id: str, phase: DecidePhase = UNDECIDED) -> None:
        self._sensor_id = sensor_id
        self._phase = phase
        # owner -> (turn of the last look, number of looks in this turn)
        self._looks: dict[str | None, tuple[int, int]] = {}

    def __setattr__(self, name: str, value: object) -> None:
        """Set an existing attribute; refused while a strategy is running."""
        if name[0] != "_" and not hasattr(type(self), name):
            raise UnknownAttribute(self._called, name, ATTRIBUTES_OF)
        if name in _CHECKS and value is not None:
            self._phase.refuse(f"set {self._called}.{name}")
            value = _CHECKS[name](value, f"{name} of {self._sensor_id!r}")
        super().__setattr__(name, value)
        if name[0] != "_":
            if name == "detection":
                self._chance = _make_chance(self.detection)
            self._phase.change_sensors()
            self._reports_all = self.team is None and self.exclude is None and not self.needs_look

    @property
    def reports_all(self) -> bool:
        """Whether every agent in view is reported without errors."""
        return self._reports_all

    @property
    def needs_chance(self) -> bool:
        """Whether the detection probability is needed."""
        return self._chance is not None

    @property
    def has_errors(self) -> bool:
        """Whether agents may be reported at wrong positions."""
        return bool(self.position_noise_m or self.false_alarm_rate or self.delay_turns)

    @refuse_while_deciding
    def reset(self) -> None:
        """Reset the count of looks."""
        self._looks.clear()

    def mark(self) -> dict[str | None, tuple[int, int]]:
        """Return the counts of looks, for `go_to`."""
        return self._looks.copy()

    @refuse_while_deciding
    def go_to(self, mark: dict[str | None, tuple[int, int]]) -> None:
        """Count looks from a mark on."""
        self._looks = mark.copy()

    def repeat_look(self) -> "DetectionModel":
        """Return a copy whose next look repeats the draws of the last look of this turn; this object is unchanged."""
        twin = copy(self)
        twin._looks = {owner: (turn, look - 1) for owner, (turn, look) in self._looks.items()}
        twin._is_trial = True
        return twin

    def in_arrays(self, radius: float) -> AgentLook:
        """Return a description of the agents reported around an agent, and whether this is exact."""
        return AgentLook(
            radius,
            teams=None if self.team is None else tuple(check_teams(self.team)),
            others=() if self.exclude is None else tuple(check_teams(self.exclude)),
            is_plain=not self.needs_look,
            is_late=bool(self.delay_turns),
        )

    @contextmanager
    def undo_looks(self) -> Iterator[None]:
        """Undo the looks of a running strategy, so that they do not change later draws."""
        self._phase.read_last_turn()
        if not self._phase.is_deciding:
            yield
            return
        looks = self._looks.copy()
        self._is_trial = True
        try:
            with self._phase.suspend():
                yield
        finally:
            self._looks = looks
            self._is_trial = False

    def select_wanted(self, rows: list[int], teams: Sequence[Any]) -> list[int]:
        """Return the rows whose agents are on a reported team; `teams` by row."""
        if self.team is None and self.exclude is None:
            return rows
        others = () if self.exclude is None else check_teams(self.exclude)
        known = None if self.team is None else check_teams(self.team)
        return [row for row in rows if (known is None or teams[row] in known) and teams[row] not in others]

    @refuse_while_deciding
    def look(self, ctx: IContext, owner: str | None) -> LookDraws:
        """Count and return one more look of this owner."""
        turn = 0 if (game := ctx.current_game) is None else game.turn
        last, looks = self._looks.get(owner, (turn, 0))
        looks = looks if last == turn else 0
        self._looks[owner] = turn, looks + 1
        return LookDraws(ctx.seed, self._sensor_id, "" if owner is None else owner, turn, looks)

    def is_noticed(
        self, look: LookDraws, names: list[str], distances: FloatArray
    ) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
        """Draw which agents are detected, (agents,)."""
        chances = self.compute_chances(distances)
        noticed: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
        noticed = kernels.convert_to_fractions(look.draw_bits(names, "detection")) < chances
        return noticed

    @property
    def needs_look(self) -> bool:
        """Whether looks must be counted, because draws or delays depend on them."""
        return self._chance is not None or self.has_errors

    @refuse_while_deciding
    def delay_report(self, ctx: IContext, look: LookDraws, seen: dict[str, Any]) -> dict[str, Any]:
        """Return the report for the present look, by agent names, after the delay."""
        return (
            find_delayed(ctx, look, seen, self.delay_turns, is_noted=not self._is_trial) if self.delay_turns else seen
        )

    def compute_chances(self, distances: FloatArray) -> FloatArray:
        """Return the detection probabilities at distances (agents,)."""
        if self._chance is None:
            return np.ones(len(distances))
        return compute_chances(self._chance, distances, f"detection of {self._sensor_id!r}")


class DetectingSensor(Sensor):
    """Mix-in for sensors of agents, with detection settings.

    Attributes:
        notice: the detection settings.
    """

    __slots__ = ()

    _notice: DetectionModel | None
    _at: Any  # a fixed place, or None
    range: float  # map units

    @property
    def notice(self) -> DetectionModel:
        """The detection settings: team filter, probability and errors."""
        if self._notice is None:  # NOTE: created on demand, so that a look touches less memory (see `NearbyAgents`)
            self._notice = DetectionModel(self.sensor_id, self._phase)
            self._phase.change_sensors()  # from now on it counts its looks
        return self._notice

    def in_arrays(self) -> AgentLook | None:
        """Return a description of how it shows agents; None for custom classes."""
        if not self._is_ours:
            return None
        found = AgentLook(self.range, is_plain=True) if self._notice is None else self._notice.in_arrays(self.range)
        return found if self._is_all_around else found._replace(is_plain=False)

    @property
    def reports_all(self) -> bool:
        """Whether it reports every agent in view, where it is and at once."""
        return self._is_ours and (self._notice is None or self._notice.reports_all)

    @property
    def has_errors(self) -> bool:
        """Whether it may report agents where they are not."""
        return self._notice is not None and self._notice.has_errors

    @property
    def covers_disc(self) -> bool:
        """Whether it covers all nodes within its range."""
        return False

    @property
    def _is_all_around(self) -> bool:
        """Whether it looks in all directions around its agent."""
        return False

    def coverage(self, node_id: int | None = None, owner: str | None = None) -> Coverage:
        """Return the nodes on which it would show agents on the ground now; not for custom classes."""
        if not self._is_ours:
            return super().coverage(node_id, owner)
        looking = self._copy_for_view()
        looking._owner = self._owner if owner is None else owner
        with self._phase.suspend(changes_world=False):
            node_ids, distances = looking._find_covered(node_id)
            positions = self.ctx.agent.positions
            living = self.ctx.agent.positions.living.tolist()
        shown_rows = set(living if self._notice is None else self._notice.select_wanted(living, positions.teams))
        not_shown = tuple(name for row, name in enumerate(positions.names) if row not in shown_rows)
        if self._notice is None:
            return Coverage(node_ids, np.ones(len(distances)), not_shown, is_convex=self._is_convex)
        chances = self._notice.compute_chances(distances)
        if self._notice.delay_turns:  # it shows nothing of the present
            chances = np.zeros(len(distances))
        is_exact = not self._notice.has_errors
        return Coverage(node_ids, chances, not_shown, is_exact=is_exact, is_convex=self._is_convex)

    @property
    def _is_convex(self) -> bool:
        """Whether it covers the straight line between any two covered nodes."""
        return False

    @abstractmethod
    def _find_covered(self, node_id: int | None) -> tuple[IntArray, FloatArray]:
        """Return the ids of the nodes in view (nodes,), and their distances (nodes,)."""

    def _report(self, look: LookDraws, node_id: int | None, seen: dict[str, Any]) -> dict[str, Any]:
        """Return the report of a look, by agent names in order of creation."""
        notice = self.notice
        if notice.false_alarm_rate and (count := look.count_false_alarms(notice.false_alarm_rate)):
            node_ids = self._find_covered(node_id)[0]
            row_of = self.ctx.agent.positions.find_row
            others = {*seen, look.owner} if self._at is None else {*seen}
            alarms = look.draw_false_alarms(count, self._find_reportable(), others, node_ids) if len(node_ids) else {}
            seen = seen | {name: self._make_sighting(node) for name, node in alarms.items()}
            seen = {name: seen[name] for name in sorted(seen, key=row_of)}
        if notice.position_noise_m and seen:
            errors = look.draw_noise([*seen], notice.position_noise_m)
            seen = dict(zip(seen, self._displace_sightings([*seen.values()], errors), strict=True))
        return notice.delay_report(self.ctx, look, seen)

    def _list_names(self) -> tuple[str, ...]:
        """Return the names of the agents seen last, if they were reported without errors."""
        return () if self._notice is not None and self._notice.has_errors else tuple(self._get_view_data())

    def _find_reportable(self) -> PossibleFalseAlarms:
        """Return the agents that may be reported falsely."""
        positions = self.ctx.agent.positions
        notice = self.notice
        teams = [None if given is None else (*check_teams(given),) for given in (notice.team, notice.exclude)]

        def make() -> PossibleFalseAlarms:
            rows = notice.select_wanted(self._find_reportable_rows(), positions.teams)
            names = [positions.names[row] for row in rows]
            return PossibleFalseAlarms(names, kernels.compute_name_keys(names))

        # NOTE: shared by the looks of all agents until one dies or changes its team (benchmarks: false
        # alarms).
        slot = "false alarms", type(self).__name__, repr(teams)
        return get_cached(self.ctx.graph.routes, slot, (positions, positions.structure_version, teams), make)

    def _find_reportable_rows(self) -> list[int]:
        """Return the rows of the agents that may be reported falsely, of any team."""
        rows: list[int] = self.ctx.agent.positions.living.tolist()
        return rows

    @abstractmethod
    def _make_sighting(self, node_id: int) -> Any:
        """Return the reported value of an agent on a node."""

    @abstractmethod
    def _displace_sightings(self, sightings: list[Any], errors: FloatArray) -> list[Any]:
        """Return the reported values of agents whose positions have errors (sightings, 3)."""

    def _make_results(self, reports: list[dict[str, Any]]) -> LookResults:
        """Return reports as arrays."""
        names = tuple(dict.fromkeys(chain(self.ctx.agent.positions.names, *reports)))  # of deleted agents, too
        rows = {name: row for row, name in enumerate(names)}
        return LookResults(
            *flatten_lists([[rows[name] for name in report] for report in reports]),
            names=names,
            places=self._list_places([sighting for report in reports for sighting in report.values()]),
        )

    @abstractmethod
    def _list_places(self, sightings: list[Any]) -> IntArray | FloatArray:
        """Return the reported positions, (sightings,) node ids or (sightings, 3)."""

    def reset(self) -> None:
        """Clear the sensed data, the count of looks, and pending reports."""
        super().reset()
        if self._notice is not None:
            self._notice.reset()
            forget_delayed(self.ctx, self.sensor_id)

    @property
    def _is_stateless(self) -> bool:
        """Whether it has no state except the data of its last look."""
        return self._notice is None

    def _take_snapshot(self) -> tuple[Any, ...]:
        """Return the sensed data and the count of looks, for `_restore`."""
        return tuple(self._last), {} if self._notice is None else self._notice.mark()

    def _restore(self, before: tuple[Any, ...]) -> None:
        """Restore the sensed data and the count of looks."""
        self._last[:], looks = before
        if self._notice is not None:
            self._notice.go_to(looks)

    def _copy_for_view(self) -> Self:
        twin = super()._copy_for_view()
        twin._notice = None if self._notice is None else self._notice.repeat_look()
        return twin


def check_teams(given: object) -> Collection[Any]:
    """Return the teams given by a keyword: one, or several in a list, tuple or set."""
    return given if isinstance(given, list | tuple | set | frozenset) else (given,)


def _check_detection(detection: Detection, name: str) -> Detection:
    if not callable(detection):
        as_chances(detection, name, or_function=True)
    return detection


def _make_chance(detection: Detection) -> Chance | None:
    """Return a checked detection probability as a function of distances."""
    if detection is None or callable(detection):
        return detection
    points = as_chances(detection, "detection")
    return lambda distances: interpolate_chances(distances, points)


def _check_noise(deviation: float, name: str) -> float:
    if deviation == inf:
        raise BadValue(f"{name} must be finite, not {deviation}.")
    return as_range(deviation, name)


def _check_rate(rate: float, name: str) -> float:
    checked = as_range(rate, name)
    if checked > MOST_FALSE_ALARMS:
        raise BadValue(f"{name} is a number of false alarms per look, at most {MOST_FALSE_ALARMS:g}, not {checked}.")
    return checked


_CHECKS: dict[str, Callable[[Any, str], Any]] = {
    "detection": _check_detection,
    "position_noise_m": _check_noise,
    "false_alarm_rate": _check_rate,
    "delay_turns": lambda turns, name: as_count(turns, name, least=0),
}
