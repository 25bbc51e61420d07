"""The scores of all games of a batch, which each game has in the order in which they were set first."""

from collections.abc import Hashable, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from gamms.errors import BadType
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown

_MOST_EXACT = 1 << 53  # scores are floats in columns


def fits_float(score: object) -> bool:
    """Return whether a score is a number that a column of floats holds exactly."""
    return isinstance(score, float) or (isinstance(score, int) and abs(score) <= _MOST_EXACT)


class Scores(dict[Hashable, FloatArray]):
    """Key -> (games,) numbers.

    Attributes:
        ranks: key -> (games,) numbers in whose order the scores of a game were set first; 0: this one was not.
        are_floats: key -> (games,) whether anything but integers was added.
    """

    def __init__(self, games: int) -> None:
        super().__init__()
        self.ranks: dict[Hashable, IntArray] = {}
        self.are_floats: dict[Hashable, BoolArray] = {}
        self._games, self._last_rank = games, 0

    @property
    def columns(self) -> tuple[dict[Hashable, Any], ...]:
        """All that is known of games: key -> (games,)."""
        return self, self.ranks, self.are_floats

    def add(self, key: Hashable, games: IntArray, points: float | FloatArray, order: IntArray | None = None) -> None:
        """Add points to the score of a key, in each of these games; one may be there several times.

        Args:
            key: of the score.
            games: their numbers.
            points: the same for all, or those of each.
            order: of each the place among what is added to several keys, ascending; None: this is one key.
        """
        if not isinstance(points, int) and np.isnan(points).any():
            raise BadType(f"The score of {shown(key)} must be a number, not {shown(points)}.")
        if key not in self:
            self[key], self.are_floats[key] = np.zeros(self._games, np.float64), np.zeros(self._games, np.bool_)
            self.ranks[key] = np.zeros(self._games, np.int64)
        if not isinstance(points, int):
            self.are_floats[key][games] = True
        np.add.at(self[key], games, points)
        ranks = self.ranks[key]
        new = np.flatnonzero(ranks[games] == 0)[::-1]  # so that of one game the first counts
        ranks[games[new]] = self._last_rank + 1 + (0 if order is None else order[new])
        self._last_rank += order is None

    def add_several(self, keys: Sequence[Hashable], games: IntArray, of: IntArray, points: float | FloatArray) -> None:
        """Add points to the scores of keys, given by their numbers `of`, in games, (pairs,) each, in their order."""
        for number in np.flatnonzero(np.bincount(of)).tolist():
            those = np.flatnonzero(of == number)
            each = points if isinstance(points, int | float) else points[those]
            self.add(keys[number], games[those], each, those)
        self._last_rank += len(of)

    def take(self, keys: Sequence[Hashable], sums: FloatArray, first: IntArray, are_floats: BoolArray) -> None:
        """Set the scores of all games to what the core has made of them, (games, keys) each.

        Args:
            keys: of the scores.
            sums: the scores.
            first: numbers in whose order points were first added in a game; -1 where none were.
            are_floats: whether anything but integers was added.
        """
        last = self._last_rank
        for number, key in enumerate(keys):
            is_set = first[:, number] >= 0
            if not is_set.any():
                continue
            self.add(key, np.zeros(0, np.int64), 0)  # which knows the key then
            self[key][:] = sums[:, number]
            self.are_floats[key] |= are_floats[:, number]
            ranks = self.ranks[key]
            is_new = is_set & (ranks == 0)
            ranks[is_new] = last + 1 + first[is_new, number]
        self._last_rank = last + 2 + int(first.max(initial=0))

    def put(self, game: int, scores: Mapping[Hashable, float]) -> None:
        """Set all scores of a game."""
        for key in self:
            if key not in scores:
                self[key][game], self.ranks[key][game] = 0.0, 0
        for rank, (key, points) in enumerate(scores.items(), 1):
            self.add(key, np.array([game]), 0)
            self[key][game], self.are_floats[key][game] = points, not isinstance(points, int)
            self.ranks[key][game] = rank

    def of(self, games: IntArray) -> list[dict[Any, Any]]:
        """Return the scores of games that were set, in the order in which they were."""
        found: list[list[tuple[int, Hashable, float]]] = [[] for _ in games]
        for key in self:
            columns = (column[key][games].tolist() for column in self.columns)
            for scores, number, rank, is_float in zip(found, *columns, strict=True):
                if rank:
                    scores.append((rank, key, number if is_float else int(number)))
        return [{key: number for _, key, number in sorted(scores, key=itemgetter(0))} for scores in found]
