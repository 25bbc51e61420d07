"""The strategy of a team that shares out the enemies that it sees: who goes to whom."""

from collections.abc import Hashable
from functools import partial
from math import inf

import numpy as np

from gamms import kernels
from gamms.arguments import as_context, as_count
from gamms.context import Context
from gamms.deciding import phase_of
from gamms.game.batch.sight import Seen
from gamms.game.batch.state import Arrays, GameArrays
from gamms.game.batch.view import MOMENTS, ArrayStrategy, ArrayView, moment_of, on_ground
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.strategies.knowledge import (
    as_otherwise,
    enemies_in_sight,
    move_to_agent,
    moves_to_agents,
    nearest_seen,
    node_of,
    offer_form,
    required,
    shared_memory,
)
from gamms.strategies.memories import Kept, boards_in_arrays, reading
from gamms.strategies.travel import random_walk
from gamms.text import shown_as_called
from gamms.typing.game import State, Strategy
from gamms.typing.routes import made_in_moment, made_last


@shown_as_called
def assign(ctx: Context, patience: int = 10, otherwise: Strategy | None = random_walk) -> Strategy:
    """Go to the enemy that is the agent's by the matching of least total distance between its team and the enemies.

    Agents tell their team where they are and which enemies they see, in `state["team_memory"]` under `"assign"`. In the
    next turn all work out the same matching from it (Kuhn: The Hungarian method for the assignment problem, 1955).
    Where agents outnumber enemies, an enemy gets several; agents without teammates go to the nearest.

    Args:
        ctx: the context.
        patience: for how many turns an enemy is looked for where it was seen last.
        otherwise: the strategy to use when no enemy is known, or there is no path; None sets no action then.

    Raises:
        BadType, BadValue: `patience` is no number of turns.
    """
    as_context(ctx, "assign")
    turns, fallback = as_count(patience, "patience of assign", 0), as_otherwise(otherwise, "assign")

    def strategy(state: State) -> None:
        here, seen = node_of(state, "assign"), enemies_in_sight(ctx, state, "assign")
        mates, enemies = _reported(ctx, state, turns)
        _report(state, here, seen)
        mine = _matching(ctx, state["team"], mates, enemies).get(state["name"]) if enemies and mates else None
        if mine is None:
            target = ctx.graph.routes.nearest(here, seen.values())
        else:
            target = seen.get(mine, None if enemies[mine] == here else enemies[mine])
        move_to_agent(ctx, state, target, seen, fallback, "assign")

    kept = Kept(_assign_begun, board="assign")
    offer_form(strategy, _assign_in_arrays, turns, parts=[fallback], looks=True, kept=kept)
    return strategy


def _assign_begun(ctx: Context, arrays: GameArrays) -> dict[Hashable, Arrays]:
    board, number, rows = (
        _no_reports(arrays, 1),
        {name: i for i, name in enumerate(arrays.roster.names)},
        arrays.streets,
    )
    for memory, known in boards_in_arrays(ctx, arrays, "assign"):
        with reading("what a team has reported"):
            for name, (turn, node) in known.get("mates", {}).items():
                if name in number:
                    board["mate turn"][0, number[name]], board["mate node"][0, number[name]] = turn, rows.rows(node)
            for name, (turn, node) in known.get("enemies", {}).items():
                if name in number:
                    place = 0, memory, number[name]
                    board["turn"][place], board["node"][place] = turn, rows.rows(node)
    return {("team_memory", "assign"): board}


def _no_reports(arrays: GameArrays | ArrayView, games: int) -> Arrays:
    """Return what is kept of games in which nothing was reported yet."""
    agents, memories = len(arrays.roster.names), int(arrays.memory_of.max(initial=0)) + 1
    of_mates = {name: np.full((games, agents), -2) for name in ("mate turn", "mate node", "next mate")}
    # what is next has been written when agents were asked last
    of_enemies = {name: np.full((games, memories, agents), -2) for name in ("turn", "node", "next", "by")}
    return of_mates | of_enemies | {"moment": np.zeros(games)}


def _assign_in_arrays(patience: int, fallback: ArrayStrategy, view: ArrayView) -> IntArray:
    seen, board = on_ground(view).enemies(), _Board(view)
    enemies, enemy_at = board.enemies(patience)
    found = _matched_in_arrays(view, board, enemies, enemy_at)[:, view.agents]
    mine = np.where(view.mask, found, -1)
    targets = nearest_seen(view, seen, mine < 0)
    own = np.nonzero(mine >= 0)
    last = enemy_at[own[0], view.memory_of[view.agents[own[1]]], mine[own]]
    targets[own] = np.where(last == view.node[own], -1, last)
    in_sight = seen.of(seen.others == mine[seen.at, seen.viewers])
    targets[in_sight.at, in_sight.viewers] = in_sight.nodes
    board.report(seen)
    return moves_to_agents(view, seen, targets, fallback)


