"""A meadow, sheep that fear dogs and stay together, dogs that drive sheep, and the gate of the pen."""

from math import dist

import networkx as nx

from gamms.strategies import goto


def meadow(width, height, spacing):
    """Return a grid with diagonals."""
    graph = nx.strong_product(nx.path_graph(width), nx.path_graph(height))
    for x, y in graph:
        graph.nodes[x, y].update(x=spacing * x, y=spacing * y)
    return nx.convert_node_labels_to_integers(graph, ordering="sorted")


def places(ctx):
    """Return the place of each node."""
    columns = ctx.graph.columns()
    return dict(zip(columns.node_ids.tolist(), columns.xy.tolist(), strict=True))


def graze(ctx, fear):
    """Make a sheep's strategy: get away from dogs nearer than `fear`, and not far from the other sheep."""
    at = places(ctx)

    def strategy(state):
        dogs = [at[node] for node in state["sensor"]["sees_dogs"][1].values()]
        flock = [at[node] for node in state["sensor"]["sees_sheep"][1].values()]

        def cost(node):
            fears = sum(max(0.0, fear - dist(at[node], dog)) for dog in dogs)
            apart = sum(dist(at[node], other) for other in flock) / max(1, len(flock))
            crowd = sum(at[node] == other for other in flock)
            return 3 * fears + apart + 20 * crowd + 12 * state["draw"].random()

        state["action"] = min(state["legal"], key=cost)

    return strategy


def drive(ctx, pen, behind):
    """Make a dog's strategy: go `behind` metres behind the sheep that is farthest from the pen."""
    at = places(ctx)

    def target(state):
        here = at[state["curr_pos"]]
        others = [at[dog.current_node_id] for dog in ctx.agent.teams["dogs"] if dog.name != state["name"]]
        sheep = [at[node] for node in state["sensor"]["sees_all"][1].values()]
        mine = [one for one in sheep if all(dist(one, here) <= dist(one, other) for other in others)] or sheep
        x, y = max(mine, key=lambda one: (dist(one, pen), one))
        far = dist((x, y), pen)
        share = behind / far
        return ctx.graph.nearest_node(x + share * (x - pen[0]), y + share * (y - pen[1]))

    return goto(ctx, target)


def gate(ctx, pen, radius, enough):
    """Keep the sheep that come into the pen, and end the game when there are enough."""
    for sheep in [agent for agent in ctx.game.agents if agent.team == "sheep"]:
        node = ctx.graph.get_node(sheep.current_node_id)
        if dist((node.x, node.y), pen) <= radius:
            ctx.game.emit("penned", agent=sheep.name, node=sheep.current_node_id)
            ctx.game.eliminate(sheep)
            ctx.game.scores["dogs"] += 1
    if ctx.game.scores["dogs"] >= enough:
        ctx.game.end("enough sheep are in the pen", winner="dogs")
