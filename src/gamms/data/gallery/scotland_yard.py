"""The strategy of Mr X, and the plan of the detectives."""

from .scotland_yard_board import COLORS, after, edges


def hide(ctx):
    """Make the strategy of Mr X: go where no detective is near, by the ticket that leaves most stations possible."""
    ways = edges(ctx)

    def strategy(state):
        facts = state["facts"]
        detectives = set(state["sensor"]["sees_detectives"][1].values())
        far = ctx.graph.distances(source=detectives, weight=None)
        left = {ticket: len(after(ways, facts["possible"], ticket) - detectives) for ticket in (*COLORS, "black")}
        left["black"] *= 0.8  # these are few

        def value(edge):
            ticket, _, target = ways[edge]
            return min(far[target], 3) + 3 * left[ticket] / max(1, *left.values()) + state["draw"].random()

        paid = [edge for edge in state["legal_edges"] if facts[f"mr_x_{ways[edge][0]}"] >= 1]
        options = [edge for edge in paid if ways[edge][2] not in detectives]
        state["action"] = {"edge": max(options, key=value)} if options else state["curr_pos"]

    return strategy


def hunt(ctx):
    """Make the detectives' plan: each goes to the nearest station where Mr X can be and no other detective goes."""
    ways = edges(ctx)
    public = ctx.graph.routes.select_mode("public")

    def plan(states):
        possible = set(states[min(states)]["facts"]["possible"])
        taken = set()
        for state in states.values():
            here = state["curr_pos"]
            stops = public.distances(source=here, weight=None)
            goal = min(possible, key=lambda node: (stops[node], node), default=here)
            possible.discard(goal)
            ahead = public.distances(source=goal, weight=None)
            paid = [edge for edge in state["legal_edges"] if state["facts"][ways[edge][0]] >= 1]
            options = [edge for edge in paid if ways[edge][2] not in taken]
            rank = {edge: (ahead[ways[edge][2]], -state["facts"][ways[edge][0]], edge) for edge in options}
            best = min(rank, key=rank.get) if rank and here != goal else None
            state["action"] = here if best is None else {"edge": best}
            taken.add(here if best is None else ways[best][2])

    return plan
