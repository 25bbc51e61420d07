"""Cops hunt a thief who shows itself every few turns, as in Scotland Yard; in between they go by a belief."""

import gamms
from gamms import belief, rules, strategies

SIDE, EVERY, TURNS = 12, 5, 60  # nodes in each row; turns from one sight of the thief to the next


def show_thief(ctx):
    """Publish where the thief is, every few turns and before the first."""
    if ctx.game.turn % EVERY == 0:
        ctx.game.publish(thief={"node": ctx.agent.get_agent("thief").current_node_id, "turn": ctx.game.turn})


show_thief.prepare = show_thief


def cop(ctx):
    """Make the strategy of a cop: go where the thief most probably is, and near."""

    def target(state):
        shown = state["facts"]["thief"]
        if shown["turn"] == state["turn"]:
            belief.note(ctx, state, "thief", shown["node"])
        chances = belief.observe(ctx, state).probability("thief")
        away = ctx.graph.distances(source=state["curr_pos"], weight=None)
        # Rounded, so that no last bit decides between nodes that are equally good.
        return max(chances, key=lambda node: (round(chances[node] / (1 + away[node]), 9), -node))

    return strategies.goto(ctx, target)


def build(seed, places):
    """Return the game of cops and a thief on some nodes, the thief's last, before its first turn."""
    ctx = gamms.create_context(seed=seed)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(SIDE, SIDE))
    for i, node in enumerate(places[:-1]):
        eyes = ctx.sensor.create_sensor(f"eyes of {i}", "agent_range", sensor_range=10.0)
        ctx.agent.create_agent(f"cop_{i}", start_node_id=node, team="cops", sensors={"eyes": eyes}, strategy=cop(ctx))
    helicopters = ctx.sensor.create_sensor("helicopters", "agent")  # the thief sees all
    escape = strategies.mix(0.7, strategies.flee(ctx), strategies.random_walk)
    ctx.agent.create_agent(
        "thief", start_node_id=places[-1], team="thief", sensors={"helicopters": helicopters}, strategy=escape
    )
    ctx.game.order = [["cops"], ["thief"]]
    ctx.game.add(rules.tag("cops", "thief", then="eliminate"))
    ctx.game.add(rules.last_team())
    ctx.game.add(rules.time_limit(TURNS, winner="thief"))
    ctx.game.add(show_thief)
    return ctx


if __name__ == "__main__":
    for cops in (2, 3, 4):
        turns = []
        for seed in range(3):
            with build(seed, [*(0, 11, 132, 143)[:cops], 66]) as ctx:
                result = ctx.game.run()
            turns.append(result.turns if result.winner == "cops" else "-")
        print(f"{cops} cops catch the thief after so many turns:", *turns)
