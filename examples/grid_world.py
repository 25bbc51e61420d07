"""The paper's grid world: two teams race to each other's starts; who meets an opponent goes back to its own."""

import gamms
from gamms.rules import Conflicts, reach, tag, time_limit
from gamms.strategies import goto, mix, random_walk

SIZE = 12
STARTS = {"red": [0, 1, 12], "blue": [143, 142, 131]}  # team -> the nodes where its agents start: opposite corners

with gamms.create_context(seed=8) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(SIZE, SIZE))
    for team, enemy in (("red", "blue"), ("blue", "red")):
        for i, (start, target) in enumerate(zip(STARTS[team], STARTS[enemy], strict=True)):
            strategy = mix(0.5, goto(ctx, target), random_walk)
            ctx.agent.create_agent(f"{team}_{i}", start_node_id=start, team=team, strategy=strategy)

    ctx.game.conflicts = Conflicts(capacity=1, among="team")
    ctx.game.add(tag("red", "blue", mutual=True))
    ctx.game.add(reach({"red": "starts of blue", "blue": "starts of red"}))
    ctx.game.add(time_limit(300))
    result = ctx.game.run()

for event in result.events:
    if event["kind"] == "tag":
        print(f"turn {event['turn']:3d}: {event['agent']} tags {event['other']} on node {event['node']}")
    elif event["kind"] == "reach":
        print(f"turn {event['turn']:3d}: {event['agent']} arrives on node {event['node']}")
print(f"{result.reason} after {result.turns} turns; the winner is {result.winner}; tags: {result.scores}")
