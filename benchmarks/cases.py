"""What is measured, and against which floor. `make()` returns two functions that return how many operations they did.

Frequent: one call. Targeted: one behaviour. Scenario: a whole game.
"""

import math
import random
import subprocess
import sys
from heapq import heappop, heappush
from itertools import islice

import batches
from worlds import ST, Spent, context, fill, grid, paper_strategy


def build():
    """One by one, against inserting the same tuples into plain dicts."""

    def ours():
        ctx = context()
        items = fill(ctx.graph.graph, 100)
        ctx.terminate()
        return items

    def floor():
        node, edge, out = {}, {}, {}
        nodes, edges = grid(100)
        for id, x, y in nodes:
            node[id] = (id, x, y)
            out[id] = []
        for id, u, v, length in edges:
            edge[id] = (id, u, v, length)
            out[u].append(v)
        return len(node) + len(edge)

    return ours, floor


def loop(agents):
    """The paper's loop, against bare Python that builds the same state dicts from ready-made answers."""

    def make(n=100):
        ctx = context()
        fill(ctx.graph.graph, n)
        rng = random.Random(7)
        starts = [rng.randrange(n * n) for _ in range(agents)]
        strategy = paper_strategy(random.Random(1).choice)
        for i, start in enumerate(starts):
            ctx.sensor.create_sensor(f"s_{i}", ST.NEIGHBOR)
            agent = ctx.agent.create_agent(f"a_{i}", start_node_id=start, sensors=[f"s_{i}"])
            agent.register_strategy(strategy)
        turns = max(1, 20000 // agents)

        def ours():
            for _ in range(turns):
                for agent in ctx.agent.create_iter():
                    state = agent.get_state()
                    agent.strategy(state)
                    agent.set_state()
                ctx.visual.simulate()
            return turns * agents

        near = [(i, *(ctx.graph.graph.get_neighbors(i))) for i in range(n * n)]
        here, before, names = list(starts), list(starts), [f"s_{i}" for i in range(agents)]

        def floor():
            for _ in range(turns):
                for i in range(agents):
                    node = here[i]
                    state = {"curr_pos": node, "sensor": {names[i]: (ST.NEIGHBOR, list(near[node]))}}
                    strategy(state)
                    before[i] = node
                    here[i] = state["action"]
            return turns * agents

        return ours, floor

    return make


def sense(kind, n, *, again=False, agents=1):
    """One sense, against building the same containers from answers that are ready."""

    def make():
        ctx = context()
        fill(ctx.graph.graph, n)
        rng = random.Random(3)
        for i in range(agents):
            ctx.agent.create_agent(f"a_{i}", start_node_id=rng.randrange(n * n))
        fov = {"fov": 2.5} if kind.name.endswith("ARC") else {}
        sensor = ctx.sensor.create_sensor("x", kind, sensor_range=50.0, **fov)
        owner = ctx.agent.get_agent("a_0")
        owner.register_sensor("x", sensor)
        owner.orientation = (0.6, 0.8)
        fresh = iter(rng.sample(range(n * n), min(n * n, 400)))
        node = next(fresh)
        sensor.sense(node)
        ready = sensor.data

        def ours():
            calls = 200 if again else 20
            for _ in range(calls):
                sensor.sense(node if again else next(fresh, node))
            return calls

        def floor():
            for _ in range(1000):
                {key: type(value)(value) for key, value in ready.items()} if "nodes" in ready else dict(ready)
            return 1000

        return ours, floor

    return make


def crowded_city():
    """A game of 1,000 agents that look around in Helsinki, against building the same dicts from ready answers."""
    import gamms.osm

    ctx = context()
    gamms.osm.helsinki(ctx)
    nodes = list(ctx.graph.graph.get_nodes())
    rng = random.Random(7)
    starts, turns = [rng.choice(nodes) for _ in range(1000)], 5
    for i, start in enumerate(starts):
        agent = ctx.agent.create_agent(f"a_{i}", start_node_id=start)
        for name, kind in CITY_SENSORS.items():
            agent.register_sensor(name, ctx.sensor.create_sensor(f"{name}_{i}", kind, sensor_range=50.0))

    def play(keep=None):
        strategy = paper_strategy(random.Random(1).choice)
        for agent, start in zip(ctx.agent.create_iter(), starts, strict=True):
            agent.current_node_id = agent.prev_node_id = start
        for _ in range(turns):
            for agent in ctx.agent.create_iter():
                state = agent.get_state()
                strategy(state)
                agent.set_state()
                if keep is not None:
                    keep.append((state["curr_pos"], {name: data for name, (_, data) in state["sensor"].items()}))
        return turns * len(starts)

    seen = []
    play(seen)
    return play, ready_city(seen, starts)


def turns(capacity=None):
    """The turn engine, against the paper's hand-written loop over the same agents, placed apart."""

    def make(n=100, agents=1000):
        def world():
            ctx = context()
            fill(ctx.graph.graph, n)
            rng, strategy = random.Random(7), paper_strategy(random.Random(1).choice)
            for i, start in enumerate(rng.sample(range(n * n), agents)):
                ctx.sensor.create_sensor(f"s_{i}", ST.NEIGHBOR)
                agent = ctx.agent.create_agent(f"a_{i}", start_node_id=start, sensors=[f"s_{i}"])
                agent.register_strategy(strategy)
            return ctx

        engine, by_hand = world(), world()
        if capacity is not None:
            from gamms.rules import Conflicts

            engine.game.conflicts = Conflicts(capacity)

        def ours():
            for _ in range(20):
                engine.game.step()
            return 20 * agents

        def floor():
            for _ in range(20):
                for agent in by_hand.agent.create_iter():
                    state = agent.get_state()
                    agent.strategy(state)
                    agent.set_state()
                by_hand.visual.simulate()
            return 20 * agents

        return ours, floor

    return make


def turns_of(agents, side, **options):
    """The turn engine with a NEIGHBOR sensor for each agent, against a bare loop that builds states of ten keys."""

    def make():
        ctx, seed, rng = lattice(side, **options), 1, random.Random(7)
        starts = [rng.randrange(side * side) for _ in range(agents)]

        def strategy(state):
            nonlocal seed
            seed = (seed * 1103515245 + 12345) & 0x7FFFFFFF
            for _, ways in state["sensor"].values():
                state["action"] = ways[(seed >> 8) % len(ways)]

        names = [f"a_{i}" for i in range(agents)]
        for i, start in enumerate(starts):
            near = ctx.sensor.create_sensor(f"s_{i}", ST.NEIGHBOR)
            ctx.agent.create_agent(names[i], start_node_id=start, sensors=[near], strategy=strategy)
        count = max(1, 20_000 // agents)

        def ours():
            for _ in range(count):
                ctx.game.step()
            return count * agents

        play = batches.bare_game(ctx.graph.graph.neighborhoods, starts, strategy, count)

        def floor():
            play()
            return count * agents

        return ours, floor

    return make


def flyers(agents=10, side=100):
    """Agents that fly over a grid, against bare Python that finds the nodes below them in a dict of cells."""

    def make():
        ctx, rng = lattice(side), random.Random(7)
        begun = [
            (rng.uniform(0.0, 10.0 * side - 10.0), rng.uniform(0.0, 10.0 * side - 10.0), 30.0) for _ in range(agents)
        ]

        def strategy(state):
            state["action"] = (1.0, 0.5, 0.0) if state["turn"] % 20 < 10 else (-1.0, -0.5, 0.0)

        for i, place in enumerate(begun):
            ctx.agent.create_agent(
                f"a_{i}", type="AERIAL", start_node_id=0, position=place, speed=7.0, strategy=strategy
            )
        cells = {}
        for node in range(side * side):
            x, y = node % side * 10.0, node // side * 10.0
            cells.setdefault((x // 20.0, y // 20.0), []).append((x, y, node))
        around = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]

        def ours():
            for _ in range(200):
                ctx.game.step()
            return 200 * agents

        def floor():
            at = list(begun)
            for turn in range(200):
                for i, (x, y, z) in enumerate(at):
                    state = {"curr_pos": (x, y, z), "sensor": {}, "name": "a", "turn": turn, "memory": {}}
                    strategy(state)
                    dx, dy, dz = state["action"]
                    far = 7.0 / math.hypot(dx, dy, dz)
                    at[i] = p, q, _ = x + dx * far, y + dy * far, z + dz * far
                    cell = p // 20.0, q // 20.0
                    min(
                        ((a - p) ** 2 + (b - q) ** 2, node)
                        for right, up in around
                        for a, b, node in cells.get((cell[0] + right, cell[1] + up), ())
                    )
            return 200 * agents

        return ours, floor

    return make


def by_metres(agents=100, side=30, speed=7.0):
    """Agents that go to legal nodes by metres, against bare Python that moves them and builds states of ten keys."""

    def make():
        ctx, rng, turns = lattice(side), random.Random(7), 5000 // agents
        ctx.game.speed_unit = "metres"
        starts, seed = [rng.randrange(side * side) for _ in range(agents)], 1

        def strategy(state):
            nonlocal seed
            seed = (seed * 1103515245 + 12345) & 0x7FFFFFFF
            legal = state["legal"]
            state["action"] = legal[(seed >> 8) % len(legal)]

        for i, start in enumerate(starts):
            ctx.agent.create_agent(f"a_{i}", start_node_id=start, speed=speed, strategy=strategy)
        near, places = ctx.graph.graph.neighborhoods, [(node, node, 0.0) for node in starts]

        def ours():
            ctx.game.run(turns)
            return turns * agents

        def floor():
            for turn in range(turns):
                for i, (here, ahead, offset) in enumerate(places):
                    legal = tuple(dict.fromkeys([here, ahead, *near[ahead], *near[here]]))
                    state = {"curr_pos": here, "edge": (here, ahead), "offset_m": offset, "xy": (0.0, 0.0)}
                    state |= {"sensor": {}, "name": "a", "team": None, "turn": turn, "memory": {}, "legal": legal}
                    strategy(state)
                    places[i] = _advanced(near, state["action"], here, ahead, offset, speed)
            return turns * agents

        return ours, floor

    return make


def _advanced(near, target, here, ahead, offset, speed):
    """Where an agent on an edge of 10 metres is after a turn on its way to a node that is next to one of its ends."""
    is_back = target == here or (target != ahead and target in near[here])
    left = offset - speed if is_back else 10.0 - offset - speed
    end = here if is_back else ahead
    if left > 0.0:
        return here, ahead, offset - speed if is_back else offset + speed
    return (end, end, 0.0) if target == end or left == 0.0 else (end, target, -left)


def memories(agents):
    """Turns in which all agents of a team write into its memory, against bare Python that copies and compares dicts."""

    def make(turns=3):
        ctx = lattice(30)

        def strategy(state):
            state["team_memory"][state["name"]] = {"seen": {state["turn"]: state["curr_pos"]}}
            state["action"] = state["curr_pos"]

        for i in range(agents):
            ctx.agent.create_agent(f"a_{i}", team="red", start_node_id=i, strategy=strategy)
        ctx.game.step()

        def ours():
            ctx.game.run(turns)
            return turns * agents

        def floor():
            shared = {f"a_{i}": {"seen": {0: i}} for i in range(agents)}
            for turn in range(turns):
                copies, after = [], dict(shared)
                for i in range(agents):
                    copy = {name: {key: dict(one) for key, one in known.items()} for name, known in shared.items()}
                    state = {"team_memory": copy, "name": f"a_{i}", "turn": turn, "curr_pos": i}
                    strategy(state)
                    copies.append(copy)
                for copy in copies:
                    after |= {name: known for name, known in copy.items() if known != shared[name]}
                shared = after
            return turns * agents

        return ours, floor

    return make


CITY_SENSORS = {"near": ST.NEIGHBOR, "around": ST.RANGE, "others": ST.AGENT_RANGE}


def messages(agents):
    """Turns in which all agents tell all others where they are, against dicts that are put into lists."""

    def make(turns=20):
        ctx = context()
        fill(ctx.graph.graph, 30)

        def strategy(state):
            state["outbox"].append({"channel": "radio", "to": None, "body": [state["turn"], state["curr_pos"]]})
            state["action"] = state["curr_pos"]

        for i in range(agents):
            ctx.agent.create_agent(f"a_{i}", start_node_id=i, strategy=strategy)
        ctx.game.add_channel("radio", range_m=1e6, loss=0.1)

        def ours():
            ctx.game.run(turns)
            return turns * agents * (agents - 1)

        def floor():
            for turn in range(turns):
                inboxes = {f"a_{i}": [] for i in range(agents)}
                for sender in inboxes:
                    message = {"channel": "radio", "sender": sender, "to": None, "turn": turn, "overheard": False}
                    for receiver, inbox in inboxes.items():
                        if receiver != sender and random.random() >= 0.1:
                            inbox.append({**message, "body": [turn, 0]})
            return turns * agents * (agents - 1)

        return ours, floor

    return make


def ready_city(seen, starts):
    """The same game where the answers are ready: what is near a node by node, who is near an agent by step."""
    near = {node: data["near"] for node, data in seen}
    around = {node: data["around"] for node, data in seen}
    others = [data["others"] for _, data in seen]

    def floor():
        strategy = paper_strategy(random.Random(1).choice)
        here, before, last = list(starts), list(starts), [None] * len(starts)
        for step, seen_there in enumerate(others):
            i = step % len(starts)
            node = here[i]
            sensed = {
                "near": (ST.NEIGHBOR, list(near[node])),
                "around": (ST.RANGE, {key: value.copy() for key, value in around[node].items()}),
                "others": (ST.AGENT_RANGE, seen_there.copy()),
            }
            state = {"curr_pos": node, "sensor": sensed}
            strategy(state)
            before[i], here[i] = node, state["action"]
            last[i] = state
        return len(others)

    return floor


def start_up():
    """Import in a fresh interpreter, against importing NumPy alone."""

    def imported(module):
        def run():
            code = f"import time; t = time.process_time(); import {module}; print(time.process_time() - t)"
            runs = [
                subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
                for _ in "12345"
            ]
            return Spent(sorted(float(run.stdout) for run in runs)[2])

        return run

    return imported("gamms"), imported("numpy")


def helsinki():
    """The shipped map at 10 m into a context, against plain dicts of the same nodes and edges."""
    import gamms.osm

    def ours():
        ctx = context()
        gamms.osm.helsinki(ctx)
        ctx.terminate()
        return 1

    ctx = context()
    gamms.osm.helsinki(ctx)
    nodes = [ctx.graph.graph.get_node(id) for id in ctx.graph.graph.get_nodes()]
    edges = [ctx.graph.graph.get_edge(id) for id in ctx.graph.graph.get_edges()]

    def floor():
        {node.id: tuple(node) for node in nodes}
        {edge.id: (edge.source, edge.target, edge.length, list(edge.points)) for edge in edges}
        return 1

    return ours, floor


def near_paths(side=300, pairs=100):
    """Paths between nodes at most 300 m apart, new ones each round, against Dijkstra by hand on a dict."""
    ctx = context()
    fill(ctx.graph.graph, side)
    nodes, edges = grid(side)
    leaving = {id: [] for id, _, _ in nodes}
    for _, u, v, length in edges:
        leaving[u].append((v, length))
    rng, batch = random.Random(3), []

    def draw():
        batch.clear()
        for source in rng.sample(list(leaving), pairs):
            x, y = ctx.graph.graph.get_node(source)[1:3]
            batch.append((source, rng.choice(list(ctx.graph.graph.get_nodes(300.0, x, y)))))

    draw()
    ctx.graph.shortest_path(*batch[0])

    def ours():
        for source, target in batch:
            ctx.graph.shortest_path(source, target)
        return pairs

    def floor():
        for source, target in batch:
            path_by_hand(leaving, source, target)
        draw()
        return pairs

    return ours, floor


def path_by_hand(leaving, source, target):
    """Return the shortest path, by Dijkstra's algorithm as a textbook has it."""
    far, before, heap = {source: 0.0}, {}, [(0.0, source)]
    while heap:
        gone, node = heappop(heap)
        if node == target:
            break
        if gone > far[node]:
            continue
        for other, length in leaving[node]:
            if gone + length < far.get(other, math.inf):
                far[other], before[other] = gone + length, node
                heappush(heap, (gone + length, other))
    path = [target]
    while path[-1] != source:
        path.append(before[path[-1]])
    return path[::-1]


def agent_look_after_a_move(agents=10_000, kind=ST.AGENT, **keywords):
    """AGENT looks between moves of one agent, against copying the dict that they give."""
    ctx = context()
    fill(ctx.graph.graph, 100)
    rng = random.Random(3)
    for i in range(agents):
        ctx.agent.create_agent(f"a_{i}", start_node_id=rng.randrange(10_000))
    sensor, mover = ctx.sensor.create_sensor("x", kind, **keywords), ctx.agent.get_agent("a_7")
    sensor.sense(0)
    ready = sensor.data

    def ours():
        for node in range(20):
            mover.current_node_id = node
            sensor.sense(0)
        return 20

    def floor():
        for _ in range(20):
            ready.copy()
        return 20

    return ours, floor


def near_in_a_straight_line(agents=2000, limit=5.0):
    """Contacts of two teams by distance, against cells in plain Python."""
    from gamms.rules import contacts

    ctx = context()
    fill(ctx.graph.graph, 150)
    rng = random.Random(3)
    places = {f"a_{i}": rng.randrange(150 * 150) for i in range(agents)}
    for i, (name, node) in enumerate(places.items()):
        ctx.agent.create_agent(name, start_node_id=node, team=i % 2)
    xy = {id: (x, y) for id, x, y in grid(150)[0]}

    def ours():
        contacts(ctx, 0, 1, euclid=limit)
        return agents

    def floor():
        by_cells(
            [xy[node] for node in list(places.values())[::2]], [xy[node] for node in list(places.values())[1::2]], limit
        )
        return agents

    return ours, floor


def by_cells(ours, theirs, limit):
    """Return the pairs of places that are within a distance."""
    cells, square = {}, limit * limit
    for u, v in theirs:
        cells.setdefault((u // limit, v // limit), []).append((u, v))
    around = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
    return [
        (x, y, u, v)
        for x, y in ours
        for dx, dy in around
        for u, v in cells.get((x // limit + dx, y // limit + dy), ())
        if (u - x) * (u - x) + (v - y) * (v - y) <= square
    ]


def lattice(n, **options):
    """A context with an n x n grid, made of arrays."""
    import numpy as np

    ctx, ids = context(**options), np.arange(n * n).reshape(n, n)
    ends = (
        np.concatenate([ids[:, :-1].ravel(), ids[:-1].ravel()]),
        np.concatenate([ids[:, 1:].ravel(), ids[1:].ravel()]),
    )
    y, x = np.indices((n, n)) * 10.0
    ctx.graph.add_nodes(ids.ravel(), x.ravel(), y.ravel())
    ctx.graph.add_edges(np.arange(2 * len(ends[0])), np.concatenate(ends), np.concatenate(ends[::-1]))
    return ctx


def neighborhoods_beyond_what_is_kept(side=700):
    """Neighbourhoods of random nodes of a large graph, against slices of two lists of ints."""
    ctx = lattice(side)
    near, rng = ctx.graph.graph.neighborhoods, random.Random(3)
    for node in range(side * side):
        near[node]
    starts, ids = [0], []
    for node in range(side * side):
        ids += near[node]
        starts.append(len(ids))
    nodes = []

    def ours():
        nodes[:] = [rng.randrange(side * side) for _ in range(50_000)]
        for node in nodes:
            near[node]
        return len(nodes)

    def floor():
        nodes[:] = [rng.randrange(side * side) for _ in range(50_000)]
        for node in nodes:
            tuple(ids[starts[node] : starts[node + 1]])
        return len(nodes)

    return ours, floor


def views_from_many_places(side=200, views=15_000):
    """RANGE looks from many places in turn, against copies of ready dicts and lists."""
    ctx = lattice(side)
    sensor = ctx.sensor.create_sensor("x", ST.RANGE, sensor_range=50.0)
    nodes = random.Random(3).sample(range(side * side), views)
    ready = []
    for node in nodes[:2000]:
        sensor.sense(node)
        ready.append(sensor.data)

    def ours():
        for node in nodes:
            sensor.sense(node)
        return views

    def floor():
        for data in ready:
            {key: value.copy() for key, value in data.items()}
        return len(ready)

    return ours, floor


def looks_of_many(agents=10_000, side=316, turns=5):
    """Turns of agents with RANGE sensors, most of which come to places that are not remembered, against `within`."""
    ctx, rng = lattice(side), random.Random(7)
    graph, choice = ctx.graph.graph, rng.choice

    def walk(state):
        state["action"] = choice(state["legal"])

    for i in range(agents):
        eyes = ctx.sensor.create_sensor(f"eyes_{i}", ST.RANGE, sensor_range=50.0)
        ctx.agent.create_agent(f"a_{i}", start_node_id=rng.randrange(side * side), sensors=[eyes], strategy=walk)
    fresh = iter(rng.sample(range(side * side), side * side))

    def ours():
        ctx.game.run(turns)
        return turns * agents

    def floor(looks=2000):
        for node in islice(fresh, looks):
            graph.within(node, 50.0)
        return looks

    return ours, floor


def open_map(side=300):
    """A saved map with bends and attributes into a context, against inflating its ends, places and lengths."""
    import zlib

    ctx = lattice(side)
    graph = ctx.graph.graph
    for id in range(0, 2 * side * (side - 1), 7):
        line = [(0, 0), (id, 5.0), (10.0, 0)]
        graph.update_edge({"id": id, "linestring": line, "name": f"street {id % 999}", "lanes": "2"})
    packed, other = ctx.graph.storage.pack(), context()
    columns = graph.columns()
    body = zlib.compress(b"".join(getattr(columns, name).tobytes() for name in ("xy", "sources", "targets", "lengths")))

    def ours():
        other.graph.storage.unpack(packed)
        return 1

    def floor():
        zlib.decompress(body)
        return 1

    return ours, floor


def recorded_states(turns=500):
    """States of a recording one after the other, against copying what ten agents have in lists."""
    import io

    import gamms

    ctx, file, rng = context(), io.BytesIO(), random.Random(3)
    fill(ctx.graph.graph, 20)

    def walk(state):
        state["action"] = rng.choice(state["legal"])

    for i in range(10):
        ctx.agent.create_agent(f"a_{i}", start_node_id=i, strategy=walk)
    ctx.record.start(file)
    ctx.game.run(turns)
    ctx.record.stop()
    file.seek(0)
    recording = gamms.recorder.open(file)
    columns = [list(range(10)) for _ in range(10)]

    def ours():
        return sum(1 for _ in recording)

    def floor():
        for _ in range(turns):
            [column.copy() for column in columns]
        return turns

    return ours, floor
