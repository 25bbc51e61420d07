"""Turns by metres in which agents decide at arrivals: columns for `gamms.core.arrivals`, of a batch or of one game."""

from array import array
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import partial
from math import nan
from typing import Any

import numpy as np

from gamms.core import arrivals, by_metres, rules, turn
from gamms.core.block import INT64
from gamms.core.travel import GoalPaths, TurnPaths
from gamms.game.movement.moves import TurnMoves
from gamms.game.movement.travel import GamePaths, RoadMap
from gamms.game.order import TurnOrder
from gamms.typing.game import EdgePlace

MOST_ARRIVALS = 1000  # per turn; beyond, an agent would move endlessly on edges of length 0
WAITS = f"it arrived {MOST_ARRIVALS} times in one turn, and waits"
NO_DEEDS = "deeds are done where a turn begins, not at an arrival in it"
_REASONS = {rules.KINDS.index("waits"): WAITS, rules.KINDS.index("late deed"): NO_DEEDS}
_ARRIVE, _CHOOSE, _GO_ON = arrivals.PHASES
_OF_GAME = (  # arguments of `GameColumns`
    *("node", "start", "previous", "alive", "placed", "stops", "home", "turn", "over", "score", "team", "plays"),
    *("first_node", "edge", "share"),
)
_OF_MOVERS = (  # arguments of `MetreMovers`
    *("ends", "went", "takes_part", "counts", "moves", "blocks", "blocked", "wanted", "held", "part_of", "part"),
    *("speeds", "motion", "start_places", "end_places", "drawn"),
)
_KINDS = dict.fromkeys(
    ("alive", "placed", "over", "plays", "takes_part", "blocked", "held"), np.dtype(np.uint8)
) | dict.fromkeys(("score", "share", "speeds"), np.dtype(np.float64))
_INT = np.dtype(np.int64)
_NO_INTS: Any = np.zeros(0, np.int64).data
_NO_FLOATS: Any = np.zeros(0).data
_NO_BYTES: Any = np.zeros(0, np.uint8).data
_ENDLESS: Any = np.full(1, np.iinfo(np.int64).max).data  # turns
_GOING: Any = np.zeros(1, np.int64).data  # a turn of one game is not interrupted in the core
_NO_PAST = turn.PastPlaces(0, _NO_INTS, _NO_INTS, _NO_FLOATS, _NO_INTS, _NO_INTS)
_MORE_LEGS = 2  # of a path to the next node


