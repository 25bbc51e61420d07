"""Four roads and a shortcut, drivers who choose roads, and the rule by which roads get slower with each car."""

from collections import Counter

import networkx as nx

WEST, NORTH, SOUTH, EAST = range(4)
PLACES = [(0, 50), (100, 100), (100, 0), (200, 50)]
ROADS = [(WEST, NORTH), (NORTH, EAST), (WEST, SOUTH), (SOUTH, EAST), (NORTH, SOUTH)]
TURNS = [4, 20, 20, 4, 3]  # that an empty road takes
NARROW = {0, 3}  # roads that take a turn longer for each car on them
PARTS = 10  # edges of a road


def town():
    """Return the roads as a directed graph. Node 10 + 10 * road + i is the i-th between the ends of a road."""
    graph = nx.DiGraph()
    for road, (start, end) in enumerate(ROADS):
        nodes = [start, *range(10 + 10 * road, 9 + 10 * road + PARTS), end]
        nx.add_path(graph, nodes)
        for i, node in enumerate(nodes):
            x, y = ((a * (PARTS - i) + b * i) / PARTS for a, b in zip(PLACES[start], PLACES[end], strict=True))
            graph.nodes[node].update(x=x, y=y)
    return graph


def drive(state, choose):
    """Follow the road, and where roads part, go to the place that `choose` returns."""
    here = state["curr_pos"]
    memory = state["memory"]
    if here >= 10:
        memory["goal"] = ROADS[here // 10 - 1][1]
    elif memory.get("place") != here:
        memory["goal"] = choose(here)
    memory["place"] = here
    state["action"] = memory["goal"]


def selfish(state):
    """Take the way that is fastest now."""
    drive(state, lambda place: fastest(place, state["facts"]["times"])[1])


def fastest(place, times):
    """Return the turns of the fastest way from a place, and the next place on it."""
    ways = [(road, end) for road, (start, end) in enumerate(ROADS) if start == place]
    return min(((times[road] + fastest(end, times)[0], end) for road, end in ways), default=(0, place))


def planned(state):
    """Go by the north if the number of the driver is even, else by the south, and never take the shortcut."""
    first = SOUTH if int(state["name"].split("_")[1]) % 2 else NORTH
    drive(state, lambda place: first if place == WEST else EAST)


def traffic(ctx):
    """Set the speeds of cars by the load of their roads, and count trips; who arrives starts again in the west."""
    cars = Counter(driver.current_node_id // 10 - 1 for driver in ctx.game.agents)
    times = [turns + cars[road] * (road in NARROW) for road, turns in enumerate(TURNS)]
    ctx.game.publish(times=times)
    for driver in ctx.game.agents:
        here = driver.current_node_id
        if here >= 10:
            driver.speed = PARTS / times[here // 10 - 1]
        elif here == EAST:
            ctx.game.scores[driver.team] += 1
            ctx.game.respawn(driver, WEST)


def draw(ctx, _):
    """Draw the roads."""
    for road, ends in enumerate(ROADS):
        ctx.visual.render_linestring([PLACES[end] for end in ends], (120, 140, 120, 120), 6 if road in NARROW else 16)


traffic.prepare = lambda ctx: ctx.game.publish(times=TURNS)
traffic.drawer = draw
