"""Models of the motion of targets, as Markov chains on a map.

A model may have a hidden part, for example the goal of the target: then a state of its chain is a place together with
this part, and observations give information about both. Of targets that obey turn restrictions, the edge by which they
came is a part of the place.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_count, as_float, as_ids, as_mapping
from gamms.belief.ground import BeliefMap, MoveMap, map_moves
from gamms.core import belief as core
from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown
from gamms.typing.game import NodeId

_MOST_PARTS = 1000  # parts of an edge: slower targets are treated as moving this share of an edge per turn
_ROUNDED = 1e-9


class Transitions(NamedTuple):
    """The transitions of a model between states; each state is at a place of a `MoveMap`."""

    sources: IntArray  # (transitions,) states
    targets: IntArray  # (transitions,) states
    chances: FloatArray  # (transitions,) probabilities; they add up to 1 for each source
    places: IntArray  # (states,)
    shares: FloatArray  # (states,) initial probability of each state among those on its node


class MotionChain:
    """A Markov chain on a map, in the form of `gamms.core.belief`.

    Args:
        found: the transitions.
        moves: the places and the map.
        parts: in games by metres, the edges and offsets of the states; see below.

    Attributes:
        rows: (states,) the rows of the nodes of the states.
        shares: see `Transitions`.
        edges: (states,) rows of the edges of the targets; -1: on the node.
        ends: (states,) rows of the end nodes of these edges; -1: on the node.
        ways: the transitions in the core.
        core: the states in the core.
    """

    def __init__(self, found: Transitions, moves: MoveMap, parts: tuple[IntArray, FloatArray] | None = None) -> None:
        ground = moves.ground
        self.rows: IntArray = moves.nodes[found.places]
        self.shares = found.shares
        states = len(found.places)
        self.edges: IntArray = np.full(states, -1) if parts is None else parts[0]
        offsets_m: FloatArray = np.zeros(states) if parts is None else parts[1]
        self.ends: IntArray = np.full(states, -1)
        between = np.flatnonzero(self.edges >= 0)
        self.ends[between] = ground.columns.targets[self.edges[between]]
        bent = np.fromiter(ground.columns.polylines, np.int64, len(ground.columns.polylines))
        self.ways = core.IncomingArcs(
            *map(kernels.as_buffer, kernels.group_by_target(found.sources, found.targets, found.chances, states))
        )
        first_on, states_on = kernels.group_rows(self.rows, ground.size)
        self.core = core.MarkovChain(
            kernels.as_buffer(self.shares),
            kernels.as_buffer(first_on.astype(np.int32)),
            kernels.as_buffer(states_on.astype(np.int32)),
            kernels.as_buffer(self.ends),
            kernels.as_buffer(np.isin(self.edges, bent).view(np.uint8)),
            kernels.as_buffer(offsets_m),
        )
        self._nodes = ground.size

    def make_buffers(self, likelihoods: FloatArray) -> core.ChainBuffers:
        """Return working memory for the core around an array of likelihoods (states,)."""
        sums = np.empty(len(self.rows))
        missed = np.ones(self._nodes)
        return core.ChainBuffers(*map(kernels.as_buffer, (likelihoods, sums, missed)))

    def predict(self, masses: FloatArray, steps: int) -> FloatArray:
        """Return probabilities (targets, states) after some steps."""
        found = np.empty_like(masses)
        sums = kernels.as_buffer(np.empty(len(self.rows)))
        core.predict(self.ways, sums, kernels.as_buffer(masses), 0, kernels.as_buffer(found), 0, len(masses), steps)
        return found

    def apply_evidence(
        self, masses: FloatArray, evidence: core.Evidence, looks: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the probabilities after observations in some games, and the probability of the observations.

        Args:
            masses: (games, targets, states)
            evidence: observations of all games, with one finding per game.
            looks: (games + 1,) offsets of the looks of each game.

        Returns:
            Arrays of shapes (games, targets, states) and (games, targets).
        """
        games, targets, states = masses.shape
        found = np.empty_like(masses)
        totals = np.empty((games, targets))
        work = self.make_buffers(np.empty(states))
        values = kernels.as_buffer(masses)
        out = kernels.as_buffer(found)
        bounds = looks.tolist()
        for game in range(games):
            at = game * targets * states
            begin = bounds[game]
            end = bounds[game + 1]
            core.observe(
                self.core, evidence, work, values, at, out, at, begin, end, game, kernels.as_buffer(totals[game])
            )
        return found, totals

    def sum_by_node(self, masses: FloatArray) -> FloatArray:
        """Convert probabilities of states (targets, states) to probabilities of nodes (targets, nodes)."""
        found = np.zeros((len(masses), self._nodes))
        values = kernels.as_buffer(masses)
        out = kernels.as_buffer(found)
        for target in range(len(masses)):
            core.add_to_nodes(self.core, values, target * len(self.rows), out, target * self._nodes)
        return found


