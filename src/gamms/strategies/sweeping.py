"""The strategy of a team that visits all nodes: which were visited, and who goes where next."""

from collections.abc import Hashable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_context, as_flag
from gamms.context import Context
from gamms.deciding import phase_of
from gamms.game.batch.state import Arrays, GameArrays
from gamms.game.batch.view import ArrayStrategy, ArrayView, moment_of
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.strategies.knowledge import (
    as_otherwise,
    known_nodes,
    move_to,
    moves_to,
    node_of,
    nodes_in_view,
    offer_form,
    required,
    shared_memory,
)
from gamms.strategies.memories import Kept, boards_in_arrays, memories_in_arrays, reading, remember, remembered
from gamms.strategies.travel import stay
from gamms.text import shown_as_called
from gamms.typing.game import NodeId, State, Strategy
from gamms.typing.routes import made_in_moment, made_last

_MOST_AT_ONCE = 1 << 22  # nodes among which the nearest are looked for at once
_FARTHER = (4.0, 16.0, 64.0, np.inf)  # mean lengths of edges: how far these are looked for first, then, and last
_SLACK = 1.0 + 1e-9  # so much farther a node may be from here that is as near to there, by rounding


@shown_as_called
def sweep(
    ctx: Context,
    nodes: Iterable[NodeId] | None = None,
    by_sight: bool = False,
    repeat: bool = False,
    otherwise: Strategy | None = stay,
) -> Strategy:
    """Visit all nodes, each by one member of the team: always the nearest that is left in the agent's part of the map.

    The map is cut into parts with as many nodes each, one for each living member in the order of the names, by
    recursive coordinate bisection (Berger, Bokhari: A partitioning strategy for nonuniform problems on
    multiprocessors, 1987). An agent that is done with its part helps with the others. Which nodes were visited is in
    `state["team_memory"]`, and where the agent goes in `state["memory"]`, under `"sweep"`.

    Args:
        ctx: the context.
        nodes: ids of those to visit; None: all nodes.
        by_sight: whether nodes count as visited, too, on which the agent's sensors would show agents.
        repeat: begin again when all are visited.
        otherwise: the strategy to use when all are visited, or the rest cannot be reached; None sets no action then.

    Raises:
        UnknownName (KeyError), BadType, BadValue: one is not a node of the map, or there are none.
    """
    as_context(ctx, "sweep")
    chosen = None if nodes is None else known_nodes(ctx, nodes, "sweep", "nodes")
    sees, again = as_flag(by_sight, "by_sight of sweep"), as_flag(repeat, "repeat of sweep")
    fallback = as_otherwise(otherwise, "sweep")

    def strategy(state: State) -> None:
        here, memory, board = node_of(state, "sweep"), required(state, "memory", "sweep"), shared_memory(state, "sweep")
        visited = board.setdefault("visited", set())
        visited |= {here, *(nodes_in_view(ctx, state) if sees else ())}
        if again and visited.issuperset(_parts(ctx, None, chosen, 1)[0]):
            visited.clear()
            visited.add(here)
        target = memory.get("sweep target")
        if target is None or target in visited:
            target = memory["sweep target"] = _next_to_visit(ctx, state, chosen, visited)
        move_to(ctx, state, target, fallback, "sweep")

    kept = Kept(_sweep_begun, board="sweep")
    offer_form(strategy, _sweep_in_arrays, chosen, sees, again, parts=[fallback], looks=sees, kept=kept)
    return strategy


def _sweep_begun(ctx: Context, arrays: GameArrays) -> dict[Hashable, Arrays]:
    def read(memory: dict[Any, Any]) -> Sequence[int]:
        target = memory.get("sweep target")
        return () if target is None else [int(arrays.streets.rows(target))]

    board = _no_visits(arrays, 1)
    for number, known in boards_in_arrays(ctx, arrays, "sweep"):
        with reading("what a team has visited"):
            board["visited"][0, number, arrays.streets.rows([*known.get("visited", ())])] = True
    return {("team_memory", "sweep"): board} | memories_in_arrays(ctx, arrays, "sweep", {"target": -1}, read)


def _no_visits(arrays: GameArrays | ArrayView, games: int) -> Arrays:
    """Return what is kept of games in which nothing was visited yet."""
    agents, nodes = len(arrays.roster.names), arrays.streets.num_nodes
    memories = int(arrays.memory_of.max(initial=0)) + 1
    return {
        "visited": np.zeros((games, memories, nodes), np.bool_),
        "seen": np.zeros((games, memories, nodes), np.bool_),  # in that turn
        "moment": np.full((games, memories), -1),
        "keeps": np.zeros((games, memories), np.bool_),  # whether what was visited before still counts
        "next": np.full((games, agents), -1),  # what agents have visited in that turn
    }


