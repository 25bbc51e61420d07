"""How long a turn of a plain Python game takes: strategies, sensors, conflicts, tags and flags; and a batch of games.

The times are CPU times of this process, for one agent and one turn. They differ from machine to machine; the games do
not.
"""

from time import process_time

import gamms
from gamms.rules import Conflicts, capture_flag, tag, time_limit

TURNS = 100


def wander(state):
    """A strategy in plain Python: flee from who is next, or go on somewhere."""
    seen = set(state["sensor"]["eyes"][1].values())
    free = [node for node in state["legal"] if node not in seen]
    state["action"] = free[state["draw"].below(len(free))] if free else state["curr_pos"]


def game_of(agents):
    """Return a context with a game of two teams on a grid with four nodes for each agent."""
    ctx = gamms.create_context(seed=1)
    side = max(8, round((4 * agents) ** 0.5))
    ctx.graph.attach_networkx_graph(gamms.graph.grid(side, side))
    for i in range(agents):
        eyes = ctx.sensor.create_sensor(f"eyes_{i}", "agent_range", sensor_range=10.0)
        start, team = i * 7919 % side**2, ("red", "blue")[i % 2]
        ctx.agent.create_agent(f"a{i}", start_node_id=start, team=team, sensors={"eyes": eyes}, strategy=wander)
    ctx.game.conflicts = Conflicts(2)
    for rule in (tag("red", "blue"), capture_flag({"red": 0, "blue": side**2 - 1}, goal=None), time_limit(10**6)):
        ctx.game.add(rule)
    return ctx


for agents in (2, 10, 100):
    with game_of(agents) as ctx:
        ctx.game.run(max_turns=5)
        began = process_time()
        ctx.game.run(max_turns=TURNS)
        spent = (process_time() - began) / (TURNS * agents)
        print(f"{agents:5d} agents, {TURNS} turns: {1e6 * spent:.1f} us, tags: {ctx.game.scores['red']}")

walkers = {team: {"count": 5, "strategy": "gamms.strategies:random_walk"} for team in ("red", "blue")}
rules = [
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}},
    {"rule": "time_limit", "with": {"turns": TURNS}},
]
scenario = gamms.scenario.Scenario(map={"grid": {"rows": 10, "columns": 10}}, teams=walkers, rules=rules)
with scenario.batch(200, seed=1) as games:
    began = process_time()
    games.run()
    spent = (process_time() - began) / (200 * TURNS * 10)
    print(f"  200 games of 10 agents in a batch: {1e6 * spent:.3f} us, tags: {games.scores['red'].sum():.0f}")
