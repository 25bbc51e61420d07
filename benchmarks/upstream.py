"""Compare with gamms 1.0.0: programs that only use its interface, run by both in turn.

    python benchmarks/upstream.py --peer PYTHON             # one that has gamms==1.0.0; a line of JSON for each row
    python benchmarks/upstream.py --peer PYTHON looks walls --rounds 1

Each program is run in a process of its own by 1.0.0 and by ours, with both graph engines of 1.0.0, and in each round
again; ratios are those of a round, and like engines are compared. The clock is CPU time. Grids are n x n nodes, 10 m
apart, with every street in both directions. The first line says what was run.
"""

import argparse
import gzip
import json
import math
import os
import platform
import random
import statistics
import subprocess
import sys
import tempfile
import time
from importlib.metadata import PackageNotFoundError, version
from itertools import islice
from pathlib import Path

from worlds import SPACING, ST, context, fill, grid, paper_strategy

import gamms

ENGINES, SIDE = ("SQLITE", "MEMORY"), 100
AREA = Path(__file__).parents[1] / "tests" / "osm_online" / "data" / "kluuvi.osm.gz"
OTHERS = (  # sensors of other agents: kind, name of the row, field of view
    ("AGENT", "AGENT", 2 * math.pi),
    ("AGENT", "AGENT of fov 2.5", 2.5),
    ("AGENT_RANGE", "AGENT_RANGE 50 m", 2 * math.pi),
    ("AGENT_ARC", "AGENT_ARC 50 m", 2.5),
)
AIMS = {  # row -> how many times as fast as SQLITE, and as MEMORY, it was to be
    **{f"the paper's loop, {agents} agents": (14, 2) for agents in ("10", "100", "1,000", "10,000")},
    "RANGE 50 m, first look from a node": (150, None),
    "ARC 50 m, first look from a node": (150, None),
    "RANGE 50 m, again": (1000, None),
    "ARC 50 m, again": (1000, None),
    "AGENT among 1,000": (None, 15),
    "AGENT_RANGE 50 m among 1,000": (None, 45),
    "AGENT_ARC 50 m among 1,000": (None, 15),
    "OCCLUDED_MAP 100 m, first look": (50, None),
    "OCCLUDED_AGENT 100 m among 100": (20, None),
    "`import gamms`": (2, 2),
    "streets of a district from XML": (None, 4),
    **{f"recording {agents} agents": (None, 20) for agents in ("10", "100", "1,000")},
    **{f"replay of {agents} agents": (None, 2) for agents in ("10", "100", "1,000")},
    "a frame of a window that pans": (None, 100),
    "the first frame of a window": (None, 10),
}


# -- programs: each yields rows of a name, a unit, and a figure, of which less is better ------------------------------


