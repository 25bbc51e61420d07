"""A network of friends who pass on rumors, teams that talk to people, and the rule of beliefs."""

import networkx as nx

from gamms.strategies import goto
from gamms.visual.legend import SIGN, LegendRow, LegendRows


def friends(count, reach, seed):
    """Return people at random places, who are friends if they live at most `reach` metres apart."""
    graph = nx.random_geometric_graph(count, reach / 100, seed=seed)
    for node, (x, y) in nx.get_node_attributes(graph, "pos").items():
        graph.nodes[node].clear()
        graph.nodes[node].update(x=100 * x, y=75 * y)
    parts = [sorted(part) for part in nx.connected_components(graph)]
    graph.add_edges_from((part[0], parts[0][0]) for part in parts[1:])
    return graph


def person(state):
    """Believe what is heard first, and tell it to friends until it has been heard from four of them."""
    heard = [message["body"] for message in state["inbox"]]
    memory = state["memory"]
    state["action"] = state["curr_pos"]
    if heard and "belief" not in memory:
        memory.update(belief=state["draw"].choice(heard), heard=0)
        state["action"] = {"do": {"believe": memory["belief"]}}
    if "belief" in memory:
        memory["heard"] += len(heard)
        if memory["heard"] <= 4:
            state["outbox"].append({"channel": "talk", "to": "people", "body": memory["belief"]})


def campaign(ctx, reach):
    """Make the strategy of a talker: go to people who have heard nothing, and talk to everybody near.

    With `reach` 0 it goes to the nearest, with 1 to the one with the most friends who have heard nothing.
    """

    def target(state):
        free = set(ctx.graph.get_nodes()) - set(state["facts"]["beliefs"])
        metres = ctx.graph.distances(source=state["curr_pos"])

        def cost(node):
            circle = ctx.graph.distances(source=node, weight=None, cutoff=reach)
            return metres[node] / len(free.intersection(circle))

        return min(sorted(free), key=cost, default=state["curr_pos"])

    go = goto(ctx, target)

    def strategy(state):
        state["outbox"].append({"channel": "talk", "to": "people", "body": state["team"]})
        go(state)

    return strategy


def beliefs(ctx):
    """Update the beliefs of people, publish them, and score the believers of each team."""
    for deed in ctx.game.performed("believe"):
        ctx.game.data["beliefs"][deed.at] = deed.values["what"]
        ctx.game.scores[deed.values["what"]] += 1
    ctx.game.publish(beliefs=ctx.game.data["beliefs"])


def prepare(ctx):
    """Begin with people who believe nothing."""
    ctx.game.data["beliefs"] = {}
    ctx.game.publish(beliefs={})


def draw(ctx, _):
    """Draw a band around people, in the color of the team that they believe."""
    for node, team in ctx.game.data["beliefs"].items():
        at = ctx.graph.get_node(node)
        ctx.visual.render_circle(at.x, at.y, 3.2, ctx.visual.drawing.color_of(team))


draw.layer = 19
draw.legend = LegendRows("", (LegendRow(SIGN, "belief", sign="ring"),))
beliefs.prepare = prepare
beliefs.drawer = draw
