"""The scores of all games of a batch, with the order in which each game first set its keys."""

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
    """Return whether a score is a number that float64 represents exactly."""
    return isinstance(score, float) or (type(score) is int and abs(score) <= _MOST_EXACT)


class Scores(dict[Hashable, FloatArray]):
    """The scores of all games: key -> float64 (games,), or objects if a game has a score that float64 cannot hold.

    Attributes:
        ranks: key -> (games,) positive integers that ascend in the order in which a game first set its keys; 0: not
            set in the game.
        are_floats: key -> (games,) whether a value other than an integer was added.
    """

    def __init__(self, games: int) -> None:
        super().__init__()
        self.ranks: dict[Hashable, IntArray] = {}
        self.are_floats: dict[Hashable, BoolArray] = {}
        self._games = games
        self._last_rank = 0

    @property
    def columns(self) -> tuple[dict[Hashable, Any], ...]:
        """The scores, ranks and float flags, key -> (games,) each."""
        return self, self.ranks, self.are_floats

    def add(self, key: Hashable, games: IntArray, points: float | FloatArray, order: IntArray | None = None) -> None:
        """Add points to the score of a key in games; a game may occur several times.

        Args:
            key: the key of the score.
            games: the numbers of the games.
            points: one number for all, or one for each entry of `games`.
            order: the position of each entry among additions to several keys, ascending; None: only this key.
        """
        if not isinstance(points, int) and np.isnan(np.asarray(points, np.float64)).any():
            raise BadType(f"The score of {shown(key)} must be a number, not {shown(points)}.")
        if key not in self:
            self._add_columns(key)
        if not isinstance(points, int):
            self.are_floats[key][games] = True
        np.add.at(self[key], games, points)
        ranks = self.ranks[key]
        new = np.flatnonzero(ranks[games] == 0)[::-1]  # reversed: the first entry of a game is written last
        ranks[games[new]] = self._last_rank + 1 + (0 if order is None else order[new])
        self._last_rank += order is None

    def add_several(self, keys: Sequence[Hashable], games: IntArray, of: IntArray, points: float | FloatArray) -> None:
        """Add points to the scores `keys[of[i]]` of `games[i]`, in this order; `games` and `of` are (pairs,)."""
        for number in np.flatnonzero(np.bincount(of)).tolist():
            those = np.flatnonzero(of == number)
            each = points if isinstance(points, int | float) else points[those]
            self.add(keys[number], games[those], each, those)
        self._last_rank += len(of)

    def take(self, keys: Sequence[Hashable], sums: FloatArray, first: IntArray, are_floats: BoolArray) -> None:
        """Set the scores of all games to the values that the core computed, (games, keys) each.

        Args:
            keys: the keys of the scores.
            sums: the scores.
            first: integers that ascend in the order in which points were first added in a game; -1 if none were.
            are_floats: whether a value other than an integer was added.
        """
        last = self._last_rank
        for number, key in enumerate(keys):
            is_set = first[:, number] >= 0
            if not is_set.any():
                continue
            if key not in self:
                self._add_columns(key)
            self[key][:] = sums[:, number]
            self.are_floats[key] |= are_floats[:, number]
            ranks = self.ranks[key]
            is_new = is_set & (ranks == 0)
            ranks[is_new] = last + 1 + first[is_new, number]
        self._last_rank = last + 2 + int(first.max(initial=0))

    def _add_columns(self, key: Hashable) -> None:
        """Add the columns of a new key."""
        self[key] = np.zeros(self._games, np.float64)
        self.are_floats[key] = np.zeros(self._games, np.bool_)
        self.ranks[key] = np.zeros(self._games, np.int64)

    def put(self, games: int | IntArray, scores: Mapping[Hashable, float]) -> None:
        """Set all scores of a game, or of several games to the same values."""
        for key in self:
            if key not in scores:
                self[key][games] = 0.0
                self.ranks[key][games] = 0
        for rank, (key, points) in enumerate(scores.items(), 1):
            if key not in self:
                self._add_columns(key)
            if not fits_float(points) and self[key].dtype != object:
                self[key] = self[key].astype(object)
            self[key][games] = points
            self.are_floats[key][games] = type(points) is not int
            self.ranks[key][games] = rank
        self._last_rank = max(self._last_rank, len(scores))

    def of(self, game: int) -> dict[Any, Any]:
        """Return the scores of a game, key -> number, in the order in which the keys were first set."""
        ranks = [(column.item(game), key) for key, column in self.ranks.items()]
        return {key: self._of(key, game) for rank, key in sorted(ranks, key=itemgetter(0)) if rank}

    def _of(self, key: Hashable, game: int) -> Any:
        points = self[key].item(game)
        return points if self.are_floats[key].item(game) else int(points)
