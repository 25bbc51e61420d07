"""Which nodes the sensors of agents show, in all games of a view at once."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import BadValue, TooLarge, UnknownName
from gamms.game.streets import Streets
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import NodeLook
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.sensor_engine import SensorType

SHOWING_NODES = {SensorType.NEIGHBOR, SensorType.MAP, SensorType.RANGE, SensorType.ARC, SensorType.OCCLUDED_MAP}
_MOST_PAIRS = 1 << 28  # agents and nodes, of one answer
_MOST_KNOWN = 1 << 24  # nodes in views that are kept, 8 bytes each


class SeenNodes(NamedTuple):
    """The nodes that agents see, as pairs: by game, then by the agent that sees.

    Those of one agent are in the order of the nodes on the map; of one NEIGHBOR sensor alone, as it shows them.

    Attributes:
        shape: games and agents of the view, nodes of the map.
        at: (pairs,) the game in the view.
        viewers: (pairs,) the agent of the view that sees.
        nodes: (pairs,) the row of the node.
    """

    shape: tuple[int, int, int]
    at: IntArray
    viewers: IntArray
    nodes: IntArray

    @property
    def mask(self) -> BoolArray:
        """Which nodes are seen, (games, agents, nodes).

        Raises:
            TooLarge: it would take more than 256 MB; the pairs may not.
        """
        return mask_of_pairs(self.shape, (self.at, self.viewers, self.nodes), "at, viewers and nodes")


def mask_of_pairs(shape: tuple[int, ...], pairs: tuple[IntArray, ...], use: str) -> BoolArray:
    """Return a mask that is true at these places; `use` says in a message what to use where it would be too large."""
    if np.prod(shape, dtype=np.float64) > _MOST_PAIRS:
        raise TooLarge(f"A mask of {shape} is too large. Use the pairs: {use}.")
    found = np.zeros(shape, np.bool_)
    found[pairs] = True
    return found


class NodeLookout(NamedTuple):
    """Sensors that show the same from the same node, and the agents of a view that carry them."""

    views: "KnownViews"
    columns: IntArray  # (carriers,) numbers in the view


Near = Callable[[IntArray, IntArray], tuple[IntArray, IntArray]]
"""Returns what `KnownRows.of` does of nodes in games, (looks,) each: the games, by their places, and rows of nodes."""
SightedNodes = Mapping[tuple[int, int], Mapping[str, IntArray]]
"""Game and agent -> sensor -> the rows of the nodes that it shows."""


def node_sensors_of(agents: Sequence[IAgent], numbers: IntArray) -> list[str]:
    """Return the names of the sensors of agents of a roster that show nodes."""
    carried = [getattr(agents[number], "sensors", {}) for number in numbers.tolist()]
    return sorted({name for one in carried for name, sensor in one.items() if sensor.type in SHOWING_NODES})


def node_lookouts(
    streets: Streets, agents: Sequence[IAgent], numbers: IntArray, names: Sequence[str]
) -> list[NodeLookout]:
    """Return the sensors of agents of a roster that show nodes, of these names, or all."""
    known = node_sensors_of(agents, numbers)
    for name in names:
        if name not in known:
            raise UnknownName("sensor that shows nodes", name, known)
    found: dict[NodeLook, tuple[NodeLook, list[int]]] = {}
    for column, number in enumerate(numbers.tolist()):
        carried = getattr(agents[number], "sensors", {})
        for name in names or known:
            if name in carried and carried[name].type in SHOWING_NODES:
                look = _look_of(agents[number], name)
                if look.turns:  # it is noted what such show
                    continue
                found.setdefault(look._replace(from_node=None), (look, []))[1].append(column)
    made = []
    for look, columns in found.values():
        made.append(NodeLookout(KnownViews(streets, look), np.unique(columns)))
    return made


def _look_of(agent: IAgent, name: str) -> NodeLook:
    form = getattr(agent.sensors[name], "nodes_in_arrays", None)
    look = "is of a class of its own" if form is None else form()
    if isinstance(look, str):
        raise BadValue(
            f"The sensor {shown(name)} of agent {shown(agent.name)} {look}, and so has no array form. "
            "Look with state['sensor'], in a strategy for one agent."
        )
    found: NodeLook = look
    return found


def seen_nodes(
    node: IntArray,
    asked: BoolArray,
    looks: Sequence[NodeLookout],
    nodes: int,
    near: "Near | None" = None,
    noted: Sequence[tuple[IntArray, IntArray, IntArray]] = (),
) -> SeenNodes:
    """Return which nodes some agents see.

    Args:
        node: where they are, rows (games, agents).
        asked: (games, agents) which of them are asked.
        looks: their sensors.
        nodes: how many there are on the map.
        near: says which nodes are next to nodes in games where roads were closed; None: they are in none.
        noted: columns of what else they see.
    """
    shape, none = (*node.shape, nodes), np.zeros(0, np.int64)
    parts = [(none, none, none), *noted]
    for views, columns in looks:
        at, carriers = np.nonzero(asked[:, columns])
        viewers = columns[carriers]
        here = node[at, viewers]
        runs, rows = views.of(here) if near is None or not views.are_next else near(at, here)
        counts = np.diff(runs)
        parts.append((np.repeat(at, counts), np.repeat(viewers, counts), rows))
    if len(looks) == 1 and not noted:
        return SeenNodes(shape, *parts[1])
    at, viewers, rows = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    looking, rows = np.divmod(np.unique((at * shape[1] + viewers) * nodes + rows), max(nodes, 1))
    return SeenNodes(shape, *np.divmod(looking, max(shape[1], 1)), rows)


def noted_nodes(
    sighted: SightedNodes, names: Sequence[str], who: tuple[IntArray, IntArray], asked: BoolArray
) -> list[tuple[IntArray, IntArray, IntArray]]:
    """Return columns of the games, agents and nodes that only the turn engine knows agents to see.

    Args:
        sighted: see `GameArrays`.
        names: of the sensors; none: all.
        who: the games of the view by their numbers in the batch, and its agents by those in the roster.
        asked: (games, agents) which agents are asked.
    """
    number, column = ({one: i for i, one in enumerate(of.tolist())} for of in who)
    parts = []
    for (game, agent), of_agent in sighted.items():
        if game in number and agent in column and asked[number[game], column[agent]]:
            looking = number[game], column[agent]
            seen = [rows for name, rows in of_agent.items() if name in names or not names]
            parts += [(np.full_like(rows, looking[0]), np.full_like(rows, looking[1]), rows) for rows in seen]
    return parts


class KnownRows:
    """What belongs to each node, such as what is seen from there, worked out when it is first asked for.

    Args:
        nodes: how many there are.
        find: returns the places in some nodes, which ascend, and the rows that belong to them, in one or more runs.
    """

    def __init__(self, nodes: int, find: Callable[[IntArray], Sequence[tuple[IntArray, IntArray]]]) -> None:
        self._nodes, self._find = nodes, find
        self._forget()

    def _forget(self) -> None:
        self._first, self._count = np.full(self._nodes, -1), np.zeros(self._nodes, np.int64)
        self._rows, self._used = np.zeros(0, np.int64), 0

    def of(self, nodes: IntArray) -> tuple[IntArray, IntArray]:
        """Return what belongs to some nodes as offsets (nodes + 1,) and rows, one after the other.

        Raises:
            TooLarge: that would be more than 268 million.
        """
        new = np.unique(nodes[self._first[nodes] < 0])
        if len(new):
            if self._used > _MOST_KNOWN:
                self._forget()
                new = np.unique(nodes)
            self._learn(new)
        counts = self._count[nodes]
        ends = _checked(counts)
        places = np.arange(ends[-1]) + np.repeat(self._first[nodes] - ends[:-1], counts)
        return ends, self._rows[places]

    def _learn(self, nodes: IntArray) -> None:
        runs = self._find(nodes)
        lines, rows = (np.concatenate([run[side] for run in runs]) for side in (0, 1))
        counts = np.bincount(lines, minlength=len(nodes))
        self._count[nodes], self._first[nodes] = counts, self._used + np.cumsum(counts) - counts
        after = self._used + len(rows)
        if after > len(self._rows):
            self._rows = np.concatenate((self._rows[: self._used], np.empty(2 * after - self._used, np.int64)))
        self._rows[self._used : after], self._used = rows, after


def _checked(counts: IntArray) -> IntArray:
    """Return offsets, refusing too many."""
    ends = np.concatenate((np.zeros(1, np.int64), np.cumsum(counts)))
    if ends[-1] > _MOST_PAIRS:
        raise TooLarge(f"The agents see {ends[-1]} nodes together, too many for arrays. Ask for fewer games.")
    return ends


class KnownViews(KnownRows):
    """What a sensor shows from each node."""

    def __init__(self, streets: Streets, look: NodeLook) -> None:
        self._streets, self._look = streets, look
        super().__init__(streets.num_nodes, self._near if look.from_node is None else self._from_each)

    @property
    def are_next(self) -> bool:
        """Whether the node itself is shown, and those to which edges lead from there."""
        return self._look.radius is None

    def of(self, nodes: IntArray) -> tuple[IntArray, IntArray]:
        """Return what is seen from some nodes; see `KnownRows`."""
        look = self._look
        if self.are_next:
            return self._streets.legal_of(nodes)
        if look.radius == np.inf and look.cone is None and look.from_node is None:
            return _checked(np.full(len(nodes), self._nodes)), np.tile(np.arange(self._nodes), len(nodes))
        return super().of(nodes if look.place is None else np.zeros_like(nodes))  # from a place all see the same

    def _near(self, nodes: IntArray) -> list[tuple[IntArray, IntArray]]:
        """Return the places in `nodes` and the rows that are in range of them and in the field of view."""
        look, (x, y), runs = self._look, self._streets.axes, [(np.zeros(0, np.int64),) * 2]
        x0, y0 = (x[nodes], y[nodes]) if look.place is None else (np.full(len(nodes), one) for one in look.place)
        here, there = kernels.Area(x0, y0, np.zeros_like(nodes)), kernels.Area(x, y, np.zeros(len(x), np.int64))
        if look.radius == np.inf:
            runs.append(np.divmod(np.arange(len(nodes) * len(x)), len(x)))
        else:
            runs += kernels.near_each_other(here, there, look.radius or 0.0)
        if look.cone is None:
            return runs
        ahead = [kernels.in_cone(x[rows] - x0[lines], y[rows] - y0[lines], *look.cone) for lines, rows in runs]
        return [(lines[kept], rows[kept]) for (lines, rows), kept in zip(runs, ahead, strict=True)]

    def _from_each(self, nodes: IntArray) -> list[tuple[IntArray, IntArray]]:
        """Return the same of a sensor that looks from one node after the other."""
        look: Any = self._look.from_node
        rows = [np.sort(self._streets.rows(look(node))) for node in self._streets.ids(nodes).tolist()]
        return [(np.full(len(one), line), one) for line, one in enumerate(rows)]
