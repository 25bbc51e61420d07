"""What sensors with a delay have seen in the last turns of all games, and are still to report."""

from collections.abc import Mapping

import numpy as np

from gamms.game.batch.sight import DELAYS, Lookout, Reports, lookouts, seen
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

    def __init__(self, state: GameArrays, known: Mapping[tuple[str, str], Mapping[int, Mapping[str, int]]]) -> None:
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

    def _first(self, number: int, known: Mapping[tuple[str, str], Mapping[int, Mapping[str, int]]]) -> Arrays:
        """Return what is kept of some sensors in one game."""
        source, slots, roster = self._sources[number], self._delays[number] + 1, self._state.roster
        shape, place_of = (slots, len(source.carriers)), {roster.names[one]: i for i, one in enumerate(source.others)}
        nodes = np.full((1, *shape, len(source.others)), -1, np.int32)
        turns, looks = np.full((1, *shape), -1), np.zeros((1, shape[1]), np.int64)
        for carrier, draws in enumerate(source.draws):
            latest = sorted(known.get(draws or ("", ""), {}).items())[-slots:]
            looks[0, carrier] = len(latest)
            for slot, (turn, found) in enumerate(latest):
                turns[0, slot, carrier] = turn
                for name in found.keys() & place_of.keys():
                    nodes[0, slot, carrier, place_of[name]] = self._state.streets.rows([found[name]])[0]
        return {"turn": turns, "looks": looks, "node": nodes}

    def _kept(self, number: int) -> Arrays:
        return self._state.keep((DELAYS, number), lambda _: {})

    def note(self, games: IntArray, asked: BoolArray) -> None:
        """Let agents look, (games, all agents), to report it later."""
        for number, source in enumerate(self._sources):
            kept, slots = self._kept(number), self._delays[number] + 1
            at, carriers = np.nonzero(asked[:, source.carriers])
            those, turn = (games[at], carriers), self._state.turn[games[at]]
            last = kept["looks"][those] - 1
            kept["looks"][those] += kept["turn"][games[at], last % slots, carriers] != turn  # of a turn, the last look
            places = games[at], (kept["looks"][those] - 1) % slots, carriers
            kept["turn"][places], kept["node"][places] = turn, -1
            found = seen(self._state, games, self._agents, asked, [source], with_own=True)
            carrier = np.searchsorted(source.carriers, found.viewers)
            other = np.searchsorted(source.others, found.others)
            slot = np.zeros((len(games), len(source.carriers)), np.int64)
            slot[at, carriers] = places[1]
            kept["node"][games[found.at], slot[found.at, carrier], carrier, other] = found.nodes

    def due(self, games: IntArray, lookout: Lookout, asked: BoolArray) -> Reports:
        """Return what sensors report now: the latest of the looks that are old enough."""
        where = [self._place_of[draws, int(who)] for draws, who in zip(lookout.draws, lookout.carriers, strict=True)]
        numbers, places = np.array(where).T
        found = [(np.zeros(0, np.int64),) * 4]
        for number in np.unique(numbers).tolist():
            kept, columns = self._kept(number), np.flatnonzero(numbers == number)
            chosen = np.ix_(games, np.arange(self._delays[number] + 1), places[columns])
            turn = kept["turn"][chosen]
            turn = np.where(turn <= self._state.turn[games][:, None, None] - self._delays[number], turn, -1)
            slot = turn.argmax(axis=1)
            nodes = kept["node"][games[:, None], slot, places[columns]]
            is_due = asked[:, lookout.columns[columns]] & (turn.max(axis=1) >= 0)
            at, carriers, others = np.nonzero((nodes >= 0) & is_due[..., None])
            found.append((at, columns[carriers], others, nodes[at, carriers, others].astype(np.int64)))
        at, carriers, others, nodes = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return at, carriers, others, nodes
