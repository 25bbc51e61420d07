"""The rules of the competition: real and decoy flags are discovered and captured."""

from gamms.visual.legend import LegendRow, LegendRows

REAL = (255, 165, 0)
UNKNOWN = (128, 128, 128)


def flags(attackers, defenders, real, radius):
    """Make the rule for flags on the nodes of the fact `candidates`.

    The real flags are drawn from the seed. Defenders know them; when one attacker has a flag in view, all attackers
    know whether it is real. An attacker that comes within `radius` edges of a real flag captures it, and is out.

    Args:
        attackers, defenders: the teams.
        real: the number of real flags; the others are decoys.
        radius: edges.
    """

    def prepare(ctx):
        candidates = sorted(ctx.game.facts["candidates"])
        drawn = ctx.stream("flags").permutation(candidates)[:real].tolist()
        ctx.game.data["flags"] = {"real": drawn, "known": [], "captured": []}
        ctx.game.publish(to=defenders, flags=drawn)
        tell(ctx)

    def tell(ctx):
        state = ctx.game.data["flags"]
        known = {node: node in state["real"] for node in state["known"]}
        ctx.game.publish(to=attackers, known=known, captured=state["captured"])

    def discover(ctx, agent):
        here = agent.current_node_id
        state = ctx.game.data["flags"]
        in_view = {here}.union(*(sensor.coverage(here, agent.name).node_ids for sensor in agent.sensors.values()))
        for node in ctx.game.facts["candidates"]:
            if node in in_view and node not in state["known"]:
                state["known"].append(node)
                ctx.game.emit("discovered", agent=agent.name, node=node, real=node in state["real"])

    def capture(ctx, agent):
        state = ctx.game.data["flags"]
        near = ctx.graph.distances(source=agent.current_node_id, weight=None, cutoff=radius)
        for node in state["known"]:
            if node in state["real"] and node in near and node not in state["captured"] and agent.alive:
                state["captured"].append(node)
                ctx.game.emit("captured", agent=agent.name, node=node)
                ctx.game.eliminate(agent)

    def flags(ctx):
        players = [agent for agent in ctx.game.agents if agent.team == attackers]
        for act in (discover, capture):
            for agent in players:
                act(ctx, agent)
        tell(ctx)
        if len(ctx.game.data["flags"]["captured"]) == real:
            ctx.game.end("all flags are captured", winner=attackers)

    def draw(ctx, _):
        state = ctx.game.data["flags"]
        for node in ctx.game.facts["candidates"]:
            at = ctx.graph.get_node(node)
            is_decoy = node in state["known"] and node not in state["real"]
            color = REAL if node in state["known"] and not is_decoy else UNKNOWN
            radius = 5 if node in state["captured"] else 12
            ctx.visual.render_circle(at.x, at.y, radius, color, 3 if is_decoy else 0)

    rows = LegendRow(UNKNOWN, "unknown flag"), LegendRow(REAL, "real flag"), LegendRow(UNKNOWN, "decoy", sign="ring")
    draw.legend = LegendRows("", rows)
    flags.prepare = prepare
    flags.drawer = draw
    return flags
