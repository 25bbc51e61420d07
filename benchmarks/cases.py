"""What is measured, and against which floor. `make()` returns two functions that return how many operations they did.

Frequent: one call. Targeted: one behaviour. Scenario: a whole game.
"""

import random
import subprocess
import sys
from typing import NamedTuple

from films import Spent, film

import gamms

SPACING = 10.0
ST = gamms.sensor.SensorType


class Case(NamedTuple):
    """One line of the table."""

    name: str
    unit: str
    make: object


# -- worlds -----------------------------------------------------------------------------------------------------


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


def context():
    """A quiet context in memory."""
    return gamms.create_context(graph_engine=gamms.graph.Engine.MEMORY, logger_config={"level": "CRITICAL"})


def paper_strategy(choice):
    """The strategy printed in the paper."""

    def strategy(state):
        for sensor_type, data in state["sensor"].values():
            if sensor_type == ST.NEIGHBOR:
                state["action"] = data[choice(range(len(data)))]
                break

    return strategy


# -- cases ------------------------------------------------------------------------------------------------------


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
        sensor = ctx.sensor.create_sensor("x", kind, sensor_range=50.0, fov=2.5)
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


CITY_SENSORS = {"near": ST.NEIGHBOR, "around": ST.RANGE, "others": ST.AGENT_RANGE}


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


def quiet_pygame():
    """The library, without a display and without its greeting."""
    import os

    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame

    return pygame


def big_map():
    """A window that nobody sees, on 99,224 edges and ten agents."""
    size = {"width": 1280, "height": 720, "simulation_time_constant": 0.5}
    ctx = gamms.create_context(
        graph_engine=gamms.graph.Engine.MEMORY,
        vis_engine=gamms.visual.Engine.PYGAME,
        vis_kwargs=size,
        logger_config={"level": "CRITICAL"},
    )
    fill(ctx.graph.graph, 158)
    ctx.visual.set_graph_visual(width=1980, height=1080)
    rng = random.Random(1)
    for i in range(10):
        ctx.agent.create_agent(f"a{i}", start_node_id=rng.randrange(158 * 158))
        ctx.visual.set_agent_visual(f"a{i}", color=(255, 0, 0), size=5)
    return ctx


def first_frame():
    """The first frame of a window, against drawing each street once."""
    import time

    pygame = quiet_pygame()

    def ours():
        ctx = big_map()
        began = time.process_time()
        ctx.visual.update()
        spent = time.process_time() - began
        ctx.terminate()
        return Spent(spent)

    places, streets = [], []
    for _, x, y in grid(158)[0]:
        places.append((x * 0.4 + 300.0, y * 0.4 + 40.0))
    for _, source, target, _ in grid(158)[1][::2]:
        streets.append((places[source], places[target]))

    def floor():
        surface, line = pygame.Surface((1280, 720)), pygame.draw.aaline
        began = time.process_time()
        for begin, end in streets:
            line(surface, (120, 120, 120), begin, end)
        return Spent(time.process_time() - began)

    return ours, floor


def zoom():
    """The 99th percentile of frames while the camera goes in and out, against making one picture larger."""
    import time

    pygame = quiet_pygame()
    ctx = big_map()
    ctx.visual.update()
    view = ctx.visual._render_manager
    size, steps = view.camera_size, 200

    def slowest(frame):
        spent = []
        for step in range(steps):
            began = time.process_time()
            frame(step)
            spent.append(time.process_time() - began)
        return Spent(sorted(spent)[int(0.99 * (steps - 1))])

    def zoomed(step):
        view.camera_size = size * (0.25 + 0.75 * abs(step % 100 / 50 - 1))
        ctx.visual.update()

    picture = pygame.Surface((1100, 620), 0, 32)
    return lambda: slowest(zoomed), lambda: slowest(lambda _: pygame.transform.smoothscale(picture, (1280, 720)))


CASES = [
    Case("frequent: sense RANGE 50 m again", "sense", sense(ST.RANGE, 100, again=True)),
    Case("frequent: sense ARC 50 m again", "sense", sense(ST.ARC, 100, again=True)),
    Case("targeted: sense RANGE first, 20x20 grid", "sense", sense(ST.RANGE, 20)),
    Case("targeted: sense RANGE first, 100x100 grid", "sense", sense(ST.RANGE, 100)),
    Case("targeted: sense RANGE first, 300x300 grid", "sense", sense(ST.RANGE, 300)),
    Case("targeted: sense AGENT among 1,000", "sense", sense(ST.AGENT, 100, again=True, agents=1000)),
    Case("targeted: sense AGENT_RANGE among 1,000", "sense", sense(ST.AGENT_RANGE, 100, again=True, agents=1000)),
    Case("targeted: build a 100x100 grid one by one", "item", build),
    Case("targeted: import", "process", start_up),
    Case("scenario: the paper's loop, 10 agents", "agent-step", loop(10)),
    Case("scenario: the paper's loop, 1,000 agents", "agent-step", loop(1000)),
    Case("scenario: the paper's loop, 10,000 agents", "agent-step", loop(10000)),
    Case("scenario: 1,000 agents look around in Helsinki", "agent-step", crowded_city),
    Case("scenario: turns of 1,000 agents", "agent-step", turns()),
    Case("scenario: turns of 1,000 agents, capacity 1", "agent-step", turns(capacity=1)),
    Case("scenario: load Helsinki at 10 m", "map", helsinki),
    Case("scenario: film Helsinki, 1280 x 720", "frame", film),
    Case("scenario: window, first of 100,000 edges", "frame", first_frame),
    Case("scenario: window, zoom, 99th percentile", "frame", zoom),
]
