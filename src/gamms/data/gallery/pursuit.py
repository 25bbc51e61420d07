"""The strategies: functions of an agent's state that set `state["action"]` to the node to go to."""

from gamms.strategies import flee, mix, random_walk


def pursue(ctx):
    """Make a pursuer's strategy: go toward the nearest visible evader, else walk at random."""
    graph = ctx.graph

    def strategy(state):
        here = state["curr_pos"]
        _, seen = state["sensor"]["eyes"]  # the type of the sensor, and its data: name -> node of every visible agent
        evaders = [
            node for name, node in seen.items() if ctx.agent.get_agent(name).team != state["team"] and node != here
        ]
        if evaders:
            nearest = min(evaders, key=lambda node: graph.distance(here, node))
            state["action"] = graph.shortest_path(here, nearest)[1]
        else:
            state["action"] = state["draw"].choice(state["legal"])  # random, but the same for the same seed

    return strategy


def evade(ctx, caution):
    """Make an evader's strategy from others: flee from visible pursuers, else walk at random."""
    return mix(caution, flee(ctx), random_walk)
