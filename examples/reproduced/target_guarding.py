"""Isaacs' game of guarding a target in the plane: how near an intruder comes, if a guard is as fast and both see all.

Each is first at the points that are nearer to it, so the intruder comes as near as the bisector of both is to the
target: half the difference of the squares of their distances from it, over the distance between them (Isaacs,
Differential Games, 1965, example 1.9.2). Both fly to that point of the bisector, with an error of a step. No intruder
who flies straight on, in one of 12 directions, comes nearer.
"""

import numpy as np

import gamms
from gamms.agent import AgentType
from gamms.experiment import Table

STEP = 0.2  # metres in a turn; the target is at (0, 0)


def fly_to_bisector(state):
    """Fly to the point of the bisector nearest to the target, or to the target if the intruder is first there."""
    here = np.array(state["curr_pos"])
    ((_, there),) = state["sensor"]["sight"][1].values()
    away = (here - there) * (1 if state["name"] == "intruder" else -1)  # from the guard
    aim = max(0.0, away @ (here + there) / 2.0) * away / (away @ away)
    state["action"] = {"direction": aim - here, "distance": min(STEP, float(np.linalg.norm(aim - here)))}


def play(starts, intrude):
    """Return how near an intruder with a strategy comes to the target."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 2))  # all are in the air
        for (name, place), strategy in zip(starts.items(), (fly_to_bisector, intrude), strict=True):
            flight = {"type": AgentType.AERIAL, "start_node_id": 0, "position": (*place, 0.0), "speed": STEP}
            sight = ctx.sensor.create_sensor(f"sight of {name}", "aerial_agent", range_m=100.0)
            ctx.agent.create_agent(name, team=name, sensors={"sight": sight}, strategy=strategy, **flight)
        ctx.game.add(gamms.rules.tag("guard", "intruder", then="eliminate", euclid=STEP, air=True))
        ctx.game.add(gamms.rules.last_team())
        ctx.game.collect("distance", lambda ctx: np.hypot(*ctx.agent.get_agent("intruder").position[:2]))
        return float(min(ctx.game.run(40).collected["distance"]["value"]))


rows = []
headings = [(np.cos(angle), np.sin(angle), 0.0) for angle in np.arange(12) * np.pi / 6]
for guard, intruder in (((0.0, 1.0), (4.0, 3.0)), ((-1.0, 0.5), (3.0, 5.0))):
    starts = {"guard": guard, "intruder": intruder}
    expected = (np.dot(intruder, intruder) - np.dot(guard, guard)) / 2.0 / np.hypot(*np.subtract(intruder, guard))
    ours = play(starts, fly_to_bisector)
    others = min(play(starts, lambda state, to=to: state.update(action=to)) for to in headings)
    rows.append({"result": f"metres from the target, guard at {guard}, intruder at {intruder}", "expected": expected})
    rows[-1] |= {
        "ours": ours,
        "low": ours - STEP,
        "high": ours + STEP,
        "agrees": abs(ours - expected) <= STEP and others >= ours - STEP,
    }
if __name__ == "__main__":
    print(Table.of(rows))
