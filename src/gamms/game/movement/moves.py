"""The moves of one turn: as arrays for the turn engine, and by name for rules and resolvers."""

from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from itertools import chain, compress, count, repeat
from operator import ne
from typing import Any, TypeVar

import numpy as np

from gamms.core import travel as core
from gamms.core.agents import MoveColumns
from gamms.core.block import stop_moves
from gamms.core.turn import TurnMovesInCore
from gamms.game.movement.travel import GamePaths, ResolvedAction, Travel
from gamms.game.order import TurnOrder
from gamms.ir.agents import AgentBlock, make_moves
from gamms.ir.columns import copy_column
from gamms.ir.progress import Progress
from gamms.typing.agent_engine import IAgent
from gamms.typing.game import Deed, EdgePlace, Leg, Move, Track

T = TypeVar("T")


class Refusals:
    """The moves and deeds that rules refuse in a turn, with reasons.

    Args:
        turn: the moves of the turn.
        performed: returns the deeds of the part of the turn.

    Attributes:
        moves: agent -> the reasons why its move is refused.
        deeds: agent -> deed -> the reasons why it is refused.
    """

    def __init__(self, turn: "TurnMoves", performed: Callable[[], list[Deed]]) -> None:
        self._turn = turn
        self._performed = performed
        self.moves: dict[str, set[str]] = {}
        self.deeds: dict[str, dict[str, set[str]]] = {}

    def add(self, agent: str, why: str, deed: str | None) -> None:
        """Refuse the move of an agent, or one of its deeds."""
        if deed is None:
            self.moves.setdefault(agent, set()).add(why)
        elif any(one.agent == agent and one.kind == deed for one in self._performed()):
            self.deeds.setdefault(agent, {}).setdefault(deed, set()).add(why)

    def take_back(self, members: Iterable[int]) -> Iterator[tuple[int, str | None, str]]:
        """Withdraw the refused moves of the agents of some slots, and list the refused deeds.

        Yield the slot of each, the kind of the deed, None for its move, and why.
        """
        turn = self._turn
        for i in members:
            name = turn.slots.names[i]
            why = self.moves.get(name)
            if why and turn.stop(i):
                yield i, None, "; ".join(sorted(why))
            for kind, reasons in sorted(self.deeds.get(name, {}).items()):
                yield i, kind, f"{kind}: {'; '.join(sorted(reasons))}"


