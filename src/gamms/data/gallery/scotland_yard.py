"""A city of stations, Mr X, the detectives' plan, and the rule that shows where Mr X is or can be."""

import networkx as nx
import numpy as np

from gamms.visual.legend import LegendRow, LegendRows


def city(stations, seed):
    """Return stations at random places, linked if no other station lies in the circle between the two."""
    rng = np.random.default_rng(seed)
    xy = np.array([(500.0, 375.0)])
    while len(xy) < stations:
        place = rng.uniform((0, 0), (1000, 750))
        if np.hypot(*(xy - place).T).min() > 38:
            xy = np.vstack([xy, place])
    graph = nx.Graph()
    graph.add_nodes_from((station, {"x": x, "y": y}) for station, (x, y) in enumerate(xy.tolist()))
    far = ((xy[:, None] - xy) ** 2).sum(axis=2)
    pairs = zip(*np.triu_indices(stations, 1), strict=True)
    graph.add_edges_from((int(a), int(b)) for a, b in pairs if not np.any(far[a] + far[b] < far[a, b]))
    return graph


def hide(ctx):
    """Make the strategy of Mr X: move to the station with the most ways on, at least three moves from detectives."""

    def strategy(state):
        detectives = state["sensor"]["sees_detectives"][1].values()
        moves = ctx.graph.distances(source=detectives, weight=None)

        def value(node):
            ways = len(ctx.graph.distances(source=node, weight=None, cutoff=2))
            return 10 * min(moves[node], 3) + ways + 5 * state["draw"].random()

        state["action"] = max(state["legal"], key=value)

    return strategy


def hunt(ctx):
    """Make the detectives' plan: each goes to the nearest station where Mr X can be and no other detective goes."""

    def plan(states):
        possible = set(states[min(states)]["facts"]["possible"])
        for state in states.values():
            moves = ctx.graph.distances(source=state["curr_pos"], weight=None)
            goal = min(possible, key=lambda node: (moves[node], node), default=state["curr_pos"])
            possible.discard(goal)
            state["action"] = ctx.graph.shortest_path(state["curr_pos"], goal, weight=None)[:2][-1]

    return plan


def show(ctx, turns):
    """Publish where Mr X is after some turns, and where he can be after later ones."""
    possible = ctx.game.facts["possible"]
    if ctx.game.turn in turns:
        possible = [ctx.agent.get_agent("mr_x").current_node_id]
        ctx.game.emit("shown", agent="mr_x", node=possible[0])
    elif possible:
        detectives = {agent.current_node_id for agent in ctx.agent.teams["detectives"]}
        left = [node for node in possible if node not in detectives]
        possible = sorted(ctx.graph.distances(source=left, weight=None, cutoff=1).keys() - detectives)
    ctx.game.publish(possible=tuple(possible))


def draw(ctx, _):
    """Mark the stations where Mr X can be."""
    nodes = list(ctx.game.facts["possible"])
    if nodes:
        ctx.visual.drawing.render_circles(ctx.graph.positions(nodes), 9.0, (230, 140, 0), 2, in_pixels=True)


draw.legend = LegendRows("", (LegendRow((230, 140, 0), "Mr X may be here", sign="ring"),))
show.drawer = draw
