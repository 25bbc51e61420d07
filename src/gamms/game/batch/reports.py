"""Which agents sensors report, and where, in all games of a view at once: who is in view and noticed, and what errs.

Sensors on the ground look from nodes and edges of the map, and report nodes; those in the air look in space.
"""

from collections.abc import Iterator
from functools import cached_property
from math import pi
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import BadValue
from gamms.game.batch.columns import as_slice, places_of, some_rows
from gamms.game.batch.flights import Flyers
from gamms.game.batch.sight_lines import SightLines, Spots
from gamms.game.batch.state import GameArrays
from gamms.game.batch.surroundings import KnownViews
from gamms.ir.chances import chances_at, chances_given
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import AgentLook, NodeLook
from gamms.kernels.draws import BitArray

DELAYS = "delayed looks"  # the key under which a batch shares what sensors are still to report
_AT_ONCE = 1 << 16  # pairs of agents that are compared at once, which stay in the cache of the processor
_FEW = 128  # agents that are compared with each other; among more, those that are near are found by cells
_LEAST, _MOST = 1e-150, 1e150  # distances whose squares are neither zero nor infinite

Look = AgentLook | NodeLook
Places = np.ndarray[Any, Any]  # where agents are reported: (pairs,) rows of nodes, or in the air (pairs, 3)
Pairs = tuple[IntArray, IntArray, IntArray]  # games of the view, and carriers and others of a lookout, by their places
Covered = tuple[IntArray, IntArray, IntArray, FloatArray]
"""Games and agents of the view, rows of nodes, and how probable it is that agents are noticed there, more than 0."""
Reports = tuple[IntArray, IntArray, IntArray, Places]  # likewise, and where they are reported


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

    def axes_of(self, look: AgentLook) -> tuple[FloatArray, ...]:
        """Return where agents are for a sensor, on each axis, (games, agents) each."""
        return self.axes if look.quat is None else self.space

    @property
    def flyers(self) -> Flyers:
        """The agents that fly, where sensors look from the air."""
        assert self.state.flyers is not None  # noqa: S101 - there are such sensors
        return self.state.flyers

    @cached_property
    def space(self) -> tuple[FloatArray, ...]:
        """Return x, y and z of where agents are; on an edge they are as high as the node passed last."""
        xyz = np.stack((*self.axes, self.flyers.ground_z[self.node]), axis=-1)
        self.flyers.put_into(xyz, self.games)
        return tuple(np.ascontiguousarray(axis) for axis in np.moveaxis(xyz, -1, 0))

    def places(self, look: Look, at: IntArray, agents: IntArray) -> Places:
        """Return where some agents are shown."""
        if look.quat is None:
            return self.node[at, agents]
        return np.column_stack([axis[at, agents] for axis in self.space])

    def on_nodes(self, look: Look, rows: IntArray) -> Places:
        """Return where agents on some nodes are shown."""
        if look.quat is None:
            return rows
        return np.column_stack((*(axis[rows] for axis in self.state.streets.axes), self.flyers.ground_z[rows]))

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
    if look.delay:
        yield _of_own(lookout, world.state.shared[DELAYS].due(world.games, lookout, asked), with_own=with_own)
        return
    blocks = _pairs(world, lookout, asked, with_own=with_own or look.false_alarms > 0.0)
    if not look.false_alarms:
        for pairs in blocks:
            at, carriers, others = pairs
            yield *pairs, _displaced(world, lookout, pairs, world.places(look, at, lookout.others[others]))
        return
    none = (np.zeros(0, np.int64),) * 3
    at, carriers, others = (np.concatenate(columns) for columns in zip(none, *blocks, strict=True))
    found = at, carriers, others, world.places(look, at, lookout.others[others])
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
            axes = world.axes_of(look)[:2]
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
    x, y = world.axes_of(lookout.look)[:2]
    at, carriers = np.nonzero(asked[:, lookout.columns])
    there, others = np.nonzero(world.alive[:, lookout.others])
    looking, seen = lookout.carriers[carriers], lookout.others[others]
    here, beside = (kernels.Area(x[on, who], y[on, who], on) for on, who in ((at, looking), (there, seen)))
    for rows, near in kernels.near_each_other(here, beside, lookout.look.radius):
        yield at[rows], carriers[rows], others[near]


