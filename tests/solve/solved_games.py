"""Small games, and their values by brute force: own rules and own programs, which share nothing with what is tested."""

from functools import cache
from itertools import product
from pathlib import Path

import networkx as nx
import numpy as np
from scipy.optimize import linprog

import gamms
from gamms.scenario import Scenario

FOLDER = Path(__file__).parent
PURSUIT = [
    {"rule": "tag", "with": {"taggers": "cops", "tagged": "robbers", "then": "eliminate"}},
    {"rule": "last_team"},
]


def pursuit(graph, cops, robbers, turns=None, **more):
    """A game of cops and robbers on the graph of a name."""
    teams = {
        name: {"agents": [{"name": f"{name[:-1]}_{i}", "node": node} for i, node in enumerate(nodes)]}
        for name, nodes in (("cops", cops), ("robbers", robbers))
    }
    return scene(graph, teams, PURSUIT, turns=turns, **more)


def scene(graph, teams, rules, turns=None, **more):
    """A game on the graph of a name, with rules that may be in this file."""
    map = {"generator": {"function": "solved_games:made", "with": {"name": graph}}}
    if turns is not None:
        more["max_turns"] = turns
    return Scenario(map=map, teams=teams, rules=rules, folder=FOLDER, seed=1, **more)


def made(name):
    """The graph of a name, for scenarios."""
    return GRAPHS[name]


def pennies(ctx):
    """Red gets a point where both are on the same node, and 2 where that is node 0; else blue gets one."""
    red, blue = (ctx.agent.get_agent(name).current_node_id for name in ("red_0", "blue_0"))
    if red == blue:
        ctx.game.scores["red"] += 2 - red
    else:
        ctx.game.scores["blue"] += 1


def race(ctx):
    """The runner wants to be at node 8 before the guard meets it; who waits loses: each turn costs the runner 0.1."""
    runner, guard = (ctx.agent.get_agent(name) for name in ("runner", "guard"))
    ctx.game.scores["reds"] -= 0.1
    if runner.current_node_id == guard.current_node_id:
        ctx.game.scores["reds"] -= 1
        ctx.game.end("met", winner="blues")
    elif runner.current_node_id == 8:
        ctx.game.scores["reds"] += 1
        ctx.game.end("home", winner="reds")


def toll(ctx):
    """Red pays a point in every third turn in which it is not on node 0, and remembers how often it has paid."""
    data = ctx.game.data.setdefault("toll", {"paid": 0})
    if ctx.game.turn % 3 == 0 and ctx.agent.get_agent("red_0").current_node_id != 0 and data["paid"] < 2:
        data["paid"] += 1
        ctx.game.scores["red"] -= 1


def lottery(ctx):
    """Give red a point by lot."""
    ctx.game.scores["red"] += int(ctx.stream("lottery").integers(2))


HIDDEN = {"turns": 0}


def hidden(ctx):
    """Give red a point in every second turn, counted where the game does not know of it."""
    HIDDEN["turns"] += 1
    ctx.game.scores["red"] += HIDDEN["turns"] % 2


def neighbours(graph):
    """Node -> the node itself and its neighbours."""
    return {node: [node, *graph.neighbors(node)] for node in graph}


def matrix_value(payoffs):
    """The value of a zero-sum game: its saddle point, or by a linear program of SciPy."""
    sure, most = max(map(min, payoffs)), min(map(max, zip(*payoffs, strict=True)))
    if sure == most:
        return sure
    rows, columns = np.shape(payoffs)
    answer = linprog(
        np.r_[np.zeros(rows), -1.0],
        A_ub=np.c_[-np.transpose(payoffs), np.ones(columns)],
        b_ub=np.zeros(columns),
        A_eq=[np.r_[np.ones(rows), 0.0]],
        b_eq=[1.0],
        bounds=[(0, None)] * rows + [(None, None)],
    )
    return -answer.fun


def caught_at_once(cop, robber, cop_to, robber_to):
    """Whether two that move at once meet: on a node, or in opposite directions on an edge."""
    return cop_to == robber_to or (cop_to == robber and robber_to == cop)


def simultaneous(graph, cop, robber, turns):
    """The probability that one cop catches one robber in so many turns, if both move at once."""
    ways = neighbours(graph)

    @cache
    def value(cop, robber, left):
        if not left:
            return 0.0
        payoffs = [
            [1.0 if caught_at_once(cop, robber, c, r) else value(c, r, left - 1) for r in ways[robber]]
            for c in ways[cop]
        ]
        return matrix_value(payoffs)

    return value(cop, robber, turns)


def in_turns(graph, cops, robber, turns):
    """Whether cops that move before the robber catch it in so many turns: 1.0 or 0.0."""
    ways = neighbours(graph)

    @cache
    def value(cops, robber, left):
        if robber in cops:
            return 1.0
        if not left:
            return 0.0
        best = 0.0
        for to in product(*(ways[cop] for cop in cops)):
            if robber in to:
                return 1.0
            worst = min(1.0 if r in to else value(tuple(sorted(to)), r, left - 1) for r in ways[robber])
            best = max(best, worst)
        return best

    return value(tuple(sorted(cops)), robber, turns)


GRAPHS = {
    "pair": nx.path_graph(2),
    "square": nx.cycle_graph(4),
    "tree": nx.balanced_tree(2, 2),
    "path": nx.path_graph(5),
    "road": nx.path_graph(9),
    "cycle": nx.cycle_graph(5),
    "grid": nx.convert_node_labels_to_integers(nx.grid_2d_graph(3, 3)),
    "star": nx.star_graph(4),
    **{f"random {seed}": nx.gnm_random_graph(6, 11, seed=seed) for seed in (1, 4, 6)},
    "one way": nx.DiGraph([(0, 1), (1, 2), (2, 3), (3, 0), (1, 0), (3, 1)]),
    "parts": nx.Graph([(0, 1), (1, 2), (3, 4)]),
    "fan": nx.Graph([(0, i) for i in range(1, 5)] + [(1, 2), (2, 3), (3, 4)]),
}


def shut(ctx):
    """Close the road between nodes 3 and 4 once the cop has left node 0."""
    if not ctx.game.data.get("shut") and ctx.agent.get_agent("cop_0").current_node_id != 0:
        ctx.game.data["shut"] = True
        graph = ctx.graph.graph
        edges = [one for one in graph.get_edges() if {graph.get_edge(one).source, graph.get_edge(one).target} == {3, 4}]
        for edge in edges:
            graph.remove_edge(edge)


@gamms.array_rule
def shut_in_arrays(turn):
    """Do what `shut` does."""
    was_shut = turn.keep("shut", lambda games: {"is": np.zeros(games, np.bool_)})["is"]
    columns, cop = turn.streets.columns, turn.roster.names.index("cop_0")
    at = np.flatnonzero(~was_shut[turn.games] & (turn.node[:, cop] != turn.streets.rows(0)))
    was_shut[turn.games[at]] = True
    ends = np.sort(columns.node_ids[np.stack((columns.sources, columns.targets))], axis=0)
    turn.close_roads(at, columns.edge_ids[(ends == [[3], [4]]).all(axis=0)].tolist())


def nothing(ctx):
    """Do nothing, and have no array form, so that the game is played in a context."""


def apart(ctx):
    """Blue gets 2 where it is not on the node of red, else 1."""
    red, blue = (ctx.agent.get_agent(name).current_node_id for name in ("red_0", "blue_0"))
    ctx.game.scores["blue"] += 1 + (red != blue)
