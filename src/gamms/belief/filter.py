"""Bayes filters on a graph: where some targets probably are, by a model of their motion and by what is observed."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_count, as_ids, as_items, as_key, as_known, as_mapping, as_numbers_of, as_range
from gamms.belief.ground import Ground, ground_of
from gamms.belief.motion import Chain, Motion, as_motion, chain_of, evidence_of
from gamms.core import belief as core
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
        self._masses = np.tile(self.chain.shares / ground.size, (number, 1))  # (targets, states)

    @property
    def masses(self) -> FloatArray:
        """(states, targets) how probable the states are; settable, see the class."""
        masses: FloatArray = self._masses.T
        return masses

    @masses.setter
    def masses(self, masses: FloatArray) -> None:
        self._masses = np.ascontiguousarray(_as_weights(masses, "masses", self.masses.shape).T)

    def predict(self, turns: int = 1) -> None:
        """Let turns pass, in which the targets move by the model."""
        self._masses = self.chain.predicted(self._masses, as_count(turns, "turns", 0) * self._motion.steps)

    def weigh_states(self, likelihoods: FloatArray) -> FloatArray:
        """Take in an observation by how probable it is for each state of the chain, (states, targets)."""
        of_states = _as_weights(likelihoods, "likelihoods", self.masses.shape)
        found, totals, by_state = np.empty_like(self._masses), np.empty(len(self._masses)), np.empty(len(of_states))
        chain, work, is_changed = (
            self.chain.core,
            self.chain.work_with(by_state),
            (of_states != 1.0).any(axis=0).tolist(),
        )
        for target, before in enumerate(self._masses):
            by_state[:] = of_states[:, target]
            totals[target] = core.weigh(
                chain, work, is_changed[target], kernels.buffer(before), 0, kernels.buffer(found[target]), 0
            )
        self._masses = found
        return totals

    def _update(
        self, looks: IntArray, seen: tuple[IntArray, FloatArray], found: IntArray, shown: BoolArray
    ) -> FloatArray:
        """Take in one look at nodes in each of some games, and where targets were found.

        Args:
            looks: (games + 1,) where the nodes of each begin, and at last where they end.
            seen: their rows, and how probable it is that a target there is missed.
            found: (games, targets) rows of nodes; -1: it was not found.
            shown: (games, targets) whether the look says something about a target.

        Returns:
            (games, targets) how probable this was.
        """
        games, targets = found.shape
        evidence = evidence_of(looks, seen, shown, found)
        masses = self._masses.reshape(games, targets, len(self.chain.rows))
        weighed, totals = self.chain.observed(masses, evidence, np.arange(games + 1))
        self._masses = weighed.reshape(self._masses.shape)
        return totals


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
        places_of = np.array([[rows.get(name, core.IS_UNSEEN) for name in self.targets]], np.int64)
        are_shown = np.array([[name not in left_out for name in self.targets]], np.bool_)
        missed = 1.0 - np.broadcast_to(chances, seen.shape)
        totals: FloatArray = self._update(np.array([0, len(seen)]), (seen, missed), places_of, are_shown)[0]
        return totals

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
        shape = self._ground.size, self.masses.shape[1]
        of_nodes = _as_weights(likelihoods, "likelihoods", shape)
        of_states = of_nodes[self.chain.rows]
        between = np.flatnonzero(self.chain.edges >= 0)
        of_states[between] = np.maximum(of_states[between], of_nodes[self.chain.ends[between]])
        return self.weigh_states(of_states)

    def probabilities(self) -> FloatArray:
        """Return how probable each node is, (targets, nodes) with the nodes as in `ctx.graph.columns()`."""
        return self.chain.of_nodes(self._masses)

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
        chances = as_array(seen, "seen", "probabilities").astype(np.float64, copy=False)
        found = np.full(self._shape, core.IS_UNSEEN) if found is None else as_array(found, "found", "integers")
        not_shown = (
            np.zeros(self._shape, np.bool_) if not_shown is None else as_array(not_shown, "not_shown", "booleans")
        )
        for name, given, shape in (
            ("seen", chances, (self._shape[0], self._ground.size)),
            ("found", found, self._shape),
            ("not_shown", not_shown, self._shape),
        ):
            if given.shape != shape:
                raise BadValue(f"{name} needs the shape {shape}, not {given.shape}.")
        if found.max(initial=-1) >= self._ground.size:
            raise BadValue(f"found: there is no row {found.max()}: the map has {self._ground.size} nodes, from 0.")
        at, rows = np.nonzero(chances)
        looks = np.searchsorted(at, np.arange(self._shape[0] + 1))
        places = np.maximum(found, core.IS_UNSEEN).astype(np.int64)
        return self._update(looks, (rows, 1.0 - chances[at, rows]), places, ~not_shown)

    def reset(self, games: IntArray) -> None:
        """Begin some games again, by their numbers: their targets may be anywhere.

        Raises:
            BadType, BadValue: these are no numbers of games.
        """
        games = as_numbers_of(games, "games", self._shape[0], "games").reshape(-1)
        masses = self._masses.reshape(*self._shape, len(self.chain.rows))
        masses[games] = self.chain.shares / self._ground.size

    def probabilities(self) -> FloatArray:
        """Return how probable each node is, (games, targets, nodes) with the nodes as in the columns."""
        return self.chain.of_nodes(self._masses).reshape(*self._shape, self._ground.size)


def _as_weights(given: object, name: str, shape: tuple[int, ...]) -> FloatArray:
    weights: FloatArray = as_array(given, name, "weights").astype(np.float64, copy=False)
    if weights.shape != shape:
        raise BadValue(f"{name} need the shape {shape}, not {weights.shape}.")
    return weights


def by_node(ground: Ground, probabilities: FloatArray) -> dict[int, float]:
    """Return node -> probability for those that are more than 0."""
    rows = np.flatnonzero(probabilities)
    return dict(zip(ground.ids_where(rows), probabilities[rows].tolist(), strict=True))
