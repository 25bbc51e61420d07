"""Which agents sensors report, and where, in all games of a view at once: who is in view and noticed, and what errs.

Sensors on the ground look from nodes and edges of the map, and report nodes. What turns with its agent, looks from the
air or reports late is not here: games with such sensors are played one by one.
"""

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.game.batch.columns import as_slice, some_rows
from gamms.game.batch.sight_lines import SightLines, Spots
from gamms.game.batch.state import GameArrays
from gamms.game.batch.surroundings import KnownViews
from gamms.ir.chances import chances_at, chances_given
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import AgentLook, NodeLook
from gamms.kernels.draws import BitArray

_AT_ONCE = 1 << 16  # pairs of agents that are compared at once, which stay in the cache of the processor
_FEW = 128  # agents that are compared with each other; among more, those that are near are found by cells
_LEAST, _MOST = 1e-150, 1e150  # distances whose squares are neither zero nor infinite

Pairs = tuple[IntArray, IntArray, IntArray]  # games of the view, and carriers and others of a lookout, by their places
Covered = tuple[IntArray, IntArray, IntArray, FloatArray]
"""Games and agents of the view, rows of nodes, and how probable it is that agents are noticed there, more than 0."""
Reports = tuple[IntArray, IntArray, IntArray, IntArray]
"""Likewise, and rows of the nodes where they are reported."""


class Lookout(NamedTuple):
    """Sensors that look alike, the agents of a view that carry them, and the agents that they show if they are in view.

    Attributes:
        look: what they show.
        columns: (carriers,) numbers in the view, ascending.
        carriers: (carriers,) numbers in the roster.
        others: (others,) numbers in the roster, ascending.
        draws: (carriers,) the names that what is drawn follows from; see `AgentLook`.
        order: (carriers,) of several sensors that show an agent the one counts where this is greatest: the last one on
            the ground, else the first in the air.
    """

    look: AgentLook
    columns: IntArray
    carriers: IntArray
    others: IntArray
    draws: list[tuple[str, str] | None]
    order: IntArray


class World:
    """Where all agents are in some games."""

    def __init__(self, state: GameArrays, games: IntArray) -> None:
        self.state, self.games = state, games
        chosen = slice(None) if len(games) == len(state) else games
        self.node: IntArray = state.node[chosen]
        self.alive: BoolArray = state.alive[chosen]

    @cached_property
    def axes(self) -> tuple[FloatArray, FloatArray]:
        """Return x and y of where agents are, on nodes or edges, (games, agents) each."""
        (x, y), movement, known = self.state.streets.axes, self.state.movement, self.state.places
        if known is not None:
            on_edge, xy = known.edge[self.games, :, 0] >= 0, known.xy[self.games]
            return np.where(on_edge, xy[..., 0], x[self.node]), np.where(on_edge, xy[..., 1], y[self.node])
        if not len(movement.edge) or not (movement.edge[self.games] >= 0).any():
            return x[self.node], y[self.node]
        rows = np.broadcast_to(self.games[:, None], self.node.shape), np.indices(self.node.shape)[1]
        xy = movement.places(self.node, rows).xy
        return xy[..., 0], xy[..., 1]

    def spots(self, at: IntArray, agents: IntArray) -> Spots:
        """Return where some agents are."""
        (x, y), which, known = self.axes, (at, agents), self.state.places
        where = self.games[at], agents
        on_edge = self.state.movement.on_edge(where) >= 0 if known is None else known.edge[where][..., 0] >= 0
        return Spots(self.node[which], on_edge, x[which], y[which])


def reports(world: World, lookout: Lookout, asked: BoolArray, *, with_own: bool) -> Iterator[Reports]:
    """Yield who is reported to whom, and where.

    Args:
        world: where agents are.
        lookout: the sensors.
        asked: (games, agents of the view) which agents look.
        with_own: whether sensors at fixed places show the agents that carry them.
    """
    look = lookout.look
    if not (len(lookout.columns) and len(lookout.others)):
        return
    blocks = _pairs(world, lookout, asked, with_own=with_own or look.false_alarms > 0.0)
    if not look.false_alarms:
        for pairs in blocks:
            at, carriers, others = pairs
            yield *pairs, _displaced(world, lookout, pairs, world.node[at, lookout.others[others]])
        return
    none = (np.zeros(0, np.int64),) * 3
    at, carriers, others = (np.concatenate(columns) for columns in zip(none, *blocks, strict=True))
    found = at, carriers, others, world.node[at, lookout.others[others]]
    found = _with_false_alarms(world, lookout, asked, found)
    places = _displaced(world, lookout, found[:3], found[3])
    yield _of_own(lookout, (*found[:3], places), with_own=with_own)