def convert_evidence(
    looks: IntArray,
    covered: tuple[IntArray, FloatArray],
    shown: BoolArray,
    found: IntArray,
    kinds: Sequence[int] | None = None,
    places: tuple[Sequence[int], Sequence[float]] | None = None,
) -> core.Evidence:
    """Return observations of targets in the form of the core.

    Args:
        looks: (looks + 1,) offsets of the nodes of each look in `covered`.
        covered: rows of the nodes, and the probability that a target there is missed, (nodes,) each.
        shown: (looks, targets) whether a look has information about a target.
        found: (findings, targets) rows of nodes, or `core.IS_UNSEEN`, `core.IS_UNKNOWN`.
        kinds: (looks,) the further coverage of each look, see `core.Evidence`; None: no look covers more.
        places: the edge ends and metres of the findings, see `core.Evidence`; None: any position at the nodes.
    """
    ends, offsets_m = (
        (np.full(found.size, core.IS_ANYWHERE_ON_NODE), np.zeros(found.size)) if places is None else places
    )
    rows, missed = covered
    along = np.full(len(looks) - 1, core.LOOKS_AT_NODES, np.uint8) if kinds is None else np.array(kinds, np.uint8)
    return core.Evidence(
        found.shape[-1],
        kernels.as_buffer(looks),
        kernels.as_buffer(rows),
        kernels.as_buffer(missed),
        kernels.as_buffer(along),
        kernels.as_buffer(shown.view(np.uint8)),
        kernels.as_buffer(found),
        kernels.as_buffer(np.asarray(ends, np.int64)),
        kernels.as_buffer(np.asarray(offsets_m, np.float64)),
    )


@dataclass(frozen=True)
class Motion:
    """A model of the motion of a target; made by `random_walk`, `to_goals` and `mixture`.

    Attributes:
        name: name and parameters of the model; models of equal name are equal.
        steps: number of moves per turn; in games by metres, the maximum number of decisions.
        make: function from the moves on a map to the transitions of one step; called by beliefs and filters.
    """

    name: Hashable
    steps: int
    make: Callable[[MoveMap], Transitions] = field(compare=False, repr=False)


def as_motion(value: object, name: str) -> Motion:
    """Check that a value is a model of motion.

    Raises:
        BadType: not a model.
    """
    if isinstance(value, Motion):
        return value
    hint = " It makes a model: call it." if callable(value) else ""
    raise BadType(f"{name} must be a model of motion, such as gamms.belief.random_walk(), not {shown(value)}.{hint}")


def random_walk(stay: float | None = None, steps: int = 1) -> Motion:
    """Model a target that moves to a random neighboring node, with equal probabilities.

    Args:
        stay: probability that the target stays; None: the same as for each neighbor, which matches
            `gamms.strategies.random_walk`.
        steps: number of edges that the target moves per turn.

    Raises:
        BadType, BadValue: `stay` is not a probability, or `steps` is not a number of edges.
    """
    share = None if stay is None else _as_probability(stay, "stay of random_walk")
    return Motion(("random_walk", share), as_count(steps, "steps of random_walk"), partial(_walk, stay=share))


def to_goals(goals: Iterable[NodeId] | Mapping[int, float], wander: float = 0.1, steps: int = 1) -> Motion:
    """Model a target that takes the shortest path to one of several goals, and stays there.

    The goal is inferred from observations. If no path leads to the goal, the target walks at random.

    Args:
        goals: ids of nodes with equal probabilities, or id -> weight, in any unit.
        wander: probability that a move is random. With 0, an observation off the path excludes the goal; if it excludes
            all goals, their probabilities are reset.
        steps: number of edges that the target moves per turn.

    Raises:
        BadType, BadValue: `goals` is invalid, or `wander` is not a probability.
        UnknownName (KeyError): when the model is used, a goal is not on the map.
    """
    ids = as_ids(goals, "goals of to_goals")
    weights = [goals[node] for node in ids] if isinstance(goals, Mapping) else [1.0] * len(ids)
    shares = _as_shares(weights, "goals of to_goals")
    share = _as_probability(wander, "wander of to_goals")
    name = ("to_goals", tuple(ids), tuple(shares), share)
    return Motion(name, as_count(steps, "steps of to_goals"), partial(_join_paths, tuple(ids), shares, share))


def _join_paths(goals: Sequence[int], shares: list[float], wander: float, moves: MoveMap) -> Transitions:
    rows = moves.ground.find_known_rows(np.array(goals, np.int64)).tolist()
    return _join_chains([_make_path_chain(moves, row, wander) for row in rows], shares)


def mixture(models: Mapping[Motion, float]) -> Motion:
    """Model a target that moves by one of several models; which one is inferred from observations.

    Args:
        models: model -> initial weight, in any unit.

    Raises:
        BadType, BadValue: a value is not a model, or the models have different steps.
    """
    for one in as_mapping(models, "models of mixture"):
        as_motion(one, "Each of the models of mixture")
    shares = _as_shares(list(models.values()), "models of mixture")
    steps = {one.steps for one in models}
    if len(steps) != 1:
        raise BadValue(f"The models of a mixture have different steps, {sorted(steps)}. Give all of them the same.")
    name = ("mixture", tuple((one.name, share) for one, share in zip(models, shares, strict=True)))
    return Motion(name, steps.pop(), partial(_mix_models, tuple(models), shares))


