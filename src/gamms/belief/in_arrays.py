"""What agents of many games believe: what `observe` and `Belief.probabilities` say, of all games of a view at once.

No observations are kept, but what follows from them: the probabilities of each team, by what it has observed before the
present turn. Looks are forgotten, so there are three of each: by the looks that count now, by none, and by those since
the last turn in which looks were forgotten, which will count after the next one.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gamms.belief.evidence import HORIZON, as_written
from gamms.belief.filter import weighed
from gamms.belief.ground import ground_of
from gamms.belief.motion import Motion, chain_of
from gamms.game.batch.begun import remembers
from gamms.game.batch.columns import PlayedGame, agents_of, as_slice, decider_of, places_of
from gamms.game.batch.forms import form_of, key_of
from gamms.game.batch.sight import looks_from_the_air
from gamms.game.batch.state import Arrays, NotTakenUp
from gamms.game.batch.view import BOARDS, ArrayView, looks_in, movement_in, parts_of, put_back
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.sensed import AgentLook
from gamms.limits import max_memory
from gamms.typing import IAgent

BOARD = "belief"  # what marks the array forms of strategies that observe; see `gamms.game.batch.view`
_MOST_AT_ONCE = 1 << 18  # probabilities, which stay in the cache of the processor
_NOW, _BY_NONE, _NEXT = range(3)  # by which looks


def why_not_believed(motion: Motion, game: PlayedGame, agent: IAgent) -> str | None:
    """Return why an agent cannot observe in arrays, in words; None: it can."""
    settings, plans = game.settings(), game.settings()["plans"]
    mates = [one for one in agents_of(game) if one.team == agent.team is not None]
    forms = [form_of(decider_of(one, plans)) for one in (agent, *mates)]
    chain = chain_of(motion, ground_of(game.ctx.graph.columns()))
    others = {key_of(form) for form in forms if BOARD in getattr(form, BOARDS, ())}
    reasons = {
        "in a game by metres": settings["speed_unit"] != "edges",
        "with rules of the phase 'deeds'": any(one.phase == "deeds" for one in game.rules),
        "with sensors that look from the air": looks_from_the_air(agent),
        "beside another one that observes for the team": len(others) > 1,
        "which goes on with what it has observed": game.turn > 0 or remembers(game, agent),
        "with a model of goals, or of several kinds": not chain.are_nodes,
    }
    return next((why for why, is_so in reasons.items() if is_so), None)


class _Look(NamedTuple):
    """What a sensor of an agent shows in this turn, in the games of a view."""

    kind: AgentLook
    covered: tuple[IntArray, IntArray, FloatArray]  # games, rows of nodes, and the chances to miss an agent there
    reported: tuple[IntArray, IntArray, IntArray]  # games, agents of the roster, and rows of nodes


def _looks(view: ArrayView) -> list[list[_Look]]:
    """Return what the sensors of each agent of a view show, in their order."""
    found: list[dict[int, _Look]] = [{} for _ in view.agents]
    for lookout, (at, columns, rows, chances), reports in looks_in(view):
        parts: list[Any] = [(np.zeros(0, np.int64),) * 4]
        if len(lookout.others) and not lookout.look.delay:
            parts += reports
        games, carriers, others, nodes = (np.concatenate(part) for part in zip(*parts, strict=True))
        missed = 1.0 - as_written(chances)
        for carrier, (column, order) in enumerate(zip(lookout.columns.tolist(), lookout.order.tolist(), strict=True)):
            own, its = columns == column, carriers == carrier
            covered, reported = (at[own], rows[own], missed[own]), (games[its], lookout.others[others[its]], nodes[its])
            found[column][order] = _Look(lookout.look, covered, reported)
    return [[looks[order] for order in sorted(looks)] for looks in found]


def expected(
    view: ArrayView, motion: Motion, names: Sequence[str] | None
) -> Iterator[tuple[IntArray, int, FloatArray]]:
    """Let the agents of a view observe, and yield how many of their targets they expect on each node.

    Args:
        view: of all agents of their teams that observe.
        motion: of the targets, from node to node.
        names: of the targets; None: all agents on the ground that are of other teams.

    Yields:
        The places of some games in the view, an agent of the view, and how many living ones, (nodes, games).

    Raises:
        NotTakenUp: roads were closed, or there is no such target; games alone know what to do then.
    """
    if movement_in(view).all_roads.are_closed:
        raise NotTakenUp("beliefs are others where roads were closed")
    memories, looks = view.memory_of[view.agents], _looks(view)
    for memory in np.unique(memories).tolist():
        yield from _Team(view, np.flatnonzero(memories == memory), motion, names, looks).observe()


class _Team:
    """Agents of a view that share a memory, or one that has its own, in all games.

    Args:
        view: in which they are asked.
        members: their numbers in the view.
        motion, names: see `expected`.
        looks: of all agents of the view.
    """

    def __init__(
        self, view: ArrayView, members: IntArray, motion: Motion, names: Sequence[str] | None, looks: list[list[_Look]]
    ) -> None:
        roster, me = view.roster, view.agents[members[0]]
        everyone = np.arange(len(roster.names))
        are_others = ~roster.are_mates(me, everyone) & (everyone != me) & ~roster.flies
        self._about = self._order = np.flatnonzero(are_others)
        if names is not None:
            known = [number for name in names for number in np.flatnonzero(np.array(roster.names) == name).tolist()]
            if len(known) < len(names) or roster.flies[known].any() or not view.is_there[:, known].all():
                raise NotTakenUp("there is no such agent on the ground")
            self._about = np.unique(known)
            self._order = np.array(known, np.int64)
        self._order = np.searchsorted(self._about, self._order)
        self._are_others = are_others[self._about]
        self._have_moved = parts_of(view)[self._about] < parts_of(view)[me]  # since they were put back
        self._view, self._members, self._looks = view, members, looks
        chain = chain_of(motion, ground_of(view.streets.columns))
        self._chain, self._steps, self._nodes = chain, motion.steps, len(chain.rows)
        first = partial(_unobserved, chain.shares / len(chain.rows), len(self._about))
        self._put = put_back(view)
        self._kept = view.keep((BOARD, int(view.memory_of[me])), first)

    def observe(self) -> Iterator[tuple[IntArray, int, FloatArray]]:
        """Yield what is expected by each member, see `expected`, and take in what all have observed."""
        asked = np.flatnonzero(self._view.mask[:, self._members].any(axis=1))
        at_once = max(1, _MOST_AT_ONCE // (self._nodes * max(1, len(self._about))))
        for begin in range(0, len(asked) if len(self._about) else 0, at_once):
            places = asked[begin : begin + at_once]
            games, turn = self._view.games[places], self._view.turn[places]
            self._put_earlier(places)
            while len(late := np.flatnonzero(self._kept["turn"][games] < turn)):  # in which none of them was asked
                masses = self._masses(games[late])
                put = self._put_back(places[late], self._kept["turn"][games[late]])
                for which in range(masses.shape[1]):
                    _put(masses[:, which], put)
                self._predict(games[late], masses)
            yield from self._observe_in(places)

    def _observe_in(self, places: IntArray) -> Iterator[tuple[IntArray, int, FloatArray]]:
        view, games = self._view, self._view.games[places]
        masses, living = self._masses(games), view.living[places][:, self._about].T
        now, put = np.ascontiguousarray(masses[:, _NOW]), self._put_back(places, view.turn[places])
        missed_by_all, found_by_all = np.ones(now.shape), put
        for column in self._members.tolist():
            missed, found = np.ones(now.shape), put.copy()
            for look in self._looks[column]:
                rows, targets, at, chances = self._take(look, places, found)
                missed[rows, targets, at] *= chances
                missed_by_all[rows, targets, at] *= chances
            found_by_all = np.maximum(found_by_all, found)
            weights, total = self._weighed(now, missed, found), np.zeros((self._nodes, len(places)))
            for target in self._order.tolist():
                is_there = living[target]
                total += weights[:, target] if is_there.all() else np.where(is_there, weights[:, target], 0.0)
            yield places, column, total
        for which in (_NOW, _NEXT)[: masses.shape[1] - 1]:
            masses[:, which] = self._weighed(masses[:, which], missed_by_all, found_by_all)
        _put(masses[:, _BY_NONE], found_by_all)
        self._predict(games, masses)

    def _take(self, look: _Look, places: IntArray, found: IntArray) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
        """Return rows, targets, games and chances that a look has missed them; write where it has found some."""
        view, number = self._view, places_of(places, len(self._view.games))
        roster, of = view.roster, places_of(self._about, len(view.roster.names))
        shows = np.array([look.kind.shows(team) for team in roster.teams], np.bool_)[roster.team_of]
        is_shown = (shows & view.living[places]) | ~view.is_there[places]  # of those to come nothing is known
        is_shown = is_shown[:, self._about] | ~self._are_others
        at, others, nodes = (number[look.reported[0]], of[look.reported[1]], look.reported[2])
        counts = (at >= 0) & (others >= 0) & self._are_others[others]
        if look.kind.errs:
            is_shown[at[counts], others[counts]] = False
        else:
            found[at[counts], others[counts]] = nodes[counts]
        at, rows, chances = number[look.covered[0]], *look.covered[1:]
        pairs, targets = np.nonzero(is_shown[at] & (at >= 0)[:, None])
        return rows[pairs], targets, at[pairs], chances[pairs]

    def _put_back(self, places: IntArray, turns: IntArray) -> IntArray:
        """Return the rows of nodes on which targets were put when these turns began, (games, targets); -1: on none."""
        which = np.ix_(self._view.games[places], self._about)
        put, nodes = self._put["turn"][which], self._put["node"][which]
        return np.where((put - self._have_moved == turns[:, None]) & self._are_others, nodes, -1)

    def _put_earlier(self, places: IntArray) -> None:
        """Put targets where they were one turn before, if they have moved before that was known."""
        games = self._view.games[places]
        earlier = self._put_back(places, self._kept["turn"][games] - 1)
        at, targets = np.nonzero((earlier >= 0) & self._have_moved)
        there = np.zeros((self._nodes, len(at)))
        there[earlier[at, targets], np.arange(len(at))] = 1.0
        self._all()[:, :, targets, games[at]] = self._moved(there)[:, None]

    # -- probabilities, (nodes, by which looks, targets, games) -------------------------------------------------------

    def _masses(self, games: IntArray) -> FloatArray:
        number = _NEXT if (self._kept["turn"][games] < HORIZON).all() else _NEXT + 1
        return np.array(self._all()[:, :number, :, as_slice(games)], order="C")

    def _all(self) -> FloatArray:
        """Return what is kept, of all games."""
        found: FloatArray = self._kept["masses"].transpose(3, 1, 2, 0)
        return found

    def _weighed(self, masses: FloatArray, missed: FloatArray, found: IntArray) -> FloatArray:
        """Return probabilities, (nodes, targets, games), after what was missed, and where targets were found."""
        _put(missed, found)
        flat = (one.reshape(self._nodes, -1) for one in (masses, missed))
        return weighed(self._chain, *flat)[0].reshape(masses.shape)

    def _moved(self, masses: FloatArray) -> FloatArray:
        """Return probabilities, (nodes, …), a turn later."""
        for _ in range(self._steps):
            masses = self._chain.transitions.sums(masses)
        return masses

    def _predict(self, games: IntArray, masses: FloatArray) -> None:
        """Let targets move, and keep the probabilities."""
        flat = self._moved(masses.reshape(self._nodes, -1))
        kept, turn = self._all(), self._kept["turn"][games] + 1
        kept[:, : masses.shape[1], :, as_slice(games)] = flat.reshape(masses.shape)
        self._kept["turn"][games] = turn
        later, sooner = (games[(turn % HORIZON == 0) & (turn > least)] for least in (HORIZON, 0))  # looks are forgotten
        kept[:, _NOW, :, later] = kept[:, _NEXT, :, later]
        kept[:, _NEXT, :, sooner] = kept[:, _BY_NONE, :, sooner]


def _put(masses: FloatArray, found: IntArray) -> None:
    """Put targets on the nodes where they were found, (games, targets)."""
    at, targets = np.nonzero(found >= 0)
    masses[:, targets, at] = 0.0
    masses[found[at, targets], targets, at] = 1.0


def _unobserved(first: FloatArray, targets: int, games: int) -> Arrays:
    """Return what is kept of games in which nothing was observed; with the games last in memory, as it is computed."""
    if (needed := 3 * first.nbytes * targets * games) > max_memory():
        raise NotTakenUp(f"beliefs would take {needed} bytes")
    masses = np.broadcast_to(first[:, None, None, None], (len(first), 3, targets, games))
    return {"masses": np.array(masses, order="C").transpose(3, 1, 2, 0), "turn": np.zeros(games, np.int64)}
