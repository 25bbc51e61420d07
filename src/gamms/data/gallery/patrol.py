"""A town with missing streets, guards that visit its sites, robbers that wait, and the rule of robberies."""

import networkx as nx
import numpy as np

from gamms.strategies import chase, first, flee, goto


def town(side, missing, seed):
    """Return a connected grid of crooked streets, some of which are missing."""
    rng = np.random.default_rng(seed)
    graph = nx.grid_2d_graph(side, side)
    for x, y in graph:
        graph.nodes[x, y].update(x=20 * x + rng.uniform(-6, 6), y=20 * y + rng.uniform(-6, 6))
    streets = list(graph.edges)
    for number in rng.permutation(len(streets))[:missing]:
        graph.remove_edge(*streets[number])
        if not nx.has_path(graph, *streets[number]):
            graph.add_edge(*streets[number])
    return nx.convert_node_labels_to_integers(graph)


def guard(ctx):
    """Make a guard's strategy: chase visible robbers, else go from site to site in random order."""

    def site(state):
        goal = state["memory"].get("site")
        left = sites_left(ctx)
        state["memory"]["site"] = goal if goal in left and goal != state["curr_pos"] else state["draw"].choice(left)
        return state["memory"]["site"]

    return first(chase(ctx, otherwise=None), goto(ctx, site))


def rob(ctx, caution):
    """Make a robber's strategy: flee from guards within `caution` metres, else go to the nearest site."""
    run = flee(ctx)
    go = goto(ctx, lambda state: ctx.graph.routes.nearest(state["curr_pos"], sites_left(ctx)))

    def strategy(state):
        guards = state["sensor"]["sees_guards"][1].values()
        near = [guard for guard in guards if ctx.graph.distance(guard, state["curr_pos"]) <= caution]
        (run if near else go)(state)

    return strategy


def sites_left(ctx):
    """Return the nodes of the sites that have not been robbed."""
    return [site.current_node_id for site in ctx.agent.teams["sites"] if site.alive]


def robbery(ctx, turns, enough):
    """Count the turns of robbers on each site; a site is robbed after `turns`, and `enough` robbed sites win."""
    since = ctx.game.data.setdefault("since", {})
    attacked = {agent.current_node_id for agent in ctx.game.agents if agent.team == "robbers"}
    for site in [agent for agent in ctx.game.agents if agent.team == "sites"]:
        since[site.name] = since.get(site.name, 0) + 1 if site.current_node_id in attacked else 0
        if since[site.name] == turns:
            ctx.game.emit("robbed", agent=site.name, node=site.current_node_id)
            ctx.game.eliminate(site)
            ctx.game.scores["robbers"] += 1
    if ctx.game.scores["robbers"] >= enough:
        ctx.game.end("enough sites are robbed", winner="robbers")
