"""Two teams walk about on a 20 x 20 grid; where red meets blue, both go back to their starts."""

import gamms

SIZE, TURNS = 20, 1000
TEAMS = {"red": [0, 19, 45], "blue": [399, 380, 354]}  # team -> the nodes where its agents start


def create_grid(graph, n):
    """Nodes 0 to n * n - 1, row by row; an edge in both directions between neighbours."""
    for node in range(n * n):
        graph.add_node({"id": node, "x": node % n, "y": node // n})
    right = [(node, node + 1) for node in range(n * n) if node % n < n - 1]
    up = [(node, node + n) for node in range(n * n - n)]
    for edge, (a, b) in enumerate(right + up):
        graph.add_edge({"id": 2 * edge, "source": a, "target": b, "length": 1.0})
        graph.add_edge({"id": 2 * edge + 1, "source": b, "target": a, "length": 1.0})


def random_walk(rng):
    """A strategy: a random neighbour, or stay; `rng` is the agent's own."""

    def strategy(state):
        _, options = state["sensor"]["near"]
        state["action"] = options[rng.integers(len(options))]

    return strategy


def tag_rule(ctx, turn):
    """Send a red and a blue agent that stand on the same node back; return how many pairs met."""
    agents = list(ctx.agent.create_iter())
    reds, blues = ([one for one in agents if one.team == team] for team in ("red", "blue"))
    pairs = [(red, blue) for red in reds for blue in blues if red.current_node_id == blue.current_node_id]
    for red, blue in pairs:
        print(f"turn {turn:4d}: {red.name} and {blue.name} meet on node {red.current_node_id}")
    for agent in dict.fromkeys(agent for pair in pairs for agent in pair):
        agent.prev_node_id = agent.current_node_id = agent.start
    return len(pairs)


with gamms.create_context(seed=5) as ctx:
    create_grid(ctx.graph.graph, SIZE)
    for team, starts in TEAMS.items():
        for i, node in enumerate(starts):
            name = f"{team}_{i}"
            agent = ctx.agent.create_agent(name, start_node_id=node, team=team, start=node)
            agent.register_sensor("near", ctx.sensor.create_sensor(f"{name}/near", gamms.sensor.SensorType.NEIGHBOR))
            agent.register_strategy(random_walk(ctx.stream("agent", name)))
    tags = 0
    for turn in range(1, TURNS + 1):
        for agent in ctx.agent.create_iter():
            agent.step()
        tags += tag_rule(ctx, turn)
        ctx.visual.simulate()
    print(f"{tags} tags in {TURNS} turns")
