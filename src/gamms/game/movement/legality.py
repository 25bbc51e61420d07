"""Check the actions of agents, and find the moves that they lead to."""

from collections.abc import Iterable, Sequence
from itertools import chain, pairwise
from math import nan
from typing import Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_int, as_known
from gamms.core import by_edges as core
from gamms.core.travel import GoalPaths
from gamms.errors import BadValue, GammsError, NoPath, UnknownName
from gamms.game.deeds import check_wanted_deeds
from gamms.game.movement.streets import StreetGraph
from gamms.game.movement.travel import (
    PathFinder,
    ResolvedAction,
    Travel,
    TravelWithTurns,
    find_usable_graph,
    make_paths_of_one,
)
from gamms.game.settings import Settings
from gamms.game.slots import AgentSlot
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray, list_forbidden_paths, split_mode
from gamms.ir.progress import Progress
from gamms.text import shown
from gamms.typing.actions import as_node, get_heading, resolve_flight
from gamms.typing.context import HostContext
from gamms.typing.game import SET_BY_STRATEGIES, STATE_KEYS, Track

_ACTION_KEYS = ("node_id", "edge", "do", "orientation")  # of an action of an agent on the ground
_FLIGHT_KEYS = ("direction", "distance", "quat", "do")  # and of one that flies
_MORE_NODES = 3  # room in addition to the nodes of a path


class MultiEdgeMoves(PathFinder):
    """Finds moves along several edges per turn, on one revision of a graph.

    Args:
        streets: the legal moves along one edge.

    Attributes:
        streets: see the argument.
    """

    def __init__(self, streets: StreetGraph) -> None:
        super().__init__(streets.columns, np.ones(len(streets.columns.edge_ids)))
        self.streets = streets
        self._most = streets.num_nodes + _MORE_NODES
        self._take_ways(self.get_ways(0))

    def _take_ways(self, hops: GoalPaths) -> None:
        """Use these shortest paths in the core, with new buffers."""
        self._hops = hops
        self._trips = make_paths_of_one(self._most)
        self._walks = core.EdgePaths(self._trips, self.streets.core, hops)

    def _begin(self, here: int, speed: float | None, place: Progress | None) -> None:
        """Place an agent at its start."""
        ahead = -1
        covered = 0.0
        if place is not None and place.source == here:
            ahead = self._row_of.get(place.target, -1)
            covered = place.share
        core.begin(
            self._walks, 0, self.find_row(here), ahead, covered, nan if speed is None else min(speed, self._most)
        )

    def list_reachable(self, here: int, speed: float | None, place: Progress | None) -> tuple[int, ...]:
        """Return the legal nodes of an agent in this turn, its own first."""
        self._begin(here, speed, place)
        return self.list_found(core.list_legal(self._walks, 0))

    def move_towards(self, agent: int, here: int, speed: float, place: Progress | None, target: int) -> ResolvedAction:
        """Return the move of an agent toward a node, along a path with the fewest edges.

        Raises:
            BadValue: there is no path.
        """
        hops = self.get_ways(agent)
        if hops is not self._hops:
            self._take_ways(hops)
        self._begin(here, speed, place)
        if not core.go_towards(self._walks, 0, hops, agent, self.find_row(target)):
            raise BadValue(str(NoPath(here, target)))
        return self._make_resolved_action()

    def move_along(self, here: int, speed: float, place: Progress | None, route: Sequence[int]) -> ResolvedAction:
        """Return the move of an agent along a route of nodes."""
        if len(route) + _MORE_NODES > self._most:
            self._most = len(route) + _MORE_NODES
            self._take_ways(self._hops)
        self._begin(here, speed, place)
        for number, node in enumerate(route):
            self._trips.route[number] = self.find_row(node)
        core.walk(self._trips, 0, len(route))
        return self._make_resolved_action()

    def _make_resolved_action(self) -> ResolvedAction:
        """Return the path that the core has written."""
        ids = self.ids
        trips = self._trips
        ahead = trips.edge[0]
        path = tuple([ids[row] for row in memoryview(trips.nodes)[: trips.passed[0]].tolist()])
        progress = None if ahead < 0 else Progress(path[-1], ids[ahead], trips.share[0])
        return ResolvedAction(path[-1], path, progress=progress)


