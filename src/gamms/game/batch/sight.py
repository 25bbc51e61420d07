"""Which agents the sensors of agents show, in all games of a view at once."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_numbers_of
from gamms.errors import BadValue, UnknownName
from gamms.game.batch.columns import Roster, places_of, some_rows
from gamms.game.batch.sight_lines import SightLines, Spots
from gamms.game.batch.state import GameArrays
from gamms.game.batch.surroundings import KnownViews, mask_of_pairs
from gamms.ir.chances import chances_at, chances_given
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import AgentLook, NodeLook
from gamms.kernels.draws import BitArray
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.sensor_engine import IN_AIR, ON_GROUND, ISensor

DELAYS = "delayed looks"  # the key under which a batch shares what sensors are still to report
_AT_ONCE = 1 << 16  # pairs of agents that are compared at once, which stay in the cache of the processor
_FEW = 128  # agents that are compared with each other; among more, those that are near are found by cells
_LEAST, _MOST = 1e-150, 1e150  # distances whose squares are neither zero nor infinite


class Seen(NamedTuple):
    """The agents that agents see, as pairs: by game, then by the agent that sees, then by the name of the other.

    Attributes:
        shape: games and agents of the view, agents of the roster.
        at: (pairs,) the game in the view.
        viewers: (pairs,) the agent of the view that sees.
        others: (pairs,) the number in the roster of the agent that is seen.
        nodes: (pairs,) the row of the node where it is seen.
    """

    shape: tuple[int, int, int]
    at: IntArray
    viewers: IntArray
    others: IntArray
    nodes: IntArray

    @property
    def mask(self) -> BoolArray:
        """Who sees whom, (games, agents of the view, agents of the roster).

        Raises:
            TooLarge: it would take more than 256 MB; the pairs do not.
        """
        use = "at, viewers, others and nodes of view.seen()"
        return mask_of_pairs(self.shape, (self.at, self.viewers, self.others), use)

    def in_games(self, games: IntArray) -> "Seen":
        """Return the pairs of some games, which ascend, as a view of these has them."""
        at = places_of(games, self.shape[0])[self.at]
        return self._replace(shape=(len(games), *self.shape[1:]), at=at).of(at >= 0)

    def with_sights(
        self,
        sights: Sequence[tuple[int, int, IntArray, IntArray]],
        games: IntArray,
        agents: IntArray,
        asked: BoolArray,
    ) -> "Seen":
        """Return these pairs with others, of which that counts which comes first.

        Args:
            sights: the game and the agent that looks, the others and the rows of nodes where they are reported.
            games: of the view, by their numbers in the batch.
            agents: of the view, by their numbers in the roster.
            asked: (games, agents) which agents are asked.
        """
        number, column = ({one: i for i, one in enumerate(of.tolist())} for of in (games, agents))
        parts = list[tuple[IntArray, ...]]()
        for game, agent, others, nodes in sights:
            if game in number and agent in column and asked[number[game], column[agent]]:
                looking = np.full_like(others, number[game]), np.full_like(others, column[agent])
                parts.append((*looking, others, nodes))
        return self.joined(parts)

    def joined(self, parts: Sequence[tuple[IntArray, ...]]) -> "Seen":
        """Return these pairs with others, the columns of each part, of which that counts which comes first."""
        own = self.at, self.viewers, self.others, self.nodes
        at, viewers, others, nodes = (np.concatenate(columns) for columns in zip(own, *parts, strict=True))
        keys = (at * self.shape[1] + viewers) * self.shape[2] + others
        _, first = np.unique(keys, return_index=True)
        return Seen(self.shape, at[first], viewers[first], others[first], nodes[first])

    def of(self, chosen: BoolArray | IntArray) -> "Seen":
        """Return some of the pairs: which, (pairs,), or their places.

        Raises:
            BadType, BadValue: there are no such pairs.
        """
        if not hasattr(self.at, "strides"):  # of another library
            return some_rows(self, chosen)
        if getattr(chosen, "dtype", None) == np.bool_:
            return some_rows(self, as_array(chosen, "chosen", "booleans", self.at.shape))
        return some_rows(self, as_numbers_of(chosen, "chosen", len(self.at), "pairs").reshape(-1))


class Lookout(NamedTuple):
    """Sensors that look alike, the agents of a view that carry them, and the agents that they show if they are in view.

    Attributes:
        look: what they show.
        columns: (carriers,) numbers in the view, ascending.
        carriers: (carriers,) numbers in the roster.
        others: (others,) numbers in the roster, ascending.
        draws: (carriers,) the names that what is drawn follows from; see `AgentLook`.
        order: (carriers,) which of the sensors of its agent each is, from 0.
    """

    look: AgentLook
    columns: IntArray
    carriers: IntArray
    others: IntArray
    draws: list[tuple[str, str] | None]
    order: IntArray


def looks_of(
    agent: IAgent, names: Sequence[str], *, may_lack_forms: bool = False, left_out: Collection[str] = ()
) -> list[AgentLook]:
    """Return how the sensors of an agent show agents: those of these names, or all that show agents."""
    carried, found = getattr(agent, "sensors", {}), []
    for name in names or carried:
        if name in carried and carried[name].type in ON_GROUND and name not in left_out:
            why = why_not_seen(agent, name)
            if why is not None:
                if may_lack_forms:
                    continue
                raise BadValue(f"{why[0].upper()}{why[1:]}, and so has no array form.")
            found.append(carried[name].in_arrays(agent.name))
    return found


def look_of(sensor: ISensor, agent: IAgent) -> AgentLook | None:
    """Return how a sensor shows other agents to one, to be computed for many games; None: that has no array form."""
    look = sensor.in_arrays(agent.name) if sensor.type in ON_GROUND and hasattr(sensor, "in_arrays") else None
    return look if isinstance(look, AgentLook) else None


def _all_looks(agent: IAgent) -> list[AgentLook]:
    looks = [look_of(sensor, agent) for sensor in getattr(agent, "sensors", {}).values()]
    return [look for look in looks if look is not None]


def reports_elsewhere(agent: IAgent) -> bool:
    """Whether sensors of an agent may show others on nodes where these are not."""
    return any(look.errs for look in _all_looks(agent))


def reports_late(agent: IAgent) -> bool:
    """Whether a sensor of an agent reports what it saw in an earlier turn."""
    return any(look.delay for look in _all_looks(agent))


def turns_with_its_agent(agent: IAgent) -> bool:
    """Whether a sensor of an agent has a field of view that turns with it."""
    sensors = getattr(agent, "sensors", {}).values()
    looks = [one.nodes_in_arrays() for one in sensors if hasattr(one, "nodes_in_arrays")]
    return any(not isinstance(look, str) and look.turns for look in (*looks, *_all_looks(agent)))


def why_not_seen(agent: IAgent, name: str) -> str | None:
    """Return in words why a sensor that shows agents has no array form; None: it has one, or shows no agents."""
    sensor = agent.sensors[name]
    if sensor.type not in ON_GROUND:
        return None
    form = getattr(sensor, "in_arrays", None)
    look = "is of a class of its own" if form is None else form(agent.name)
    return f"the sensor {shown(name)} of agent {shown(agent.name)}, which {look}" if isinstance(look, str) else None


def names_of(agents: Sequence[IAgent], numbers: IntArray) -> list[str]:
    """Return the names of the sensors of agents of a roster that show agents."""
    carried = [getattr(agents[number], "sensors", {}) for number in numbers.tolist()]
    return sorted({name for one in carried for name, sensor in one.items() if sensor.type in ON_GROUND | IN_AIR})


def noted_sensors(agent: IAgent) -> list[str]:
    """Return the sensors of an agent that only the turn engine can ask in games that are played one by one.

    These look from the air, turn with the agent, report late, or are of a class of their own.
    """
    found = []
    for name, sensor in getattr(agent, "sensors", {}).items():
        look = look_of(sensor, agent)
        is_odd = look is None or look.turns or look.delay
        if sensor.type in IN_AIR or (sensor.type in ON_GROUND and is_odd):
            found.append(name)
    return found


def lookouts(
    roster: Roster,
    numbers: IntArray,
    names: Sequence[str],
    *,
    may_lack_forms: bool = False,
    left_out: Mapping[int, Collection[str]] | None = None,
) -> list[Lookout]:
    """Return the sensors of agents of a roster, those that look alike together; of these names, or all.

    Args:
        roster: of the batch.
        numbers: of the agents.
        names: of sensors.
        may_lack_forms: whether those without an array form are left out.
        left_out: agent -> its sensors that are left out.
    """
    agents = roster.agents
    unknown = [name for name in names if name not in names_of(agents, numbers)]
    if unknown:
        raise UnknownName("sensor that shows agents", unknown[0], names_of(agents, numbers))
    found: dict[tuple[AgentLook, int], tuple[AgentLook, list[tuple[int, int]], list[tuple[str, str] | None]]] = {}
    for column, number in enumerate(numbers.tolist()):
        carried = Counter[AgentLook]()  # an agent may carry several that look alike
        without = (left_out or {}).get(number, ())
        looks = looks_of(agents[number], names, may_lack_forms=may_lack_forms, left_out=without)
        for order, look in enumerate(looks):
            key = look.what
            _, columns, draws = found.setdefault((key, carried[key]), (look, [], []))
            columns.append((column, order))
            draws.append(look.draws)
            carried[key] += 1
    made = []
    for look, listed, draws in found.values():
        among, ranks = np.array(listed).T
        made.append(Lookout(look, among, numbers[among], _shown(roster, look), draws, ranks))
    return made


def _shown(roster: Roster, look: AgentLook) -> IntArray:
    """Return the numbers of the agents that a sensor shows where they are in view."""
    is_shown = [(look.teams is None or team in look.teams) and team not in look.others for team in roster.teams]
    return np.flatnonzero(np.array(is_shown, np.bool_)[roster.team_of])


def seen(
    state: GameArrays,
    games: IntArray,
    agents: IntArray,
    asked: BoolArray,
    looks: Sequence[Lookout],
    *,
    with_own: bool = False,
) -> Seen:
    """Return which agents some agents see."""
    world, roster, found = _World(state, games), len(state.roster.names), list[tuple[IntArray, ...]]()
    for lookout in looks:
        if len(lookout.columns) and len(lookout.others):
            for at, carriers, others, nodes in _reports(world, lookout, asked, with_own=with_own):
                looking = at * len(agents) + lookout.columns[carriers]
                found.append((looking * roster + lookout.others[others], nodes, lookout.order[carriers]))
    none = np.zeros(0, np.int64)
    keys, nodes, order = (np.concatenate(parts) for parts in zip((none, none, none), *found, strict=True))
    if len(looks) > 1 or any(one.look.false_alarms for one in looks):  # of what several sensors show, the last counts
        by_key = np.lexsort((order, keys))
        kept = by_key[np.append(np.diff(keys[by_key]) != 0, True)[: len(keys)]]
        keys, nodes = keys[kept], nodes[kept]
    looking, shown_agents = _split(keys, roster)
    at, viewers = _split(looking, len(agents))
    return Seen((len(games), len(agents), roster), at, viewers, shown_agents, nodes)


def _split(numbers: IntArray, size: int) -> tuple[IntArray, IntArray]:
    """Return what `np.divmod` returns of numbers that are not negative, in half the time."""
    quotients = numbers // max(size, 1)
    return quotients, numbers - quotients * size


class _World:
    """Where all agents are in some games."""

    def __init__(self, state: GameArrays, games: IntArray) -> None:
        self.state, self.games = state, games
        chosen = slice(None) if len(games) == len(state) else games
        self.node: IntArray = state.node[chosen]
        self.alive: BoolArray = state.alive[chosen]

    @cached_property
    def axes(self) -> tuple[FloatArray, FloatArray]:
        """Return x and y of where agents are, on nodes or edges, (games, agents) each."""
        (x, y), movement = self.state.streets.axes, self.state.movement
        if not len(movement.edge) or not (movement.edge[self.games] >= 0).any():
            return x[self.node], y[self.node]
        rows = np.broadcast_to(self.games[:, None], self.node.shape), np.indices(self.node.shape)[1]
        xy = movement.places(self.node, rows).xy
        return xy[..., 0], xy[..., 1]

    def spots(self, at: IntArray, agents: IntArray) -> Spots:
        """Return where some agents are."""
        (x, y), edge, which = self.axes, self.state.movement.edge, (at, agents)
        on_edge = edge[self.games[at], agents] >= 0 if len(edge) else np.zeros(len(at), np.bool_)
        return Spots(self.node[which], on_edge, x[which], y[which])


Pairs = tuple[IntArray, IntArray, IntArray]  # games of the view, and carriers and others of a lookout, by their places
Reports = tuple[IntArray, IntArray, IntArray, IntArray]  # likewise, and rows of nodes


def _reports(world: _World, lookout: Lookout, asked: BoolArray, *, with_own: bool) -> Iterator[Reports]:
    """Yield who is reported to whom, and where."""
    look = lookout.look
    if look.delay:
        yield _of_own(lookout, world.state.shared[DELAYS].due(world.games, lookout, asked), with_own=with_own)
        return
    blocks = _pairs(world, lookout, asked, with_own=with_own or look.false_alarms > 0.0)
    if not look.false_alarms:
        for pairs in blocks:
            at, carriers, others = pairs
            yield *pairs, _displaced(world, lookout, pairs, world.node[at, lookout.others[others]])
        return
    none = (np.zeros(0, np.int64),) * 3
    at, carriers, others = (np.concatenate(columns) for columns in zip(none, *blocks, strict=True))
    reports = at, carriers, others, world.node[at, lookout.others[others]]
    reports = _with_false_alarms(world, lookout, asked, reports)
    nodes = _displaced(world, lookout, reports[:3], reports[3])
    yield _of_own(lookout, (*reports[:3], nodes), with_own=with_own)


def _of_own(lookout: Lookout, reports: Reports, *, with_own: bool) -> Reports:
    """Return the reports, but with `with_own` without those of agents of themselves."""
    if with_own or lookout.look.place is None:
        return reports
    is_other = lookout.carriers[reports[1]] != lookout.others[reports[2]]
    at, carriers, others, nodes = (column[is_other] for column in reports)
    return at, carriers, others, nodes


def _pairs(world: _World, lookout: Lookout, asked: BoolArray, *, with_own: bool) -> Iterator[Pairs]:
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


def _near(world: _World, lookout: Lookout, asked: BoolArray) -> Iterator[Pairs]:
    """Yield who is in range of whom, by comparing all with all."""
    look, columns, wide, size = lookout.look, _few(lookout.columns), len(lookout.columns), len(lookout.others)
    carriers, others = _few(lookout.carriers), _few(lookout.others)
    at_once = max(1, _AT_ONCE // size)  # agents that look
    step = max(1, at_once // wide)  # games
    for first in range(0, len(world.games), step):
        games = slice(first, first + step)
        is_asked, is_there = asked[games, columns], world.alive[games, others]
        if look.radius < np.inf:
            (x, x0), (y, y0) = ((axis[games, others], axis[games, carriers]) for axis in world.axes)
            if look.place is not None:
                x0, y0 = (np.full(x0.shape, place) for place in look.place)
        for begin in range(0, wide, at_once):
            some = slice(begin, begin + at_once)
            found = is_asked[:, some, None] & is_there[:, None]
            if look.radius < np.inf:
                found &= _within(x[:, None] - x0[:, some, None], y[:, None] - y0[:, some, None], look.radius)
            looking, seen = _split(np.flatnonzero(found), size)
            at, looking = _split(looking, found.shape[1])
            yield at + first, looking + begin, seen


def _few(numbers: IntArray) -> IntArray | slice:
    """Return numbers as a slice where they follow each other, which takes no copy."""
    first, last = int(numbers[0]), int(numbers[-1])
    return slice(first, last + 1) if last - first == len(numbers) - 1 else numbers


def _near_by_cells(world: _World, lookout: Lookout, asked: BoolArray) -> Iterator[Pairs]:
    """Yield who is in range of whom, by cells of the map."""
    x, y = world.axes
    at, carriers = np.nonzero(asked[:, lookout.columns])
    there, others = np.nonzero(world.alive[:, lookout.others])
    looking, seen = lookout.carriers[carriers], lookout.others[others]
    here, beside = (kernels.Area(x[on, who], y[on, who], on) for on, who in ((at, looking), (there, seen)))
    for rows, near in kernels.near_each_other(here, beside, lookout.look.radius):
        yield at[rows], carriers[rows], others[near]


def _offsets(world: _World, lookout: Lookout, pairs: Pairs) -> tuple[FloatArray, FloatArray]:
    """Return how far east and north of the agents that look the others are, (pairs,)."""
    (x, y), (at, carriers, others), place = world.axes, pairs, lookout.look.place
    there, here = (at, lookout.others[others]), (at, lookout.carriers[carriers])
    x0, y0 = (x[here], y[here]) if place is None else place
    return x[there] - x0, y[there] - y0


def _ahead(world: _World, lookout: Lookout, pairs: Pairs) -> BoolArray | None:
    """Return which pairs are in the field of view; None: all."""
    cone = lookout.look.cone
    if cone is None:
        return None
    if not lookout.look.turns:
        return kernels.in_cone(*_offsets(world, lookout, pairs), *cone)
    at, carriers, _ = pairs
    looking = lookout.carriers[carriers]
    those = world.games[at], looking, world.node[at, looking]
    return in_turned_cone(world.state, those, _offsets(world, lookout, pairs), cone)


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


def _unhidden(world: _World, lookout: Lookout, pairs: Pairs) -> BoolArray | None:
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


def _noticed(world: _World, lookout: Lookout, pairs: Pairs) -> BoolArray | None:
    """Return which pairs are such that the one notices the other; None: all."""
    look = lookout.look
    if (look.chances is None and look.chance is None) or not len(pairs[0]):
        return None
    far = np.hypot(*_offsets(world, lookout, pairs))
    if look.chance is None:
        chances = chances_at(far, np.array(look.chances))
    else:
        sensors = sorted({repr(draws[0]) for draws in lookout.draws if draws is not None})
        chances = chances_given(look.chance, far, f"detection of {' and '.join(sensors)}")
    return kernels.fraction_many(_drawn(world, lookout, pairs, "detection")) < chances


def _drawn(world: _World, lookout: Lookout, pairs: Pairs, purpose: str, *which: str) -> BitArray:
    """Return 64 random bits for each pair, as `Look.bits` draws them."""
    at, carriers, others = pairs
    return _bits(world, lookout, (at, carriers), world.state.roster.keys[lookout.others[others]], purpose, *which)


def _bits(
    world: _World, lookout: Lookout, looks: tuple[IntArray, IntArray], names: BitArray, purpose: str, *which: str | int
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


def _with_false_alarms(world: _World, lookout: Lookout, asked: BoolArray, reports: Reports) -> Reports:
    """Return the reports and false ones, as `Look.false_alarms` draws them."""
    look, state = lookout.look, world.state
    at, carriers = np.nonzero(asked[:, lookout.columns])
    if not len(at):
        return reports
    no_name = kernels.name_keys([""])

    def one(some: IntArray, purpose: str, *which: str | int) -> BitArray:
        return _bits(world, lookout, (at[some], carriers[some]), no_name, purpose, *which)

    every = np.arange(len(at))
    counts = np.array([kernels.poisson(bits, look.false_alarms) for bits in one(every, "false alarms").tolist()])
    looking, shown_agents = lookout.carriers[carriers], lookout.others
    may_be = world.alive[at][:, shown_agents]
    if look.place is None:
        may_be &= looking[:, None] != shown_agents
    number = np.full((len(world.games), len(lookout.columns)), -1)
    number[at, carriers] = every
    may_be[number[reports[0], reports[1]], reports[2]] = False
    ends, rows = _covered(world, lookout, at, looking)
    sizes, found = np.diff(ends), [reports]
    for i in range(int(counts.max(initial=0))):
        some = np.flatnonzero((counts > i) & may_be.any(axis=1) & (sizes > 0))
        if not len(some):
            break
        names = np.broadcast_to(state.roster.keys[shown_agents], (len(some), len(shown_agents)))
        lots = _bits(world, lookout, (at[some], carriers[some]), names, "false alarm", i)
        chosen = np.where(may_be[some], lots, 0).argmax(axis=1)
        may_be[some, chosen] = False
        places = kernels.below_many(one(some, "false alarm", "place", i), sizes[some])
        found.append((at[some], carriers[some], chosen, rows[ends[some] + places]))
    first, second, third, nodes = (np.concatenate(columns) for columns in zip(*found, strict=True))
    return first, second, third, nodes


def _covered(world: _World, lookout: Lookout, at: IntArray, looking: IntArray) -> tuple[IntArray, IntArray]:
    """Return the nodes that agents have in view as offsets (looks + 1,) and rows, one after the other."""
    look, shared, streets = lookout.look, world.state.shared, world.state.streets
    key = "covered", look.what
    if key not in shared:
        shared[key] = KnownViews(streets, NodeLook(look.radius, look.place, from_node=look.covers))
    spots, (x, y) = world.spots(at, looking), streets.axes
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
        kept[kept] = ~_hidden_nodes(world, lookout, some_rows(spots, which[kept]), rows[kept])
    counts = np.bincount(which[kept], minlength=len(at))
    return np.concatenate((np.zeros(1, np.int64), np.cumsum(counts))), rows[kept]


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


def _hidden_nodes(world: _World, lookout: Lookout, spots: Spots, rows: IntArray) -> BoolArray:
    """Return which nodes are hidden from agents on edges, (pairs,); those on nodes have looked past obstacles."""
    found, hides, streets = np.zeros(len(rows), np.bool_), lookout.look.hides_pairs, world.state.streets
    if hides is not None:
        on, node = spots.on_edge, rows[spots.on_edge]
        xy = np.column_stack((spots.x, spots.y))[on]
        found[on] = hides(streets.ids(spots.node[on]), xy, on[on], streets.ids(node), streets.columns.xy[node])
    return found


def _displaced(world: _World, lookout: Lookout, pairs: Pairs, nodes: IntArray) -> IntArray:
    """Return the rows of the nodes where agents are reported that are seen on nodes, (pairs,)."""
    look, streets = lookout.look, world.state.streets
    if not look.noise or look.nearest is None or not len(nodes):
        return nodes
    errors = (kernels.normals(_drawn(world, lookout, pairs, "position noise", axis).tolist()) for axis in "xy")
    x, y = (axis[nodes] + look.noise * error for axis, error in zip(streets.axes, errors, strict=True))
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