def _of_own(lookout: Lookout, found: Reports, *, with_own: bool) -> Reports:
    """Return the reports, but with `with_own` without those of agents of themselves."""
    if with_own or lookout.look.place is None:
        return found
    is_other = lookout.carriers[found[1]] != lookout.others[found[2]]
    at, carriers, others, places = (column[is_other] for column in found)
    return at, carriers, others, places


def _pairs(world: World, lookout: Lookout, asked: BoolArray, *, with_own: bool) -> Iterator[Pairs]:
    """Yield who sees whom, in the order of the games, then of the carriers, then of the others."""
    look = lookout.look
    by_cells = look.place is None and len(lookout.others) > _FEW and _LEAST < look.radius < _MOST
    for found in (_near_by_cells if by_cells else _near)(world, lookout, asked):
        at, carriers, others = found
        if look.place is None or not with_own:
            is_other = lookout.carriers[carriers] != lookout.others[others]
            at, carriers, others = at[is_other], carriers[is_other], others[is_other]
        for is_left in (_ahead, _unhidden, _noticed):
            left = is_left(world, lookout, (at, carriers, others))
            if left is not None:
                at, carriers, others = at[left], carriers[left], others[left]
        yield at, carriers, others


def _near(world: World, lookout: Lookout, asked: BoolArray) -> Iterator[Pairs]:
    """Yield who is in range of whom, on the map, by comparing all with all."""
    look, columns, wide, size = lookout.look, as_slice(lookout.columns), len(lookout.columns), len(lookout.others)
    carriers, others = as_slice(lookout.carriers), as_slice(lookout.others)
    at_once = max(1, _AT_ONCE // size)  # agents that look
    step = max(1, at_once // wide)  # games
    for first in range(0, len(world.games), step):
        games = slice(first, first + step)
        is_asked, is_there = asked[games, columns], world.alive[games, others]
        if look.radius < np.inf:
            axes = world.axes
            (x, x0), (y, y0) = ((axis[games, others], axis[games, carriers]) for axis in axes)
            if look.place is not None:
                x0, y0 = (np.full(x0.shape, place) for place in look.place[:2])
        for begin in range(0, wide, at_once):
            some = slice(begin, begin + at_once)
            found = is_asked[:, some, None] & is_there[:, None]
            if look.radius < np.inf:
                found &= _within(x[:, None] - x0[:, some, None], y[:, None] - y0[:, some, None], look.radius)
            looking, seen = split(np.flatnonzero(found), size)
            at, looking = split(looking, found.shape[1])
            yield at + first, looking + begin, seen


def _near_by_cells(world: World, lookout: Lookout, asked: BoolArray) -> Iterator[Pairs]:
    """Yield who is in range of whom, on the map, by its cells."""
    x, y = world.axes
    at, carriers = np.nonzero(asked[:, lookout.columns])
    there, others = np.nonzero(world.alive[:, lookout.others])
    looking, seen = lookout.carriers[carriers], lookout.others[others]
    here, beside = (kernels.Area(x[on, who], y[on, who], on) for on, who in ((at, looking), (there, seen)))
    for rows, near in kernels.near_each_other(here, beside, lookout.look.radius):
        yield at[rows], carriers[rows], others[near]


def _offsets(world: World, lookout: Lookout, pairs: Pairs) -> list[FloatArray]:
    """Return how far east and north of the agents that look, in the air and up, the others are, (pairs,)."""
    axes, (at, carriers, others), place = world.axes, pairs, lookout.look.place
    there, here = (at, lookout.others[others]), (at, lookout.carriers[carriers])
    if place is None:
        return [axis[there] - axis[here] for axis in axes]
    return [axis[there] - start for axis, start in zip(axes, place, strict=True)]


def _ahead(world: World, lookout: Lookout, pairs: Pairs) -> BoolArray | None:
    """Return which pairs are in the field of view; None: all."""
    look = lookout.look
    if look.cone is None:
        return None
    dx, dy = _offsets(world, lookout, pairs)
    return kernels.in_cone(dx, dy, *look.cone)


def _unhidden(world: World, lookout: Lookout, pairs: Pairs) -> BoolArray | None:
    """Return between which pairs no obstacle is; None: all."""
    look, (at, carriers, others) = lookout.look, pairs
    if look.height is None:
        return None
    key = (
        "hidden",
        look.what._replace(chances=None, chance=None, teams=None, others=(), noise=0.0, false_alarms=0.0, delay=0),
    )
    known = world.state.shared.setdefault(key, SightLines(world.state.streets, look))
    is_hidden: BoolArray = known.hidden(
        world.spots(at, lookout.carriers[carriers]), world.spots(at, lookout.others[others])
    )
    return ~is_hidden


def _noticed(world: World, lookout: Lookout, pairs: Pairs) -> BoolArray | None:
    """Return which pairs are such that the one notices the other; None: all."""
    look = lookout.look
    if (look.chances is None and look.chance is None) or not len(pairs[0]):
        return None
    offsets = _offsets(world, lookout, pairs)
    far = np.hypot(*offsets)
    return kernels.fraction_many(_drawn(world, lookout, pairs, "detection")) < _chances(lookout, far)


def _chances(lookout: Lookout, far: FloatArray) -> FloatArray:
    """Return how probable it is that agents are noticed at distances, (agents,)."""
    look = lookout.look
    if look.chance is None:
        return chances_at(far, np.array(look.chances))
    sensors = sorted({repr(draws[0]) for draws in lookout.draws if draws is not None})
    return chances_given(look.chance, far, f"detection of {' and '.join(sensors)}")


def _drawn(world: World, lookout: Lookout, pairs: Pairs, purpose: str, *which: str) -> BitArray:
    """Return 64 random bits for each pair, as `Look.bits` draws them."""
    at, carriers, others = pairs
    return _bits(world, lookout, (at, carriers), world.state.roster.keys[lookout.others[others]], purpose, *which)


def _bits(
    world: World, lookout: Lookout, looks: tuple[IntArray, IntArray], names: BitArray, purpose: str, *which: str | int
) -> BitArray:
    """Return 64 random bits for each look, (looks,), and the hash of a name; or for several, (looks, names)."""
    state, (at, carriers) = world.state, looks
    games = world.games[at]
    used, number = np.unique(carriers, return_inverse=True)
    keys = np.array([state.purposes(purpose, *(lookout.draws[i] or ()), *which) for i in used.tolist()])
    shape = (-1,) + (1,) * (names.ndim - 1)
    purposes: BitArray = keys[number, games].reshape(shape)
    return kernels.draw_bits_rows(purposes, names, state.turn[games].reshape(shape))


def _with_false_alarms(world: World, lookout: Lookout, asked: BoolArray, found: Reports) -> Reports:
    """Return the reports and false ones, as `Look.false_alarms` draws them."""
    look, state = lookout.look, world.state
    at, carriers = np.nonzero(asked[:, lookout.columns])
    no_name = kernels.name_keys([""])

    def one(some: IntArray | slice, purpose: str, *which: str | int) -> BitArray:
        return _bits(world, lookout, (at[some], carriers[some]), no_name, purpose, *which)

    drawn = one(np.s_[:], "false alarms").tolist() if len(at) else ()
    counts = np.array([kernels.poisson(bits, look.false_alarms) for bits in drawn], np.int64)
    errs = counts > 0
    if not errs.any():
        return found
    at, carriers, counts = at[errs], carriers[errs], counts[errs]
    looking, shown_agents = lookout.carriers[carriers], lookout.others
    may_be = world.alive[at][:, shown_agents]
    if look.place is None:
        may_be &= looking[:, None] != shown_agents
    number = np.full((len(world.games), len(lookout.columns)), -1)
    number[at, carriers] = np.arange(len(at))
    which = number[found[0], found[1]]
    may_be[which[which >= 0], found[2][which >= 0]] = False
    ends, rows = _covered(world, lookout, at, looking)
    sizes, parts = np.diff(ends), [found]
    for i in range(int(counts.max())):
        some = np.flatnonzero((counts > i) & may_be.any(axis=1) & (sizes > 0))
        if not len(some):
            break
        names = np.broadcast_to(state.roster.keys[shown_agents], (len(some), len(shown_agents)))
        lots = _bits(world, lookout, (at[some], carriers[some]), names, "false alarm", i)
        chosen = np.where(may_be[some], lots, 0).argmax(axis=1)
        may_be[some, chosen] = False
        places = kernels.below_many(one(some, "false alarm", "place", i), sizes[some])
        parts.append((at[some], carriers[some], chosen, rows[ends[some] + places]))
    first, second, third, where = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return first, second, third, where


def _covered(world: World, lookout: Lookout, at: IntArray, looking: IntArray) -> tuple[IntArray, IntArray]:
    """Return the nodes that agents have in view as offsets (looks + 1,) and rows, one after the other."""
    which, rows = _covered_from_nodes(world, lookout.look, at, looking)
    counts = np.bincount(which, minlength=len(at))
    return np.concatenate((np.zeros(1, np.int64), np.cumsum(counts))), rows


def covered(world: World, lookout: Lookout, asked: BoolArray) -> Covered:
    """Return on which nodes sensors on the ground would show agents with some probability, from the nodes passed last.

    Args:
        world: where agents are.
        lookout: the sensors.
        asked: (games, agents of the view) which agents look.
    """
    look, (x, y) = lookout.look, world.state.streets.axes
    at, carriers = np.nonzero(asked[:, lookout.columns])
    looking = lookout.carriers[carriers]
    node = world.node[at, looking]
    spots = Spots(node, np.zeros(len(node), np.bool_), x[node], y[node])
    which, rows = _covered_from_nodes(world, look, at, looking, spots)
    chances = np.ones(len(rows))
    if look.chances is not None or look.chance is not None:
        x0, y0 = (spots.x[which], spots.y[which]) if look.place is None else look.place[:2]
        chances = _chances(lookout, np.hypot(x[rows] - x0, y[rows] - y0))
        shown = chances > 0.0
        which, rows, chances = which[shown], rows[shown], chances[shown]
    return at[which], lookout.columns[carriers[which]], rows, chances


def _covered_from_nodes(
    world: World, look: AgentLook, at: IntArray, looking: IntArray, spots: Spots | None = None
) -> tuple[IntArray, IntArray]:
    """Return the nodes in view from spots, None: where agents are, as numbers of looks, ascending, and rows."""
    shared, streets = world.state.shared, world.state.streets
    key = "covered", look.what
    if key not in shared:
        place = None if look.place is None else (look.place[0], look.place[1])
        shared[key] = KnownViews(streets, NodeLook(look.radius, place, from_node=look.covers))
    spots, (x, y) = world.spots(at, looking) if spots is None else spots, streets.axes
    is_beside = spots.on_edge & (look.place is None)
    on_node, on_edge = np.flatnonzero(~is_beside), np.flatnonzero(is_beside)
    ends, rows = shared[key].of(spots.node[on_node])
    which = np.repeat(on_node, np.diff(ends))
    if len(on_edge):
        lines, around = _around(spots.x[on_edge], spots.y[on_edge], (x, y), look.radius)
        which, rows = np.append(which, on_edge[lines]), np.append(rows, around)
        order = np.argsort(which, kind="stable")
        which, rows = which[order], rows[order]
    if look.height is not None and len(on_edge):
        kept = ~_hidden_nodes(world, look, some_rows(spots, which), rows)
        which, rows = which[kept], rows[kept]
    return which, rows


def _around(
    x: FloatArray, y: FloatArray, axes: tuple[FloatArray, FloatArray], radius: float
) -> tuple[IntArray, IntArray]:
    """Return the nodes in range of places, (places,), as numbers of places and rows, both ascending."""
    if _LEAST < radius < _MOST:
        parts = [*kernels.near_each_other(kernels.Area(x, y), kernels.Area(*axes), radius)]
        lines, rows = (np.concatenate([part[side] for part in parts]) for side in (0, 1))
        return lines, rows
    found = [np.flatnonzero(_within(axes[0] - x0, axes[1] - y0, radius)) for x0, y0 in zip(x, y, strict=True)]
    return np.repeat(np.arange(len(x)), [len(rows) for rows in found]), np.concatenate(found)


def _hidden_nodes(world: World, look: AgentLook, spots: Spots, rows: IntArray) -> BoolArray:
    """Return which nodes are hidden from agents on edges, (pairs,); those on nodes have looked past obstacles."""
    found, hides, streets = np.zeros(len(rows), np.bool_), look.hides_pairs, world.state.streets
    if hides is not None:
        on, node = spots.on_edge, rows[spots.on_edge]
        xy = np.column_stack((spots.x, spots.y))[on]
        found[on] = hides(streets.ids(spots.node[on]), xy, on[on], streets.ids(node), streets.columns.xy[node])
    return found


def _displaced(world: World, lookout: Lookout, pairs: Pairs, places: IntArray) -> IntArray:
    """Return where agents are reported that are seen at places: on the ground the nodes nearest to displaced ones."""
    look, streets = lookout.look, world.state.streets
    if not look.noise or not len(places):
        return places
    drawn = (_drawn(world, lookout, pairs, "position noise", axis).tolist() for axis in "xy")
    errors = [look.noise * kernels.normals(bits) for bits in drawn]
    if look.nearest is None:
        return places
    x, y = (axis[places] + error for axis, error in zip(streets.axes, errors, strict=True))
    return streets.rows(look.nearest(x, y))


def _within(dx: FloatArray, dy: FloatArray, radius: float) -> BoolArray:
    """Return which offsets are no longer than a radius, as the index of nodes finds them; they are overwritten."""
    with np.errstate(over="ignore"):
        if not _LEAST < radius < _MOST:
            return np.hypot(dx, dy) <= radius
        dx *= dx
        dy *= dy
        dx += dy
    return dx <= radius * radius


def split(numbers: IntArray, size: int) -> tuple[IntArray, IntArray]:
    """Return what `np.divmod` returns of numbers that are not negative, in half the time."""
    quotients = numbers // max(size, 1)
    return quotients, numbers - quotients * size
