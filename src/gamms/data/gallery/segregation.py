"""People who move away from neighbors that are unlike them, and the rule that measures how alike neighbors are."""


def live(share):
    """Make a person's strategy: stay if at least this share of the neighbors are of the own team, else move away."""

    def strategy(state):
        teams = [name.split("_")[0] for name in state.sensors["neighbors"]]
        is_content = teams.count(state["team"]) >= share * len(teams)
        state["action"] = state["curr_pos"] if is_content else state["draw"].choice(state["legal"])

    return strategy


def likeness(ctx):
    """Score the mean percentage of neighbors that are alike, and end the game when nobody moves."""
    teams = {agent.current_node_id: agent.team for agent in ctx.game.agents}
    shares = []
    for node, team in teams.items():
        at = ctx.graph.get_node(node)
        near = [teams[other] for other in ctx.graph.get_nodes(15, at.x, at.y) if other in teams and other != node]
        if near:
            shares.append(100 * near.count(team) / len(near))
    ctx.game.scores["alike"] = sum(shares) / len(shares)
    if all(move.start == move.end for move in ctx.game.moves.values()):
        ctx.game.end("everybody is content")