def _mix_models(models: Sequence[Motion], shares: list[float], moves: MoveMap) -> Transitions:
    return _join_chains([one.make(moves) for one in models], shares)


@lru_cache(maxsize=32)
def get_chain(motion: Motion, ground: BeliefMap, metres: float | None = None, turns: str | None = None) -> MotionChain:
    """Return the chain of a model on a map, cached.

    Args:
        motion: the model.
        ground: the map.
        metres: the distance per turn in games by metres, with states on edges; None: targets are on nodes only.
        turns: the mode of targets that obey turn restrictions; see `map_moves`.
    """
    moves = map_moves(ground, turns)
    found = motion.make(moves)
    return MotionChain(found, moves) if metres is None else _make_chain_by_metres(found, moves, metres / motion.steps)


def _make_chain_by_metres(found: Transitions, moves: MoveMap, step_m: float) -> MotionChain:
    """Return a chain with states along edges: each step leads to a node, or on along an edge.

    A target that reaches a node within a step decides again in the next step.
    """
    here = np.arange(len(found.places))
    number = len(found.places)
    if step_m <= 0.0:
        return MotionChain(found._replace(sources=here, targets=here, chances=np.ones(number)), moves)
    pairs, which = np.unique(found.sources * number + found.targets, return_inverse=True)
    chances = np.bincount(which, found.chances)
    sources = pairs // number
    targets = pairs % number
    edges = moves.find_edges(found.places[sources], found.places[targets])
    lengths = np.where(edges >= 0, moves.ground.columns.lengths[edges], 0.0)
    between = np.clip(np.ceil(lengths / step_m - _ROUNDED) - 1.0, 0.0, _MOST_PARTS).astype(np.int64)
    first = number + np.cumsum(between) - between  # first state of each edge
    parts = number + np.arange(between.sum())
    edge_of = np.repeat(np.arange(len(pairs)), between)
    is_last = parts == (first + between - 1)[edge_of]
    longer = Transitions(
        np.concatenate((sources, parts)),
        np.concatenate((np.where(between, first, targets), np.where(is_last, targets[edge_of], parts + 1))),
        np.concatenate((chances, np.ones(len(parts)))),
        np.concatenate((found.places, found.places[sources[edge_of]])),
        np.concatenate((found.shares, np.zeros(len(parts)))),
    )
    offsets = (parts - first[edge_of] + 1) * step_m
    places = np.concatenate((np.full(number, -1), edges[edge_of])), np.concatenate((np.zeros(number), offsets))
    return MotionChain(longer, moves, places)


def _walk(moves: MoveMap, stay: float | None) -> Transitions:
    sources = moves.starts
    here = np.arange(len(moves.nodes))
    ways = np.bincount(sources, minlength=len(here))
    stays = 1.0 / (ways + 1.0) if stay is None else np.where(ways, stay, 1.0)
    chances = np.concatenate((stays, ((1.0 - stays) / np.maximum(ways, 1))[sources]))
    ends = np.concatenate((here, sources)), np.concatenate((here, moves.ends))
    return Transitions(*ends, chances, here, moves.shares)


def _make_path_chain(moves: MoveMap, goal: int, wander: float) -> Transitions:
    steps = moves.find_steps(goal)
    is_there: BoolArray = moves.nodes == goal
    walk = _walk(moves, None)
    is_led = steps >= 0
    at_random = walk.chances * np.where(is_led, wander, 1.0)[walk.sources]
    at_random = np.where(is_there[walk.sources], walk.sources == walk.targets, at_random)
    led = np.flatnonzero(is_led & ~is_there)
    ends = np.concatenate((walk.sources, led)), np.concatenate((walk.targets, steps[led]))
    chances = np.concatenate((at_random, np.full(len(led), 1.0 - wander)))
    return Transitions(*ends, chances, walk.places, walk.shares)


def _join_chains(chains: list[Transitions], shares: list[float]) -> Transitions:
    """Return one chain that consists of several chains without transitions between them."""
    first = np.cumsum([0, *(len(chain.places) for chain in chains)])[:-1].tolist()
    return Transitions(
        np.concatenate([chain.sources + begin for chain, begin in zip(chains, first, strict=True)]),
        np.concatenate([chain.targets + begin for chain, begin in zip(chains, first, strict=True)]),
        np.concatenate([chain.chances for chain in chains]),
        np.concatenate([chain.places for chain in chains]),
        np.concatenate([chain.shares * share for chain, share in zip(chains, shares, strict=True)]),
    )


def _as_probability(value: object, name: str) -> float:
    number = as_float(value, name)
    if not 0.0 <= number <= 1.0:
        raise BadValue(f"{name} must be a probability from 0 to 1, not {number}.")
    return number


def _as_shares(weights: list[float], name: str) -> list[float]:
    numbers = [as_float(weight, f"Each weight of {name}") for weight in weights]
    if not numbers or min(numbers) < 0.0 or sum(numbers) <= 0.0:
        raise BadValue(f"{name[0].upper()}{name[1:]} need weights that add up to more than 0, not {shown(weights)}.")
    return [number / sum(numbers) for number in numbers]
