"""A network of relays, intruders that disable them, engineers that repair them, and a rule about connectivity."""

from functools import cache

import networkx as nx

from gamms.strategies import chase, first, goto


def relays(count, reach, seed):
    """Return relays at random positions in a square of 100 by 100 metres, with links up to length `reach`."""
    graph = nx.random_geometric_graph(count, reach / 100, seed=seed)
    for node, (x, y) in nx.get_node_attributes(graph, "pos").items():
        graph.nodes[node].clear()
        graph.nodes[node].update(x=100 * x, y=100 * y)
    return graph


def working(ctx):
    """Return the nodes of working relays."""
    return {relay.current_node_id for relay in ctx.agent.teams["relays"] if relay.alive}


def attack(ctx):
    """Make an intruder's strategy: go to the working relay with the most links relative to its distance."""
    links = cache(lambda node: len(ctx.graph.distances(source=node, weight=None, cutoff=1)))

    def target(state):
        left = working(ctx)
        metres = ctx.graph.distances(source=state["curr_pos"])
        return max(sorted(left), key=lambda node: links(node) / (30 + metres[node]), default=None)

    return goto(ctx, target)


def repair(ctx):
    """Make an engineer's strategy: chase visible intruders, else go to the nearest disabled relay."""

    def target(state):
        out = sorted({relay.current_node_id for relay in ctx.agent.teams["relays"]} - working(ctx))
        return ctx.graph.routes.nearest(state["curr_pos"], out) if out else None

    return first(chase(ctx, otherwise=None), goto(ctx, target))


def outages(ctx, least):
    """Disable relays at intruders, repair them at engineers, and end the game if too few are connected."""
    there = {agent.current_node_id: agent.team for agent in ctx.game.agents if agent.team != "relays"}
    for relay in ctx.agent.teams["relays"]:
        if relay.alive and there.get(relay.current_node_id) == "intruders":
            ctx.game.eliminate(relay)
        elif not relay.alive and there.get(relay.current_node_id) == "engineers":
            ctx.game.respawn(relay)
    edges = ctx.graph.columns()
    ends = zip(edges.sources.tolist(), edges.targets.tolist(), strict=True)
    left = working(ctx)
    network = nx.Graph([(a, b) for a, b in ends if a in left and b in left])
    whole = max(map(len, nx.connected_components(network)), default=0)
    ctx.game.data["together"] = whole
    if whole < least * len(ctx.agent.teams["relays"]):
        ctx.game.end("the network has fallen apart", winner="intruders")