def _sweep_in_arrays(
    chosen: tuple[int, ...] | None, sees: bool, again: bool, fallback: ArrayStrategy, view: ArrayView
) -> IntArray:
    nodes = view.streets.num_nodes
    rows = np.arange(nodes) if chosen is None else np.unique(view.streets.rows(chosen))
    board, memory = _Visited(view), view.memory_of[view.agents]
    target, here = remembered(view, "sweep", target=-1)["target"], view.node
    are_left = np.zeros(nodes, np.bool_)
    are_left[rows] = True
    left = board.left(rows)[:, memory]  # (games, agents) how many
    is_new: BoolArray = ~board.has(here)
    own_left, now = left - (is_new & are_left[here]), None
    is_known = board.has(np.maximum(target, 0))
    if sees:
        now = view.covered()
        np.put_along_axis(now, here[..., None], True, axis=-1)
        fresh = now & ~board.of_all()
        is_new = np.logical_or.reduce(fresh, axis=-1)
        own_left = left - (fresh & are_left).sum(axis=-1)
        is_known = is_known | np.take_along_axis(now, np.maximum(target, 0)[..., None], axis=-1)[..., 0]
    is_done = view.mask & again & (own_left == 0)
    seeks = view.mask & ((target < 0) | (target == here) | (~is_done & is_known))
    at, columns = np.nonzero(seeks)
    found, most = np.full(len(at), -1), max(1, _MOST_AT_ONCE // nodes)
    for first in range(0, len(at), most):
        some = slice(first, first + most)
        which = at[some], columns[some]
        visited = board.rows(which) if now is None else board.rows(which) | now[which]
        wanted = are_left & ~(visited & ~is_done[which][:, None])
        wanted[np.arange(len(wanted)), here[which]] = False
        own = wanted & (_parts_in_arrays(view, chosen, which))
        found[some] = _nearest(view, here[which], own)
        rest = first + np.flatnonzero(found[some] < 0)
        found[rest] = _nearest(view, here[at[rest], columns[rest]], wanted[rest - first])
    target[at, columns] = found
    remember(view, "sweep", target=target)
    board.visit(is_new=is_new, is_done=is_done, now=now)
    return moves_to(view, target, fallback)


class _Visited:
    """Which nodes teams have visited, in all games of a view; what is visited now counts when they are asked again.

    Args:
        view: of the agents that ask.
    """

    def __init__(self, view: ArrayView) -> None:
        self._view, self._kept = view, view.keep(("team_memory", "sweep"), partial(_no_visits, view))
        self._memory = view.memory_of[view.agents]
        self._turn()

    def _turn(self) -> None:
        """Take what was written when agents were asked before."""
        view, kept, games = self._view, self._kept, self._view.games
        is_old = kept["moment"][games] != moment_of(view)[:, None]
        at, agents = np.nonzero((kept["next"][games] >= 0) & is_old[:, view.memory_of])
        written = np.zeros(is_old.shape, np.bool_)
        written[at, view.memory_of[agents]] = True
        begins = np.nonzero(written & ~kept["keeps"][games])
        kept["visited"][games[begins[0]], begins[1]] = False
        kept["visited"][games[at], view.memory_of[agents], kept["next"][games[at], agents]] = True
        kept["next"][games[at], agents] = -1
        places = games[np.nonzero(written)[0]], np.nonzero(written)[1]
        kept["visited"][places] |= kept["seen"][places]
        kept["seen"][places] = False
        kept["keeps"][games] &= ~is_old
        kept["moment"][games] = moment_of(view)[:, None]

    def has(self, node: IntArray) -> BoolArray:
        """Return whether these nodes were visited, (games, agents)."""
        found: BoolArray = self._kept["visited"][self._view.games[:, None], self._memory, node]
        return found

    def rows(self, which: tuple[IntArray, IntArray]) -> BoolArray:
        """Return which nodes were visited, of some agents, (agents, nodes)."""
        found: BoolArray = self._kept["visited"][self._view.games[which[0]], self._memory[which[1]]]
        return found

    def of_all(self) -> BoolArray:
        """Return which nodes were visited, (games, agents, nodes)."""
        found: BoolArray = self._kept["visited"][self._view.games][:, self._memory]
        return found

    def left(self, nodes: IntArray) -> IntArray:
        """Return how many of these nodes were not visited, (games, memories)."""
        found: IntArray = len(nodes) - self._kept["visited"][self._view.games][:, :, nodes].sum(axis=2)
        return found

    def visit(self, *, is_new: BoolArray, is_done: BoolArray, now: BoolArray | None) -> None:
        """Note that agents have visited the nodes where they are, and those in view; those that are done begin again.

        Args:
            is_new: (games, agents) whether one of these is new.
            is_done: (games, agents)
            now: (games, agents, nodes) that are in view; None: those where they are alone count.
        """
        view, kept = self._view, self._kept
        size = kept["visited"][view.games].sum(axis=2)[:, self._memory]
        counts = view.mask & np.where(is_done, ~self.has(view.node) | (size != 1), is_new)
        at, columns = np.nonzero(counts)
        kept["next"][view.games[at], view.agents[columns]] = view.node[at, columns]
        at, columns = np.nonzero(counts & ~is_done)
        kept["keeps"][view.games[at], self._memory[columns]] = True
        if now is not None:
            np.logical_or.at(kept["seen"], (view.games[at], self._memory[columns]), now[at, columns])


def _parts_in_arrays(view: ArrayView, chosen: tuple[int, ...] | None, which: tuple[IntArray, IntArray]) -> BoolArray:
    """Return which nodes are in the parts of agents, (agents, nodes)."""
    columns, streets, team_of = view.streets.columns, view.streets, view.roster.team_of
    at, agents = which[0], view.agents[which[1]]
    are_mates = view.living[at] & (team_of == team_of[agents, None])
    has_team = np.array([team is not None for team in view.roster.teams], np.bool_)[team_of[agents]]
    members = np.where(has_team, are_mates.sum(axis=1), 1)
    rank = np.where(has_team, (are_mates & (np.arange(len(team_of)) < agents[:, None])).sum(axis=1), 0)
    ids = columns.node_ids if chosen is None else np.array(chosen)
    found = np.zeros((len(at), len(columns.node_ids)), np.bool_)
    for number in np.unique(members).tolist():
        parts = np.full(len(columns.node_ids), -1)
        for part, those in enumerate(_bisected(ids, columns.xy[streets.rows(ids)], number)):
            parts[streets.rows(those)] = part
        some = members == number
        found[some] = parts == rank[some, None]
    return found


def _nearest(view: ArrayView, starts: IntArray, wanted: BoolArray) -> IntArray:
    """Return the node that is nearest by road of those that are wanted, (agents, nodes); -1 where none can be reached.

    Of several that are equally near, it is the one with the lowest id.
    """
    streets, found = view.streets, np.full(len(starts), -1)
    arcs, left = streets.ways("length"), np.flatnonzero(wanted.any(axis=1))
    mean = float(arcs.weights.mean()) if len(arcs.weights) else 0.0
    for farther in _FARTHER:
        roots, line_of = np.unique(starts[left], return_inverse=True)
        if not len(roots):
            break
        cutoff = np.inf if farther == np.inf else farther * mean
        lines, rows, far = kernels.reached_from(arcs, roots, len(streets.counts), cutoff)
        entries, ends = kernels.chosen_runs(np.searchsorted(lines, np.arange(len(roots) + 1)), line_of)
        who = np.repeat(np.arange(len(left)), np.diff(ends))
        are_wanted = wanted[left[who], rows[entries]]
        who, entries = who[are_wanted], entries[are_wanted]
        least = np.full(len(left), np.inf)
        np.minimum.at(least, who, far[entries])
        is_found = (least * _SLACK <= cutoff) & np.isfinite(least)
        near = np.flatnonzero((far[entries] <= (least * _SLACK)[who]) & is_found[who])
        who, nodes = who[near], rows[entries[near]]
        metres = view.routes().distances(starts[left[who]], nodes)
        order = np.lexsort((streets.ids(nodes), metres, who))[::-1]  # the best is written last
        found[left[who[order]]] = nodes[order]
        left = left[~is_found]
    return found


def _next_to_visit(ctx: Context, state: State, chosen: tuple[int, ...] | None, visited: set[int]) -> int | None:
    """Return the nearest node that is left in the agent's part, else on the whole map; of several, the lowest id."""
    name, here = required(state, "name", "sweep"), state["curr_pos"]
    team = required(state, "team", "sweep")
    members = {} if team is None else _living_members(ctx, team)
    own = _parts(ctx, team, chosen, len(members) or 1)[members[name] if members else 0]
    nearest = ctx.graph.routes.nearest(here, sorted(own - visited))
    if nearest is None:
        nearest = ctx.graph.routes.nearest(here, sorted(_parts(ctx, None, chosen, 1)[0] - visited))
    return nearest


def _living_members(ctx: Context, team: Hashable) -> dict[str, int]:
    """Return the living agents of a team in the order of their names, name -> its place; not to be changed."""

    def make() -> dict[str, int]:
        agents = ctx.agent.agents.values()
        names = sorted(one.name for one in agents if one.team == team and one.alive)
        return {name: place for place, name in enumerate(names)}

    return made_in_moment(ctx.graph.routes, phase_of(ctx), ("members", team), make)


def _parts(ctx: Context, team: Hashable, chosen: tuple[int, ...] | None, number: int) -> list[set[int]]:
    """Return so many parts of some nodes, with as many nodes each, by cutting along the longer side again and again."""

    def make() -> list[set[int]]:
        ids = ctx.graph.columns().node_ids.tolist() if chosen is None else chosen
        return [set(part.tolist()) for part in _bisected(np.array(ids), ctx.graph.graph.positions(ids), number)]

    return made_last(ctx.graph.routes, ("sweep", team, chosen), number, make)


def _bisected(ids: IntArray, xy: FloatArray, number: int) -> list[IntArray]:
    if number <= 1:
        return [ids]
    axis = int(np.argmax(np.ptp(xy, axis=0))) if len(ids) else 0
    order = np.lexsort((ids, xy[:, axis]))
    first, second = np.split(order, [len(ids) * (number // 2) // number])
    return _bisected(ids[first], xy[first], number // 2) + _bisected(ids[second], xy[second], number - number // 2)