class TurnMoves(TurnMovesInCore):
    """The moves of one turn by slot, and by name for rules and resolvers.

    Args:
        order: the agents.
        starts, ends: the nodes where the move of each agent begins and ends.
        actions: slot -> its action, if it flies, turns or does deeds.
        moves: the starts and ends as arrays of the core; None: not known yet.
        paths: the paths of agents that do more than to move along one edge; None: there are none.
        took_part: (agents,) whether each took part; None: those that take part now.

    Attributes:
        order, starts, ends, actions, paths, took_part: see the arguments.
        slots: the slots of the agents.
        applied: the version of the block when these moves were made, by agents with paths; -1: not known.
    """

    __slots__ = ()

    def get_core_columns(self) -> MoveColumns:
        """Return the starts and ends of all moves as arrays of the core."""
        return make_moves(self.starts, self.ends) if self.columns is None else self.columns

    def copy_for_agents(self, agents: Any, twin_of: Callable[[IAgent], IAgent]) -> "TurnMoves":
        """Return the same moves for the agents of a copied game, matched by name; see `Slots.copy_for_agents`."""
        order = copy(self.order)
        order.block = agents.block
        order.entries = -1  # those of the copy are numbered independently
        order.rows_version = -1
        order.slots = self.slots.copy_for_agents(agents, twin_of)
        return TurnMoves(order, self.starts, self.ends, self.actions, paths=self.paths, took_part=self.took_part)

    def are_latest(self, block: AgentBlock) -> bool:
        """Return whether all agents that took part are where these moves have brought them, along paths."""
        is_same = self.order.block is block and self.order.entries == block.structure.entries
        return is_same and self.applied == block.version

    def get_by_name(self) -> dict[str, Move]:
        """Return agent -> its move, for agents on the ground, in the order of names."""
        if self.by_names is None:
            ground = self.order.whole.on_ground
            self.by_names = self.select_by_slot(
                self.select_taking_part(range(len(self.slots)) if ground is None else ground)
            )
        return self.by_names

    def select_taking_part(self, indices: Sequence[int]) -> Sequence[int]:
        """Return those of some slots whose agents took part."""
        took_part = self.took_part
        return indices if 0 not in took_part else [i for i in indices if took_part[i]]

    def find_index(self, name: str) -> int | None:
        """Return the slot of an agent that took part, by its name; None: it did not."""
        i: int | None = self.order.index_of.get(name)
        return i if i is not None and self.took_part[i] else None

    def select_by_slot(self, indices: Sequence[int]) -> dict[str, Move]:
        """Return agent -> its move, for the slots `indices`."""
        moves = {}
        for i in indices:
            slot = self.slots[i]
            path, _, legs = self.find_track(i)
            if path[:1] == path[1:2]:  # the track says that it waits for its part of the turn
                path = path[1:]
            moves[slot.name] = Move(slot.name, slot.team, self.starts[i], self.ends[i], path, legs)
        return moves

    def list_places(self) -> tuple[list[Any], list[Any]]:
        """Return the start and end place of each agent, by slot: a node id, or an edge."""
        starts: list[Any] = list(self.starts)
        ends: list[Any] = list(self.ends)
        for i in range(len(starts)):
            begun = None if self.paths is None else self.paths.get_first_leg(i)
            progress = None if self.paths is None else self.paths.get_progress(i)
            if begun is not None:
                starts[i] = EdgePlace(begun.edge)
            if progress is not None and progress.motion:
                ends[i] = EdgePlace(progress.edge)
        return starts, ends

    def list_tracks(self, agents: Iterable[IAgent]) -> list[Track]:
        """Return the tracks of agents; an agent that was placed or flew is on its node only at time 1."""
        slots = [(agent, self.find_slot(agent)) for agent in agents]
        return [Track((one.current_node_id,), (1.0,)) if i is None else self.find_track(i) for one, i in slots]

    def has_path(self, i: int) -> bool:
        """Return whether the path of the agent of a slot is in `paths`."""
        return self.paths is not None and self.paths.maps[i] is not None

    def find_slot(self, agent: IAgent) -> int | None:
        """Return the slot of an agent; None: it has none, or is not where its move has ended."""
        i = self.find_index(agent.name)
        if (
            i is None
            or self.ends[i] != agent.current_node_id
            or self.slots[i].agent is not agent
            or self.is_displaced(i)
        ):
            return None
        return i

    def get_track(self, i: int) -> Track:
        """Return the nodes, times and legs of the move of a slot."""
        track: Track | None = None if self.paths is None else self.paths.make_track(i)
        if track is not None:
            return track
        start = self.starts[i]
        end = self.ends[i]
        return Track((start,), (0.0,)) if start == end else Track((start, end), (0.0, 1.0))

    def find_track(self, i: int) -> Track:
        """Return the track of a slot, with the edge that its action has named as a leg."""
        # NOTE: contacts read `get_track`: in games that count edges they compare nodes, whatever edge leads to them.
        track = self.get_track(i)
        action = self.actions.get(i)
        if track.legs or action is None or action.edge is None or len(track.path) == 1:
            return track
        path, times, _ = track
        last = max(place for place in range(1, len(path)) if path[place - 1] != path[place])
        leg = Leg(path[last - 1], path[last], action.edge, 0.0, 1.0, times[last - 1], times[last])
        return track._replace(legs=(leg,))

    def find_named_edges(self) -> dict[str, int]:
        """Return agent -> the id of the edge that its action has named, for those that come to its end."""
        named = {self.slots[i].name: action.edge for i, action in self.actions.items() if action.edge is not None}
        tracks = {name: self.find_track(self.order.index_of[name]) for name in named}
        ends = {name: [stay.edge for stay in track.legs if stay.end == 1.0] for name, track in tracks.items()}
        return {name: edge for name, edge in named.items() if ends[name] == [edge]}

    def set_heading(self, i: int, heading: tuple[float, float] | None) -> None:
        """Set the heading that the agent of a slot has chosen at an arrival."""
        action = self.actions.get(i) or ResolvedAction(self.ends[i], (self.starts[i],))
        self.actions[i] = action._replace(heading=heading)

    def is_displaced(self, i: int) -> bool:
        """Return whether an agent on the end node of its move got there otherwise: it flew, or a rule placed it."""
        slot = self.slots[i]
        action = self.actions.get(i)
        block = self.slots.block_now
        if block.placed and slot.name in block.rows and block.find_row(slot.name) in block.placed:
            return True
        if slot.flies:
            return action is not None and action.position not in (None, slot.agent.prev_position)
        if not slot.travels:
            return False
        ended = self.get_progress(i)
        now = block.get_progress(block.find_row(slot.name)) if slot.name in block.rows else ended
        return (now and now[:-1]) != (ended and ended[:-1])  # the last field, its motion, does not count

    def stop(self, i: int) -> bool:
        """Keep the agent of a slot at its start; return whether it would have moved."""
        here = self.starts[i]
        action = self.actions.get(i)
        goes = self.ends[i] != here or (self.paths is not None and self.paths.is_moving(i))
        if goes or (action is not None and action.position is not None):
            self.order.blocked[i] += 1
            self._stay(i, here)
            return True
        return False

    def stop_each(self, losers: memoryview) -> tuple[Sequence[int], Sequence[Any]]:
        """Keep the agents of slots at their starts; return the slots and the ends of those that would have moved."""
        if not len(losers):
            return losers, losers
        if self.actions or self.paths is not None:
            _, ends = self.list_places()
            wanted = [(i, ends[i]) for i in losers]  # before `stop` changes the ends
            stopped = [(i, end) for i, end in wanted if self.stop(i)]
            return [i for i, _ in stopped], [end for _, end in stopped]
        self.by_names = None
        slots = memoryview(array("q", losers.tobytes()))
        nodes = memoryview(array("q", losers.tobytes()))
        count = stop_moves(self.starts, self.ends, self.order.blocked.data, losers, slots, nodes)
        return slots[:count], nodes[:count]

    def give_up(self, block: AgentBlock) -> None:
        """Cancel the moves of agents that a rule has placed elsewhere since they decided."""
        nodes = self.order.get_nodes()
        self.starts = copy_column(self.starts)
        self.ends = copy_column(self.ends)
        self.columns = None
        began_on = (
            [] if self.paths is None else [i for i in range(len(nodes)) if self.paths.get_first_leg(i) is not None]
        )
        left = {i for i in began_on if block.get_edge_position(self.slots[i].row) is None}
        for i in left.union(compress(count(), map(ne, self.starts, nodes))):
            self.starts[i] = nodes[i]
            self._take_path(i, None, i)
            self._stay(i, nodes[i])

    def _stay(self, i: int, node: int) -> None:
        self.ends[i] = node
        if self.paths is not None and self.has_path(i):
            core.stay(self.paths.core, i)
        action = self.actions.get(i)
        if action is not None:
            self.actions[i] = action._replace(position=None)
        self.by_names = None

    def get_progress(self, i: int) -> Progress | None:
        """Return the position of the agent of a slot on an edge when its move ends; None: it is on a node."""
        return None if self.paths is None else self.paths.get_progress(i)

    # -- turns with several parts ----------------------------------------------------------------------------------

    def let_stand(self, paced: Iterable[int], travel: Travel) -> None:
        """Let agents of slots stand that are on an edge, and do not act in this part of the turn."""
        maps = None if self.paths is None else self.paths.maps
        for i in paced if maps is None else [i for i in paced if maps[i] is None]:
            slot = self.slots[i]
            place = travel.get_position(slot.row) if slot.travels else None
            if place is not None and travel.roads.get_row_of_edge(place.edge) is not None:
                travel.stay(place, self.starts[i])
                self.paths = self.paths or GamePaths(len(self.slots))
                travel.put(self.paths, i)

    def fit_to_order(self, order: TurnOrder) -> "TurnMoves":
        """Return the moves for another order, or of other agents that take part; those that are new stay."""
        lives = order.moving.lives
        if order is self.order and lives == self.took_part:
            return self
        places = np.fromiter(map(self.order.index_of.get, order.names, repeat(-1)), np.int64, len(order.names))
        if order.rows_version != self.order.rows_version:  # a new agent may have the name of a deleted one
            for i in [i for name in self.slots.departed if (i := order.index_of.get(name)) is not None]:
                j = places[i]
                if j >= 0 and order.slots[i].agent is not self.slots[j].agent:
                    places[i] = -1
        order.block.locate()
        nodes = order.get_nodes()
        takes_part = (places >= 0) & np.frombuffer(lives, np.bool_)
        takes_part[takes_part] = np.frombuffer(self.took_part, np.bool_)[places[takes_part]]
        there = np.flatnonzero(takes_part)
        starts = np.array(nodes, np.int64)
        ends = np.array(nodes, np.int64)
        before = places[there]
        starts[there] = np.asarray(self.starts)[before]
        ends[there] = np.asarray(self.ends)[before]
        number = dict(zip(before.tolist(), there.tolist(), strict=True)) if self.actions else {}
        actions = {number[j]: self.actions[j] for j in sorted(self.actions) if j in number}
        found = TurnMoves(order, starts.data, ends.data, actions)
        for i, j in zip(there.tolist(), before.tolist(), strict=True):
            found._take_path(i, self.paths, j)
        return found

    def fit_to_parts(self, parts: Sequence[Sequence[Any]]) -> "TurnMoves":
        """Fit each move into the part of the turn of the agent's team; return this object."""
        teams = self.order.list_teams()
        for number, part in enumerate(parts):
            self.go_in_part(number, len(parts), [i for i, team in enumerate(teams) if team in part])
        return self

    def go_in_part(self, number: int, parts: int, members: Iterable[int]) -> None:
        """Fit the moves of some slots into one of several equal parts of the turn; until then the agents wait."""
        paths = self.paths or GamePaths(len(self.slots))
        self.paths = paths
        for i in members:
            if paths.maps[i] is None and self.starts[i] != self.ends[i]:
                paths.walk(i, (self.starts[i], self.ends[i]))
            paths.go_in_part(i, number, parts)
        self.by_names = None

    def add_part(self, later: "TurnMoves", part: int) -> None:
        """Add the moves of a later part of the turn; both have the same order."""
        parts = later.order.parts
        starts = copy_column(self.starts)
        ends = copy_column(self.ends)
        for i in parts[part].members:
            action = later.actions.get(i)
            is_put = later.starts[i] != ends[i]  # by a rule in its part of the turn, and it gave up its move
            if not is_put:
                ends[i] = later.ends[i]
            if action is not None:
                self.actions[i] = action
            self._take_path(i, None if is_put else later.paths, i)
        for i in chain.from_iterable(one.members for one in parts[part + 1 :]):
            self.actions.pop(i, None)
            self._take_path(i, later.paths, i)  # it may stand on an edge
            starts[i] = later.starts[i]
            ends[i] = later.starts[i]
        self.starts = starts
        self.ends = ends
        self.columns = None
        self.by_names = None

    def _take_path(self, i: int, paths: GamePaths | None, other: int) -> None:
        """Let the agent of a slot have the path of another slot in other paths."""
        if paths is not None and paths.maps[other] is not None:
            self.paths = self.paths or GamePaths(len(self.slots))
            self.paths.take(i, paths.core, other, paths.count_room(other), paths.maps[other])
        elif self.paths is not None:
            self.paths.maps[i] = None


