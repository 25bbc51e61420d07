"""Hiders that look for corners, and seekers that count first and then visit all streets around."""

from functools import cache

from gamms.strategies import chase, first, flee, goto, sweep


def hide(ctx, reach):
    """Make the strategy of a hider: run from seekers in view, else go where least can be seen within `reach` metres."""

    @cache
    def corner(start):
        eyes = ctx.agent.get_agent("hiders_0").sensors["sees_seekers"]
        near = ctx.graph.distances(source=start, cutoff=reach)
        return min(sorted(near), key=lambda node: len(eyes.coverage(node).node_ids))

    def target(state):
        if "corner" not in state["memory"]:
            state["memory"]["corner"] = corner(state["curr_pos"])
        return state["memory"]["corner"]

    return first(flee(ctx, otherwise=None), goto(ctx, target))


def seek(ctx, head_start, radius):
    """Make the strategy of a seeker: stand at first, then chase hiders in view, else visit all streets."""
    middle = ctx.graph.nearest_node(385980, 6672300)
    area = sorted(ctx.graph.distances(source=middle, cutoff=radius))
    look = first(chase(ctx, otherwise=None), sweep(ctx, nodes=area, repeat=True))

    def strategy(state):
        if state["turn"] < head_start:
            state["action"] = state["curr_pos"]
        else:
            look(state)

    return strategy
