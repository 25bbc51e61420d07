"""Robots patrol a fence, and intruders need some turns to get through: how many are caught, by how robots move."""

import networkx as nx

import gamms

POSTS, ROBOTS, NEEDED, TURNS = 48, 4, 8, 500  # nodes of the fence; turns that an intruder needs


def fence():
    """Return a circle of posts, ten metres apart."""
    graph = nx.cycle_graph(POSTS).to_directed()
    for i, (x, y) in nx.circular_layout(graph, scale=10 * POSTS / 6.28).items():
        graph.nodes[i].update(x=x, y=y)
    nx.set_edge_attributes(graph, 10.0, "length")
    return graph


def robot(state, on):
    """Go on along the fence with the probability `on`, else turn round."""
    way = state["memory"].get("way", 1)
    state["memory"]["way"] = way if state["draw"].random() < on else -way
    state["action"] = (state["curr_pos"] + state["memory"]["way"]) % POSTS


def intrusions(is_clever):
    """Make the rule of the intruder: it appears at a post, needs some turns there, and comes again.

    Args:
        is_clever: whether it comes where a robot has just left; otherwise at any post without a robot.
    """

    def intrusions(ctx):
        intruder, since = ctx.agent.get_agent("intruder"), ctx.game.data.get("since", 0)
        if intruder.alive and ctx.game.turn - since >= NEEDED:
            ctx.game.emit("intrusion", agent="intruder", node=intruder.current_node_id)
            ctx.game.scores["intruders"] += 1
            ctx.game.eliminate(intruder)
        elif not intruder.alive:
            taken = {agent.current_node_id for agent in ctx.game.agents}
            left = sorted(move.start for move in ctx.game.moves.values() if move.team == "robots")
            posts = [post for post in (left if is_clever else range(POSTS)) if post not in taken]
            if posts:
                at = posts[ctx.stream("intrusion", ctx.game.turn).integers(len(posts))]
                ctx.game.data["since"] = ctx.game.turn
                ctx.game.respawn(intruder, int(at))

    return intrusions


def build(seed, on, is_clever):
    """Return the game, before its first turn."""
    ctx = gamms.create_context(seed=seed)
    ctx.graph.attach_networkx_graph(fence())
    for i in range(ROBOTS):
        name, post = f"robot_{i}", i * POSTS // ROBOTS
        ctx.agent.create_agent(name, start_node_id=post, team="robots", strategy=lambda state: robot(state, on))
    ctx.agent.create_agent("intruder", start_node_id=1, team="intruders", alive=False)
    ctx.game.add(gamms.rules.tag("robots", "intruders", then="eliminate"))
    ctx.game.add(intrusions(is_clever))
    return ctx


if __name__ == "__main__":
    for on in (1.0, 0.9, 0.5):
        for is_clever in (False, True):
            with build(7, on, is_clever) as ctx:
                scores = ctx.game.run(TURNS).scores
            share = scores.get("robots", 0) / sum(scores.values())
            where = "follow robots" if is_clever else "come anywhere"
            print(f"robots go on with {on:4.0%}, intruders {where}: {share:.0%} are caught")
