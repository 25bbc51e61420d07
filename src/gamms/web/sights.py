"""What agents sense, as a page shows it: what each sensor saw, the shape of its field of view, and what teams see.

A recording says what sensors reported, and not which nodes a sensor covers that reports agents alone: the sensors of
the context that follows the game say that.
"""

from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import NotOffered
from gamms.ir.graph import GraphColumns, IntArray
from gamms.recorder.detached import DetachedState
from gamms.recorder.errors import refusing
from gamms.recorder.sensed import Look, looks_of, parts_of
from gamms.text import as_text
from gamms.visual.drawing import drawing_of
from gamms.web.facts import words_of

MOST_SIDES = 20  # of which a page offers what they see
_MOST_KNOWN = 20_000  # fields of view that are remembered
_NONE = np.zeros(0, np.int64)


class Shape(NamedTuple):
    """The outline of a field of view.

    Attributes:
        is_carried: whether its corners are seen from its agent, with which it goes.
        corners: (corners, 2) in the steps of the map.
    """

    is_carried: bool
    corners: IntArray


class Seen(NamedTuple):
    """What one sensor of an agent saw.

    Attributes:
        agent: the name of its agent.
        sensor: its name.
        kind: of the sensor.
        shape: the outline of its field of view; None: it has none.
        field: rows of the nodes that it covers, of a sensor that reports agents alone.
        nodes: rows of the nodes that it reported.
        edges: likewise.
        agents: names of agents, and the rows of the nodes on which it reported them; -1: those that they are on.
        words: what it reported, if that is nothing of these.
    """

    agent: str
    sensor: str
    kind: str
    shape: Shape | None
    field: IntArray
    nodes: IntArray
    edges: IntArray
    agents: Sequence[tuple[str, int]]
    words: str | None


class Sight(NamedTuple):
    """What a side sees: ascending rows of nodes, and the names of agents of others."""

    nodes: IntArray
    agents: Sequence[str]


class Sensed(NamedTuple):
    """What was sensed at one moment."""

    looks: Sequence[Seen]
    sides: Mapping[str, Sight]


