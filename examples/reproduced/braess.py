"""Braess' paradox: a new road makes the trip of every driver longer.

Drivers go from west to east by north or south, on a road that takes as many minutes as it has cars, and another that
always takes 45. A new road from north to south takes none (Braess, Über ein Paradoxon aus der Verkehrsplanung, 1968).
Expected is the mean of every equilibrium: no driver gains by another way. In the game, one driver a day may change.
"""

from collections import Counter
from itertools import combinations_with_replacement, pairwise

import networkx as nx

import gamms
from gamms.experiment import Table

DRIVERS, LONG, DAYS = 40, 45, 100
NORTH, SOUTH, NEW = (0, 1, 3), (0, 2, 3), (0, 1, 2, 3)  # from west, 0, by north, 1, or south, 2, to east, 3


def find_minutes(way, ways):
    """Return the minutes of a way if these ways are taken."""
    cars = Counter(road for one in ways for road in pairwise(one))
    return sum({(0, 1): cars[0, 1], (2, 3): cars[2, 3], (1, 2): 0}.get(road, LONG) for road in pairwise(way))


def find_best(number, taken, known):
    """Return the fastest way for one driver if the others keep theirs; his own if no other is faster."""
    others = [*taken[:number], *taken[number + 1 :]]
    return min([taken[number], *known], key=lambda way: find_minutes(way, [*others, way]))


def find_equilibria(known):
    """Return the mean minutes in each equilibrium."""
    found = set()
    for taken in combinations_with_replacement(known, DRIVERS):
        if all(find_best(taken.index(way), taken, known) == way for way in set(taken)):
            found.add(sum(find_minutes(way, taken) for way in taken) / DRIVERS)
    return found


def play(known):
    """Return the mean minutes of the last day; a turn is a day, in which drivers go up to three roads."""

    def drive(state):
        number, taken = int(state["name"]), state["facts"]["taken"]
        is_free = state["turn"] % DRIVERS == number
        state["action"] = list(find_best(number, taken, known) if is_free else taken[number])[1:]

    def return_home(ctx):
        ctx.game.publish(taken=[move.path for _, move in sorted(ctx.game.moves.items())])
        for driver in ctx.game.agents:
            ctx.game.respawn(driver)

    graph = nx.DiGraph(road for way in known for road in pairwise(way))
    nx.set_node_attributes(graph, {0: {"x": 0, "y": 0}, 1: {"x": 1, "y": 1}, 2: {"x": 1, "y": -1}, 3: {"x": 2, "y": 0}})
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(graph)
        for number in range(DRIVERS):
            ctx.agent.create_agent(f"{number:02}", start_node_id=0, team="drivers", speed=3, strategy=drive)
        ctx.game.publish(taken=[NORTH] * DRIVERS)
        ctx.game.add(return_home)
        ctx.game.run(DAYS)
        taken = ctx.game.facts["taken"]
    return sum(find_minutes(way, taken) for way in taken) / DRIVERS


rows = []
for name, known in {"two ways": [NORTH, SOUTH], "a third by the new road": [NORTH, SOUTH, NEW]}.items():
    (expected,), ours = find_equilibria(known), play(known)
    rows.append({"result": f"mean minutes, {name}", "expected": expected, "ours": ours, "agrees": ours == expected})
if __name__ == "__main__":
    print(Table.of(rows))
