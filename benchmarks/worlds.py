"""What cases share: grids, contexts, the strategy of the paper."""

import gamms

SPACING = 10.0
ST = gamms.sensor.SensorType


class Spent(float):
    """Seconds per operation that a case has measured itself; the harness takes them instead of its own clock."""


def grid(n):
    """Node and edge tuples of an n x n grid with every street in both directions."""
    nodes = [(i * n + j, i * SPACING, j * SPACING) for i in range(n) for j in range(n)]
    edges = []
    for i in range(n):
        for j in range(n):
            for k, m in ((i + 1, j), (i, j + 1)):
                if k < n and m < n:
                    u, v = i * n + j, k * n + m
                    edges += [(len(edges), u, v, SPACING), (len(edges) + 1, v, u, SPACING)]
    return nodes, edges


def fill(graph, n):
    """Build the grid one by one; returns how many items that were."""
    nodes, edges = grid(n)
    for id, x, y in nodes:
        graph.add_node({"id": id, "x": x, "y": y})
    for id, u, v, length in edges:
        graph.add_edge({"id": id, "source": u, "target": v, "length": length})
    return len(nodes) + len(edges)


def context(engine="MEMORY", **options):
    """A quiet context, by default in memory."""
    return gamms.create_context(graph_engine=gamms.graph.Engine[engine], logger_config={"level": "CRITICAL"}, **options)


def paper_strategy(choice):
    """The strategy printed in the paper."""

    def strategy(state):
        for sensor_type, data in state["sensor"].values():
            if sensor_type == ST.NEIGHBOR:
                state["action"] = data[choice(range(len(data)))]
                break

    return strategy
