"""Experts that disarm bombs, thugs that disturb them, and the rule that counts the bombs that are disarmed."""


def _armed(state):
    return [bomb for bomb in state["facts"]["bombs"] if bomb not in state["facts"]["disarmed"]]


def disarm(ctx):
    """Make the strategy of experts: go to the nearest armed bomb to which no colleague is nearer, and disarm it."""
    distance = ctx.graph.distance

    def strategy(state):
        here = state["curr_pos"]
        colleagues = state["sensor"]["colleagues"][1].values()
        armed = _armed(state)
        free = [bomb for bomb in armed if all(distance(here, bomb) <= distance(node, bomb) for node in colleagues)]
        bomb = min(free or armed, key=lambda bomb: distance(here, bomb), default=here)
        is_there = here == bomb and state["edge"] is None
        state["action"] = {"do": {"disarm": bomb}} if is_there and bomb in armed else bomb

    return strategy


def disturb(ctx):
    """Make the strategy of thugs: go to the nearest expert in sight, or else to one armed bomb after the other."""

    def strategy(state):
        here = state["curr_pos"]
        seen = list(state["sensor"]["eyes"][1].values())
        if seen:
            state["action"] = min(seen, key=lambda node: ctx.graph.distance(here, node))
            return
        armed = _armed(state) or [here]
        goal = state["memory"].get("goal", here)
        if goal == here or goal not in armed:
            goal = state["draw"].choice(armed)
        state["memory"]["goal"] = goal
        state["action"] = goal

    return strategy


def bombs(nodes):
    """Make the rule that publishes and counts the bombs that are disarmed; the experts win when all are."""

    def prepare(ctx):
        ctx.game.data["bombs"] = dict.fromkeys(nodes, False)
        ctx.game.publish(bombs=tuple(nodes), disarmed=())

    def disposal(ctx):
        are_disarmed = ctx.game.data["bombs"]
        for deed in ctx.game.performed("disarm"):
            if not are_disarmed[deed.values["bomb"]]:
                are_disarmed[deed.values["bomb"]] = True
                ctx.game.scores[deed.team] += 1
                ctx.game.publish(disarmed=tuple(bomb for bomb in nodes if are_disarmed[bomb]))
        if all(are_disarmed.values()):
            ctx.game.end("all bombs are disarmed", winner="experts")

    disposal.prepare = prepare
    disposal.drawer = draw
    return disposal


def draw(ctx, _):
    """Draw a square at each bomb: red while it is armed, green when it is disarmed."""
    for bomb, is_disarmed in ctx.game.data["bombs"].items():
        node = ctx.graph.graph.get_node(bomb)
        color = (40, 160, 60) if is_disarmed else (200, 40, 40)
        ctx.visual.render_rectangle(node.x - 9, node.y + 9, 18, 18, color)