def _matched_in_arrays(view: ArrayView, board: "_Board", enemies: BoolArray, enemy_at: IntArray) -> IntArray:
    """Return the enemy of each agent by the matching of its team, (games, all agents); -1: none."""
    are_mates, mate_at = board.mates()
    found = np.full(are_mates.shape, -1)
    asking = np.zeros(enemies.shape[:2], np.bool_)
    at, columns = np.nonzero(view.mask)
    asking[at, view.memory_of[view.agents[columns]]] = True
    games, memories = np.nonzero(asking & enemies.any(axis=2))
    is_mate = are_mates[games] & (view.memory_of == memories[:, None])
    at, mate, enemy = np.nonzero(is_mate[:, :, None] & enemies[games, memories][:, None])
    far = view.routes().distances(mate_at[games[at], mate], enemy_at[games[at], memories[at], enemy], at=games[at])
    bounds = np.searchsorted(at, np.arange(len(games) + 1)).tolist()
    for game, begin, end in zip(games.tolist(), bounds, bounds[1:], strict=False):
        if begin == end:
            continue
        mates, others = np.unique(mate[begin:end]), np.unique(enemy[begin:end])
        table, rounds = far[begin:end].reshape(len(mates), len(others)), -(-len(mates) // len(others))
        chosen = np.array(kernels.least_matching(np.tile(table, rounds))) % len(others)
        found[game, mates] = np.where(table[np.arange(len(mates)), chosen] < inf, others[chosen], -1)
    return found


class _Board:
    """What teams remember under "assign", in all games of a view; what is written counts when they are asked again.

    Args:
        view: of the agents that read it.
    """

    def __init__(self, view: ArrayView) -> None:
        self._view, self._kept = view, view.keep(("team_memory", "assign"), partial(_no_reports, view))
        kept, games = self._kept, np.flatnonzero(self._kept["moment"][view.games] != moment_of(view))
        turn = (kept["moment"][view.games[games]] // MOMENTS).astype(np.int64)
        for new, node, when in (("next mate", "mate node", "mate turn"), ("next", "node", "turn")):
            written = kept[new][view.games[games]]
            at = np.nonzero(written >= 0)
            places = view.games[games[at[0]]], *at[1:]
            kept[node][places], kept[when][places], kept[new][places] = written[at], turn[at[0]], -2
        kept["by"][view.games[games]] = -2
        kept["moment"][view.games] = moment_of(view)

    def mates(self) -> tuple[BoolArray, IntArray]:
        """Return which living agents have reported since the last turn, (games, all agents), and where they were."""
        games, kept = self._view.games, self._kept
        reported: BoolArray = kept["mate turn"][games] >= np.maximum(0, self._view.turn - 1)[:, None]
        return reported & self._view.living, kept["mate node"][games]

    def enemies(self, patience: int) -> tuple[BoolArray, IntArray]:
        """Return which living enemies are known, (games, memories, all agents), and where they were seen last."""
        games, oldest = self._view.games, np.maximum(0, self._view.turn - 1 - patience)[:, None, None]
        return (self._kept["turn"][games] >= oldest) & self._view.living[:, None], self._kept["node"][games]

    def report(self, seen: Seen) -> None:
        """Tell the team where agents are and which enemies they see; of several that see one, the last name counts."""
        view, kept = self._view, self._kept
        at, columns = np.nonzero(view.mask)
        kept["next mate"][view.games[at], view.agents[columns]] = view.node[at, columns]
        by = view.agents[seen.viewers]
        places = view.games[seen.at], view.memory_of[by], seen.others
        is_news = (kept["turn"][places] != view.turn[seen.at]) | (kept["node"][places] != seen.nodes)
        counts = np.flatnonzero(is_news & (by > kept["by"][places]))
        some = tuple(column[counts] for column in places)  # of one place, the last is written last
        kept["next"][some], kept["by"][some] = seen.nodes[counts], by[counts]


# -- what the team knows ----------------------------------------------------------------------------------------------


def _report(state: State, here: int, seen: dict[str, int]) -> None:
    """Tell the team where the agent is and which enemies it sees."""
    board, turn = shared_memory(state, "assign"), required(state, "turn", "assign")
    board.setdefault("mates", {})[required(state, "name", "assign")] = (turn, here)
    board.setdefault("enemies", {}).update((name, (turn, node)) for name, node in seen.items())


def _reported(ctx: Context, state: State, patience: int) -> tuple[dict[str, int], dict[str, int]]:
    """Return where living teammates were in the last turn, and where living enemies were seen last, by name."""
    board, now, agents = shared_memory(state, "assign"), required(state, "turn", "assign"), ctx.agent.agents
    reports = [dict(board.get(part, {})) for part in ("mates", "enemies")]

    def make() -> tuple[dict[str, int], dict[str, int]]:
        found = []
        for part, oldest in zip(reports, (now - 1, now - 1 - patience), strict=True):
            known = sorted((name, node) for name, (turn, node) in part.items() if turn >= oldest)
            found.append({name: node for name, node in known if name in agents and agents[name].alive})
        return found[0], found[1]

    return made_in_moment(
        ctx.graph.routes, phase_of(ctx), ("assign reports", state["team"]), make, (now, patience, reports)
    )


def _matching(ctx: Context, team: Hashable, mates: dict[str, int], enemies: dict[str, int]) -> dict[str, str]:
    """Return the enemy of each agent by the matching of least total distance, if it can be reached."""
    routes, rounds = ctx.graph.routes, -(-len(mates) // len(enemies))

    def make() -> dict[str, str]:
        costs = np.tile(routes.distances(list(mates.values()), list(enemies.values())), rounds)
        names = list(enemies) * rounds
        pairs = zip(mates, kernels.least_matching(costs), costs, strict=True)
        return {mate: names[column] for mate, column, row in pairs if row[column] < inf}

    # NOTE: all agents of a team ask for the same one in a turn (500 agents: 0.2 s instead of 100).
    return made_last(routes, ("assign", team), (mates, enemies), make)
