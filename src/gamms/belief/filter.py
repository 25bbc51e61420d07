"""Bayes filters on a graph: where some targets probably are, by a model of their motion and by what is observed."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_count, as_ids, as_items, as_key, as_known, as_mapping, as_numbers_of, as_range
from gamms.belief.ground import Ground, ground_of
from gamms.belief.motion import Chain, Motion, as_motion, chain_of
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing import IContext
from gamms.typing.game import NodeId


class Masses:
    """Probabilities of the states of some targets, which move independently of each other by one chain.

    Args:
        ground: the map.
        motion: how the targets move.
        metres: how far they go in a turn, in games by metres; None: they are on nodes only.
        number: of targets.

    Attributes:
        chain: of the model, with the states.
        masses: (states, targets) of each target they add up to 1; at first each is on any node, with the same
            probability. Settable, to go on from earlier ones.

    Raises:
        BadType, BadValue: the motion is no model, or the map has no nodes.
    """

    def __init__(self, ground: Ground, motion: Motion, metres: float | None, number: int) -> None:
        self._ground = ground
        pace = None if metres is None else as_range(metres, "metres of a filter")
        self.chain: Chain = chain_of(as_motion(motion, "motion"), ground, pace)
        self._motion = motion
        if not ground.size:
            raise BadValue("A filter needs a map, and the graph has no nodes. Add them before.")
        self.masses: FloatArray = np.repeat(self.chain.shares[:, None] / ground.size, number, axis=1)

    def predict(self, turns: int = 1) -> None:
        """Let turns pass, in which the targets move by the model."""
        for _ in range(as_count(turns, "turns", 0) * self._motion.steps):
            self.masses = self.chain.transitions.sums(self.masses)

    def weigh_states(self, likelihoods: FloatArray) -> FloatArray:
        """Take in an observation by how probable it is for each state of the chain, (states, targets)."""
        self.masses, totals = weighed(self.chain, self.masses, _likelihoods(likelihoods, self.masses.shape))
        return totals

    def _of_nodes(self) -> FloatArray:
        """Return how probable each node is, (nodes, targets)."""
        chain = self.chain
        return self.masses if chain.are_nodes else chain.by_node.sums(self.masses)[: self._ground.size]

    def _unseen(self, missed: FloatArray) -> FloatArray:
        """Return how probable it is for each state that a target in it is not seen, by that of the nodes."""
        on_nodes: BoolArray = self.chain.edges < 0
        of_states = missed[self.chain.rows]
        of_states[~on_nodes] = 1.0
        return of_states


class Filter(Masses):
    """Probabilities of where some targets are, which are exactly those of Bayes' rule.

    The targets move independently of each other. At first each is on any node, with the same probability.

    Args:
        ctx: the context, whose map is taken as it is now.
        motion: how the targets move.
        targets: their names.
        metres: how far they go in a turn, in games by metres; None: they are on nodes only. What is on an edge counts
            for the node that it has passed last.

    Attributes:
        targets: their names.
        chain: of the model, with the states.
        masses: (states, targets) of the chain of the model; of each target they add up to 1. Settable, to go on from
            earlier ones.

    Raises:
        BadType, BadValue: the motion is no model, or the map has no nodes.
    """

    def __init__(self, ctx: IContext, motion: Motion, targets: Iterable[str], *, metres: float | None = None) -> None:
        self.targets: Sequence[str] = tuple(as_items(targets, "targets", "names"))
        super().__init__(ground_of(ctx.graph.columns()), motion, metres, len(self.targets))

    def update(
        self,
        seen_nodes: Iterable[NodeId] = (),
        detection_probability: float | Iterable[float] = 1.0,
        found: Mapping[str, NodeId] | None = None,
        not_shown: Iterable[str] = (),
    ) -> FloatArray:
        """Take in what was observed at one moment, between two turns.

        Args:
            seen_nodes: ids of nodes on which a target would have been noticed.
            detection_probability: how probable that was, or for each of these nodes how probable.
            found: target -> the node it was seen on.
            not_shown: targets of which `seen_nodes` say nothing.

        Returns:
            (targets,) how probable the observation was by what was believed before. Where it was 0, the belief was
            wrong, and begins again from this observation alone.

        Raises:
            UnknownName (KeyError): there is no such node or target.
            BadType, BadValue: a probability is none.
        """
        seen = self._ground.known_rows(np.array(as_ids(seen_nodes, "seen_nodes"), np.int64))
        given: object = detection_probability
        if isinstance(given, Iterable) and not isinstance(given, np.ndarray):
            given = [*given]
        chances = as_array(given, "detection_probability", "probabilities", (len(seen),))
        places = dict(as_mapping({} if found is None else found, "found"))
        left_out = frozenset(as_key(name, "Each of not_shown") for name in as_items(not_shown, "not_shown", "names"))
        for name in (*places, *sorted(left_out)):
            as_known(name, "target", self.targets)
        rows = dict(
            zip(places, self._ground.known_rows(np.array(as_ids(places.values(), "found"), np.int64)), strict=True)
        )
        missed = np.ones(self._ground.size)
        np.multiply.at(missed, seen, 1.0 - chances)
        likelihoods = np.repeat(self._unseen(missed)[:, None], len(self.targets), axis=1)
        for column, name in enumerate(self.targets):
            if name in rows:
                likelihoods[:, column] = self.chain.rows == rows[name]
            elif name in left_out:
                likelihoods[:, column] = 1.0
        return self.weigh_states(likelihoods)

    def weigh(self, likelihoods: FloatArray) -> FloatArray:
        """Take in an observation by how probable it is for each node.

        Args:
            likelihoods: (nodes, targets) of the observation, if the target is on the node; on an edge, the greater one
                of its ends.

        Returns:
            As `update`.

        Raises:
            BadType, BadValue: the array has another shape, or a likelihood is negative, infinite or NaN.
        """
        chain, shape = self.chain, (self._ground.size, self.masses.shape[1])
        likelihoods = _likelihoods(likelihoods, shape)
        of_states = likelihoods[chain.rows]
        between = np.flatnonzero(chain.edges >= 0)
        ends = self._ground.columns.targets[chain.edges[between]]
        of_states[between] = np.maximum(of_states[between], likelihoods[ends])
        return self.weigh_states(of_states)

    def probabilities(self) -> FloatArray:
        """Return how probable each node is, (targets, nodes) with the nodes as in `ctx.graph.columns()`."""
        return self._of_nodes().T.copy()

    def probability(self, target: str) -> dict[int, float]:
        """Return node -> how probable it is that a target is there, without those where it cannot be.

        Raises:
            UnknownName (KeyError): there is no such target.
        """
        as_known(as_key(target, "The name of a target"), "target", self.targets)
        return by_node(self._ground, self.probabilities()[self.targets.index(target)])


class GamesFilter(Masses):
    """The same for targets of many games at once: the probabilities are those of a `Filter` of each game, bit by bit.

    It takes 8 bytes for each state of the chain, which are the nodes or more, and each target of each game.

    Args:
        columns: the map, such as `view.streets.columns`.
        motion: how the targets move.
        games: how many.
        targets: how many in each.
        metres: as for a `Filter`.

    Raises:
        BadType, BadValue: as for a `Filter`.
    """

    def __init__(
        self, columns: GraphColumns, motion: Motion, games: int, targets: int = 1, *, metres: float | None = None
    ) -> None:
        self._shape = as_count(games, "games", least=0), as_count(targets, "targets", least=0)
        super().__init__(ground_of(columns), motion, metres, self._shape[0] * self._shape[1])

    def update(
        self, seen: FloatArray | BoolArray, found: IntArray | None = None, not_shown: BoolArray | None = None
    ) -> FloatArray:
        """Take in what was observed in all games at one moment, between two turns.

        Args:
            seen: (games, nodes) how probable it was that a target on a node would have been noticed.
            found: (games, targets) the rows of the nodes on which targets were seen; -1: it was not seen.
            not_shown: (games, targets) of which targets `seen` says nothing.

        Returns:
            (games, targets) as `Filter.update`.

        Raises:
            BadType, BadValue: an array has another shape, `seen` has no probabilities, or `found` no rows of nodes.
        """
        games, targets = self._shape
        chances = as_array(seen, "seen", "probabilities").astype(np.float64, copy=False)
        found = None if found is None else as_array(found, "found", "integers")
        not_shown = None if not_shown is None else as_array(not_shown, "not_shown", "booleans")
        for name, given, shape in (
            ("seen", chances, (games, self._ground.size)),
            ("found", found, self._shape),
            ("not_shown", not_shown, self._shape),
        ):
            if given is not None and given.shape != shape:
                raise BadValue(f"{name} needs the shape {shape}, not {given.shape}.")
        if found is not None and found.max(initial=-1) >= self._ground.size:
            raise BadValue(f"found: there is no row {found.max()}: the map has {self._ground.size} nodes, from 0.")
        likelihoods = np.repeat(self._unseen(1.0 - chances.T), targets, axis=1)
        if not_shown is not None:
            likelihoods[:, not_shown.ravel()] = 1.0
        if found is not None:
            there = np.flatnonzero(found.ravel() >= 0)
            likelihoods[:, there] = self.chain.rows[:, None] == found.ravel()[there]
        return self.weigh_states(likelihoods).reshape(self._shape)

    def reset(self, games: IntArray) -> None:
        """Begin some games again, by their numbers: their targets may be anywhere.

        Raises:
            BadType, BadValue: these are no numbers of games.
        """
        games = as_numbers_of(games, "games", self._shape[0], "games").reshape(-1)
        masses = self.masses.reshape(-1, *self._shape)
        masses[:, games] = (self.chain.shares / self._ground.size)[:, None, None]

    def probabilities(self) -> FloatArray:
        """Return how probable each node is, (games, targets, nodes) with the nodes as in the columns."""
        return self._of_nodes().T.reshape(*self._shape, self._ground.size).copy()


def _likelihoods(given: object, shape: tuple[int, ...]) -> FloatArray:
    likelihoods: FloatArray = as_array(given, "likelihoods", "weights").astype(np.float64, copy=False)
    if likelihoods.shape != shape:
        raise BadValue(f"likelihoods need the shape {shape}, not {likelihoods.shape}.")
    return likelihoods


def by_node(ground: Ground, probabilities: FloatArray) -> dict[int, float]:
    """Return node -> probability for those that are more than 0."""
    rows = np.flatnonzero(probabilities)
    return dict(zip(ground.ids_where(rows), probabilities[rows].tolist(), strict=True))


def weighed(chain: Chain, masses: FloatArray, likelihoods: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return masses (states, targets) after observations, and how probable these were; see `Filter.update`."""
    found, totals = np.empty_like(masses), np.ones(masses.shape[1])
    for columns in kernels.column_blocks(masses):
        block, by_state = found[:, columns], likelihoods[:, columns]
        np.multiply(masses[:, columns], by_state, out=block)
        is_changed = (by_state != 1.0).any(axis=0)
        totals[columns] = sums = np.where(is_changed, _totals(block), 1.0)
        for column in np.flatnonzero(sums == 0.0).tolist():
            shares, possible = chain.shares, by_state[:, column]
            # At first no target is on an edge; and perhaps no state is possible.
            prior = next(one for one in (shares * possible, possible, shares) if one.any())
            block[:, column] = prior
            sums[column] = _totals(block[:, column : column + 1])[0]
        block /= sums
    return found, totals


def _totals(masses: FloatArray) -> FloatArray:
    """Return the sums of columns (columns,), the same bits for a column alone: halves are added up."""
    while len(masses) > 1:
        half = len(masses) // 2
        added = masses[:half] + masses[half : 2 * half]
        if len(masses) % 2:
            added[0] += masses[-1]
        masses = added
    totals: FloatArray = masses[0].copy()
    return totals