def _offsets(world: World, lookout: Lookout, pairs: Pairs) -> list[FloatArray]:
    """Return how far east and north of the agents that look, in the air and up, the others are, (pairs,)."""
    axes, (at, carriers, others), place = world.axes_of(lookout.look), pairs, lookout.look.place
    there, here = (at, lookout.others[others]), (at, lookout.carriers[carriers])
    if place is None:
        return [axis[there] - axis[here] for axis in axes]
    return [axis[there] - start for axis, start in zip(axes, place, strict=True)]


def _ahead(world: World, lookout: Lookout, pairs: Pairs) -> BoolArray | None:
    """Return which pairs are in the field of view; None: all."""
    look, (at, carriers, _) = lookout.look, pairs
    if look.quat is not None:
        return _ahead_in_space(world, look, (at, lookout.carriers[carriers]), _offsets(world, lookout, pairs))
    if look.cone is None:
        return None
    dx, dy = _offsets(world, lookout, pairs)
    if not look.turns:
        return kernels.in_cone(dx, dy, *look.cone)
    looking = lookout.carriers[carriers]
    those = world.games[at], looking, world.node[at, looking]
    return in_turned_cone(world.state, those, (dx, dy), look.cone)


def _ahead_in_space(
    world: World, look: Look, looking: tuple[IntArray, IntArray], offsets: list[FloatArray]
) -> BoolArray:
    """Return what is in range and in the field of view in the air, (looks,); of agents not at the place of the sensor.

    Args:
        world: where agents are.
        look: of the sensor.
        looking: the games of the view and the agents of the roster that look, (looks,) each.
        offsets: how far east, north and up it is, (looks,) each.
    """
    dx, dy, dz = offsets
    radius = look.radius or 0.0
    found: BoolArray = kernels.squares(dx, dy, dz) <= radius * radius
    if isinstance(look, AgentLook):
        found &= (dx != 0.0) | (dy != 0.0) | (dz != 0.0)
    if look.fov >= 2.0 * pi:
        return found
    quat: Any = look.quat
    if look.place is None:
        at, agents = looking
        quat = kernels.multiply_quaternions(world.flyers.turned(world.games[at], agents), quat)
    return found & kernels.in_view(offsets, kernels.quaternion_to_direction(quat), look.fov)


def in_turned_cone(
    state: GameArrays,
    looking: tuple[IntArray, IntArray, IntArray],
    offsets: tuple[FloatArray, FloatArray],
    cone: tuple[tuple[float, float], float],
) -> BoolArray:
    """Return what is in fields of view that turn with their agents, (looks,); without a heading, they look all around.

    Args:
        state: of the batch.
        looking: the games, agents and rows of the nodes where they are, (looks,) each.
        offsets: how far east and north that is, (looks,) each.
        cone: as those of an `AgentLook`.
    """
    if state.headings is None:
        raise BadValue("A field of view that turns with its agent is for agents that are carried by a batch.")
    (cos, sin), ((x, y), fov) = state.headings.of(*looking), cone
    heading = x * cos - y * sin, x * sin + y * cos
    found: BoolArray = kernels.in_cone(*offsets, heading, fov) | ((heading[0] == 0.0) & (heading[1] == 0.0))
    return found