def build_and_loop(engine):
    """Build a graph one by one, and play the loop of the paper with more and more agents."""
    ctx = context(engine)
    began = time.process_time()
    items = fill(ctx.graph.graph, SIDE)
    yield "build a 100x100 grid one by one", "s an item", (time.process_time() - began) / items
    for agents in (10, 100, 1000, 10_000):
        walkers(ctx, agents, SIDE * SIDE)
        turns = max(1, 10_000 // agents)
        turn(ctx)

        def play(turns=turns):
            for _ in range(turns):
                turn(ctx)

        spent = statistics.median(_timed(play) for _ in range(4))
        yield f"the paper's loop, {agents:,} agents", "s an agent-step", spent / turns / agents
        for agent in list(ctx.agent.create_iter()):
            ctx.agent.delete_agent(agent.name)
    ctx.terminate()


def looks(engine):
    """Look around with each kind of sensor on a graph from networkx, alone and among other agents."""
    ctx, rng = context(engine), random.Random(3)
    yield "… from networkx", "s an item", attach(ctx)
    owner = ctx.agent.create_agent("a_0", start_node_id=0)
    fresh = iter(rng.sample(range(SIDE * SIDE), 400))
    for kind, fov in (("RANGE", 2 * math.pi), ("ARC", 2.5)):
        sensor = _sensor(ctx, owner, ST[kind], fov=fov)
        owner.orientation = (0.6, 0.8)
        first = [_timed(lambda sensor=sensor, node=node: sensor.sense(node)) for node in islice(fresh, 15)]
        yield f"{kind} 50 m, first look from a node", "s a look", statistics.median(first)
        yield f"{kind} 50 m, again", "s a look", per_call(lambda sensor=sensor: sensor.sense(5050))
    whole = _sensor(ctx, owner, ST["MAP"])
    whole.sense(5050)
    yield "MAP, the whole graph", "s a look", per_call(lambda: whole.sense(5050))
    near, node = _sensor(ctx, owner, ST["NEIGHBOR"]), iter(lambda: rng.randrange(SIDE * SIDE), -1)
    some = list(islice(node, 1000))
    yield "NEIGHBOR", "s a look", per_call(lambda: [near.sense(one) for one in some]) / len(some)
    others = [owner]
    for agents in (10, 1000):
        others += [
            ctx.agent.create_agent(f"a_{i}", start_node_id=rng.randrange(SIDE * SIDE))
            for i in range(len(others), agents)
        ]
        for kind, about, fov in OTHERS:
            sensor = _sensor(ctx, owner, ST[kind], fov=fov)
            yield f"{about} among {agents:,}", "s a look", per_call(lambda sensor=sensor: sensor.sense(5050))

            def moved(sensor=sensor, other=others[-1]):
                other.current_node_id = next(node)
                sensor.sense(5050)

            yield f"… after a move, {about} among {agents:,}", "s a look", per_call(moved)
    ctx.terminate()


def walls(engine):
    """Look around among 10,000 faces of obstacles."""
    ctx, rng, count = context(engine), random.Random(3), 10_000
    attach(ctx)
    given = list(faces(count, SIDE * SPACING))
    began = time.process_time()
    for id, *corners in given:
        ctx.graph.add_obstacle_face(id, **dict(zip(("tr", "tl", "br", "bl"), corners, strict=True)), type=1)
    yield "add 10,000 faces one by one", "s a face", (time.process_time() - began) / count
    for i in range(100):
        ctx.agent.create_agent(f"a_{i}", start_node_id=rng.randrange(SIDE * SIDE))
    owner, fresh = ctx.agent.get_agent("a_0"), iter(rng.sample(range(SIDE * SIDE), 400))
    for kind, name in (
        ("OCCLUDED_MAP", "OCCLUDED_MAP 100 m, first look"),
        ("OCCLUDED_AGENT", "OCCLUDED_AGENT 100 m among 100"),
    ):
        sensor = _sensor(ctx, owner, ST[kind], 100.0)
        first = [_timed(lambda sensor=sensor, node=node: sensor.sense(node)) for node in islice(fresh, 15)]
        yield name, "s a look", statistics.median(first)
        if kind == "OCCLUDED_MAP":
            yield "OCCLUDED_MAP 100 m, again", "s a look", per_call(lambda sensor=sensor: sensor.sense(5050))
    ctx.terminate()


def recordings(engine, side=20):
    """Play with and without a recording, and replay it in another context."""
    for agents in (10, 100, 1000):
        turns, extra = 20_000 // agents, []
        ctx, other = context(engine), context(engine)
        for one in (ctx, other):
            fill(one.graph.graph, side)
            walkers(one, agents, side * side)

        def play(ctx=ctx, turns=turns):
            for _ in range(turns):
                turn(ctx)

        def record(ctx=ctx, play=play):
            play()
            ctx.record.stop()

        play()
        for attempt in range(3):
            path = Path(f"{agents}_{attempt}.ggr")
            ctx.record.start(str(path))  # which writes the map: not an agent-step
            extra.append(_timed(record) - _timed(play))
        yield f"recording {agents:,} agents", "s an agent-step", statistics.median(extra) / turns / agents
        yield f"… bytes of {agents:,} agents", "bytes an agent-step", path.stat().st_size / turns / agents

        def replay(other=other, path=path):
            for _ in other.record.replay(str(path)):
                pass

        yield f"replay of {agents:,} agents", "s an agent-step", _timed(replay) / turns / agents
        ctx.terminate()
        other.terminate()


def starts(engine):
    """Import in a fresh interpreter, and make contexts."""
    for module in ("gamms", "gamms.osm"):
        code = f"import time; t = time.process_time(); import {module}; print(time.process_time() - t)"
        runs = [subprocess.check_output([sys.executable, "-c", code], text=True).splitlines()[-1] for _ in range(3)]
        yield f"`import {module}`", "s", statistics.median(map(float, runs))
    context(engine).terminate()
    made = []
    for _ in range(20):
        began = time.process_time()
        ctx = context(engine)
        made.append(time.process_time() - began)
        ctx.terminate()
    yield "create a context", "s", statistics.median(made)


def streets(engine):
    """Read the streets of a district from XML at 10 m, and put them into a context."""
    import gamms.osm

    Path("district.osm").write_bytes(gzip.decompress(AREA.read_bytes()))
    found = []
    yield (
        "streets of a district from XML",
        "s",
        _timed(lambda: found.append(gamms.osm.graph_from_xml("district.osm", resolution=10.0))),
    )
    ctx = context(engine)
    yield "… into a context", "s", _timed(lambda: ctx.graph.attach_networkx_graph(found[0]))
    ctx.terminate()


def windows(engine, side=158):
    """Draw frames of a window with 99,224 edges."""
    size = {"width": 1280, "height": 720, "simulation_time_constant": 0.5}
    ctx = context(engine, vis_engine=gamms.visual.Engine.PYGAME, vis_kwargs=size)
    fill(ctx.graph.graph, side)
    ctx.visual.set_graph_visual(width=1980, height=1080)
    for i in range(10):
        ctx.agent.create_agent(f"a{i}", start_node_id=i * 2001)
        ctx.visual.set_agent_visual(f"a{i}", color=(255, 0, 0), size=5)
    yield "the first frame of a window", "s a frame", _timed(ctx.visual.update)
    view, span, steps = ctx.visual._render_manager, side * SPACING, iter(range(10**9))
    size = view.camera_size

    def pan():  # across the map and back, 10 pixels a frame
        phase = next(steps) * 20.0 * size / 1280 % (2 * span)
        view.camera_x = phase if phase < span else 2 * span - phase
        ctx.visual.update()

    def zoom():  # in and out by 2 % a frame
        view.camera_size = size * (0.25 + 0.75 * abs(next(steps) % 100 / 50 - 1))
        ctx.visual.update()

    for name, move in (("pans", pan), ("zooms", zoom)):
        yield f"a frame of a window that {name}", "s a frame", per_call(move, at_least=2.0)
    ctx.terminate()


PROGRAMS = {
    program.__name__: program for program in (starts, streets, looks, walls, recordings, build_and_loop, windows)
}
ALIKE = {"streets", "recordings", "windows"}  # what they measure does not depend on the engine: with MEMORY alone


def per_call(call, at_least=0.1):
    """Return the CPU seconds of a call, of as many as take some time together."""
    call()  # the first is not counted
    calls, more, spent = 0, 1, 0.0
    while spent < at_least:
        spent += _timed(lambda times=more: [call() for _ in range(times)])
        calls, more = calls + more, 2 * more
    return spent / calls


def _timed(work):
    began = time.process_time()
    work()
    return time.process_time() - began


def _sensor(ctx, owner, kind, metres=50.0, fov=2 * math.pi):
    """Return a sensor of an agent; all have a name of their own."""
    name = f"x_{kind.name}_{fov}_{len(list(ctx.agent.create_iter()))}"
    sensor = ctx.sensor.create_sensor(name, kind, sensor_range=metres, fov=fov)
    owner.register_sensor(name, sensor)
    return sensor


def attach(ctx):
    """Put a grid of networkx into a context, and return the seconds of it for an item."""
    import networkx as nx

    graph = nx.DiGraph()
    nodes, edges = grid(SIDE)
    graph.add_nodes_from((id, {"x": x, "y": y}) for id, x, y in nodes)
    graph.add_edges_from((u, v, {"id": id, "length": length}) for id, u, v, length in edges)
    return _timed(lambda: ctx.graph.attach_networkx_graph(graph)) / (len(nodes) + len(edges))


def walkers(ctx, agents, nodes):
    """Put agents with a NEIGHBOR sensor into a context, which go by the strategy that the paper prints."""
    rng, strategy = random.Random(7), paper_strategy(random.Random(1).choice)
    for i in range(agents):
        name = f"near_{agents}_{i}"
        ctx.sensor.create_sensor(name, ST.NEIGHBOR)
        agent = ctx.agent.create_agent(f"a_{agents}_{i}", start_node_id=rng.randrange(nodes), sensors=[name])
        agent.register_strategy(strategy)


def turn(ctx):
    """Play a turn as the paper prints it."""
    for agent in ctx.agent.create_iter():
        state = agent.get_state()
        agent.strategy(state)
        agent.set_state()
    ctx.visual.simulate()


def faces(count, extent):
    """Yield ids and corners of walls, 8 m long and 6 m high, anywhere on a map."""
    rng = random.Random(5)
    for id in range(count):
        x, y, angle = rng.uniform(0, extent), rng.uniform(0, extent), rng.uniform(0, 2 * math.pi)
        dx, dy = 4 * math.cos(angle), 4 * math.sin(angle)
        yield id, *((x + side * dx, y + side * dy, z) for z in (6.0, 0.0) for side in (1, -1))


# -- both sides, in turn ----------------------------------------------------------------------------------------------


def one(program, engine):
    """Run a program in this process, and print what it found: a line of JSON for each row."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # 1.0.0 puts its database into the current folder
        for name, unit, figure in PROGRAMS[program](engine):
            print(json.dumps([name, unit, figure]), flush=True)
        os.chdir("/")


def run_in(python, arguments):
    """Run this file by a Python and return the lines of JSON; another Python must not find our package."""
    environment = {**os.environ, "SDL_VIDEODRIVER": "dummy", "SDL_AUDIODRIVER": "dummy"}
    if python != sys.executable:
        environment.pop("PYTHONPATH", None)
    command = [python, __file__, *arguments]
    printed = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=environment).stdout
    return [json.loads(line) for line in printed.splitlines() if line.startswith(("[", "{"))]


def about():
    """Say what is run here."""
    found = {"gamms": getattr(gamms, "__version__", None), "python": platform.python_version()}
    for name in ("gamms", "numpy", "networkx", "shapely", "osmnx", "pygame", "numba"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def compare(name, unit, found):
    """Return the record of a row: medians, and the ratios by round, with the least and the greatest."""
    record = {"name": name, "unit": unit, "aims": AIMS.get(name, (None, None))}
    for engine in ENGINES:
        theirs, ours = found.get(("1.0.0", engine)), found.get(("ours", engine))
        if not theirs or not ours:
            continue
        ratios = sorted(their / our for their, our in zip(theirs, ours, strict=True))
        record[engine] = {
            "1.0.0": statistics.median(theirs),
            "ours": statistics.median(ours),
            "ratio": statistics.median(ratios),
            "least": ratios[0],
            "greatest": ratios[-1],
        }
    return record


def main():
    """Parse, run both in turn, and print records."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="*", help=f"run only these of {', '.join(PROGRAMS)}")
    parser.add_argument("--peer", help="the Python of an environment with gamms 1.0.0")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--one", help=argparse.SUPPRESS)
    parser.add_argument("--engine", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(about())) if options.one == "about" else one(options.one, options.engine)
        return
    if not options.peer or set(options.programs) - set(PROGRAMS):
        parser.error(f"give --peer, the Python of an environment with gamms 1.0.0, and programs of {list(PROGRAMS)}")
    pythons = {"1.0.0": options.peer, "ours": sys.executable}
    print(json.dumps({side: run_in(python, ["--one", "about"])[0] for side, python in pythons.items()}), flush=True)
    for program in options.programs or PROGRAMS:
        rows = {}  # name -> its unit, and the figures of each side, one for each round
        for _ in range(options.rounds):
            for engine in ENGINES[program in ALIKE :]:
                for side, python in pythons.items():
                    for name, unit, figure in run_in(python, ["--one", program, "--engine", engine]):
                        rows.setdefault(name, (unit, {}))[1].setdefault((side, engine), []).append(figure)
        for name, (unit, found) in rows.items():
            print(json.dumps(compare(name, unit, found)), flush=True)


if __name__ == "__main__":
    main()