Stay = tuple[float, float]
"""When an agent comes to a node or an edge, and when it leaves it, from 0 to 1."""


def list_stays_on_nodes(track: Track) -> list[tuple[int, Stay]]:
    """Return the nodes on which an agent was in a turn, with times; not a node that it left when the turn began."""
    path, times, legs = track
    if legs:
        leaves = [leg.since for leg in legs[1:]] + [1.0]
        ends = zip(legs, leaves, strict=True)
        arrivals = [(leg, until) for leg, until in ends if leg.end in (0.0, 1.0) and leg.begin != leg.end]
        found = [(leg.target if leg.end else leg.source, (leg.until, until)) for leg, until in arrivals]
        waits = legs[0].since > 0.0 and legs[0].begin in (0.0, 1.0)
        return [(path[0], (0.0, legs[0].since)), *found] if waits else found
    found = []
    for number, (node, time) in enumerate(zip(path, times, strict=True)):
        if number and path[number - 1] == node:  # it pauses
            found[-1] = node, (found[-1][1][0], time)
        else:
            found.append((node, (time, time)))
    node, (since, _) = found[-1]
    found[-1] = node, (since, 1.0)
    return found[1:] if len(found) > 1 and found[0][1] == (0.0, 0.0) else found


def list_stays_on_edges(track: Track, find_edge: Callable[[int, int], int | None]) -> list[tuple[int, Stay]]:
    """Return the edges on which an agent was in a turn, with times.

    Args:
        track: its track.
        find_edge: returns the id of the edge between two nodes of its path; None: it was removed.
    """
    path, times, legs = track
    if legs:
        turned = [leg.back if leg.end < leg.begin and leg.back is not None else leg.edge for leg in legs]
        return [(edge, (leg.since, leg.until)) for edge, leg in zip(turned, legs, strict=True)]
    steps = zip(path, path[1:], times, times[1:], strict=False)
    found = [(find_edge(source, target), (since, until)) for source, target, since, until in steps if source != target]
    return [(edge, stay) for edge, stay in found if edge is not None]
