"""Smugglers that draw random paths, and police that cover as many of these paths as possible."""

from collections import Counter
from functools import cache

from gamms.strategies import chase, first, goto


def ways(ctx, detour):
    """Make a function that draws a random path from a node to an exit, at most `detour` times the shortest one."""

    @cache
    def places(start, end):
        out = ctx.graph.distances(source=start)
        back = ctx.graph.distances(target=end)
        return [node for node in sorted(out) if out[node] + back.get(node, out[end] * detour) <= detour * out[end]]

    def way(start, draw):
        end = draw.choice(sorted(ctx.game.facts["exits"]))
        place = draw.choice(places(start, end))
        return [*ctx.graph.shortest_path(start, place), *ctx.graph.shortest_path(place, end)[1:]]

    return way


def smuggle(ctx, detour):
    """Make a smuggler's strategy: draw a path and follow it."""
    way = ways(ctx, detour)

    def strategy(state):
        memory = state["memory"]
        if "way" not in memory:
            memory["way"] = way(state["curr_pos"], state["draw"])[1:]
        state["action"] = memory["way"][min(state["turn"], len(memory["way"]) - 1)]

    return strategy


def blockade(ctx, detour, samples):
    """Make the plan of the police: draw sample paths like smugglers, and stand on the most used nodes."""
    way = ways(ctx, detour)
    drive = first(chase(ctx, otherwise=None), goto(ctx, lambda state: state["memory"]["post"]))

    def plan(states):
        if not next(iter(states.values()))["memory"]:
            lead = next(iter(states.values()))
            starts = ctx.graph.place(samples, (385911, 6671900), 400, rng=lead["rng"])
            ends = ctx.graph.distances(source=ctx.game.facts["exits"], cutoff=150)
            drawn = []
            for start in starts:
                drawn += [set(way(start, lead["draw"])) - ends.keys() for _ in range(samples)]
            for state in states.values():
                passed = Counter()
                for one in drawn:
                    passed.update(one)
                post = max(sorted(passed), key=passed.__getitem__)
                state["memory"]["post"] = post
                drawn = [one for one in drawn if post not in one]
        for state in states.values():
            drive(state)

    return plan
