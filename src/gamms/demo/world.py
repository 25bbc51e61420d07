"""Where a game of capture the flag is played: two territories, a flag in each, and how far it is to everywhere."""

from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.typing import IContext

_FLAG_AT = 0.12  # how far into the territory from its far end, as a share of all nodes
_LEAST_NODES = 50


class Team(NamedTuple):
    """A side of the game."""

    name: str
    size: int
    color: tuple[int, int, int]


class World(NamedTuple):
    """What does not change during a game; a node is given by its id, a team by its number."""

    teams: tuple[Team, Team]
    side: dict[int, int]  # node -> the team whose territory it is in
    flag: tuple[int, int]  # team -> the node where its flag stands
    to_flag: tuple[dict[int, float], dict[int, float]]  # team -> node -> metres by road to its flag
    to_home: tuple[dict[int, float], dict[int, float]]  # team -> node -> metres by road to its territory


def make_world(ctx: IContext, teams: tuple[Team, Team]) -> World:
    """Split the graph of a context across its longer extent, draw lots for the halves and put up the flags.

    Raises:
        BadValue: the map is too small, or one flag cannot be reached from the other.
    """
    columns = ctx.graph.columns()
    if len(columns.node_ids) < _LEAST_NODES:
        raise BadValue(f"The map has {len(columns.node_ids)} nodes; the game needs at least {_LEAST_NODES}.")
    axis = int(np.argmax(np.ptp(columns.xy, axis=0)))
    along = columns.xy[:, axis]
    if ctx.stream("demo", "lots").integers(2):  # no map is fair: chance decides who plays on which half
        along = -along
    side = (along >= np.median(along)).astype(int)
    flags = [_flag_row(columns, along, share) for share in (_FLAG_AT, 1.0 - _FLAG_AT)]
    ids = columns.node_ids.tolist()
    flag = (ids[flags[0]], ids[flags[1]])
    if not all(isfinite(ctx.graph.graph.distance(flag[1 - team], flag[team])) for team in (0, 1)):
        raise BadValue("One flag cannot be reached from the other on this map. Load it with bidirectional=True.")
    territories = [columns.node_ids[side == team] for team in (0, 1)]
    return World(
        teams,
        side=dict(zip(ids, side.tolist(), strict=True)),
        flag=flag,
        to_flag=(_metres_to(ctx, flag[0]), _metres_to(ctx, flag[1])),
        to_home=(_metres_to(ctx, territories[0]), _metres_to(ctx, territories[1])),
    )


def starts(world: World, team: int, rng: np.random.Generator) -> list[int]:
    """One node for each agent of a team: near its flag, in its territory, drawn from `rng`."""
    near = sorted(
        (node for node, metres in world.to_flag[team].items() if world.side[node] == team and metres < float("inf")),
        key=lambda node: (world.to_flag[team][node], node),
    )
    pool = near[: max(10 * world.teams[team].size, 40)]
    return [pool[i] for i in rng.choice(len(pool), world.teams[team].size, replace=len(pool) < world.teams[team].size)]


def _flag_row(columns: GraphColumns, along: FloatArray, share: float) -> int:
    """The node nearest to the middle of the strip that lies `share` of the way along the map."""
    low, high = np.quantile(along, sorted((max(share - 0.05, 0.0), min(share + 0.05, 1.0))))
    strip = np.flatnonzero((along >= low) & (along <= high))
    middle = np.median(columns.xy[strip], axis=0)
    return int(strip[np.argmin(np.hypot(*(columns.xy[strip] - middle).T))])


def _metres_to(ctx: IContext, target: int | IntArray) -> dict[int, float]:
    """By road from each node to the nearest of some nodes; infinite where there is no way."""
    known = ctx.graph.graph.distances(target=target)
    return {node: known.get(node, inf) for node in ctx.graph.graph.get_nodes()}
