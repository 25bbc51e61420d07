"""A driver that leaves town, and turns around at checkpoints."""

from gamms.strategies import goto


def escape(ctx, exits):
    """Make the evader's strategy: drive to the nearest exit, and to another one when police is seen on the way."""
    roads = ctx.graph.routes.select_mode("drive")

    def choose(state):
        here = state["curr_pos"]
        memory = state["memory"]
        goal = memory.get("goal")
        police = state["sensor"]["police"][1].values()
        if goal is None or not set(police).isdisjoint(roads.shortest_path(here, goal)):
            tried = [*memory.get("tried", []), goal]
            memory["tried"] = tried if not set(exits) <= set(tried) else [goal]
            left = [node for node in exits if node not in memory["tried"]]
            goal = min(left, key=lambda node: roads.distance(here, node))
        memory["goal"] = goal
        return goal

    return goto(ctx, choose)
