"""Looks at agents: which agents are within the radius, and in the field of view, of a sensor.

`is_within` and `is_ahead` are the tests of all looks. `see` finds the agents that an agent of a batch sees, with an
`AgentSearch`. `AgentPositions` holds the agents of a context in the order of their creation; a `RangeSearch`
finds those within one radius of a point, with a grid in a hash table, and returns them in the same order.
"""

from __future__ import annotations

from array import array
from math import atan2, fabs
from typing import Any

from gamms.core.agents import AgentColumns
from gamms.core.block import INT64

LEAST = 1e-150  # squares of radii between LEAST
MOST = 1e150  # and MOST are neither zero nor infinite; other radii are scaled
SCALE = 2.0**600
MOST_CELLS = 536870912.0  # 2 ** 29, to each side of the origin
SLACK = 1.0 + 1e-6  # a cell is wider than the radius, because places in cells are rounded
FACTOR_X = 73856093
FACTOR_Y = 19349663
MANY = 16  # results of at least this many agents are stored for the next search from the node
MOST_KEPT = 1 << 20  # the maximum number of stored agents
TURN = 6.283185307179586  # radians


# -- tests -------------------------------------------------------------------------------------------------------------


def compute_scale(radius: float) -> float:
    """Return the power of two that scales a radius so that its square is neither zero nor infinite."""
    if radius <= LEAST:
        return SCALE
    return 1.0 / SCALE if radius >= MOST else 1.0


def is_within(dx: float, dy: float, square: float) -> bool:
    """Return whether an offset is at most as long as a radius; `square` is the square of the radius.

    The test is dx * dx + dy * dy <= square in 64-bit floats, so an agent on the circle is within the radius.
    """
    return dx * dx + dy * dy <= square


def is_ahead(dx: float, dy: float, axis: float, rim: float) -> bool:
    """Return whether an offset is in a sector; an offset of zero is in every sector.

    Args:
        dx: the offset.
        dy: the offset.
        axis: the direction of view, radians.
        rim: half the angle of the sector, radians.
    """
    off = fabs(atan2(dy, dx) - axis)
    return off <= rim or TURN - off <= rim or (dx == 0.0 and dy == 0.0)


# -- the agents of batches ---------------------------------------------------------------------------------------------


class SensorTable:
    """The sensors of agents: each shows the agents of some teams within a radius.

    Attributes:
        begins: (agents + 1,) the sensors of agent `i` are `begins[i]` to `begins[i + 1] - 1`.
        squares: (sensors,) squared radii, of radii that need no scale; may be infinite.
        shows: (sensors * teams,) 1: the sensor shows agents of the team.
        teams: the number of teams.
    """

    def __init__(self, begins: memoryview[int], squares: memoryview[float], shows: memoryview[int], teams: int) -> None:
        self.begins = begins
        self.squares = squares
        self.shows = shows
        self.teams = teams


def is_shown(sensors: SensorTable, viewer: int, team: int, dx: float, dy: float) -> bool:
    """Return whether a sensor of an agent shows an agent of a team at an offset."""
    for sensor in range(sensors.begins[viewer], sensors.begins[viewer + 1]):
        if sensors.shows[sensor * sensors.teams + team] and is_within(dx, dy, sensors.squares[sensor]):
            return True
    return False


def find_widest_square(sensors: SensorTable, viewer: int) -> float:
    """Return the largest squared radius of an agent's sensors; -1: it has none."""
    widest = -1.0
    for sensor in range(sensors.begins[viewer], sensors.begins[viewer + 1]):
        widest = max(widest, sensors.squares[sensor])
    return widest


