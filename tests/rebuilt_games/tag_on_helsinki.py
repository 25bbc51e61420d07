"""Fifty against fifty on the streets of Helsinki: on its own ground a team hunts, on the other's it is hunted."""

import gamms
from gamms import rules, strategies
from gamms.rules import territory

TEAMS, TURNS = ("red", "blue"), 60


def player(ctx):
    """Make the strategy of all players: chase at home, flee abroad, and walk about without an enemy in sight."""
    chase, flee = strategies.chase(ctx, otherwise=None), strategies.flee(ctx, otherwise=None)

    def meet(state):
        is_home = state["facts"]["territory"][state["curr_pos"]] == state["team"]
        (chase if is_home else flee)(state)

    return strategies.first(meet, strategies.random_waypoints(ctx))


def build(seed, places):
    """Return the game, before its first turn; the first half of the places is red's."""
    ctx = gamms.create_context(seed=seed)
    gamms.osm.helsinki(ctx)
    strategy = player(ctx)
    for i, node in enumerate(places):
        team = TEAMS[i >= len(places) / 2]
        eyes = ctx.sensor.create_sensor(f"eyes of {i}", "agent_range", sensor_range=80.0)
        name = f"{team}_{i:02}"
        ctx.agent.create_agent(name, start_node_id=node, team=team, speed=2, sensors={"eyes": eyes}, strategy=strategy)
    ctx.game.add(territory.published(territory.halves(ctx, "y", teams=TEAMS)))
    ctx.game.add(rules.tag(*TEAMS, mutual=True, then="eliminate", territory="territory"))
    ctx.game.add(rules.respawn(after=5))
    return ctx
