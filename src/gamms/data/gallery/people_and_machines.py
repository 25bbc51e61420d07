"""A town of blocks, and the strategy of the runner if no person plays it."""

from gamms.graph import grid


def blocks(width, height):
    """Return a grid of streets around blocks of three by one nodes."""
    graph = grid(height, width)
    for y in range(1, height, 2):
        graph.remove_nodes_from([y * width + x for x in range(width) if x % 4])
    return graph


def collect(ctx, fear):
    """Make the runner's strategy: go to the nearest coin, at least `fear` away from visible hunters."""

    def strategy(state):
        coins = state["sensor"]["sees_coins"][1].values()
        hunters = state["sensor"]["sees_hunters"][1].values()

        def cost(node):
            fears = sum(max(0.0, fear - ctx.graph.distance(node, hunter)) for hunter in hunters)
            return 3 * fears + min(ctx.graph.distance(node, coin) for coin in coins) + state["draw"].random()

        state["action"] = min(state["legal"], key=cost)

    return strategy
