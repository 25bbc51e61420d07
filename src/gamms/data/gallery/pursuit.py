"""How the agents play: a strategy is a function of an agent's state that sets `state["action"]`, a node to go to."""

from gamms.strategies import flee, mix, random_walk


def pursue(ctx):
    """Make the strategy of a pursuer: go towards the nearest evader in sight, and wander while there is none."""
    graph = ctx.graph

    def strategy(state):
        here = state["curr_pos"]
        _, seen = state["sensor"]["eyes"]  # what the sensor is, and what it tells: name -> node of every agent in sight
        evaders = [
            node for name, node in seen.items() if ctx.agent.get_agent(name).team != state["team"] and node != here
        ]
        if evaders:
            nearest = min(evaders, key=lambda node: graph.distance(here, node))
            state["action"] = graph.shortest_path(here, nearest)[1]
        else:
            state["action"] = state["draw"].choice(state["legal"])  # by lot, the same for the same seed

    return strategy


def evade(ctx, caution):
    """Make the strategy of an evader: flee from pursuers in sight, or walk at random; it is put together of others."""
    return mix(caution, flee(ctx), random_walk)
