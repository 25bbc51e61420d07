"""Robots that go to squares of others, and the rule that paints the squares."""


def paint(ctx, steal):
    """Make a robot's strategy: go to the nearest foreign square, where enemy squares are `steal` metres nearer."""

    def strategy(state):
        owners = state["facts"].get("owners", {})
        metres = ctx.graph.distances(source=state["curr_pos"])
        draw = state["draw"]

        def cost(node):
            return metres[node] - steal * (node in owners) + 8 * draw.random()

        foreign = [node for node in sorted(metres) if owners.get(node) != state["team"]]
        goal = min(foreign, key=cost, default=state["curr_pos"])
        state["action"] = ctx.graph.shortest_path(state["curr_pos"], goal)[:2][-1]

    return strategy


def area(ctx):
    """Give each team the nodes on which its robots are, and a point for each node that it owns."""
    owners = ctx.game.data.setdefault("owners", {})
    for robot in ctx.game.agents:
        owners[robot.current_node_id] = robot.team
    for team in ctx.agent.teams:
        ctx.game.scores[team] = list(owners.values()).count(team)
    ctx.game.publish(owners=owners)


def draw(ctx, _):
    """Draw the squares in the colors of their owners."""
    for node, team in ctx.game.data.get("owners", {}).items():
        at = ctx.graph.get_node(node)
        corners = [(at.x + 5 * x, at.y + 5 * y) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        ctx.visual.render_polygon(corners, (*ctx.visual.drawing.color_of(team)[:3], 110))


area.drawer = draw