class IllegalAction(GammsError, ValueError):
    """An action is malformed or not legal."""

    @classmethod
    def missing(cls, legal: Sequence[int], state: Iterable[str]) -> "IllegalAction":
        """Return the error for an agent that has set no action; it names a key that was set instead.

        Args:
            legal: the ids of its legal nodes.
            state: the keys of its state.
        """
        said = f"state['action'] was not set (what is returned does not count); legal are {[*legal]}"
        unknown = next((key for key in state if key not in STATE_KEYS), None)
        return cls(
            said if unknown is None else f"{said}. {UnknownName('key of the state', unknown, SET_BY_STRATEGIES)}"
        )


def refuse_any(edge: int, name: str) -> BadValue:
    """Return the error for an action that names an edge in a game in which agents may move to any node."""
    return BadValue(
        f"An action names an edge, {edge}, in a game in which agents may move to any node: legal='any'. Agent "
        f"{shown(name)} names the node: {{'node_id': …}}."
    )


def refuse_edge(edge: int, flaw: str, legal: Sequence[int]) -> BadValue:
    """Return the error for an action that names an edge which is not legal.

    Args:
        edge: its id.
        flaw: why it is not legal.
        legal: the ids of the legal edges.
    """
    return BadValue(f"Edge {edge} is not legal: {flaw}; state['legal_edges'] are {[*legal]}.")


def explain_edge(edge: tuple[int, int, int], here: int, on_edge: int | None, mode: str | None) -> str:
    """Return why an agent may not take an edge, given by the ids of its ends and its own.

    Args:
        edge: the edge.
        here: the node of the agent.
        on_edge: the edge that it is on; None: it is on its node.
        mode: its mode.
    """
    source, target, _ = edge
    if on_edge is not None:
        return f"the agent is on edge {on_edge}"
    if source != here:
        return f"it begins on node {source}, and the agent is on node {here}"
    return f"it leads from node {here} to itself" if target == here else f"mode {mode!r} may not use it"


