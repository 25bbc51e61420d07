"""Errors of sensor reports: false alarms and position noise by keyed draws, and delay.

The model is the common one of target tracking (Bar-Shalom, Willett and Tian, "Tracking and Data Fusion", 2011):
position errors are Gaussian and independent, and false alarms are a Poisson process, uniform on the covered area.
"""

from collections.abc import Collection, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels.draws import BitArray
from gamms.plain import to_plain
from gamms.typing import IContext

AXES = ("x", "y", "z")
MOST_FALSE_ALARMS = 100.0  # per look: more would hide any agent


class PossibleFalseAlarms(NamedTuple):
    """The agents that may be reported falsely, in order of creation."""

    names: list[str]
    keys: BitArray  # (names,) hashes of the names


class LookDraws(NamedTuple):
    """The random draws of one look of a sensor, made from what tells it from all other looks."""

    seed: int
    sensor_id: str
    owner: str  # "": no agent
    turn: int
    number: int  # index of the look among the looks of this owner in this turn, from 0

    def draw_bits(self, names: Iterable[str], purpose: str) -> BitArray:
        """Return 64 random bits for each name, (names,)."""
        return self._draw_bits(kernels.compute_name_keys(names), purpose)

    def draw_noise(self, names: Sequence[str], deviation: float) -> FloatArray:
        """Return the position errors of agents, (names, 3)."""
        keys = kernels.compute_name_keys(names)
        axes = [kernels.convert_to_normals(self._draw_bits(keys, "position noise", axis).tolist()) for axis in AXES]
        return deviation * np.column_stack(axes)

    def count_false_alarms(self, rate: float) -> int:
        """Draw the number of false alarms, with mean `rate`."""
        return kernels.convert_to_poisson(self._draw_one("false alarms"), rate)

    def draw_false_alarms(
        self, count: int, among: PossibleFalseAlarms, but: Collection[str], node_ids: IntArray
    ) -> dict[str, int]:
        """Return agent -> the node on which it is reported falsely.

        Args:
            count: number of false alarms, limited by the number of agents.
            among: agents that may be reported falsely, each at most once.
            but: names of agents that are excluded.
            node_ids: nodes on which they may be reported (nodes,), at least one.
        """
        found: dict[str, int] = {}
        names, keys = among
        left = np.arange(len(names))
        if 2 * len(but) > len(names):  # otherwise the agent with the highest draw is rarely excluded
            left = np.array([i for i, name in enumerate(names) if name not in but], np.int64)
        # each agent draws a number and the highest counts, so that one agent hardly affects others
        for i in range(count):
            lots = self._draw_bits(keys[left], "false alarm", i)
            while len(left):
                highest = int(lots.argmax())
                name = names[left[highest]]
                left = np.delete(left, highest)
                lots = np.delete(lots, highest)
                if name not in but:
                    found[name] = int(
                        node_ids[kernels.convert_to_integer(self._draw_one("false alarm", "place", i), len(node_ids))]
                    )
                    break
        return found

    def _draw_bits(self, keys: BitArray, purpose: str, *which: str | int) -> BitArray:
        return kernels.draw_bits_rows(self._make_key(purpose, *which), keys, self.turn, self.number)

    def _draw_one(self, purpose: str, *which: str | int) -> int:
        return kernels.draw_bits(self._make_key(purpose, *which), kernels.compute_name_key(""), self.turn, self.number)

    def _make_key(self, purpose: str, *which: str | int) -> int:
        return kernels.compute_purpose_key(self.seed, purpose, self.sensor_id, self.owner, *which)


def find_delayed(ctx: IContext, look: LookDraws, seen: dict[str, Any], delay: int, *, is_noted: bool) -> dict[str, Any]:
    """Return the data of an earlier look as plain values: the latest look that is at least `delay` turns old.

    Args:
        ctx: the context.
        look: the present look.
        seen: the present data, by names of agents.
        delay: turns.
        is_noted: whether to store the present data for later reports.
    """
    known = get_delayed_looks(ctx)
    if known is None and not is_noted:  # a drawing before the game begins
        return {}
    if known is None:
        raise BadValue(
            f"Sensor {look.sensor_id!r} has delay_turns={delay}, but no turns are counted: play with ctx.game, "
            "which counts them."
        )
    key = look.sensor_id, look.owner
    looks = known.get(key, {}) | {look.turn: to_plain(seen)}
    due = max((turn for turn in looks if turn <= look.turn - delay), default=None)
    if is_noted:
        known[key] = {turn: one for turn, one in looks.items() if due is None or turn >= due}
    return {} if due is None else looks[due].copy()


def get_delayed_looks(ctx: IContext) -> dict[tuple[str, str], dict[int, dict[str, Any]]] | None:
    """Return the pending reports of sensors, which are part of the game; None without a game."""
    game = ctx.current_game
    looks: dict[tuple[str, str], dict[int, dict[str, Any]]] | None
    looks = None if game is None else game.internals.state.delayed_looks
    return looks


def forget_delayed(ctx: IContext, sensor_id: str) -> None:
    """Drop the pending reports of a sensor."""
    looks = get_delayed_looks(ctx) or {}
    for key in [key for key in looks if key[0] == sensor_id]:
        del looks[key]