class ArrivalColumns:
    """Data that all threads share in games whose agents decide at arrivals; see `core.arrivals`.

    Args:
        shape: the numbers of games and agents.

    Attributes:
        now: (games,) the time of the last arrivals.
        comes, late, loses: (games, agents) whether the agent arrives, wants to do deeds, and has lost a conflict.
        asked, legs, passed, nodes, here, counts: see `core.arrivals.Arrivals`.
        queue: the agents under way.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        games, agents = shape
        rows = games * agents
        self._columns = np.zeros(6 * rows + games, np.int64)
        self.queue = arrivals.Queue(agents, games)
        self.now = np.full(games, np.inf)
        self.comes = np.zeros(shape, np.uint8)
        self.late = np.zeros(shape, np.uint8)
        self.asked, self.loses, self.legs, self.passed, self.nodes, self.here = self._columns[: 6 * rows].reshape(
            6, *shape
        )
        self.counts = self._columns[6 * rows :]

    def list_here(self, game: int) -> list[int]:
        """Return the agents of a game that decide or go on now."""
        here: list[int] = self.here[game, : self.counts[game]].tolist()
        return here

    def get_thread(
        self, travelers: by_metres.MetreMovers, *, has_end: bool, chosen: TurnPaths | None = None
    ) -> arrivals.Arrivals:
        """Return the data of one thread.

        Args:
            travelers: the agents.
            has_end: whether arrivals at the end of a turn count.
            chosen: receives the paths of agents that functions move; None: see `core.arrivals`.
        """
        columns: list[Any] = [self.comes, self.late, self._columns]
        views = [one.reshape(-1).data for one in columns]
        now: Any = self.now.data
        return arrivals.Arrivals(travelers, MOST_ARRIVALS, self.queue, now, *views, has_end=has_end, chosen=chosen)


class ArrivingAgents:
    """The agents of one game in a part of its turns in which they decide at arrivals, as the only row of the core.

    Only arriving agents are moved. The positions of the others are computed from their legs when needed
    (`AgentBlock.on_edge`), so that the cost of an arrival depends only on the arriving agents.

    Args:
        order: the living agents.
        members: the slots of the agents of this part of a turn.
        roads: the map.
        of_modes: the map with the edges that each mode of the agents may use.
        has_end: whether arrivals at the end of the turn count, because there are conflicts.

    Attributes:
        order, roads, has_end: see the arguments.
        here: the slots of the agents that arrive now, in the order of names; at the start, of all agents.
        now: the time of these arrivals, from 0 to 1.
        starts: the node of each agent when the part of the turn began.
        chosen: receives the paths that agents choose here.
    """

    def __init__(
        self,
        order: TurnOrder,
        members: Sequence[int],
        roads: RoadMap,
        of_modes: Mapping[str, RoadMap],
        *,
        has_end: bool,
    ) -> None:
        agents = len(order.slots)
        self.order = order
        self.roads = roads
        self.has_end = has_end
        self.now = 0.0
        self.here: list[int] = []
        self.chosen = GamePaths(agents)
        self._under_way = order.block.under_way
        self._rows = order.selection.rows
        self._members = members
        self._modes = of_modes
        self._moved = set[int]()  # slots
        self._arrivals = ArrivalColumns((1, agents))
        self._events = rules.Events(1)
        columns: dict[str, Any] = {
            name: np.zeros(agents, _KINDS.get(name, _INT)).data for name in (*_OF_GAME, *_OF_MOVERS)
        }
        self._columns = columns
        no_paths: list[Any] = [_NO_BYTES, 0, _NO_INTS, _NO_INTS, _NO_INTS, _NO_INTS, _NO_FLOATS]
        streets = roads.join([*of_modes.values()]) if of_modes else roads.map
        ways = GoalPaths(streets, streets, roads.reach.core, *no_paths)
        unknown: Any = None  # as the legal nodes are
        nothing: list[Any] = [unknown, _NO_BYTES, *[None] * 4]  # functions decide, and find paths and conflicts
        self._movers = by_metres.MetreMovers(
            *(ways, ways, unknown, self._events, self.chosen.core, *nothing),
            edges=_NO_INTS,
            slots=0,
            nodes=len(roads.ids),
            most_edges=1,
            has_all=True,
            parts=1,
            **{name: columns[name] for name in _OF_MOVERS},
        )
        places: dict[str | None, int] = {mode: number * len(roads.ids) for number, mode in enumerate(of_modes, 1)}
        firsts: Any = np.array([places.get(slot.mode, 0) for slot in order.slots] if of_modes else [], np.int64).data
        games = rules.GameColumns(agents, 0, mode_first=firsts, **{name: columns[name] for name in _OF_GAME})
        at_arrivals = self._arrivals.get_thread(self._movers, has_end=has_end, chosen=self.chosen.core)
        self._player = turn.Player(games, self._movers, at_arrivals, None, _ENDLESS, _GOING, 0, _GOING, _NO_PAST)
        columns["part_of"][:] = array(INT64, [1]) * agents
        columns["edge"][:] = array(INT64, [-1]) * agents

    def begin(self) -> list[int]:
        """Begin the part of a turn; return the slots of the agents that decide: all that are not on their way."""
        columns = self._columns
        roads = self.roads
        block = self.order.block
        self.starts = self.order.get_nodes()
        self._paths = GamePaths(len(self._rows))
        self._movers.take_paths(self._paths.core, has_all=True)
        self._moved.clear()
        self._places: list[Any] = [*self.starts]
        self._befores = self._places.copy()
        self._let_take_part(self.order.moving.select_present(self._members))
        for i, row in enumerate(self._rows):
            place = block.get_edge_position(row)
            if place is not None:
                self._places[i] = EdgePlace(place.edge)
            if columns["alive"][i]:
                columns["node"][i] = roads.find_row(self.starts[i])
                columns["edge"][i] = -1 if place is None else roads.edge_rows[place.edge]
                columns["share"][i] = 0.0 if place is None else place.share
                columns["motion"][i] = 0 if place is None else place.motion
                self._paths.maps[i] = roads
        self._arrivals.now[0] = arrivals.UNBEGUN
        self._play(_ARRIVE)
        self._read_here()
        decides = self._arrivals.comes[0] == arrivals.ASKED
        going = {i for i in self.here if not decides[i]}
        return [i for i in self._members if i not in going]

    def _let_take_part(self, members: Sequence[int]) -> None:
        """Let the agents of these slots move that are on the ground."""
        columns = self._columns
        slots = self.order.slots
        columns["alive"][:] = bytes(len(self._rows))
        for i in members:
            if slots[i].travels:
                columns["alive"][i] = 1
                columns["part_of"][i] = 0
                speed = slots[i].speed
                columns["speeds"][i] = nan if speed is None else speed

    def _play(self, phase: int) -> None:
        turn.play_phases(self._player, phase, 0, 1)

    def _read_here(self) -> None:
        """Read the agents that decide or go on now."""
        self.now = self._arrivals.now.item()
        self.here = self._arrivals.list_here(0)
        self.chosen.drop(self.here)

    def arrive(self) -> bool:
        """Move the agents that arrive next to their nodes; return whether there are any."""
        self._play(_ARRIVE)
        self._read_here()
        if self.now > 1.0:
            return False
        self._under_way.pass_time(self.now)
        for i in self.here:
            self._arrive(i)
        return True

    def choose(self, late: Iterable[int]) -> None:
        """Let the agents set out on their chosen paths.

        Args:
            late: the slots of the agents that want to do deeds at an arrival.
        """
        for i in late:
            self._arrivals.late[0, i] = 1
        if self._paths.reserve(max(map(self._paths.count_legs, self.here), default=0) + _MORE_LEGS):
            self._movers.take_paths(self._paths.core, has_all=True)
        self._play(_CHOOSE)

    def list_places(self) -> tuple[list[Any], list[Any]]:
        """Return the places of all agents, node ids or edges, before and after they have set out."""
        before = self._places
        self._befores = before
        self._places = before.copy()
        for i in self.here:
            place = self._columns["end_places"][i]
            edge = place - len(self.roads.ids)
            self._places[i] = self.roads.ids[place] if edge < 0 else EdgePlace(self.roads.edge_ids[edge][2])
        return before, self._places

    def find_goal(self, i: int) -> Any:
        """Return the node or edge on which the agent of a slot is after it has set out."""
        return self._places[i]

    def go_on(self, losers: Collection[int]) -> list[tuple[int, str]]:
        """Let all agents go on that have decided, but for those of some slots, which stay where they are.

        Return the slots of agents that do not get what they want, and why.
        """
        for i in losers:
            self._columns["held"][i] = 1
            self._places[i] = self._befores[i]
        self._play(_GO_ON)
        paths = self._paths
        legs = self._arrivals.legs[0].data
        for i in self.here:
            if i in losers:
                self._arrive(i)
            if paths.count_legs(i) > (0 if i in losers else legs[i]):
                self._moved.add(i)
                self._under_way.depart(self._rows[i], partial(paths.get_position_at, i))
        if losers:
            self._under_way.pass_time(self.now)
        events = self._events
        found = [(events.agents[row], _REASONS[events.kinds[row]]) for row in range(events.count)]
        events.count = 0
        return found

    def _arrive(self, i: int) -> None:
        """Put the agent of a slot on the node that it has passed last."""
        self._moved.add(i)
        self._under_way.arrive(self._rows[i], self._paths.end(i))

    def close(self) -> None:
        """Put all agents back to their places at the start of the turn; their moves are applied after the turn."""
        self._under_way.pass_time(0.0)
        for i in self._moved:
            self._under_way.put_back(self._rows[i], self.starts[i])

    def end(self, moves: TurnMoves) -> None:
        """Set the moves of the agents to their paths through the turn."""
        moves.paths = self._paths
        for i, roads in enumerate(self._paths.maps):
            if roads is not None:
                moves.ends[i] = self._paths.end(i)
