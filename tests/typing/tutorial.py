from collections.abc import Callable

import numpy as np

import gamms
from gamms.sensor import SensorType
from gamms.typing import IGraph

ctx = gamms.create_context(seed=7)
graph = ctx.graph.graph
graph.add_node({"id": 0, "x": 0, "y": 0})
graph.add_node({"id": 1, "x": 1, "y": 0})
graph.add_edge({"id": 0, "source": 0, "target": 1, "length": 1.0})
print(graph.get_node(1), list(graph.get_neighbors(0)))

N = 20
graph.clear()
ids = np.arange(N * N)
ctx.graph.add_nodes(ids, x=ids % N, y=ids // N)
right = ids[ids % N < N - 1]
up = ids[ids < N * N - N]
one_way = np.concatenate([np.stack([right, right + 1]), np.stack([up, up + N])], axis=1)
ends = np.concatenate([one_way, one_way[::-1]], axis=1)
ctx.graph.add_edges(np.arange(ends.shape[1]), sources=ends[0], targets=ends[1])

ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
ctx.sensor.create_sensor("around", SensorType.RANGE, sensor_range=2.0)
near, around = ctx.sensor.get_sensor("near"), ctx.sensor.get_sensor("around")
near.sense(0)
around.sense(0)
print(near.data, list(around.data["nodes"]))

STARTS = {"red": [0, 19], "blue": [399, 380]}
for team, nodes in STARTS.items():
    for i, node in enumerate(nodes):
        name = f"{team}_{i}"
        sensors = {
            kind.lower(): ctx.sensor.create_sensor(f"{name}/{kind}", SensorType[kind], sensor_range=5.0)
            for kind in ("NEIGHBOR", "AGENT_RANGE")
        }
        ctx.agent.create_agent(name, start_node_id=node, team=team, sensors=sensors, home=node)

red = ctx.agent.get_agent("red_0")
print(red.team, red.home, red.get_state())


def walker(rng: np.random.Generator) -> gamms.typing.Strategy:
    def strategy(state: gamms.typing.State) -> None:
        _, options = state["sensor"]["neighbor"]
        state["action"] = options[rng.integers(len(options))]

    return strategy


def hunter(graph: IGraph, rng: np.random.Generator) -> gamms.typing.Strategy:
    def strategy(state: gamms.typing.State) -> None:
        _, options = state["sensor"]["neighbor"]
        _, seen = state["sensor"]["agent_range"]
        prey = [graph.get_node(node) for name, node in seen.items() if name.startswith("red")]
        if not prey:
            state["action"] = options[rng.integers(len(options))]
            return

        def distance(option: int) -> float:
            node = graph.get_node(option)
            return min(abs(one.x - node.x) + abs(one.y - node.y) for one in prey)

        state["action"] = min(options, key=distance)

    return strategy


for agent in ctx.agent.create_iter():
    rng = ctx.stream("agent", agent.name)
    agent.register_strategy(walker(rng) if agent.team == "red" else hunter(graph, rng))


def tag_rule(ctx: gamms.Context) -> int:
    agents = list(ctx.agent.create_iter())
    tags = 0
    for red in (one for one in agents if one.team == "red"):
        for blue in (one for one in agents if one.team == "blue"):
            if red.current_node_id == blue.current_node_id:
                tags += 1
                for agent in (red, blue):
                    agent.current_node_id = agent.prev_node_id = agent.home
    return tags


tags = 0
for turn in range(400):
    for agent in ctx.agent.create_iter():
        state = agent.get_state()
        agent.strategy(state)
        agent.set_state()
    tags += tag_rule(ctx)
    ctx.visual.simulate()
ctx.visual.save("game.svg", title="Tag on a grid")
ctx.game.add(tag_rule)
kite = ctx.agent.create_agent("kite", type=gamms.agent.AgentType.AERIAL, start_node_id=0, speed=5.0, sensors=["near"])
height: float = kite.position[2] + kite.get_state()["quat"][0]


def climb(state: gamms.typing.AerialState) -> None:
    state["action"] = (0.0, 0.0, state["curr_pos"][2] + 1.0)


kite.register_strategy(gamms.strategies.first(climb, gamms.strategies.random_walk))
ctx.agent.create_agent("kite2", type="AERIAL", start_node_id=0, speed=5.0, strategy=climb)


def cautious(state: gamms.typing.State) -> None:
    if state["turn"] < 5 or "seen" in state["team_memory"]:
        state["action"] = state["draw"].choice(state["legal"])


anna = ctx.agent.create_agent("anna", start_node_id=0, strategy=gamms.strategies.first(cautious, gamms.strategies.stay))
wall = ctx.sensor.create_sensor("wall", SensorType.OCCLUDED_MAP, at=(1.0, 2.0))
wall.observer_height = 2.0
ctx.sensor.create_sensor("guard", SensorType.AGENT_RANGE, at=12, team="blue", detection=[(1.0, 0.9)]).sense()
ctx.game.add(tag_rule)
ctx.game.add(gamms.rules.tag("red", lambda agent: agent.team == "blue", then=lambda ctx, _, other: ctx.game.eliminate(other)))
ctx.game.add(gamms.rules.reach({"red": [5, 6], "blue": "starts of red"}, score=1))
ctx.game.add(gamms.rules.capture_flag({"red": 0, "blue": 399}, territory=gamms.rules.territory.halves(ctx)))


def last_wins(contest: gamms.rules.Contest, ctx: gamms.Context) -> list[str]:
    return [mover.agent for mover in contest.movers][-contest.places :] if ctx.game.turn else []


ctx.game.conflicts = gamms.rules.Conflicts(capacity=1, resolve=last_wins)
ctx.game.conflicts = gamms.rules.Conflicts(resolve=gamms.rules.by_priority(lambda agent: agent.energy))
result = ctx.game.run(max_turns=10)
print(result.turns)
for player in ctx.game.agents:
    player.energy = player.current_node_id + 1
    if player.team == "red" and player.name in ctx.game.moves:
        ctx.game.eliminate(player)
ctx.game.eliminate("red_0")
cautious(ctx.game.observation("anna"))
climb(ctx.game.observation(kite))
ctx.game.respawn("red_0", 12)
start = ctx.game.start_node("red_0")
lost: int = start if isinstance(start, int) else 0
ctx.terminate()