def _unhidden(world: World, lookout: Lookout, pairs: Pairs) -> BoolArray | None:
    """Return between which pairs no obstacle is; None: all."""
    look, (at, carriers, others) = lookout.look, pairs
    if look.height is None:
        return None
    if look.quat is not None:
        who = lookout.others[others]
        ends, flies = world.places(look, at, who), world.state.roster.flies[who]
        return _in_line(world, look, (at, lookout.carriers[carriers]), ends, world.node[at, who], flies)
    key = (
        "hidden",
        look.what._replace(chances=None, chance=None, teams=None, others=(), noise=0.0, false_alarms=0.0, delay=0),
    )
    known = world.state.shared.setdefault(key, SightLines(world.state.streets, look))
    is_hidden: BoolArray = known.hidden(
        world.spots(at, lookout.carriers[carriers]), world.spots(at, lookout.others[others])
    )
    return ~is_hidden


def _in_line(
    world: World,
    look: Look,
    looking: tuple[IntArray, IntArray],
    ends: FloatArray,
    nodes: IntArray,
    flies: BoolArray | bool,
) -> BoolArray:
    """Return which places no obstacle hides in the air, (looks,): those in tunnels are hidden.

    Args:
        world: where agents are.
        look: of the sensor.
        looking: the games of the view and the agents of the roster that look, (looks,) each.
        ends: the places, (looks, 3).
        nodes: rows of the nodes below them, or where they are.
        flies: (looks,) which of them are in the air.
    """
    found: BoolArray = world.flyers.is_outside[nodes] | flies
    at, agents = looking
    if look.in_line is not None:
        eyes = world.places(look, at, agents) if look.place is None else np.broadcast_to(look.place, ends.shape)
        found[found] = look.in_line(eyes[found], ends[found])
    return found


def _noticed(world: World, lookout: Lookout, pairs: Pairs) -> BoolArray | None:
    """Return which pairs are such that the one notices the other; None: all."""
    look = lookout.look
    if (look.chances is None and look.chance is None) or not len(pairs[0]):
        return None
    offsets = _offsets(world, lookout, pairs)
    far = np.hypot(*offsets) if look.quat is None else np.sqrt(kernels.squares(*offsets))
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
    turns, number_of = state.turn[games], state.looks[games, lookout.carriers[carriers]]
    purposes: BitArray = keys[number, games].reshape(shape)
    return kernels.draw_bits_rows(purposes, names, turns.reshape(shape), number_of.reshape(shape))


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
    if look.quat is not None:
        may_be &= ~state.roster.flies[shown_agents]
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
        parts.append((at[some], carriers[some], chosen, world.on_nodes(look, rows[ends[some] + places])))
    first, second, third, where = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return first, second, third, where


def _covered(world: World, lookout: Lookout, at: IntArray, looking: IntArray) -> tuple[IntArray, IntArray]:
    """Return the nodes that agents have in view as offsets (looks + 1,) and rows, one after the other."""
    find = _covered_from_nodes if lookout.look.quat is None else _covered_from_air
    which, rows = find(world, lookout.look, at, looking)
    counts = np.bincount(which, minlength=len(at))
    return np.concatenate((np.zeros(1, np.int64), np.cumsum(counts))), rows


def _covered_from_air(world: World, look: AgentLook, at: IntArray, looking: IntArray) -> tuple[IntArray, IntArray]:
    """Return the nodes that agents have in view in the air, as numbers of looks, ascending, and rows."""
    key = "covered from", look.what
    x0: FloatArray
    y0: FloatArray
    if look.place is None:
        x0, y0 = (axis[at, looking] for axis in world.space[:2])
    elif key in world.state.shared:
        rows = world.state.shared[key]
        return np.repeat(np.arange(len(at)), len(rows)), np.tile(rows, len(at))
    else:
        x0, y0 = (np.full(1, place) for place in look.place[:2])
    x, y = world.state.streets.axes
    which, rows = _around(x0, y0, (x, y), look.radius)
    kept = _are_seen_from_air(world, look, (at[which], looking[which]), rows)
    which, rows = which[kept], rows[kept]
    if look.place is None:
        return which, rows
    world.state.shared[key] = rows
    return np.repeat(np.arange(len(at)), len(rows)), np.tile(rows, len(at))


