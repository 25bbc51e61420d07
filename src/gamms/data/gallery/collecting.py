"""Robots that fetch parcels, and the rule by which parcels appear, are carried and are delivered."""

from itertools import product

from gamms.strategies import goto
from gamms.visual.legend import SIGN, LegendRow, LegendRows

PARCEL = (255, 165, 0)
MOST = 2  # parcels that a robot carries


def nearest(ctx, depot):
    """Make a robot's strategy: fetch the nearest parcels until it is full, then go to the depot."""

    def target(state):
        parcels = state["facts"]["parcels"]
        is_full = state["facts"]["loads"].get(state["name"], 0) == MOST
        return ctx.graph.routes.nearest(state["curr_pos"], parcels) if parcels and not is_full else depot

    return goto(ctx, target)


def divided(ctx, depot):
    """Make a team's plan: match robots with parcels, the nearest pairs first; all others go to the depot."""

    def plan(states):
        facts = next(iter(states.values()))["facts"]
        free = [name for name in states if facts["loads"].get(name, 0) < MOST]
        metres = {name: ctx.graph.distances(source=states[name]["curr_pos"]) for name in free}
        pairs = [(metres[name][node], name, node) for name, node in product(free, facts["parcels"])]
        goals = {}
        for _, name, node in sorted(pairs):
            if name not in goals and node not in goals.values():
                goals[name] = node
        for name, state in states.items():
            state["action"] = goals.get(name, depot)

    return plan


def deliveries(depots, center, radius, chance):
    """Make the rule: a parcel appears in a turn with probability `chance`; robots pick up parcels, and deliver them."""

    def prepare(ctx):
        ctx.game.data.update(parcels=[], loads={})
        ctx.game.publish(parcels=[], loads={})

    def deliveries(ctx):
        parcels = ctx.game.data["parcels"]
        loads = ctx.game.data["loads"]
        rng = ctx.stream("parcels", ctx.game.turn)
        if rng.random() < chance:
            parcels.append(int(rng.choice(sorted(ctx.graph.distances(source=center, cutoff=radius)))))
        for robot in rng.permutation(ctx.game.agents):
            here = robot.current_node_id
            if here == depots[robot.team]:
                ctx.game.scores[robot.team] += loads.pop(robot.name, 0)
            elif here in parcels and loads.get(robot.name, 0) < MOST:
                parcels.remove(here)
                loads[robot.name] = loads.get(robot.name, 0) + 1
        ctx.game.publish(parcels=parcels, loads=loads)

    def draw(ctx, _):
        for team, node in depots.items():
            at = ctx.graph.get_node(node)
            ctx.visual.render_circle(at.x, at.y, 16, ctx.visual.drawing.color_of(team), width=5)
        for node in ctx.game.data["parcels"]:
            at = ctx.graph.get_node(node)
            ctx.visual.render_circle(at.x, at.y, 8, PARCEL)

    draw.legend = LegendRows("", (LegendRow(PARCEL, "parcel"), LegendRow(SIGN, "depot", sign="ring")))
    deliveries.prepare = prepare
    deliveries.drawer = draw
    return deliveries
