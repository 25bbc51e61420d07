"""Two robots, which are simulated here, hunt a runner in Helsinki beside an agent that is only in the game."""

import gamms
from gamms.bridge import SimulatedClock, SimulatedRobot, drive


class InTunnels(SimulatedRobot):
    """A robot whose receiver finds no satellites for 20 seconds in every minute."""

    def __call__(self):
        """Return a fix, or None."""
        fix = super().__call__()
        return None if self.clock.now() % 60.0 < 20.0 else fix


with gamms.create_context(seed=5) as ctx:
    gamms.osm.helsinki(ctx)
    crossing = ctx.graph.find("Mannerheimintie & Kaivokatu").node
    near = ctx.graph.routes.isochrones(crossing, [800.0])[0]
    for name, node in zip(("carl", "robot_a", "robot_b"), ctx.rng.choice(near, 3), strict=True):
        ctx.sensor.create_sensor(name, "agent_range", sensor_range=600.0, team="runners")
        hunt = gamms.strategies.chase(ctx)
        ctx.agent.create_agent(name, start_node_id=node, team="hunters", speed=10, sensors=[name], strategy=hunt)
    ctx.sensor.create_sensor("eyes", "agent_range", sensor_range=300.0, team="hunters")
    runner = {"team": "runners", "speed": 9, "sensors": ["eyes"], "strategy": gamms.strategies.flee(ctx)}
    ctx.agent.create_agent("runner", start_node_id=crossing, **runner)
    ctx.game.add(gamms.rules.tag("hunters", "runners", metres=15.0, then="eliminate"))
    ctx.game.add(gamms.rules.last_team())

    clock = SimulatedClock()  # all that wait for each other share it; without one, robots drive in real time
    robots = {
        "robot_a": SimulatedRobot(ctx, "robot_a", clock=clock, speed=3.0, noise_m=1.0),
        "robot_b": InTunnels(ctx, "robot_b", clock=clock, speed=3.0, noise_m=1.0),
    }
    for name, robot in robots.items():
        ctx.game.add(drive(name, robot, limit_s=40.0, arrive_m=5.0))
    ctx.record.start("robots", overwrite=True)
    result = ctx.game.run(max_turns=40)
    print(result.headline())
    print(f"The robots drove for {clock.now():.0f} seconds.")
    for event in result.events:
        if event["kind"] == "robot_late":
            print(f"turn {event['turn']}: {event['agent']} was late ({event['status']})")
    for name, noted in ctx.game.data["robots"].items():
        print(f"{name}: {noted['status']}, {noted['off_m']:.1f} m beside edge {noted['edge']}")
