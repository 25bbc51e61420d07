"""Hiders that look for hidden corners, and seekers that wait first and then visit all streets."""

from functools import cache

from gamms.strategies import chase, first, flee, goto, sweep


def hide(ctx, reach):
    """Make a hider's strategy: flee from visible seekers, else go to the least visible node within `reach` metres."""

    @cache
    def visibility(node):
        eyes = ctx.agent.get_agent("hiders_0").sensors["sees_seekers"]
        return len(eyes.coverage(node).node_ids)

    @cache
    def corner(start):
        near = ctx.graph.distances(source=start, cutoff=reach)
        return min(sorted(near), key=visibility)

    def target(state):
        if "corner" not in state["memory"]:
            state["memory"]["corner"] = corner(state["curr_pos"])
        return state["memory"]["corner"]

    return first(flee(ctx, otherwise=None), goto(ctx, target))


def seek(ctx, head_start, radius):
    """Make a seeker's strategy: wait at first, then chase visible hiders, else visit all streets."""
    middle = ctx.graph.nearest_node(385980, 6672300)
    area = sorted(ctx.graph.distances(source=middle, cutoff=radius))
    look = first(chase(ctx, otherwise=None), sweep(ctx, nodes=area, repeat=True))

    def strategy(state):
        if state["turn"] < head_start:
            state["action"] = state["curr_pos"]
        else:
            look(state)

    return strategy
