"""The game of examples/periodic_visibility.py without GAMMS: networkx for paths, dicts for the rest."""

from math import dist

import networkx as nx
from keyed import Draw


def play(seed, nodes, edges, starts, every, turns):
    """Yield after each turn: agent -> node of the living, and the scores.

    Args:
        seed: of the game.
        nodes: node -> (x, y).
        edges: (source, target, length), in their order.
        starts: agent -> node; the thief is called so, all others are cops.
        every: after how many turns the thief is shown.
        turns: how many the game has.
    """
    graph = nx.DiGraph()
    graph.add_nodes_from(nodes)
    graph.add_weighted_edges_from(edges)
    hops = dict(nx.all_pairs_shortest_path_length(graph))
    legal = {node: [node, *graph[node]] for node in graph}
    at, scores = dict(starts), {}
    cops = sorted(name for name in starts if name != "thief")
    observed = []  # for each turn: cop -> (nodes that it looked at, where it knows the thief)
    priors = [dict.fromkeys(nodes, 1.0 / len(nodes))]  # for each turn, before what is observed in it
    for turn in range(turns):
        shown = at["thief"] if turn % every == 0 else None
        observed.append({})
        for cop in cops:
            seen = {node for node in nodes if dist(nodes[node], nodes[at[cop]]) <= 10.0}
            observed[turn][cop] = seen, at["thief"] if at["thief"] in seen else shown
        if turn:
            priors.append(predicted(weighed(priors[-1], observed[turn - 1].values()), legal))
        goals = {}
        for cop in cops:
            chances = weighed(priors[turn], [observed[turn][cop]])
            here = at[cop]
            goals[cop] = max(
                (node for node in chances if chances[node] > 0.0),
                key=lambda node: (round(chances[node] / (1 + hops[here][node]), 9), -node),
            )
        before = at["thief"]
        for cop, goal in goals.items():
            options = legal[at[cop]]
            at[cop] = goal if goal in options else min(options[1:], key=lambda node: (hops[node][goal], node))
        taken = {at[cop] for cop in cops}
        draw = Draw(seed, "thief", turn)
        if draw.random() < 0.7:
            at["thief"] = max(legal[before], key=lambda node: (min(hops[place][node] for place in taken), -node))
        else:
            at["thief"] = draw.choice(legal[before])
        if before in taken or at["thief"] in taken:
            scores["cops"] = 1
            yield {cop: at[cop] for cop in cops}, scores
            return
        yield dict(at), scores


def predicted(chances, legal):
    """Return node -> probability after a step to any neighbour, or none, each as likely."""
    after = dict.fromkeys(chances, 0.0)
    for node, chance in chances.items():
        for end in legal[node]:
            after[end] += chance / len(legal[node])
    return after


def weighed(chances, observations):
    """Return node -> probability, by Bayes' rule, after some observations of one turn."""
    found = [known for _, known in observations if known is not None]
    looked = set().union(*(seen for seen, _ in observations))
    weights = {node: chance * (node == found[0] if found else node not in looked) for node, chance in chances.items()}
    total = sum(weights.values())
    return {node: weight / total for node, weight in weights.items()}
