"""Trucks that drive to their depot, and escorts that stay with them until a raider comes near."""

from gamms.strategies import goto


def drive(ctx):
    """Make a truck's strategy: go to the depot."""
    return goto(ctx, lambda _: ctx.agent.get_agent("depot_0").current_node_id)


def escort(ctx, reach):
    """Make an escort's strategy: go to the raider nearest to its truck within `reach`, else to the truck."""

    def target(state):
        trucks = [truck.current_node_id for truck in ctx.agent.teams["trucks"] if truck.alive]
        mine = trucks[int(state["name"].rpartition("_")[2]) % len(trucks)]
        raiders = state["sensor"]["sees_raiders"][1].values()
        near = {raider: ctx.graph.distance(raider, mine) for raider in raiders}
        nearest = min(near, key=lambda node: (near[node], node), default=mine)
        return nearest if near.get(nearest, 0.0) <= reach else mine

    return goto(ctx, target)
