"""What sensors with a delay have seen in the last turns of all games, and are still to report."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gamms.game.batch.reports import DELAYS, Lookout, Places, Reports, World, reports
from gamms.game.batch.sight import lookouts
from gamms.game.batch.state import Arrays, GameArrays
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray


class DelayedLooks:
    """What sensors with a delay have seen.

    Of each sensor as many looks are kept as its delay has turns, and one more, which is due.

    Args:
        state: of the batch.
        known: what they have seen before in the game, which may have begun; see `GameState.delayed_looks`.
    """

    def __init__(self, state: GameArrays, known: Mapping[tuple[str, str], Mapping[int, Mapping[str, Any]]]) -> None:
        self._state, self._agents = state, np.arange(len(state.roster.names))
        delayed = [one for one in lookouts(state.roster, self._agents, (), may_lack_forms=True) if one.look.delay]
        self._sources = [lookout._replace(look=lookout.look._replace(delay=0)) for lookout in delayed]
        self._delays = [lookout.look.delay for lookout in delayed]
        self._place_of = {
            (draws, int(carrier)): (number, place)
            for number, lookout in enumerate(delayed)
            for place, (draws, carrier) in enumerate(zip(lookout.draws, lookout.carriers, strict=True))
        }

        for number in range(len(delayed)):
            state.first[DELAYS, number] = self._first(number, known)

    def _first(self, number: int, known: Mapping[tuple[str, str], Mapping[int, Mapping[str, Any]]]) -> Arrays:
        """Return what is kept of some sensors in one game."""
        source, slots, roster = self._sources[number], self._delays[number] + 1, self._state.roster
        shape, place_of = (slots, len(source.carriers)), {roster.names[one]: i for i, one in enumerate(source.others)}
        places, in_air = self._nowhere(number, (1, *shape, len(source.others))), source.look.quat is not None
        turns, looks = np.full((1, *shape), -1), np.zeros((1, shape[1]), np.int64)
        for carrier, draws in enumerate(source.draws):
            latest = sorted(known.get(draws or ("", ""), {}).items())[-slots:]
            looks[0, carrier] = len(latest)
            for slot, (turn, found) in enumerate(latest):
                turns[0, slot, carrier] = turn
                for name in found.keys() & place_of.keys():
                    where = found[name][1] if in_air else self._state.streets.rows([found[name]])[0]
                    places[0, slot, carrier, place_of[name]] = where
        return {"turn": turns, "looks": looks, "place": places}

    def _nowhere(self, number: int, shape: tuple[int, ...]) -> Places:
        """Return that some sensors show agents at no places."""
        if self._sources[number].look.quat is None:
            return np.full(shape, -1, np.int32)
        return np.full((*shape, 3), np.nan)

    def _kept(self, number: int) -> Arrays:
        return self._state.keep((DELAYS, number), lambda _: {})

    def note(self, games: IntArray, asked: BoolArray) -> None:
        """Let agents look, (games, all agents), to report it later."""
        if not self._sources:
            return
        world = World(self._state, games)
        for number, source in enumerate(self._sources):
            kept, slots = self._kept(number), self._delays[number] + 1
            at, carriers = np.nonzero(asked[:, source.carriers])
            those, turn = (games[at], carriers), self._state.turn[games[at]]
            last = kept["looks"][those] - 1
            kept["looks"][those] += kept["turn"][games[at], last % slots, carriers] != turn  # of a turn, the last look
            noted = games[at], (kept["looks"][those] - 1) % slots, carriers
            kept["turn"][noted], kept["place"][noted] = turn, self._nowhere(number, ())
            slot = np.zeros((len(games), len(source.carriers)), np.int64)
            slot[at, carriers] = noted[1]
            for game, carrier, other, places in reports(world, source, asked, with_own=True):
                kept["place"][games[game], slot[game, carrier], carrier, other] = places

    def due(self, games: IntArray, lookout: Lookout, asked: BoolArray) -> Reports:
        """Return what sensors report now: the latest of the looks that are old enough."""
        where = [self._place_of[draws, int(who)] for draws, who in zip(lookout.draws, lookout.carriers, strict=True)]
        numbers, columns_of = np.array(where).T
        none, in_air = np.zeros(0, np.int64), lookout.look.quat is not None
        parts: list[Reports] = [(none, none, none, np.zeros((0, 3)) if in_air else none)]
        for number in np.unique(numbers).tolist():
            kept, columns = self._kept(number), np.flatnonzero(numbers == number)
            chosen = np.ix_(games, np.arange(self._delays[number] + 1), columns_of[columns])
            turn = kept["turn"][chosen]
            turn = np.where(turn <= self._state.turn[games][:, None, None] - self._delays[number], turn, -1)
            slot = turn.argmax(axis=1)
            places = kept["place"][games[:, None], slot, columns_of[columns]]
            is_known = ~np.isnan(places[..., 0]) if in_air else places >= 0
            is_due = asked[:, lookout.columns[columns]] & (turn.max(axis=1) >= 0)
            at, carriers, others = np.nonzero(is_known & is_due[..., None])
            found = places[at, carriers, others]
            parts.append((at, columns[carriers], others, found if in_air else found.astype(np.int64)))
        at, carriers, others, found = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        return at, carriers, others, found
