"""Runners that choose a safe exit, until they lose patience."""

from gamms.strategies import goto, safest_exit


def run(ctx, exits, patience):
    """Make a runner's strategy: go to the safest exit, after `patience` turns to the nearest."""
    careful = safest_exit(ctx, exits)
    bold = goto(ctx, lambda state: ctx.graph.routes.nearest(state["curr_pos"], exits))

    def strategy(state):
        (careful if state["turn"] < patience else bold)(state)

    return strategy
