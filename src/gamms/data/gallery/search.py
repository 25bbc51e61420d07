"""Drones that fly along lanes and report, and rescuers that go to the nearest reported person."""

from math import hypot

from gamms.strategies import goto

BREADTH = 250.0  # metres between two lanes


def fly(ctx, north):
    """Make a drone's strategy: fly up and down the map in lanes, and report visible people to the rescuers.

    Args:
        ctx: the context.
        north: whether it starts in the south, and flies north first.
    """
    west, south = ctx.graph.columns().xy.min(axis=0)
    east, top = ctx.graph.columns().xy.max(axis=0)
    lanes = [west + BREADTH * (i + 0.5) for i in range(int((east - west) / BREADTH) + 1)]
    corners = []
    for i, x in enumerate(lanes):
        ends = (south, top) if (i % 2 == 0) == north else (top, south)
        corners += [(x, y) for y in ends]
    if not north:
        corners.reverse()

    def strategy(state):
        for name, (_, (x, y, _)) in state["sensor"]["camera"][1].items():
            report = {"who": name, "at": ctx.graph.nearest_node(x, y)}
            state["outbox"].append({"channel": "radio", "to": "rescuers", "body": report})
        x, y, _ = state["curr_pos"]
        lane = state["memory"].get("lane", 0)
        if hypot(corners[lane][0] - x, corners[lane][1] - y) < 25:
            lane = (lane + 1) % len(corners)
        state["memory"]["lane"] = lane
        state["action"] = (corners[lane][0] - x, corners[lane][1] - y, 0.0)

    return strategy


def rescue(ctx, patience):
    """Make a rescuer's strategy: go to the nearest place where a person was reported, for `patience` turns."""

    def target(state):
        reports = state["memory"].setdefault("reports", {})
        for message in state["inbox"]:
            reports[message["body"]["who"]] = (message["turn"], message["body"]["at"])
        fresh = [node for turn, node in reports.values() if state["turn"] - turn <= patience]
        there = [node for node in fresh if node != state["curr_pos"]]
        return ctx.graph.routes.nearest(state["curr_pos"], sorted(there)) if there else None

    return goto(ctx, target)