def nodes_in_view(world: World, look: Look, looking: tuple[IntArray, IntArray, IntArray], rows: IntArray) -> BoolArray:
    """Return which nodes are in view of sensors that look from the air, or turn with their agents, (looks, nodes).

    Args:
        world: where agents are.
        look: of the sensors.
        looking: the games of the view, the agents of the roster that look, and the rows of their nodes, (looks,) each.
        rows: of the nodes, (nodes,) each once.
    """
    at, agents, here = looking
    shape = len(at), len(rows)
    if look.quat is not None:
        which = np.repeat(np.arange(shape[0]), shape[1])
        seen = _are_seen_from_air(world, look, (at[which], agents[which]), np.tile(rows, shape[0]))
        return seen.reshape(shape)
    shared, streets, found = world.state.shared, world.state.streets, np.zeros(shape, np.bool_)
    key = "around", type(look), look.radius, look.cone, look.height
    if key not in shared:
        from_node = look.covers if isinstance(look, AgentLook) else look.from_node
        shared[key] = KnownViews(streets, NodeLook(look.radius, from_node=from_node))
    place, (x, y) = places_of(rows, streets.num_nodes), streets.axes
    ends, around = shared[key].of(here)
    which = np.repeat(np.arange(shape[0]), np.diff(ends))
    which, around = which[place[around] >= 0], around[place[around] >= 0]
    if look.cone is not None:
        where = here[which]
        those, offsets = (world.games[at[which]], agents[which], where), (x[around] - x[where], y[around] - y[where])
        is_ahead = in_turned_cone(world.state, those, offsets, look.cone)
        which, around = which[is_ahead], around[is_ahead]
    found[which, place[around]] = True
    return found


def _are_seen_from_air(world: World, look: Look, looking: tuple[IntArray, IntArray], rows: IntArray) -> BoolArray:
    """Return which nodes are in view of sensors in the air, (looks,).

    Args:
        world: where agents are.
        look: of the sensors.
        looking: the games of the view and the agents of the roster that look, (looks,) each.
        rows: of the nodes, (looks,).
    """
    ends = world.on_nodes(look, rows)
    starts = [axis[looking] for axis in world.space] if look.place is None else look.place
    found = _ahead_in_space(world, look, looking, [end - start for end, start in zip(ends.T, starts, strict=True)])
    if look.height is not None:
        at, agents = (column[found] for column in looking)
        found[found] = _in_line(world, look, (at, agents), ends[found], rows[found], flies=False)
    return found


def covered(world: World, lookout: Lookout, asked: BoolArray) -> Covered:
    """Return on which nodes sensors on the ground would show agents with some probability, from the nodes passed last.

    Args:
        world: where agents are.
        lookout: the sensors.
        asked: (games, agents of the view) which agents look.
    """
    look, (x, y) = lookout.look, world.state.streets.axes
    at, carriers = np.nonzero(asked[:, lookout.columns] & (look.delay == 0))  # what is late shows nothing of now
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
    offsets = x[rows] - spots.x[which], y[rows] - spots.y[which]
    kept: BoolArray = np.ones(len(rows), np.bool_)
    if look.turns and look.cone is not None:
        kept = in_turned_cone(
            world.state, (world.games[at[which]], looking[which], spots.node[which]), offsets, look.cone
        )
    if look.height is not None and len(on_edge):
        kept[kept] = ~_hidden_nodes(world, look, some_rows(spots, which[kept]), rows[kept])
    return which[kept], rows[kept]


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


def _displaced(world: World, lookout: Lookout, pairs: Pairs, places: Places) -> Places:
    """Return where agents are reported that are seen at places: on the ground the nodes nearest to displaced ones."""
    look, streets = lookout.look, world.state.streets
    if not look.noise or not len(places):
        return places
    axes = "xy" if look.quat is None else "xyz"
    drawn = (_drawn(world, lookout, pairs, "position noise", axis).tolist() for axis in axes)
    errors = [look.noise * kernels.normals(bits) for bits in drawn]
    if look.quat is not None:
        return places + np.column_stack(errors)
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