class Sights:
    """Works out what agents sense in a context that follows a game.

    Args:
        ctx: the context.
        step: corners of shapes are counted in it.
    """

    def __init__(self, ctx: Any, step: Callable[[], float]) -> None:
        self._ctx, self._step = ctx, step
        self._covered: dict[Any, IntArray] = {}
        self._shapes: dict[Any, Shape | None] = {}
        self._columns: GraphColumns | None = None
        self._rows: dict[str, tuple[IntArray, IntArray]] = {}

    def forget(self) -> None:
        """Forget fields of view, because sensors or the map have changed."""
        self._covered.clear()
        self._shapes.clear()

    def rows(self, of: str, ids: Any) -> IntArray:
        """Return the rows of "nodes" or "edges" by their ids; -1 where there is none."""
        if not len(ids):
            return _NONE
        columns = self._ctx.graph.columns()
        if columns is not self._columns:
            self._columns = columns
            given = {"nodes": columns.node_ids, "edges": columns.edge_ids}
            self._rows = {name: (np.argsort(one, kind="stable"), np.sort(one)) for name, one in given.items()}
        order, known = self._rows[of]
        wanted = np.asarray(ids, np.int64)
        if not len(known):
            return np.full(len(wanted), -1)
        places = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
        found: IntArray = np.where(known[places] == wanted, order[places], -1)
        return found

    def sensed(self, looked: Sequence[Mapping[str, Any]], state: DetachedState) -> Sensed:
        """Return what was sensed, where the game stands.

        Args:
            looked: the data of events.
            state: how the game stands.
        """
        names = state.agents.names_by_number()
        nodes = self.rows("nodes", state.agents.columns["node"]).tolist()
        at = dict(zip(state.agents.columns["names"], nodes, strict=True))
        with refusing("What was sensed is not right", with_type=True):
            found = [pair for data in looked for pair in looks_of(data)]
            looks = [self._seen(names[number], look, names, at) for number, look in found if number in names]
        return Sensed(looks, self._sides(looks, state))

    def _seen(self, name: str, look: Look, names: Mapping[int, str], now: Mapping[str, int]) -> Seen:
        nodes, edges, agents, other = parts_of(look)
        rows, edge_rows = self.rows("nodes", nodes), self.rows("edges", edges)
        at = self.rows("nodes", [node for _, node in agents]).tolist()
        pairs = [(names[number], row) for (number, _), row in zip(agents, at, strict=True) if number in names]
        seen = [(other, -1 if now[other] == row else row) for other, row in pairs]
        agent = self._ctx.agent.agents.get(name)
        sensor = getattr(agent, "sensors", {}).get(look.sensor)
        is_there = sensor is not None and isfinite(getattr(sensor, "range", inf))
        shape = self._shape(agent, sensor) if is_there else None
        field = self._field(agent, sensor) if is_there else _NONE
        words = None if other is None else words_of(other)
        found = rows[rows >= 0], edge_rows[edge_rows >= 0], seen
        return Seen(name, as_text(look.sensor), as_text(look.kind), shape, field, *found, words)

    # -- fields of view -----------------------------------------------------------------------------------------

    def _shape(self, agent: Any, sensor: Any) -> Shape | None:
        """Return the outline of what a sensor covers; None where obstacles leave no polygon of it."""
        if sensor.type.name.startswith("OCCLUDED"):
            return None
        place, look = _pose(agent, sensor)
        key = sensor.sensor_id, look
        if key not in self._shapes:
            view = drawing_of(self._ctx).carriers.sight(sensor, agent).view
            self._shapes[key] = None if view is None else self._outline(view.outline, sensor, place)
        return self._shapes[key]

    def _outline(self, outline: Any, sensor: Any, place: Any) -> Shape | None:
        if len(outline) < 3 or not np.isfinite(outline).all():
            return None
        is_carried = getattr(sensor, "at", None) is None
        node = self._ctx.graph.graph.get_node(place) if isinstance(place, int) else None
        middle = np.array([node.x, node.y]) if node is not None else np.array(place[:2])
        corners = np.rint((outline - middle if is_carried else outline) / self._step())
        return Shape(is_carried, corners.astype(np.int32).T)

    def _field(self, agent: Any, sensor: Any) -> IntArray:
        """Return the rows of the nodes that a sensor covers which reports agents alone."""
        place, look = _pose(agent, sensor)
        on_edge = drawing_of(self._ctx).motion.on_edges().get(agent.name)
        key = sensor.sensor_id, place, look, on_edge
        known = self._covered.get(key)
        if known is None:
            if len(self._covered) >= _MOST_KNOWN:
                self._covered.clear()
            looks_from: Any = agent.current_node_id if on_edge is None else on_edge
            try:
                covered = sensor.coverage(looks_from, agent.name).node_ids
            except NotOffered:
                covered = _NONE
            known = self._covered[key] = self.rows("nodes", covered)
        return known

    # -- sides --------------------------------------------------------------------------------------------------

    def _sides(self, looks: Sequence[Seen], state: DetachedState) -> dict[str, Sight]:
        """Return what each side sees."""
        columns = state.agents.columns
        names = columns["names"]
        side_of = dict(zip(names, sides_in(columns), strict=True))
        sides = dict.fromkeys(side_of.values())
        if len(sides) > MOST_SIDES:
            return {}
        nodes = self.rows("nodes", columns["node"])
        alive = np.asarray(columns["alive"]) != 0
        size = len(self._ctx.graph.columns().node_ids)
        masks = {side: np.zeros(size + 1, bool) for side in sides}  # the last one is of nodes that are not there
        found: dict[str, dict[str, None]] = {side: {} for side in sides}
        living = {name for name, is_alive in zip(names, alive.tolist(), strict=True) if is_alive}
        for name, row in zip(names, nodes.tolist(), strict=True):
            if name in living:
                masks[side_of[name]][row] = True
        for look in looks:
            if look.agent not in living:
                continue
            side = side_of[look.agent]
            masks[side][look.nodes] = True
            found[side].update(dict.fromkeys(name for name, _ in look.agents))
            masks[side][look.field] = True
        is_on_node = (np.asarray(columns["kind"]) == 0) & (np.asarray(columns["edge_share"]) == 0)
        sights = {}
        for side, mask in masks.items():
            mask[-1] = False
            standing = np.flatnonzero(is_on_node & mask[nodes]).tolist()
            found[side].update(dict.fromkeys(names[row] for row in standing))
            others = [name for name in found[side] if side_of.get(name) != side]
            sights[side] = Sight(np.flatnonzero(mask), others)
        return sights


def sides_in(columns: Mapping[str, Any]) -> list[str]:
    """Return the side of each agent: the text of its team, or without one its name."""
    pairs = zip(columns["names"], columns["teams"], strict=True)
    return [name if team is None else as_text(team) for name, team in pairs]


def _pose(agent: Any, sensor: Any) -> tuple[Any, Any]:
    """Return where a sensor looks from, a node or a position, and what its outline depends on besides its range."""
    if getattr(sensor, "at", None) is not None:
        return (0.0, 0.0), None
    if "AERIAL" in sensor.type.name:
        position = tuple(agent.position)
        return position, (position[2], tuple(agent.quat))
    turns = getattr(sensor, "turns_with_agent", False)
    return agent.current_node_id, tuple(agent.orientation) if turns else None
