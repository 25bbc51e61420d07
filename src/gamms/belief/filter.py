"""Bayes filters on a graph: the probable positions of targets, from a model of motion and observations."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gamms import kernels
from gamms.arguments import (
    as_array,
    as_context,
    as_count,
    as_ids,
    as_items,
    as_key,
    as_known,
    as_mapping,
    as_numbers_of,
    as_range,
)
from gamms.belief.ground import BeliefMap, get_belief_map
from gamms.belief.motion import Motion, MotionChain, as_motion, convert_evidence, get_chain
from gamms.core import belief as core
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, as_node_ids
from gamms.ir.obstacles import BoolArray
from gamms.typing import IContext
from gamms.typing.game import NodeId


class StateProbabilities:
    """Probabilities of the states of targets, which move independently of each other by one Markov chain.

    Args:
        ground: the map.
        motion: model of the motion of the targets.
        metres: distance per turn, in games by metres; None: targets are on nodes only.
        number: the number of targets.

    Attributes:
        chain: the chain of the model.
        masses: (states, targets) for each target they add up to 1; initially uniform over the nodes. Settable, to
            continue from earlier ones.

    Raises:
        BadType, BadValue: the motion is not a model, or the map has no nodes.
    """

    def __init__(self, ground: BeliefMap, motion: Motion, metres: float | None, number: int) -> None:
        self._ground = ground
        self._metres = None if metres is None else as_range(metres, "metres of a filter")
        self._motion = as_motion(motion, "motion")
        self.chain: MotionChain = get_chain(self._motion, ground, self._metres)
        if not ground.size:
            raise BadValue("A filter needs a map, but the graph has no nodes. Add nodes first.")
        self._masses = np.tile(self.chain.shares / ground.size, (number, 1))  # (targets, states)

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes without the chain, which a copy takes from the model."""
        state = vars(self).copy()
        del state["chain"]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Become a copy."""
        vars(self).update(state)
        self.chain = get_chain(self._motion, self._ground, self._metres)

    @property
    def masses(self) -> FloatArray:
        """The probabilities of the states, (states, targets); settable, see the class."""
        masses: FloatArray = self._masses.T
        return masses

    @masses.setter
    def masses(self, masses: FloatArray) -> None:
        self._masses = np.ascontiguousarray(_as_weights(masses, "masses", self.masses.shape).T)

    def predict(self, turns: int = 1) -> None:
        """Advance some turns, in which the targets move by the model."""
        self._masses = self.chain.predict(self._masses, as_count(turns, "turns", 0) * self._motion.steps)

    def weigh_states(self, likelihoods: FloatArray) -> FloatArray:
        """Update with the likelihood of an observation in each state of the chain, (states, targets)."""
        of_states = _as_weights(likelihoods, "likelihoods", self.masses.shape)
        found = np.empty_like(self._masses)
        totals = np.empty(len(self._masses))
        by_state = np.empty(len(of_states))
        chain = self.chain.core
        work = self.chain.make_buffers(by_state)
        is_changed = (of_states != 1.0).any(axis=0).tolist()
        for target, before in enumerate(self._masses):
            by_state[:] = of_states[:, target]
            totals[target] = core.weigh(
                chain, work, is_changed[target], kernels.as_buffer(before), 0, kernels.as_buffer(found[target]), 0
            )
        self._masses = found
        return totals

    def _update(
        self, looks: IntArray, seen: tuple[IntArray, FloatArray], found: IntArray, shown: BoolArray
    ) -> FloatArray:
        """Update with one look at nodes in each game, and with the positions of found targets.

        Args:
            looks: (games + 1,) offsets of the nodes of each game in `seen`.
            seen: rows of the nodes, and the probability that a target there is missed.
            found: (games, targets) rows of nodes; -1: not found.
            shown: (games, targets) whether the look has information about a target.

        Returns:
            The probability of the observation, (games, targets).
        """
        games, targets = found.shape
        evidence = convert_evidence(looks, seen, shown, found)
        masses = self._masses.reshape(games, targets, len(self.chain.rows))
        weighed, totals = self.chain.apply_evidence(masses, evidence, np.arange(games + 1))
        self._masses = weighed.reshape(self._masses.shape)
        return totals


class Filter(StateProbabilities):
    """The exact Bayesian probabilities of the positions of targets.

    The targets move independently of each other. The initial distribution is uniform over the nodes.

    Args:
        ctx: the context; its present map is used.
        motion: model of the motion of the targets.
        targets: names of the targets.
        metres: distance per turn, in games by metres; None: targets are on nodes only. A target on an edge counts for
            the last node that it passed.

    Attributes:
        targets: names of the targets.
        chain: the chain of the model.
        masses: (states, targets) for each target they add up to 1. Settable, to continue from earlier ones.

    Raises:
        BadType, BadValue: the motion is not a model, or the map has no nodes.
    """

    def __init__(self, ctx: IContext, motion: Motion, targets: Iterable[str], *, metres: float | None = None) -> None:
        self.targets: Sequence[str] = tuple(as_items(targets, "targets", "names"))
        super().__init__(get_belief_map(as_context(ctx, "Filter").graph.columns()), motion, metres, len(self.targets))

    def update(
        self,
        seen_nodes: Iterable[NodeId] = (),
        detection_probability: float | Iterable[float] = 1.0,
        found: Mapping[str, NodeId] | None = None,
        not_shown: Iterable[str] = (),
    ) -> FloatArray:
        """Update with an observation between two turns.

        Args:
            seen_nodes: ids of nodes on which a target would have been noticed.
            detection_probability: the probability of noticing a target there; one for all nodes, or one for each node.
            found: target -> the node on which it was seen.
            not_shown: targets about which `seen_nodes` has no information.

        Returns:
            The probability (targets,) of the observation under the previous belief. If it was 0, the belief was wrong,
            and restarts from this observation alone.

        Raises:
            UnknownName (KeyError): a node or target does not exist.
            BadType, BadValue: a probability is invalid.
        """
        seen = self._ground.find_known_rows(np.array(as_node_ids(seen_nodes, "seen_nodes"), np.int64))
        given: object = detection_probability
        if isinstance(given, Iterable) and not isinstance(given, np.ndarray):
            given = [*given]
        chances = as_array(given, "detection_probability", "probabilities", (len(seen),))
        places = dict(as_mapping({} if found is None else found, "found"))
        left_out = frozenset(as_key(name, "Each of not_shown") for name in as_items(not_shown, "not_shown", "names"))
        for name in (*places, *sorted(left_out)):
            as_known(name, "target", self.targets)
        rows = dict(
            zip(places, self._ground.find_known_rows(np.array(as_ids(places.values(), "found"), np.int64)), strict=True)
        )
        places_of = np.array([[rows.get(name, core.IS_UNSEEN) for name in self.targets]], np.int64)
        are_shown = np.array([[name not in left_out for name in self.targets]], np.bool_)
        missed = 1.0 - np.broadcast_to(chances, seen.shape)
        totals: FloatArray = self._update(np.array([0, len(seen)]), (seen, missed), places_of, are_shown)[0]
        return totals

    def weigh(self, likelihoods: FloatArray) -> FloatArray:
        """Update with the likelihood of an observation for each node.

        Args:
            likelihoods: (nodes, targets) probability of the observation if the target is on the node; for a target on
                an edge, the greater one of its ends.

        Returns:
            See `update`.

        Raises:
            BadType, BadValue: the shape is wrong, or a likelihood is negative, infinite or NaN.
        """
        shape = self._ground.size, self.masses.shape[1]
        of_nodes = _as_weights(likelihoods, "likelihoods", shape)
        of_states = of_nodes[self.chain.rows]
        between = np.flatnonzero(self.chain.edges >= 0)
        of_states[between] = np.maximum(of_states[between], of_nodes[self.chain.ends[between]])
        return self.weigh_states(of_states)

    def probabilities(self) -> FloatArray:
        """Return the probability of each node, (targets, nodes), with the nodes as in `ctx.graph.columns()`."""
        return self.chain.sum_by_node(self._masses)

    def probability(self, target: str) -> dict[int, float]:
        """Return node -> probability that a target is there, without impossible nodes.

        Raises:
            UnknownName (KeyError): the target does not exist.
        """
        as_known(as_key(target, "The name of a target"), "target", self.targets)
        return list_by_node(self._ground, self.probabilities()[self.targets.index(target)])


class GamesFilter(StateProbabilities):
    """A filter for the targets of many games at once, with exactly the results of one `Filter` per game.

    It needs 8 bytes for each state of the chain (at least the nodes), and each target of each game.

    Args:
        columns: the map, for example `view.streets.columns`.
        motion: model of the motion of the targets.
        games: number of games.
        targets: number of targets in each game.
        metres: see `Filter`.

    Raises:
        BadType, BadValue: see `Filter`.
    """

    def __init__(
        self, columns: GraphColumns, motion: Motion, games: int, targets: int = 1, *, metres: float | None = None
    ) -> None:
        self._shape = as_count(games, "games", least=0), as_count(targets, "targets", least=0)
        super().__init__(get_belief_map(columns), motion, metres, self._shape[0] * self._shape[1])

    def update(
        self, seen: FloatArray | BoolArray, found: IntArray | None = None, not_shown: BoolArray | None = None
    ) -> FloatArray:
        """Update with an observation in all games, between two turns.

        Args:
            seen: (games, nodes) the probability that a target on a node would have been noticed.
            found: (games, targets) rows of the nodes on which targets were seen; -1: not seen.
            not_shown: (games, targets) whether `seen` has no information about a target.

        Returns:
            (games, targets) see `Filter.update`.

        Raises:
            BadType, BadValue: a shape is wrong, `seen` has invalid probabilities, or `found` invalid rows.
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
            raise BadValue(f"found has row {found.max()}, but the map has {self._ground.size} nodes, from 0.")
        at, rows = np.nonzero(chances)
        looks = np.searchsorted(at, np.arange(self._shape[0] + 1))
        places = np.maximum(found, core.IS_UNSEEN).astype(np.int64)
        return self._update(looks, (rows, 1.0 - chances[at, rows]), places, ~not_shown)

    def reset(self, games: IntArray) -> None:
        """Restart some games, given by number: their targets may be anywhere.

        Raises:
            BadType, BadValue: invalid numbers of games.
        """
        games = as_numbers_of(games, "games", self._shape[0], "games").reshape(-1)
        masses = self._masses.reshape(*self._shape, len(self.chain.rows))
        masses[games] = self.chain.shares / self._ground.size

    def probabilities(self) -> FloatArray:
        """Return the probability of each node, (games, targets, nodes), with the nodes as in the columns."""
        return self.chain.sum_by_node(self._masses).reshape(*self._shape, self._ground.size)


def _as_weights(given: object, name: str, shape: tuple[int, ...]) -> FloatArray:
    weights: FloatArray = as_array(given, name, "weights").astype(np.float64, copy=False)
    if weights.shape != shape:
        raise BadValue(f"{name} need the shape {shape}, not {weights.shape}.")
    return weights


def list_by_node(ground: BeliefMap, probabilities: FloatArray) -> dict[int, float]:
    """Return node -> probability, without probabilities of 0."""
    rows = np.flatnonzero(probabilities)
    return dict(zip(ground.list_ids(rows), probabilities[rows].tolist(), strict=True))