class AgentSearch:
    """Finds the agents that plain sensors show, in games of a batch: by ascending x, to both sides of an observer.

    Attributes:
        looks: the sensors of all agents of a game.
        agents: the number of agents of a game.
        node: (games * agents,) the node of each agent.
        alive: (games * agents,) whether it is alive.
        team: (agents,) its team number.
        xy: (2 * nodes,) x and y of each node, map units.
        order: (games * agents,) the agents of each game by ascending x; empty: no agent looks.
        ranks: (games * agents,) the place of each agent in this order.
        places: (2 * games * agents,) x and y of each agent.
    """

    def __init__(
        self,
        looks: SensorTable,
        node: memoryview[int],
        alive: memoryview[int],
        team: memoryview[int],
        xy: memoryview[float],
        order: memoryview[int],
    ) -> None:
        self.looks = looks
        self.agents = len(team)
        self.node = node
        self.alive = alive
        self.team = team
        self.xy = xy
        self.order = order
        self.ranks = memoryview(array(INT64, bytes(8 * len(order))))
        self.places: memoryview[Any] = memoryview(array("d", bytes(16 * len(order))))

    def load_node_positions(self, game: int, base: int) -> int:
        """Take the positions of the agents of a game from their nodes, which are numbered from `base` in `xy`."""
        first = game * self.agents
        for row in range(first, first + self.agents):
            node = base + self.node[row]
            self.places[2 * row] = self.xy[2 * node]
            self.places[2 * row + 1] = self.xy[2 * node + 1]
        return self.sort(game)

    def load_positions(self, game: int, xy: memoryview[float], begin: int) -> int:
        """Take the positions of the agents of a game, who may be between nodes, from `xy[begin:]`."""
        first = 2 * game * self.agents
        for number in range(2 * self.agents):
            self.places[first + number] = xy[begin + number]
        return self.sort(game)

    def sort(self, game: int) -> int:
        """Order the agents of a game by their places.

        The order of the last call is corrected by insertion, because most agents have not passed others.
        """
        first = game * self.agents
        for number in range(1, self.agents):
            agent = self.order[first + number]
            x = self.places[2 * (first + agent)]
            place = first + number
            while place > first and self.places[2 * (first + self.order[place - 1])] > x:
                self.order[place] = self.order[place - 1]
                place -= 1
            self.order[place] = agent
        for number in range(self.agents):
            self.ranks[first + self.order[first + number]] = number
        return 0


def see(s: AgentSearch, game: int, viewer: int, seen: memoryview[int]) -> int:
    """Write the numbers of the agents that an agent sees to `seen`, (agents,), in no order; return how many they are.

    Dead agents and the agent itself are left out. The search goes to both sides along the x axis, up to the widest
    radius of the agent's sensors.
    """
    widest = find_widest_square(s.looks, viewer)
    first = game * s.agents
    here = first + viewer
    count = 0
    for side in range(-1, 2, 2):
        rank = s.ranks[here] + side
        while 0 <= rank < s.agents:
            other = s.order[first + rank]
            dx = s.places[2 * (first + other)] - s.places[2 * here]
            if not is_within(dx, 0.0, widest):
                break
            dy = s.places[2 * (first + other) + 1] - s.places[2 * here + 1]
            if s.alive[first + other] and is_shown(s.looks, viewer, s.team[other], dx, dy):
                seen[count] = other
                count += 1
            rank += side
    return count


def sort_numbers(numbers: memoryview[int], count: int) -> int:
    """Sort the first numbers, by insertion over gaps that shrink."""
    gap = 1
    while gap < count // 9:
        gap = 3 * gap + 1
    while gap > 0:
        for place in range(gap, count):
            number = numbers[place]
            before = place - gap
            while before >= 0 and numbers[before] > number:
                numbers[before + gap] = numbers[before]
                before -= gap
            numbers[before + gap] = number
        gap //= 3
    return 0


# -- the agents of a context -------------------------------------------------------------------------------------------


