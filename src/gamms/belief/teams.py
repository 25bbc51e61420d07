"""What teams of the games of a batch believe: `observe` and `Belief.probabilities` for array forms of strategies.

No observations are kept, but what follows from them: the probabilities of each team, by what it has observed before the
present turn. Looks are forgotten, so there are three of each: by the looks that count now, by none, and by those since
the last turn in which looks were forgotten, which will count after the next one.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.belief.evidence import HORIZON, as_written
from gamms.belief.ground import ground_of
from gamms.belief.motion import Motion, chain_of, evidence_of
from gamms.core import belief as core
from gamms.game.batch.begun import remembers
from gamms.game.batch.columns import PlayedGame, agents_of, decider_of, places_of
from gamms.game.batch.forms import key_of, strategy_spec_of
from gamms.game.batch.sight import looks_from_the_air
from gamms.game.batch.state import Arrays, NotTakenUp
from gamms.game.batch.view import ArrayView, looks_in, movement_in, parts_of, put_back
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import AgentLook
from gamms.limits import max_memory
from gamms.typing import IAgent

BOARD = "belief"  # one of the `boards` of strategies that observe, see `StrategySpec`
_MOST_AT_ONCE = 1 << 20  # probabilities of members that are worked out together
_NOW, _BY_NONE, _NEXT = range(3)  # by which looks


def why_not_believed(motion: Motion, game: PlayedGame, agent: IAgent) -> str | None:
    """Return why an agent cannot observe in arrays, in words; None: it can."""
    settings, plans = game.settings(), game.settings()["plans"]
    mates = [one for one in agents_of(game) if one.team == agent.team is not None]
    specs = [strategy_spec_of(decider_of(one, plans)) for one in (agent, *mates)]
    chain = chain_of(motion, ground_of(game.ctx.graph.columns()))
    others = {key_of(spec.array_form) for spec in specs if BOARD in spec.boards}
    reasons = {
        "in a game by metres": settings["speed_unit"] != "edges",
        "with rules of the phase 'deeds'": any(one.phase == "deeds" for one in game.rules),
        "with sensors that look from the air": looks_from_the_air(agent),
        "beside another one that observes for the team": len(others) > 1,
        "which goes on with what it has observed": game.turn > 0 or remembers(game, agent),
        "with a model of goals, or of several kinds": not chain.are_nodes,
    }
    return next((why for why, is_so in reasons.items() if is_so), None)


_Part = tuple[IntArray, IntArray, FloatArray, BoolArray]
"""Games, rows of nodes and the chances to miss an agent there; and about which targets that says something, (games,
targets)."""


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
        The places of some games in the view, an agent of the view, and how many living ones, (games, nodes).

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
        self._chain, self._steps = chain_of(motion, ground_of(view.streets.columns)), motion.steps
        self._nodes, self._targets = len(self._chain.rows), len(self._about)
        first = partial(_unobserved, self._chain.shares / self._nodes, self._targets)
        self._put = put_back(view)
        self._kept = view.keep((BOARD, int(view.memory_of[me])), first)
        self._masses = kernels.buffer(self._kept["masses"])
        self._work, self._totals = self._chain.make_work(), kernels.buffer(np.empty(self._targets))

    def observe(self) -> Iterator[tuple[IntArray, int, FloatArray]]:
        """Yield what is expected by each member, see `expected`, and take in what all have observed."""
        asked = np.flatnonzero(self._view.mask[:, self._members].any(axis=1))
        at_once = max(1, _MOST_AT_ONCE // (self._nodes * len(self._members)))
        for begin in range(0, len(asked) if self._targets else 0, at_once):
            places = asked[begin : begin + at_once]
            games, turn = self._view.games[places], self._view.turn[places]
            self._put_earlier(places)
            while len(late := np.flatnonzero(self._kept["turn"][games] < turn)):  # in which none of them was asked
                put = self._put_back(places[late], self._kept["turn"][games[late]])
                self._end_turn(games[late], self._evidence([], put[:, None]), 0, 1)
            yield from self._observe_in(places)

    def _observe_in(self, places: IntArray) -> Iterator[tuple[IntArray, int, FloatArray]]:
        view, games, nodes = self._view, self._view.games[places], self._nodes
        put = self._put_back(places, view.turn[places])
        found = np.repeat(put[:, None], len(self._members) + 1, axis=1)  # by each member, and at last by all
        parts = list[_Part]()
        ends = [0]
        for member, column in enumerate(self._members.tolist()):
            parts += [self._take(look, places, found[:, member]) for look in self._looks[column]]
            ends.append(len(parts))
        found[:, -1] = found.max(axis=1)
        evidence = self._evidence(parts, found)
        living, order = kernels.buffer(view.living[places][:, self._about].view(np.uint8)), kernels.buffer(self._order)
        total = np.zeros((len(self._members), len(places), nodes))
        totals = kernels.buffer(total)
        for i, game in enumerate(games.tolist()):
            looks, finding = [i * len(parts) + end for end in ends], i * found.shape[1]
            for member in range(len(self._members)):
                core.expect(
                    self._chain.core,
                    evidence,
                    self._work,
                    self._masses,
                    self._at(game, _NOW),
                    looks[member],
                    looks[member + 1],
                    finding + member,
                    order,
                    living,
                    i * self._targets,
                    totals,
                    (member * len(games) + i) * nodes,
                )
        for member, column in enumerate(self._members.tolist()):
            yield places, column, total[member]
        self._end_turn(games, evidence, len(parts), found.shape[1])

    def _take(self, look: _Look, places: IntArray, found: IntArray) -> _Part:
        """Return what a look has missed in some games; write where it has found targets, (games, targets)."""
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
        at = number[look.covered[0]]
        return at[at >= 0], look.covered[1][at >= 0], look.covered[2][at >= 0], is_shown

    def _evidence(self, parts: list[_Part], found: IntArray) -> core.Evidence:
        """Return what was observed in some games: the looks of each, as many as there are parts, one after the other.

        Args:
            parts: what looks have missed.
            found: (games, findings, targets) rows of nodes; -1: it was not found.
        """
        games, looks = len(found), len(parts)
        none = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
        missed = [(at * looks + i, rows, chances) for i, (at, rows, chances, _) in enumerate(parts)]
        number, rows, chances = (np.concatenate(columns) for columns in zip(none, *missed, strict=True))
        order = np.argsort(number, kind="stable")
        shown = [is_shown for *_, is_shown in parts]
        bounds = np.searchsorted(number[order], np.arange(games * looks + 1))
        return evidence_of(
            bounds,
            (rows[order], chances[order]),
            np.stack(shown, axis=1) if parts else np.zeros(0, np.bool_),
            found.reshape(-1, self._targets),
        )

    def _put_back(self, places: IntArray, turns: IntArray) -> IntArray:
        """Return the rows of nodes on which targets were put when these turns began, (games, targets); -1: on none."""
        which = np.ix_(self._view.games[places], self._about)
        put, nodes = self._put["turn"][which], self._put["node"][which]
        return np.where((put - self._have_moved == turns[:, None]) & self._are_others, nodes, -1)

    def _put_earlier(self, places: IntArray) -> None:
        """Put targets where they were one turn before, if they have moved before that was known."""
        games, masses = self._view.games[places], self._kept["masses"]
        earlier = self._put_back(places, self._kept["turn"][games] - 1)
        at, targets = np.nonzero((earlier >= 0) & self._have_moved)
        for game, target, node in zip(games[at].tolist(), targets.tolist(), earlier[at, targets].tolist(), strict=True):
            there = np.zeros((1, self._nodes))
            there[0, node] = 1.0
            masses[game, :, target] = self._chain.predicted(there, self._steps)

    def _at(self, game: int, stream: int) -> int:
        """Return where the probabilities of a game by some looks begin."""
        return (game * 3 + stream) * self._targets * self._nodes

    def _end_turn(self, games: IntArray, evidence: core.Evidence, looks: int, findings: int) -> None:
        """Take in what all have observed, and let the targets move.

        Args:
            games: of the batch.
            evidence: of these games; the last finding is that of all.
            looks: how many there are of each game.
            findings: likewise.
        """
        chain, work, masses, turns = self._chain.core, self._work, self._masses, self._kept["turn"]
        sums = kernels.buffer(np.empty(self._nodes))
        for i, game in enumerate(games.tolist()):
            at, last, finding = self._at(game, _NOW), (i + 1) * looks, (i + 1) * findings - 1
            streams = _NEXT if turns[game] < HORIZON else _NEXT + 1
            for stream in range(streams):
                begin = last if stream == _BY_NONE else last - looks
                there = self._at(game, stream)
                core.observe(chain, evidence, work, masses, there, masses, there, begin, last, finding, self._totals)
            core.predict(self._chain.ways, sums, masses, at, masses, at, streams * self._targets, self._steps)
        turns[games] += 1
        kept, turn = self._kept["masses"], turns[games]
        later, sooner = (games[(turn % HORIZON == 0) & (turn > least)] for least in (HORIZON, 0))  # looks are forgotten
        kept[later, _NOW] = kept[later, _NEXT]
        kept[sooner, _NEXT] = kept[sooner, _BY_NONE]


def _unobserved(first: FloatArray, targets: int, games: int) -> Arrays:
    """Return what is kept of games in which nothing was observed: (games, by which looks, targets, nodes)."""
    if (needed := 3 * first.nbytes * targets * games) > max_memory():
        raise NotTakenUp(f"beliefs would take {needed} bytes")
    return {"masses": np.tile(first, (games, 3, targets, 1)), "turn": np.zeros(games, np.int64)}