class Legality:
    """Checks the actions of agents, and finds the moves that they lead to.

    Args:
        ctx: the context, for its graph and agents.
        settings: the settings of the game.
        state: the state of the game, for the edges that agents have driven.
        mode: the edge attribute that says which edges the agents may use; None: those with any mode, see
            `get_for_agent`.

    Attributes:
        travel: the paths of agents by metres.
    """

    def __init__(self, ctx: HostContext, settings: Settings, state: GameState, mode: str | None = None) -> None:
        self._ctx = ctx
        self._settings = settings
        self._state = state
        self._mode = mode
        self._turns: tuple[object, kernels.ForbiddenPaths] | None = None  # with the columns of the graph
        self._of_modes: dict[str, Legality] = {}
        self._like: Legality | None = None
        is_free = mode is None or not split_mode(mode)[1]
        self.travel = Travel(ctx, settings, mode) if mode is None or is_free else TravelWithTurns(ctx, settings, mode)
        self._streets: StreetGraph | None = None  # of the last revision of the graph
        self._walking: MultiEdgeMoves | None = None
        self._ids: tuple[StreetGraph | None, tuple[int, ...]] = None, ()  # a map, and the ids of its nodes

    def get_for_agent(self, mover: AgentSlot) -> "Legality":
        """Return the legality of the actions of agents with the mode of an agent."""
        return self.get_for_mode(mover.mode)

    def get_for_mode(self, mode: str | None) -> "Legality":
        """Return the legality of the actions of agents with a mode; None: of those without."""
        if mode == self._mode:
            return self
        assert mode is not None  # noqa: S101 - agents without a mode ask this object
        if mode not in self._of_modes:
            self._of_modes[mode] = Legality(self._ctx, self._settings, self._state, mode)
            self._of_modes[mode].travel.now = self.travel.now
            if self._like is not None:
                self._of_modes[mode].travel.like = self._like.get_for_mode(mode).travel
        return self._of_modes[mode]

    def share_maps(self, like: "Legality") -> None:
        """Use the maps of another game as long as this one has the same; called before any agent is asked."""
        self._like = like
        self.travel.like = like.travel

    def keep_map(self, *, keeps: bool) -> None:
        """Decide on the present map until the map is not kept any more, whatever functions change in the graph."""
        for one in (self, *self._of_modes.values()):
            if keeps and not one.travel.keeps_map:
                _ = one.travel.roads
            one.travel.keeps_map = keeps

    def set_time(self, now: float) -> None:
        """Set the time in the turn at which agents of all modes decide, from 0 to 1."""
        for one in (self, *self._of_modes.values()):
            one.travel.now = now

    @property
    def _graph(self) -> Any:  # Any: see `find_usable_graph`
        """The graph of the edges that the agents may use, whatever turn restrictions say."""
        return find_usable_graph(self._ctx, self._mode)

    def resolve(self, mover: AgentSlot, here: int, action: object) -> ResolvedAction:
        """Return the move that an action leads to; the path of an agent by metres is then in `travel` of its mode.

        Raises:
            GammsError: the action is malformed or not legal; the message says why.
        """
        deeds = None
        keys = _FLIGHT_KEYS if mover.flies else _ACTION_KEYS
        if isinstance(action, dict):
            for key in action:
                as_known(key, "key of an action", keys)
        if isinstance(action, dict) and "do" in action:
            deeds = check_wanted_deeds(action["do"], self._settings.deeds, self._ctx) or None
            action = {key: value for key, value in action.items() if key != "do"}
            if not mover.flies and "edge" not in action:
                action.setdefault("node_id", None if mover.travels else here)
        if mover.flies:
            position, quat = resolve_flight(self._ctx.agent.block, mover.row, action)
            return ResolvedAction(here, (here,), position=position, quat=quat, deeds=deeds)
        heading: Any = ()
        names_edge = isinstance(action, dict) and "edge" in action
        if isinstance(action, dict):
            heading = get_heading({"node_id": None, **action} if names_edge else action)
            if names_edge and "node_id" in action:
                raise BadValue("An action names the next node or the edge to it, not both: leave out 'node_id'.")
            action = action["edge"] if names_edge else action["node_id"]
        if names_edge:
            resolved = self.get_for_agent(mover)._take_edge(mover, here, as_int(action, "The id of an edge"))
        else:
            resolved = self._resolve_move(mover, here, action)
        if heading == () and deeds is None:
            return resolved
        return resolved._replace(heading=heading, deeds=deeds)

    def _resolve_move(self, mover: AgentSlot, here: int, action: object) -> ResolvedAction:
        """Return the move toward a node, or along a list of nodes; None: an agent by metres stops."""
        own = self.get_for_agent(mover)
        self._check_driven(mover)
        if mover.travels and action is None:
            return own.find_path(mover, here, None)
        if isinstance(action, list) or (isinstance(action, np.ndarray) and action.ndim == 1):
            nodes = list(map(self._check_node, action))
            return own.find_path(mover, here, nodes) if mover.travels else own.resolve_path(mover, here, nodes, True)
        node = self._check_node(action)
        return own.find_path(mover, here, node) if mover.travels else own.resolve_path(mover, here, [node], False)

    def _take_edge(self, mover: AgentSlot, here: int, edge: int) -> ResolvedAction:
        """Return the move along an edge that an action has named."""
        if self._settings.legal == "any":
            raise refuse_any(edge, mover.name)
        self._check_driven(mover)
        roads = self.travel.roads
        row = roads.get_row_of_edge(edge)
        if row is None:
            raise UnknownName("edge", edge)
        legal = self.list_edges(mover, here)
        if edge not in legal:
            raise refuse_edge(edge, self._explain_refused_edge(mover, here, roads.edge_ids[row]), legal)
        if mover.travels:
            self.travel.cross_edge(self.travel.get_position(mover.row), here, mover.speed, edge)
            return ResolvedAction(self.travel.end(), (here,), edge=edge)
        if mover.obeys_turns:
            return _make_step(here, (edge, roads.edge_ids[row][1]))
        return self.resolve_path(mover, here, [roads.edge_ids[row][1]], True)._replace(edge=edge)

    def _explain_refused_edge(self, mover: AgentSlot, here: int, edge: tuple[int, int, int]) -> str:
        """Return why an agent may not take an edge, given by the ids of its ends and its own."""
        place = self.travel.get_position(mover.row) if mover.travels else None
        is_usable = edge[1] != here and edge[2] in self.travel.roads.list_edges(here)
        if place is None and is_usable:
            return self._explain_forbidden_edge(mover, here)
        return explain_edge(edge, here, None if place is None else place.edge, self._mode)

    def list_edges(self, mover: AgentSlot, here: int) -> tuple[int, ...]:
        """Return the ids of the edges that the action of an agent may name."""
        if mover.flies or self._settings.legal == "any":
            return ()
        own = self.get_for_agent(mover)
        place = own.travel.get_position(mover.row) if mover.travels else None
        if place is None:
            return tuple(own._list_onward_edges(mover, here))
        around = own.travel.roads.list_around(place.edge)
        return tuple(around if not mover.obeys_turns else [edge for edge in around if edge == place.edge])

    # -- turn restrictions ------------------------------------------------------------------------------------------

    def find_driven(self, name: str) -> tuple[int, ...]:
        """Return the ids of the edges on which an agent has come to its node, as many as matter for its next turn.

        Empty: it obeys no turn restrictions, begins on its node, or was placed there.
        """
        known = self._state.driven.get(name, ())
        if not known:
            return ()
        block = self._ctx.agent.block
        row = block.find_row(name)
        mode = block.modes[row]
        if mode is None or not split_mode(mode)[1]:
            return ()
        roads = self.get_for_mode(mode).travel.roads
        walk: list[tuple[int, int, int]] = []  # the ids of the ends of each edge, and its own
        for edge in known:
            place = roads.get_row_of_edge(edge)
            ends = None if place is None else roads.edge_ids[place]
            if ends is None or edge not in roads.list_edges(ends[0]):  # it was removed, or closed to the mode
                walk = []
            else:
                walk = [*walk, ends] if walk and walk[-1][1] == ends[0] else [ends]
        previous, node = block.get_previous_node(row), block.get_node(row)
        if not walk or walk[-1][1] != node:
            return ()
        if self._settings.speed_unit == "edges":
            has_come = walk[-1][0] == previous
        else:  # it passes several nodes in a turn, and may end it on the node where it has begun it
            has_come = previous != node or any(source == previous for source, *_ in walk)
        return tuple([edge for *_, edge in walk]) if has_come else ()

    def _check_driven(self, mover: AgentSlot) -> None:
        """Forget the edges that an agent has driven if they do not lead to its node any more: it begins there."""
        known = self._state.driven
        if mover.name in known:
            driven = self.find_driven(mover.name)
            if driven:
                known[mover.name] = driven
            else:
                del known[mover.name]

    def drive_on(self, mover: AgentSlot, edges: Sequence[int], driven: dict[str, tuple[int, ...]]) -> None:
        """Note the edges, by id, that an agent that obeys turn restrictions has driven to their ends in a turn."""
        forbidden = self.get_for_agent(mover)._forbidden
        before = known = driven.get(mover.name, ())
        for edge in edges:
            known = forbidden.step(known, edge) or (edge,)
        if edges and not mover.travels:
            driven[mover.name] = known
        elif edges:
            count = max(len(known), len(edges))  # all of this turn: its first node is then the previous one
            driven[mover.name] = (*before, *edges)[-count:]

    @property
    def _forbidden(self) -> kernels.ForbiddenPaths:
        """The forbidden sequences of edges, by id, also with edges that are closed and may be open later."""
        columns = self._ctx.graph.columns()
        if self._turns is None or self._turns[0] is not columns:
            attribute, _ = split_mode(str(self._mode))
            paths = list_forbidden_paths(columns, with_closed=True).get(attribute, [])
            self._turns = columns, kernels.ForbiddenPaths(paths)
        return self._turns[1]

    def _list_onward_edges(self, mover: AgentSlot, here: int) -> list[int]:
        """Return the ids of the edges that an agent on a node may take next, in ascending order."""
        if not mover.obeys_turns:
            return self.travel.roads.list_edges(here)
        return sorted(edge for edge, _ in self._list_moves(mover, here))

    def _explain_forbidden_edge(self, mover: AgentSlot, here: int) -> str:
        """Return why an edge that the mode may use is not legal for an agent that obeys turn restrictions."""
        edge = self.find_driven(mover.name)[-1]
        source = self._ctx.agent.block.get_previous_node(mover.row)
        return (
            f"the agent came to node {here} along edge {edge} from node {source}, and a turn restriction forbids it, "
            "or it leads back, which is legal only where nothing else is"
        )

    def _obey(self, mover: AgentSlot, here: int, path: list[int]) -> ResolvedAction:
        """Return the move of an agent by edges that obeys turn restrictions, along the cheapest legal edge."""
        path = [node for node, before in zip(path, [here, *path], strict=False) if node != before]
        if not path:
            return ResolvedAction(here, (here,))
        onward = self._list_moves(mover, here)
        found = [one for one in onward if one[1] == path[0]]
        if found and len(path) == 1:
            return _make_step(here, found[0])
        legal = [*self.list_reachable(mover, here)]
        if not found and path[0] in self._graph.neighborhoods[here]:
            raise BadValue(
                f"No turn to node {path[0]} is legal: {self._explain_forbidden_edge(mover, here)}; legal are {legal}."
            )
        raise BadValue(f"Node {path[-1]} is not next to node {here}; legal are {legal}.")

    def find_edge(self, mode: str | None, source: int, target: int) -> int | None:
        """Return the id of the edge that agents of a mode take between two nodes if their action names none.

        It is the cheapest that they may use; None: there is none now.
        """
        return self.get_for_mode(mode).travel.roads.find_edge(source, target)

    def find_path(self, mover: AgentSlot, here: int, wanted: int | list[int] | None) -> ResolvedAction:
        """Find the path of an agent by metres: toward a node, along a list of nodes, or None to stop."""
        travel = self._tell_driven(mover)
        place = travel.get_position(mover.row)
        if wanted is None:
            travel.stay(place, here)
        elif isinstance(wanted, list):
            travel.follow_route(place, here, mover.speed, wanted)
        else:
            travel.find_path_towards(mover.row, place, here, mover.speed, wanted)
        return ResolvedAction(travel.end(), (here,))

    def _list_moves(self, mover: AgentSlot, here: int) -> list[tuple[int, int]]:
        """Return the ids of each edge that an agent that obeys turns may take next, and of its end."""
        travel = self._tell_driven(mover)
        assert isinstance(travel, TravelWithTurns)  # noqa: S101 - its mode says that it obeys
        return travel.list_moves(here)

    def _tell_driven(self, mover: AgentSlot) -> Travel:
        """Return the paths of agents by metres; if turns count, for an agent that has come by the edges that it has."""
        if isinstance(self.travel, TravelWithTurns):
            self.travel.driven = self.find_driven(mover.name)
        return self.travel

    def is_open(self, track: Track) -> bool:
        """Return whether all edges of a legal move still exist."""
        path, _, legs = track
        if legs:
            return all(self.travel.roads.get_row_of_edge(leg.edge) is not None for leg in legs)
        near = self._ctx.graph.graph.neighborhoods
        has_node = self._ctx.graph.graph.has_node
        if self._settings.legal == "any" or not all(map(has_node, path)):
            return all(map(has_node, path))
        return all(end in near[start] for start, end in pairwise(path))

    def list_reachable(self, mover: AgentSlot, here: int) -> tuple[int, ...]:
        """Return the ids of the legal nodes of an agent in this turn, its own first; () for an agent that flies."""
        if mover.flies:
            return ()
        if mover.is_plain:
            return tuple(self._ctx.graph.graph.neighborhoods[here])
        own = self.get_for_agent(mover)
        if mover.travels:
            travel = own._tell_driven(mover)
            travel.prepare(mover.row)
            return travel.list_legal(here, travel.get_position(mover.row), mover.speed)
        if self._settings.legal == "any":
            return self._list_all_nodes(here)
        if mover.obeys_turns:
            ends = [end for _, end in own._list_moves(mover, here)]
            return tuple(dict.fromkeys([here, *ends]))
        return own.walking.list_reachable(here, mover.speed, self._ctx.agent.block.get_progress(mover.row))

    def _list_all_nodes(self, here: int) -> tuple[int, ...]:
        """Return all nodes, the agent's own first."""
        streets = self.streets
        if self._ids[0] is not streets:
            self._ids = streets, tuple(streets.columns.node_ids.tolist())
        ids = self._ids[1]
        row = int(streets.rows([here])[0])
        return (here, *ids[:row], *ids[row + 1 :])

    @property
    def streets(self) -> StreetGraph:
        """The legal moves along one edge, as arrays."""
        graph = self._graph
        columns = graph.columns()
        if self._streets is None or self._streets.columns is not columns:
            self._streets = StreetGraph(columns, graph.routes)
        return self._streets

    @property
    def walking(self) -> MultiEdgeMoves:
        """The legal moves along several edges per turn."""
        streets = self.streets
        if self._walking is None or self._walking.streets is not streets:
            self._walking = MultiEdgeMoves(streets)
        return self._walking

    def list_reachable_each(self, movers: Sequence[AgentSlot], starts: Sequence[int]) -> tuple[IntArray, IntArray]:
        """Return the legal nodes of several agents: offsets (agents + 1,) and ids."""
        legal = [self.list_reachable(mover, here) for mover, here in zip(movers, starts, strict=True)]
        offsets = np.zeros(len(legal) + 1, np.int64)
        np.cumsum(list(map(len, legal)), out=offsets[1:])
        return offsets, np.fromiter(chain.from_iterable(legal), np.int64, int(offsets[-1]))

    def _check_node(self, action: object) -> int:
        graph = self._ctx.graph.graph
        node = as_node(action, graph)
        if not graph.has_node(node):
            raise UnknownName("node", node)
        return node

    def _check_path(self, here: int, path: list[int]) -> list[int]:
        """Return an action's list of nodes without the agent's own node (BadValue: an edge is missing)."""
        path = path[1:] if path and path[0] == here else path
        near = self._graph.neighborhoods
        if self._settings.legal == "edges":
            for start, end in zip([here, *path], path, strict=False):
                if end not in near[start]:
                    raise BadValue(f"{self._no_edge} from node {start} to node {end}.")
        return path

    @property
    def _no_edge(self) -> str:
        """The beginning of a message that an edge is missing."""
        return "No edge leads" if self._mode is None else f"No edge that mode {self._mode!r} may use leads"

    def resolve_path(self, mover: AgentSlot, here: int, nodes: list[int], is_route: bool) -> ResolvedAction:
        """Return the move along a path, or along the shortest path to its only node, as far as it goes in this turn."""
        path = self._check_path(here, nodes) if is_route else nodes
        if not path or (path == [here] and not is_route):
            return ResolvedAction(here, (here,))
        if self._settings.legal == "any":
            return ResolvedAction(path[-1], (here, *path))
        if mover.obeys_turns:
            return self._obey(mover, here, path)
        if mover.speed is None:
            near = self._graph.neighborhoods[here]
            if len(path) > 1 or path[0] not in near:
                raise BadValue(f"Node {path[-1]} is not next to node {here}; legal are {list(near)}.")
            return ResolvedAction(path[0], (here, path[0]))
        place = self._ctx.agent.block.get_progress(mover.row)
        if is_route:
            return self.walking.move_along(here, mover.speed, place, path)
        return self.walking.move_towards(mover.row, here, mover.speed, place, path[0])


def _make_step(here: int, onward: tuple[int, int]) -> ResolvedAction:
    """Return the move from a node along an edge, given by its id and that of its end."""
    edge, end = onward
    return ResolvedAction(end, (here, end), edge=edge)