class AgentPositions:
    """The positions of agents on the map.

    Attributes:
        at: node -> (x, y), map units.
        names: (agents,) the names of the agents.
        rows: name -> row.
        nodes: (agents,) their nodes.
        count: the number of agents.
        x, y: (room,) their positions.
        is_seen: (room,) whether searches find the agent.
    """

    def __init__(self, at: Any) -> None:
        self.at = at
        self.names: list[str] = []
        self.rows: dict[str, int] = {}
        self.nodes: list[Any] = []
        self.count = 0
        self._reserve(8)

    def _reserve(self, room: int) -> None:
        self.x = memoryview(array("d", bytes(8 * room)))
        self.y = memoryview(array("d", bytes(8 * room)))
        self.is_seen = memoryview(array("b", bytes(room)))

    def fill(self, names: list[str], nodes: list[Any]) -> int:
        """Set the nodes of all agents, all of them visible to searches (KeyError: a node does not exist).

        Args:
            names: their names; the same list object means unchanged names.
            nodes: their nodes.
        """
        count = len(nodes)
        self.count = 0
        if count > len(self.x):
            self._reserve(count + count // 2)
        at = self.at
        for row in range(count):
            place = at[nodes[row]]
            self.x[row] = place[0]
            self.y[row] = place[1]
            self.is_seen[row] = 1
        if names is not self.names:
            self.names = names
            self.rows = {name: row for row, name in enumerate(names)}
        self.nodes = nodes
        self.count = count
        return 0

    def follow(self, columns: AgentColumns) -> int:
        """Update the nodes of all agents from the columns; return the number of agents that have moved (KeyError)."""
        moved = 0
        for row in range(self.count):
            node = columns._get_node(row)
            if node != self.nodes[row]:
                place = self.at[node]
                self.nodes[row] = node
                self.x[row] = place[0]
                self.y[row] = place[1]
                moved += 1
        return moved

    def put(self, row: int, node: Any, *, is_seen: bool) -> None:
        """Set the node of an agent, and whether searches find it (KeyError: the node does not exist)."""
        place = self.at[node]
        self.nodes[row] = node
        self.x[row] = place[0]
        self.y[row] = place[1]
        self.is_seen[row] = is_seen

    def get_node(self, row: int) -> Any:
        """Return the node of an agent."""
        return self.nodes[row]


class RangeSearch:
    """Finds the agents within a radius of a point, including those exactly on the circle.

    The test is `is_within`; both sides are scaled by a power of two if the square would be zero or infinite.

    Args:
        places: the positions of the agents.
        radius: map units, nonnegative; may be infinite.
        view: the parameters of the sensor, stored with its last result.

    Attributes:
        view: the parameters of the sensor.
        is_built: whether the grid is up to date; otherwise `build` is necessary.
    """

    # NOTE: cells are entries of a hash table, so that neither outliers nor moves require a new grid.

    def __init__(self, places: AgentPositions, radius: float, view: tuple[Any, ...]) -> None:
        self.places = places
        self.view = view
        self.is_built = False
        self.radius = radius
        self.scale = compute_scale(radius)
        self.square = (radius * self.scale) * (radius * self.scale)
        self.is_endless = radius == float("inf")
        self.size = 1.0
        self.room = 0
        self.mask = 0
        self.everyone: dict[Any, Any] = {}
        self.known: dict[Any, dict[Any, Any]] = {}  # results by node, until an agent moves
        self.kept = 0  # the number of agents in `known`
        self._reserve(0)

    def _reserve(self, room: int) -> None:
        entries = 8
        while entries < 2 * room:
            entries *= 2
        self.room = room
        self.mask = entries - 1
        self.first = memoryview(array("i", bytes(4 * entries)))
        self.after = memoryview(array("i", bytes(4 * (room + 1))))
        self.before = memoryview(array("i", bytes(4 * (room + 1))))
        self.cell_x = memoryview(array("i", bytes(4 * (room + 1))))
        self.cell_y = memoryview(array("i", bytes(4 * (room + 1))))
        self.found = memoryview(array(INT64, bytes(8 * (room + 1))))

    def build(self) -> int:
        """Build the grid from all agents."""
        if self.places.count > self.room:
            self._reserve(self.places.count + self.places.count // 2)
        self._enter_all()
        self._forget()
        if self.is_endless:
            self.everyone = self._make_named_results(self._find(0.0, 0.0), "")
        self.is_built = True
        return 0

    def _enter_all(self) -> int:
        x = self.places.x
        y = self.places.y
        greatest = 0.0
        for row in range(self.places.count):
            greatest = max(greatest, fabs(x[row]))
            greatest = max(greatest, fabs(y[row]))
        self.size = self.radius * SLACK
        self.size = max(self.size, greatest / MOST_CELLS)
        if self.size <= 0.0:
            self.size = 1.0
        for entry in range(self.mask + 1):
            self.first[entry] = -1
        for row in range(self.places.count - 1, -1, -1):
            self.before[row] = -2
            if self.places.is_seen[row]:
                self._enter(row)
        return 0

    def _forget(self) -> int:
        self.known.clear()
        self.kept = 0
        return 0

    def move(self, row: int) -> int:
        """Update the grid after an agent has moved, appeared or disappeared."""
        if self.is_endless:
            self.is_built = False
        if not self.is_built:
            return 0
        if self.kept > 0:
            self._forget()
        if self.before[row] != -2:
            self._leave(row)
        if self.places.is_seen[row]:
            self._enter(row)
        return 0

    def _enter(self, row: int) -> int:
        self.cell_x[row] = self._find_cell(self.places.x[row])
        self.cell_y[row] = self._find_cell(self.places.y[row])
        entry = self._find_entry(self.cell_x[row], self.cell_y[row])
        other = self.first[entry]
        self.after[row] = other
        self.before[row] = -1
        if other >= 0:
            self.before[other] = row
        self.first[entry] = row
        return 0

    def _leave(self, row: int) -> int:
        after = self.after[row]
        before = self.before[row]
        if before >= 0:
            self.after[before] = after
        else:
            self.first[self._find_entry(self.cell_x[row], self.cell_y[row])] = after
        if after >= 0:
            self.before[after] = before
        self.before[row] = -2
        return 0

    def _find_cell(self, value: float) -> int:
        """Return the cell number of a coordinate; coordinates far away are clamped to the last cell."""
        place = value / self.size
        if place > MOST_CELLS:
            place = MOST_CELLS
        elif place < -MOST_CELLS:
            place = -MOST_CELLS
        cell = as_cell(place)
        if cell > place:
            cell -= 1
        return cell

    def _find_entry(self, cell_x: int, cell_y: int) -> int:
        return ((cell_x * FACTOR_X) ^ (cell_y * FACTOR_Y)) & self.mask

    def _find(self, x: float, y: float) -> int:
        """Write the rows of the agents near a point into `found`, ascending; return their number."""
        count = 0
        if self.is_endless:
            for row in range(self.places.count):
                if self.places.is_seen[row]:
                    self.found[count] = row
                    count += 1
            return count
        xs = self.places.x
        ys = self.places.y
        middle_x = self._find_cell(x)
        middle_y = self._find_cell(y)
        for cell_y in range(middle_y - 1, middle_y + 2):
            for cell_x in range(middle_x - 1, middle_x + 2):
                row = self.first[self._find_entry(cell_x, cell_y)]
                while row >= 0:
                    if self.cell_x[row] == cell_x and self.cell_y[row] == cell_y:
                        dx = (xs[row] - x) * self.scale
                        dy = (ys[row] - y) * self.scale
                        if is_within(dx, dy, self.square):
                            self.found[count] = row
                            count += 1
                    row = self.after[row]
        sort_numbers(self.found, count)
        return count

    def _make_named_results(self, count: int, own: str) -> dict[Any, Any]:
        names = self.places.names
        nodes = self.places.nodes
        own_row = self.places.rows.get(own, -1)
        data = {}
        for place in range(count):
            row = self.found[place]
            if row != own_row:
                data[names[row]] = nodes[row]
        return data

    def find_by_name(self, x: float, y: float, own: str) -> dict[Any, Any]:
        """Return name -> node of the agents near a point, except the agent `own`; "" excludes none."""
        if not self.is_built:
            self.build()
        if not self.is_endless:
            return self._make_named_results(self._find(x, y), own)
        data = self.everyone.copy()
        data.pop(own, None)
        return data

    def find_rows(self, x: float, y: float) -> list[int]:
        """Return the rows of the agents near a point, ascending."""
        if not self.is_built:
            self.build()
        count = self._find(x, y)
        return [self.found[place] for place in range(count)]

    def find_rows_ahead(self, x: float, y: float, axis: float, rim: float) -> list[int]:
        """Return the rows of the agents near a point and within a sector, ascending; an agent at the point is included.

        Args:
            x: of the point.
            y: of the point.
            axis: the direction of view, radians.
            rim: half the angle of the sector, radians.
        """
        if not self.is_built:
            self.build()
        xs = self.places.x
        ys = self.places.y
        rows = []
        for place in range(self._find(x, y)):
            row = self.found[place]
            if is_ahead(xs[row] - x, ys[row] - y, axis, rim):
                rows.append(row)
        return rows

    def find_around_node(self, node: Any, own: str) -> dict[Any, Any]:
        """Return name -> node of the agents near a node, except the agent `own` (KeyError: the node does not exist)."""
        place = self.places.at[node]
        if self.is_endless or not self.is_built:
            return self.find_by_name(place[0], place[1], own)
        # NOTE: copying a large dict takes a tenth of the time of building it (w3, AGENT_RANGE among 1,000).
        found = self.known.get(node)
        if found is None:
            count = self._find(place[0], place[1])
            if count < MANY:
                return self._make_named_results(count, own)
            if self.kept + count > MOST_KEPT:
                self._forget()
            found = self._make_named_results(count, "")
            self.known[node] = found
            self.kept += count
        data = found.copy()
        data.pop(own, None)
        return data


class NodeViews:
    """The nodes and edges that a sensor with a full circle of view sees from each node, as far as computed.

    Attributes:
        known: node -> (nodes, edges), a dict and a list.
        view: see `RangeSearch`.
    """

    def __init__(self, known: Any, view: tuple[Any, ...]) -> None:
        self.known = known
        self.view = view


def as_cell(place: float) -> int:
    """Return a float truncated to an integer."""
    return int(place)


class AgentIndex:
    """The agents of one context for sensors: their positions, and a search for each radius.

    A subclass takes positions that this class cannot follow.

    Attributes:
        phase: the phase of the context.
        agents: the positions.
        sights: radius -> search.
        entered: the agents whose positions were entered last, if all were on nodes; None: not all were.
        epoch: the epoch of the context when they were entered.
        version: the version of the set of living agents at that time; see `ir.columns.StructureLog`.
        revised: the object that counts the changes of the map.
        revision: the revision of the map when they were entered.
        moment: the moment at which the positions were last checked.
    """

    def __init__(self, phase: Any, agents: AgentPositions) -> None:
        self.phase = phase
        self.agents = agents
        self.sights: dict[float, RangeSearch] = {}
        self.entered: AgentColumns | None = None
        self.epoch = 0
        self.version = 0
        self.revised: Any = None
        self.revision: Any = None
        self.moment: Any = None

    def get_shared_look(self, radius: float) -> Any:
        """Return a search for agents around nodes, valid until an agent moves; None if agents are on edges."""
        if not self.follow() and self.load_all_positions():
            return None
        found = self.sights.get(radius)
        return self.find_sight(radius) if found is None else found

    def follow(self) -> bool:
        """Update the positions if agents have only moved to nodes since; return whether this was possible."""
        entered = self.entered
        agents: Any = entered
        if entered is None or self.epoch != self.phase.epoch or self.version != agents.structure.version:
            return False
        if entered.travellers or self.revision != self.revised.revision:
            return False
        if self.agents.follow(entered) > 0:
            for sight in self.sights.values():
                sight.is_built = False
        self.moment = self.phase.moment
        return True

    def load_all_positions(self) -> bool:
        """Take all positions; return whether agents may be on edges."""
        raise NotImplementedError

    def find_sight(self, radius: float) -> RangeSearch:
        """Return the search for a radius; it is added if it is new."""
        raise NotImplementedError
