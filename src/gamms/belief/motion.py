"""How targets are expected to move: models that become Markov chains on a map.

A model may have a part that is not seen, such as the goal of the target: then a state of its chain is a node together
with that part, and what is observed says something about both.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_count, as_float, as_ids, as_mapping
from gamms.belief.ground import Ground
from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.text import shown
from gamms.typing.game import NodeId

_MOST_PARTS = 1000  # of an edge: slower targets are taken to go so much of it in a turn
_ROUNDED = 1e-9


class Transitions(NamedTuple):
    """Where a model leads, from states to states; each state is on a node."""

    sources: IntArray  # (transitions,) states
    targets: IntArray  # (transitions,) states
    chances: FloatArray  # (transitions,) of each source they add up to 1
    rows: IntArray  # (states,) of nodes
    shares: FloatArray  # (states,) how probable each state is at first among those on its node


class Chain:
    """A Markov chain on a map, as it is computed with.

    Args:
        found: the chain.
        parts: by metres, the edges and offsets of its states; see below.

    Attributes:
        rows, shares: see `Transitions`.
        edges: (states,) rows of the edges that the targets are on; -1: on the node.
        offsets_m: (states,) how far from the node; 0.0 on it.
        transitions: the sums of what comes to each state.
        are_nodes: whether each state is a node, in the same row.
        by_node: the sums of the states on each node, in the first rows.
    """

    def __init__(self, found: Transitions, parts: tuple[IntArray, FloatArray] | None = None) -> None:
        self.rows, self.shares, states = found.rows, found.shares, len(found.rows)
        on_nodes = np.full(states, -1), np.zeros(states)
        self.edges: IntArray = on_nodes[0] if parts is None else parts[0]
        self.offsets_m: FloatArray = on_nodes[1] if parts is None else parts[1]
        self.transitions = kernels.Arrivals(found.sources, found.targets, found.chances, states)
        self.are_nodes = np.array_equal(found.rows, np.arange(states))
        self.by_node = kernels.Arrivals(np.arange(states), found.rows, np.ones(states), states)


@dataclass(frozen=True)
class Motion:
    """A model of how a target moves; `random_walk`, `to_goals` and `mixture` make such.

    Attributes:
        name: what it does and its numbers; models of one name are equal.
        steps: how often the target moves in a turn; by metres, how often it decides at most.
        make: from a map to the chances of one step there; for beliefs and filters, which call it.
    """

    name: Hashable
    steps: int
    make: Callable[[Ground], Transitions] = field(compare=False, repr=False)


def as_motion(value: object, name: str) -> Motion:
    """Check that a value is a model of motion.

    Raises:
        BadType: it is not.
    """
    if isinstance(value, Motion):
        return value
    hint = " That makes a model: call it." if callable(value) else ""
    raise BadType(f"{name} must be a model of motion, such as gamms.belief.random_walk(), not {shown(value)}.{hint}")


def random_walk(stay: float | None = None, steps: int = 1) -> Motion:
    """Expect a target to go to any neighbouring node, each as likely.

    Args:
        stay: how probable it is that the target stays; None: as probable as each neighbour, which is how
            `gamms.strategies.random_walk` walks.
        steps: how many edges the target goes in a turn.

    Raises:
        BadType, BadValue: `stay` is no probability, or `steps` no number of edges.
    """
    share = None if stay is None else _as_probability(stay, "stay of random_walk")
    return Motion(("random_walk", share), as_count(steps, "steps of random_walk"), lambda ground: _walk(ground, share))


def to_goals(goals: Iterable[NodeId] | Mapping[int, float], wander: float = 0.1, steps: int = 1) -> Motion:
    """Expect a target to go to one of some goals by the shortest path, and to stay there.

    Which goal it is follows from what is observed. Where no path leads to the goal, the target walks at random.

    Args:
        goals: ids of nodes, each as likely, or id -> how likely, in any unit.
        wander: how probable it is that a move is a random one. With 0, a target that is seen off its path has no
            goal any longer that would explain that, and all goals are as likely as at first.
        steps: how many edges the target goes in a turn.

    Raises:
        BadType, BadValue: `goals` are none, or `wander` is no probability.
        UnknownName (KeyError), when it is used: a goal is not on the map.
    """
    ids = as_ids(goals, "goals of to_goals")
    weights = [goals[node] for node in ids] if isinstance(goals, Mapping) else [1.0] * len(ids)
    shares, share = _as_shares(weights, "goals of to_goals"), _as_probability(wander, "wander of to_goals")

    def make(ground: Ground) -> Transitions:
        rows = ground.known_rows(np.array(ids, np.int64)).tolist()
        return _joined([_path(ground, row, share) for row in rows], shares)

    name = ("to_goals", tuple(ids), tuple(shares), share)
    return Motion(name, as_count(steps, "steps of to_goals"), make)


def mixture(models: Mapping[Motion, float]) -> Motion:
    """Expect a target to move by one of several models; which one follows from what is observed.

    Args:
        models: model -> how likely it is at first, in any unit.

    Raises:
        BadType, BadValue: these are no models, or they differ in their steps.
    """
    for one in as_mapping(models, "models of mixture"):
        as_motion(one, "Each of the models of mixture")
    shares, steps = _as_shares(list(models.values()), "models of mixture"), {one.steps for one in models}
    if len(steps) != 1:
        raise BadValue(f"The models of a mixture have different steps, {sorted(steps)}. Give all of them the same.")
    name = ("mixture", tuple((one.name, share) for one, share in zip(models, shares, strict=True)))
    return Motion(name, steps.pop(), lambda ground: _joined([one.make(ground) for one in models], shares))


@lru_cache(maxsize=32)
def chain_of(motion: Motion, ground: Ground, metres: float | None = None) -> Chain:
    """Return the chain of a model on a map, made once; by metres in a turn, with the parts of edges."""
    found = motion.make(ground)
    return Chain(found) if metres is None else _by_metres(found, ground, metres / motion.steps)


def _by_metres(found: Transitions, ground: Ground, step_m: float) -> Chain:
    """Return a chain whose targets are on edges for as many steps as these take: each step leads to a node, or on.

    A target that reaches a node within a step decides again in the next one.
    """
    here, number = np.arange(len(found.rows)), len(found.rows)
    if step_m <= 0.0:
        return Chain(found._replace(sources=here, targets=here, chances=np.ones(number)))
    pairs, which = np.unique(found.sources * number + found.targets, return_inverse=True)
    chances = np.bincount(which, found.chances)
    sources, targets = pairs // number, pairs % number
    edges = ground.shortest_edges(found.rows[sources], found.rows[targets])
    lengths = np.where(edges >= 0, ground.columns.lengths[edges], 0.0)
    between = np.clip(np.ceil(lengths / step_m - _ROUNDED) - 1.0, 0.0, _MOST_PARTS).astype(np.int64)
    first = number + np.cumsum(between) - between  # the first state of each edge
    parts = number + np.arange(between.sum())
    edge_of = np.repeat(np.arange(len(pairs)), between)
    is_last = parts == (first + between - 1)[edge_of]
    longer = Transitions(
        np.concatenate((sources, parts)),
        np.concatenate((np.where(between, first, targets), np.where(is_last, targets[edge_of], parts + 1))),
        np.concatenate((chances, np.ones(len(parts)))),
        np.concatenate((found.rows, found.rows[sources[edge_of]])),
        np.concatenate((found.shares, np.zeros(len(parts)))),
    )
    offsets = (parts - first[edge_of] + 1) * step_m
    places = np.concatenate((np.full(number, -1), edges[edge_of])), np.concatenate((np.zeros(number), offsets))
    return Chain(longer, places)


def _walk(ground: Ground, stay: float | None) -> Transitions:
    sources, targets = ground.ways
    here, ways = np.arange(ground.size), np.bincount(sources, minlength=ground.size)
    stays = 1.0 / (ways + 1.0) if stay is None else np.where(ways, stay, 1.0)
    chances = np.concatenate((stays, ((1.0 - stays) / np.maximum(ways, 1))[sources]))
    ends = np.concatenate((here, sources)), np.concatenate((here, targets))
    return Transitions(*ends, chances, here, np.ones(ground.size))


def _path(ground: Ground, goal: int, wander: float) -> Transitions:
    columns = ground.columns
    arcs = kernels.make_arcs(columns.targets, columns.sources, columns.lengths, ground.size)
    tight = kernels.tight_arcs(arcs, kernels.shortest_distances(arcs, np.array([goal])))
    hops = kernels.shortest_distances(tight, np.array([goal]))
    steps = kernels.first_steps(tight, hops, columns.node_ids)
    steps[goal] = goal
    walk, is_led = _walk(ground, None), steps >= 0
    at_random = walk.chances * np.where(is_led, wander, 1.0)[walk.sources]
    at_random = np.where(walk.sources == goal, walk.sources == walk.targets, at_random)
    led = np.flatnonzero(is_led & (np.arange(ground.size) != goal))
    ends = np.concatenate((walk.sources, led)), np.concatenate((walk.targets, steps[led]))
    chances = np.concatenate((at_random, np.full(len(led), 1.0 - wander)))
    return Transitions(*ends, chances, walk.rows, walk.shares)


def _joined(chains: list[Transitions], shares: list[float]) -> Transitions:
    """Return one chain of which the states of each are a part, that no transition leaves."""
    first = np.cumsum([0, *(len(chain.rows) for chain in chains)])[:-1].tolist()
    return Transitions(
        np.concatenate([chain.sources + begin for chain, begin in zip(chains, first, strict=True)]),
        np.concatenate([chain.targets + begin for chain, begin in zip(chains, first, strict=True)]),
        np.concatenate([chain.chances for chain in chains]),
        np.concatenate([chain.rows for chain in chains]),
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
