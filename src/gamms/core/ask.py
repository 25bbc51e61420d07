"""Call sensors and strategies of agents one by one, and read the common answers.

This module handles Python objects and holds the GIL. Uncommon answers - awaitables, errors, and actions other than a
legal node - go to the `answers` object; see `ask_each`.
"""

from __future__ import annotations

from math import nan
from typing import Any

from gamms.core import travel
from gamms.core.agents import MoveColumns, MovingAgents
from gamms.core.form import as_dict
from gamms.core.sight import RangeSearch
from gamms.core.travel import GoalPaths, PathsBySlot, ReachSearch, RoadEdges, TurnPaths


class StateKey:
    """A descriptor that reads a key of a dict as an attribute; only `action` can be set.

    Args:
        name: the key.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, state: Any, owner: Any) -> Any:
        """Return the value of the key (AttributeError: the key does not exist)."""
        if state is None:
            return self
        try:
            return state[self.name]
        except KeyError:
            keys = ", ".join([str(key) for key in state])
            raise AttributeError(f"This state has no {self.name!r}. Its keys are: {keys}.") from None

    def __set__(self, state: Any, value: object) -> None:
        """Set `action` (AttributeError: any other key)."""
        if self.name != "action":
            raise AttributeError(f"state.{self.name} cannot be set: a strategy sets state.action.")
        state["action"] = value


class SensorCall:
    """A sensor of an agent, prepared for repeated calls.

    Attributes:
        name: its name in the state.
        last: a list whose first item is the last data; for a user's sensor class, an object that can be indexed alike.
        kind: its type, as in the state; None: the type is read after each call.
        sensor: the object that is called, with `sense` and `type`; None: the sensor shows the neighbors of the node.
        number: the group of equal sensors that share data; -1: the sensor shares no data.
    """

    def __init__(self, name: str, last: Any, kind: Any, sensor: Any, number: int = -1) -> None:
        self.name = name
        self.last = last
        self.kind = kind
        self.sensor = sensor
        self.number = number


class DecidingAgent:
    """An agent with its own strategy.

    Attributes:
        agent, strategy, team: the agent, its strategy and its team.
        template: the constant part of its state; None: the agent needs `answers.observe`, or it has no strategy.
        sensors: its sensors.
        last: a list whose only item is the last state that it got.
        travels: whether it moves by metres.
        speed: its speed; None: one edge per turn.
    """

    def __init__(
        self,
        agent: Any,
        strategy: Any,
        template: Any,
        sensors: tuple[SensorCall, ...],
        last: list[Any],
        *,
        travels: bool = False,
        speed: float | None = None,
    ) -> None:
        self.agent = agent
        self.strategy = strategy
        self.template = template
        self.team = agent.team
        self.sensors = sensors
        self.last = last
        self.travels = travels
        self.speed = speed


class TravelSearch:
    """Finds the legal nodes and the paths of agents of one game by metres, with node ids in place of rows.

    A place is the position of an agent on an edge, as `ir.progress.Progress`; None: it is on its node.

    Attributes:
        now: the time in the turn, from 0 to 1, at which agents decide.
        at_arrivals: whether agents decide on arrival at each node.
        map, reach: the map, and working memory.
        trips: the last path that was found, in row 0.
        ways: the shortest paths of agents.
        found_on: the ids of the map on which it was found.
        ids, xy: ids and positions of nodes by row.
        row_of, edge_row_of: id of a node or an edge -> its row.
        lines: row of an edge -> its points, and their distances.
    """

    def __init__(self) -> None:
        self.now = 0.0
        self.at_arrivals = False
        self.found_on: Any = None

    def take_map(
        self,
        map: RoadEdges,
        reach: ReachSearch,
        ids: list[int],
        xy: list[Any],
        row_of: Any,
        edge_row_of: Any,
        lines: Any,
    ) -> None:
        """Use another map."""
        self.map = map
        self.reach = reach
        self.ids = ids
        self.xy = xy
        self.row_of = row_of
        self.edge_row_of = edge_row_of
        self.lines = lines

    def take_ways(self, ways: GoalPaths) -> None:
        """Use other memory for shortest paths."""
        self.ways = ways

    def take_trips(self, trips: TurnPaths) -> None:
        """Use other memory for paths by metres."""
        self.trips = trips

    def list_legal(self, here: int, place: Any, speed: float | None) -> tuple[int, ...]:
        """Return the legal nodes of an agent: the nodes next to it, then the nodes that it can reach in this turn.

        An agent whose edge was closed counts as on the node that it passed last. An agent under way that decides on
        arrival gets the nodes that it can reach from the end of its edge.
        """
        node = self.row_of[here]
        edge = -1
        share = 0.0
        motion = 0
        if place is not None:
            edge = self.edge_row_of.get(place.edge, -1)
            share = place.share
            motion = place.motion
        pace = nan if speed is None else speed
        count = travel.find_reachable(self.map, self.reach, node, edge, share, motion, pace, self.now, self.at_arrivals)
        found = []
        for number in range(count):
            found.append(self.ids[self.reach.nodes[number]])  # noqa: PERF401 - a comprehension is not compiled as well
        return tuple(found)

    def show(self, state: Any, here: int, place: Any) -> int:
        """Write the position of an agent to its state, a dict."""
        state = as_dict(state)
        edge = -1 if place is None else self.edge_row_of.get(place.edge, -1)
        if self.at_arrivals:
            state["time"] = self.now
        if edge < 0:
            state["edge"] = None
            state["offset_m"] = 0.0
            state["xy"] = self.xy[self.row_of[here]]
            return 0
        points, lengths = self.lines[edge]
        x, y, _, _ = find_point(points, lengths, place.share)
        state["edge"] = (place.source, place.target, place.edge)
        state["offset_m"] = place.share * self.map.lengths[edge]
        state["xy"] = (x, y)
        return 0

    def begin(self, here: int, place: Any, speed: float | None) -> int:
        """Place an agent at the start of its path (KeyError: its edge or node does not exist)."""
        node = self.row_of[here]
        edge = -1
        share = 0.0
        motion = 0
        if place is not None:
            edge = self.edge_row_of[place.edge]
            share = place.share
            motion = place.motion
        pace = nan if speed is None else speed
        most = 1 if self.at_arrivals else travel.ENDLESS
        return travel.begin(self.trips, 0, node, edge, share, motion, self.now, pace, most)

    def go_towards(self, agent: int, here: int, place: Any, speed: float | None, target: int) -> bool:
        """Find the shortest path of an agent toward a node, as far as the turn allows; return whether it can go there.

        `agent` is the row of its shortest paths.
        """
        self.begin(here, place, speed)
        return travel.go_towards(self.map, self.trips, self.ways, agent, 0, self.row_of[target])

    def put(self, paths: PathsBySlot, i: int) -> int:
        """Add the path to those of a game, as the path of the agent of a slot."""
        return paths.take(i, self.trips, 0, self.trips.legs[0], self.found_on)

    def end(self) -> int:
        """Return the node that the agent passes last."""
        return self.ids[self.trips.node[0]]


def find_point(points: list[Any], lengths: list[float], share: float) -> tuple[float, float, float, float]:
    """Return the point (x, y) at a share of the length of a polyline, and the direction (cos, sin) there.

    Args:
        points: its points.
        lengths: the distance from each point to the next.
        share: the share.
    """
    left = share * sum(lengths)
    for i in range(len(lengths)):
        length = lengths[i]
        if length > 0.0 and left <= length:
            x0, y0 = points[i]
            x1, y1 = points[i + 1]
            dx = (x1 - x0) / length
            dy = (y1 - y0) / length
            return x0 + left * dx, y0 + left * dy, dx, dy
        left -= length
    x0, y0 = points[len(points) - 1]
    return x0, y0, 0.0, 0.0


def sense_all(
    carried: tuple[SensorCall, ...], phase: Any, moment: Any, alike: Any, here: Any, legal: Any
) -> dict[Any, Any]:
    """Call the sensors of an agent at its node; return name -> (type, data). `ask_each` describes the arguments."""
    sensed = {}
    for look in carried:
        if look.sensor is None:
            seen = [*legal]
            look.last[0] = seen
            sensed[look.name] = (look.kind, seen)
            continue
        known = alike[look.number] if look.number >= 0 else None
        if known is not None and phase.moment is moment:
            data = look_around(known, look, here)
            if data is not None:
                sensed[look.name] = (look.kind, data)
                continue
        phase.agent = None
        look.sensor.sense(here)
        sensed[look.name] = (look.sensor.type, look.last[0])
    return sensed


def look_around(known: Any, look: SensorCall, here: Any) -> Any:
    """Return the data of a sensor from data shared by equal sensors; None: the sensor has to be called.

    Args:
        known: a `RangeSearch` or `NodeViews`.
        look: the sensor.
        here: the id of the observer's node.
    """
    if type(known) is RangeSearch:
        sight = known
        data = sight.find_around_node(here, look.sensor._owner)
        view = sight.view
    else:
        views = known
        seen = views.known.get(here)
        if seen is None:
            return None
        data = {"nodes": seen[0].copy(), "edges": seen[1].copy()}
        view = views.view
    look.last[0] = data
    look.last[1] = (here, view[0], view[1], view[2])
    return data


def ask_each(
    answers: Any,
    phase: Any,
    individuals: list[DecidingAgent],
    sensors: list[tuple[SensorCall, ...]],
    slots: Any,
    moves: MoveColumns,
    near: Any,
    alike: Any,
    movers: MovingAgents,
    search: Any,
) -> int:
    """Call the strategies of agents one by one, if they take part, and store their actions.

    All agents decide from the same state of the game: nothing may change in between. After the call, `phase.agent` is
    still the last agent.

    Args:
        answers: handles uncommon cases by `observe`, `take`, `fail`, `wait_for`, `note` and `team_memory`; `sense`
            calls the sensors of an agent by metres, `make_paths` makes room for paths in `paths`, and `make` makes a
            state from a template.
        phase: its `agent` is set to the agent that decides; its `moment` changes whenever the world may have changed.
        individuals: the agents.
        sensors: the sensors of each agent.
        slots: the slot of each agent.
        moves: the moves of all agents, by slot; the ends are written.
        near: node id -> the nodes that are legal along one edge.
        alike: the data that each group of equal sensors shares: a `RangeSearch`, `NodeViews`, or None.
        movers: all agents, by slot.
        search: finds the paths of agents by metres, as a `TravelSearch`.
    """
    make = answers.make
    shared = answers.state.team_memories
    columns = movers.columns
    turn = answers.state.turn
    moment = phase.moment
    has_memories = bool(shared)
    paths = search
    where = None
    for place in range(len(individuals)):
        one = individuals[place]
        i = slots[place]
        if not movers._takes_part[i]:
            continue
        here = moves.starts[i]
        if one.template is None:
            phase.agent = None
            legal = ()
            state = as_dict(answers.observe(answers.slots[i]))
            one.last[0] = state
            if one.strategy is None:
                continue
        else:
            if one.travels:
                where = columns.get_edge_position(movers.rows[i])
                legal = paths.list_legal(here, where, one.speed)
                phase.agent = None
                sensed = answers.sense(answers.slots[i]) if sensors[place] else {}
            else:
                legal = near[here]
                sensed = sense_all(sensors[place], phase, moment, alike, here, legal)
            state = as_dict(make(one.template))
            if one.travels:
                paths.show(state, here, where)
            one.last[0] = state
            state["curr_pos"] = here
            state["sensor"] = sensed
            state["turn"] = turn
            state["legal"] = legal
            state["team_memory"] = answers.get_team_memory(one.team) if has_memories else {}
        phase.agent = one.agent
        try:
            answer = one.strategy(state)
            if answer is not None and hasattr(type(answer), "__await__"):
                answers.wait_for(i, state, answer)
                continue
            action = state["action"]
        except Exception as error:  # noqa: BLE001 - a strategy is the caller's code
            answers.fail(i, state, error)
            continue
        if type(action) is not int or action not in legal:
            answers.take(i, state)
        elif not one.travels:
            moves.ends[i] = action
        elif paths.go_towards(movers.rows[i], here, where, one.speed, action):
            if answers.paths is None:
                answers.make_paths()
            paths.put(answers.paths, i)
            moves.ends[i] = paths.end()
        else:
            answers.take(i, state)
        mine = state.get("team_memory")
        if mine or (has_memories and one.team in shared):
            answers.note(i, mine)
    return 0
