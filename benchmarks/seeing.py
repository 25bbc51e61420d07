"""What agents of batches see, against NumPy kernels that only do that, and against the same agents one by one."""

import time

import numpy as np
from worlds import Spent

WALK = "gamms.strategies:random_walk"


def pursuit(games=4096, turns=50):
    """Two pursuers and an evader on Helsinki that see 200 m far, as vectors, against vectors of a kernel alone."""
    from gamms.scenario import Scenario

    teams = {
        "red": {"count": 2, "sensors": ["near"], "strategy": "gamms.strategies:chase"},
        "blue": {"count": 1, "sensors": ["near"], "strategy": "gamms.strategies:flee"},
    }
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 200.0}}
    rules = [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}]
    scenario = Scenario(map={"helsinki": {}}, teams=teams, sensors=near, rules=rules, max_turns=turns)
    batch = scenario.batch(games)

    def ours():
        batch.reset()  # which draws where agents begin, and is not counted
        began = time.process_time()
        for _ in range(turns):
            for team in teams:
                batch.observe(team).vector(2)
            batch.step()
        return Spent((time.process_time() - began) / (3 * games * turns))

    xy = batch.observe("red").streets.columns.xy
    node = np.random.default_rng(1).integers(len(xy), size=(games, 3))

    def floor():
        for _ in range(turns):
            x, y = xy[node, 0], xy[node, 1]
            dx, dy = x[:, None] - x[:, :, None], y[:, None] - y[:, :, None]
            is_seen = dx * dx + dy * dy <= 200.0**2
            np.stack([is_seen, is_seen * dx, is_seen * dy], axis=-1).astype(np.float32)
        return 3 * games * turns

    return ours, floor


def crowd(agents=100_000, side=316, metres=25.0):
    """Agents of one game on a grid, half of each team, of which each sees some around it, against cells."""
    batch, xy = _crowded(agents, side, metres, [])

    def ours():
        batch.reset()  # or it would know what it has seen
        return len(batch.observe("red").seen("near").at)

    def floor():
        node = batch.observe("red").node[0], batch.observe("blue").node[0]
        everyone = xy[np.concatenate(node)]
        return len(by_cells(everyone[: len(node[0])], everyone, metres)[0])

    return ours, floor


def tags(agents=100_000, side=1_000, metres=5.0, turns=5):
    """Turns in which agents of one game tag those of the other team that are near, against a walk and cells."""
    from gamms.rules import tag

    batch, xy = _crowded(agents, side, metres, [tag("red", "blue", euclid=metres, then="respawn")])

    def ours():
        for _ in range(turns):
            batch.step()
        return turns * agents

    def floor():
        for _ in range(turns):
            by_cells(xy[batch.observe("red").node[0]], xy[batch.observe("blue").node[0]], metres)
        return turns * agents

    return ours, floor


def _crowded(agents, side, metres, rules):
    """Return a batch of one game with so many agents of two teams on a grid, and where its nodes are."""
    import gamms

    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    x, y = np.tile(np.arange(side), side) * 10.0, np.repeat(np.arange(side), side) * 10.0
    ids = np.arange(side * side).reshape(side, side)
    pairs = [(ids[:, :-1], ids[:, 1:]), (ids[:-1], ids[1:])]
    ends = [np.concatenate([part.ravel() for pair in pairs for part in pair[::step]]) for step in (1, -1)]
    ctx.graph.graph.add_nodes(np.arange(side * side), x, y)
    ctx.graph.graph.add_edges(np.arange(len(ends[0])), ends[0], ends[1], np.full(len(ends[0]), 10.0))
    starts = np.random.default_rng(1).integers(side * side, size=agents)
    walk = gamms.strategies.random_walk
    near = ctx.sensor.create_sensor("near", "AGENT_RANGE", sensor_range=metres)
    for name, some in (("red", starts[: agents // 2]), ("blue", starts[agents // 2 :])):
        ctx.agent.create_team(name, some, strategy=walk, sensors=[near])
    for rule in rules:
        ctx.game.add(rule)
    ctx.game.max_turns = 10**9
    return ctx.game.batch(1), np.column_stack((x, y))


def by_cells(points, others, limit):
    """Return the pairs of points and others that are near each other, by a grid of cells as wide as the limit."""
    low = np.minimum(points.min(axis=0), others.min(axis=0)) - limit
    wide = int((max(points[:, 0].max(), others[:, 0].max()) - low[0]) / limit) + 2
    cells = [
        ((part[:, 1] - low[1]) / limit).astype(int) * wide + ((part[:, 0] - low[0]) / limit).astype(int)
        for part in (points, others)
    ]
    order = np.argsort(cells[1], kind="stable")
    begins = np.concatenate(([0], np.cumsum(np.bincount(cells[1], minlength=int(cells[0].max()) + 2 * wide))))
    rows, found = [], []
    for stripe in (-wide, 0, wide):
        first, last = begins[cells[0] + stripe - 1], begins[cells[0] + stripe + 2]
        counts = last - first
        row = np.repeat(np.arange(len(points)), counts)
        place = np.arange(len(row)) + np.repeat(first - np.cumsum(counts) + counts, counts)
        other = order[place]
        offsets = points[row] - others[other]
        near = offsets[:, 0] ** 2 + offsets[:, 1] ** 2 <= limit * limit
        rows.append(row[near])
        found.append(other[near])
    return np.concatenate(rows), np.concatenate(found)


def views(games=64, side=64, agents=64, turns=20):
    """Games of 64 agents on a 64x64 grid whose views have a radius of 5 nodes, at once, against one by one."""
    from gamms.scenario import Scenario

    sensors = {
        "near": {"type": "AGENT_RANGE", "sensor_range": 50.0},
        "map": {"type": "RANGE", "sensor_range": 50.0},
    }
    teams = {"red": {"count": agents, "strategy": WALK, "sensors": ["near", "map"]}}
    scenario = Scenario(
        map={"grid": {"width": side, "height": side}},
        teams=teams,
        sensors=sensors,
        conflicts={"capacity": 1, "among": "all", "resolve": "at_random"},
        max_turns=10**9,
    )
    batch, alone = scenario.batch(games), scenario.build(seed=0)

    def ours():
        for _ in range(turns):
            view = batch.observe("red")
            view.seen("near")
            view.seen_nodes("map")
            batch.step()
        return games * agents * turns

    def floor():
        alone.game.run(turns)
        return agents * turns

    return ours, floor
