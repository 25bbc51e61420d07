"""The paper's capture the flag, on the streets of Helsinki: intruders are tagged before they can capture anything."""

import gamms
from gamms.rules import Conflicts, capture_flag, tag, territory, time_limit
from gamms.sensor import SensorType
from gamms.strategies import first, flee, goto, guard, mix, random_walk

BASES = {"red": (0.25, 0.5), "blue": (0.75, 0.5)}  # team -> where its flag is, as shares of the map


def attack(ctx, team, enemy):
    """A strategy: fetch the enemy's flag and bring it home, away from enemies in sight there."""

    def target(state):
        flags = state["facts"]["flags"]
        return flags[team if flags[enemy]["carrier"] == state["name"] else enemy]["node"]

    def careful(state):
        if state["facts"]["territory"][state["curr_pos"]] == enemy and state["rng"].random() < 0.5:
            run(state)

    run, advance = flee(ctx, otherwise=None), goto(ctx, target)
    return first(careful, mix(0.9, advance, random_walk))


with gamms.create_context(seed=5) as ctx:
    gamms.osm.helsinki(ctx, resolution=30.0)
    xy = ctx.graph.columns().xy
    low, size = xy.min(axis=0), xy.max(axis=0) - xy.min(axis=0)
    flags = {team: ctx.graph.nearest_node(*(low + share * size)) for team, share in BASES.items()}

    for team, enemy in (("red", "blue"), ("blue", "red")):
        defend = mix(0.5, guard(ctx, flags[team], radius=150.0), random_walk)
        strategies = [*[attack(ctx, team, enemy)] * 3, defend]
        starts = list(ctx.graph.distances(source=flags[team], cutoff=200.0))
        for i, strategy in enumerate(strategies):
            name = f"{team}_{i}"
            eyes = ctx.sensor.create_sensor(f"{name}/eyes", SensorType.AGENT_RANGE, sensor_range=90.0, team=enemy)
            ctx.agent.create_agent(name, start_node_id=starts[i], team=team, sensors={"eyes": eyes}, strategy=strategy)

    ctx.game.conflicts = Conflicts(capacity=1, among="team")
    ctx.game.add(territory.published(territory.by_distance(ctx, flags)))
    ctx.game.add(tag("red", "blue", metres=10.0, territory="territory", mutual=True, score=0))
    ctx.game.add(capture_flag(flags, territory="territory", goal=1))
    ctx.game.add(time_limit(500))
    result = ctx.game.run()
    ctx.visual.save("capture_the_flag.svg", title=f"{result.reason}, turn {result.turns}")

for event in result.events:
    if "flag" in event:
        print(f"turn {event['turn']:3d}: {event['agent']}: {event['kind']}, the flag of {event['flag']}")
tags = sum(event["kind"] == "tag" for event in result.events)
print(f"{result.reason} after {result.turns} turns and {tags} tags: {result.scores}; the winner is {result.winner}")
