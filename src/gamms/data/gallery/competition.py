"""Two baselines of the competition: attackers that look at one flag after the other, defenders that guard and chase."""

from gamms.strategies import chase, first, flee, goto, guard


def attack(ctx, caution):
    """Make an attacker's strategy: flee from defenders nearer than `caution`, else go to the flags.

    Flags known to be real come first, then unseen flags; within each group, the nearest.
    """

    def flag(state):
        known = state["facts"]["known"]
        captured = state["facts"]["captured"]
        real = [node for node, is_real in known.items() if is_real and node not in captured]
        goals = real or [node for node in state["facts"]["candidates"] if node not in known]
        return min(goals, key=lambda node: (ctx.graph.distance(state["curr_pos"], node), node), default=None)

    go = goto(ctx, flag)
    run = flee(ctx)

    def strategy(state):
        near = [
            node for name, node in state["sensor"]["eyes"][1].items() if ctx.agent.get_agent(name).team != state["team"]
        ]
        is_danger = any(ctx.graph.distance(state["curr_pos"], node) < caution for node in near)
        (run if is_danger else go)(state)

    return strategy


def defend(ctx, post):
    """Make a defender's strategy: chase attackers seen by itself or by a tower, else guard a real flag."""
    pursue = chase(ctx, otherwise=None)

    def walk(state):
        flags = state["facts"]["flags"]
        mine = flags[int(state["name"].rpartition("_")[2]) % len(flags)]
        guard(ctx, mine, post)(state)

    return first(pursue, walk)
