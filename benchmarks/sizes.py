"""How long single things take, and how much memory: what a user waits for once, or pays in each turn.

    python benchmarks/sizes.py            # all, each in a process of its own; a line of JSON for each figure
    python benchmarks/sizes.py sight

Times are those of the CPU, but for films and the table of sight, at which several threads or processes work: those that
pass. Memory is the most that the process has had.
"""

import argparse
import json
import os
import random
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import teams
from pictures import quiet_pygame
from worlds import context, fill

import gamms
from gamms.ir.packing import Decoder
from gamms.limits import MemoryBudget
from gamms.recorder.formats import blocks


def million():
    """A team of a million agents on a million nodes, which the program moves, then a plan of arrays."""
    ctx, made = teams.lattice(1000), []
    yield "create a million agents", *spent(lambda: made.append(ctx.agent.create_team("red", np.arange(1_000_000))))
    (team,) = made
    team.random_actions()
    yield "their random_actions()", *spent(team.random_actions, times=3)
    nodes = team.random_actions()
    yield "their move(…)", *spent(lambda: team.move(nodes), times=3)
    ctx.game.step()
    yield "a turn in which they have neither a strategy nor sensors", *spent(ctx.game.step, times=5)
    ctx.game.command("red", teams.by_keys, arrays=True)
    yield "the first turn of a million agents", *spent(ctx.game.step)
    yield "a later turn", *spent(ctx.game.step, times=5)
    yield "memory, a million agents on a million nodes", memory(), "MB"


def graphs():
    """A grid of a million nodes from arrays; a look, a path of 300 m, and its file."""
    found = []
    yield "a grid of 1,000,000 nodes from arrays", *spent(lambda: found.append(teams.lattice(1000)))
    ctx, nodes = found[0], iter(random.Random(1).sample(range(1_000_000), 100))
    sensor = ctx.sensor.create_sensor("near", "RANGE", sensor_range=50.0)
    yield "the first look in it, RANGE 50 m", *spent(lambda: sensor.sense(next(nodes)))
    yield "later looks at new places", *spent(lambda: sensor.sense(next(nodes)), times=50)
    yield "the first path of 300 m", *spent(lambda: ctx.graph.shortest_path(500_500, 500_530))
    ends = iter([(node, node + 30) for node in random.Random(2).sample(range(1_000_000), 30) if node % 1000 < 970])
    yield "later paths of 300 m", *spent(lambda: ctx.graph.shortest_path(*next(ends)), times=20)
    yield "save it", *spent(lambda: ctx.graph.save("grid.gamms"))
    yield "its file", Path("grid.gamms").stat().st_size / 2**20, "MB"
    yield "memory of all this", memory(), "MB"


def snapshots():
    """Snapshots and forks of a game of ten agents with two sensors each, after 200 turns on Helsinki."""
    ctx = context()
    gamms.osm.helsinki(ctx)
    nodes = list(ctx.graph.graph.get_nodes())
    for i in range(10):
        near = ctx.sensor.create_sensor(f"near_{i}", "NEIGHBOR")
        far = ctx.sensor.create_sensor(f"far_{i}", "AGENT_RANGE", sensor_range=100.0)
        agent = ctx.agent.create_agent(f"a_{i}", start_node_id=nodes[i * 700], sensors=[near, far])
        agent.register_strategy(gamms.strategies.random_walk)
    ctx.game.run(200)
    yield "snapshot() and restore(), 10 agents", *spent(lambda: ctx.game.restore(ctx.game.snapshot()), times=100)
    yield "a fork, 10 agents", *spent(lambda: ctx.game.fork(1), times=20)


def walks():
    """What moves take in recordings of random walks, without the map and keyframes: at most 0.4 bytes were the aim."""
    for agents, side, turns in ((100_000, 316, 64), (1_000_000, 1000, 4)):
        ctx = teams.lattice(side)
        ctx.agent.create_team("red", np.arange(agents) % (side * side))
        ctx.game.command("red", teams.by_stream, arrays=True)
        ctx.record.start("walk.ggr", overwrite=True)
        for _ in range(turns):
            ctx.game.step()
        ctx.record.stop()
        with Path("walk.ggr").open("rb") as stream:
            found = blocks.read_contents(blocks.BlockSource(stream), Decoder(MemoryBudget(1 << 26, "it"))).found
        size = sum(block.size for block in found if block.type == blocks.TURNS)
        yield f"a move in the recording of a random walk of {agents:,}", size / turns / agents, "bytes"


def sight():
    """What is visible in Helsinki within 250 m: 8,651 nodes, 3,606 faces."""
    ctx = context()
    gamms.osm.helsinki(ctx, buildings=True)
    nodes = iter(random.Random(1).sample(list(ctx.graph.graph.get_nodes()), 200))
    sensor = ctx.sensor.create_sensor("eyes", "OCCLUDED_MAP", sensor_range=250.0)
    sensor.sense(next(nodes))
    yield "OCCLUDED_MAP 250 m on demand, new places", *spent(lambda: sensor.sense(next(nodes)), times=50)
    began = time.perf_counter()
    ctx.graph.visibility(250.0, path="seen.table")
    yield "its table is made, by the clock", time.perf_counter() - began, "s"


def crowds():
    """Frames of a window that pans over teams that walk at random, and of films of them, 1280 x 720."""
    quiet_pygame()
    for agents in (1_000, 10_000):
        ctx = crowd(agents, gamms.visual.Engine.PYGAME)
        ctx.visual.update()
        view, frames = ctx.visual._render_manager, []
        for frame in range(200):
            if frame % 5 == 0:
                ctx.game.step()
            view.camera_x += 2.0
            frames.append(spent(ctx.visual.update)[0])
        yield f"a frame of a window that pans over {agents:,} agents that move", statistics.median(frames), "s"
        yield "… 99 % of the frames", statistics.quantiles(frames, n=100)[-1], "s"
        ctx.terminate()
    for agents in (1_000, 10_000, 100_000):
        with crowd(agents) as ctx:
            began, options = time.perf_counter(), {"width": 1280, "height": 720, "frames_per_turn": 5}
            with ctx.visual.film(f"{agents}.mp4", **options) as film:
                ctx.game.run(max_turns=10)
            yield f"a frame of a film of {agents:,}, by the clock", (time.perf_counter() - began) / film.frames, "s"


def crowd(agents, vis_engine=gamms.visual.Engine.NO_VIS):
    """Return the context of a team that walks at random on 10,000 nodes."""
    size = {"width": 1280, "height": 720} if vis_engine is gamms.visual.Engine.PYGAME else None
    ctx = context(vis_engine=vis_engine, vis_kwargs=size, seed=1)
    fill(ctx.graph.graph, 100)
    ctx.agent.create_team("red", np.random.default_rng(1).integers(0, 10_000, agents))
    ctx.game.command("red", teams.by_keys, arrays=True)
    return ctx


PROGRAMS = {program.__name__: program for program in (million, graphs, snapshots, walks, sight, crowds)}


def spent(work, times=1):
    """Return the median of the CPU seconds of some calls, and their unit."""
    found = []
    for _ in range(times):
        began = time.process_time()
        work()
        found.append(time.process_time() - began)
    return statistics.median(found), "s"


def memory():
    """Return the most memory that this process has had, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main():
    """Run each program in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="*", help=f"some of {', '.join(PROGRAMS)}")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    for program in options.programs or PROGRAMS:
        if not options.here:
            subprocess.run([sys.executable, __file__, "--here", program], check=True)
            continue
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            for name, value, unit in PROGRAMS[program]():
                print(json.dumps({"name": name, "value": value, "unit": unit}), flush=True)
            os.chdir("/")


if __name__ == "__main__":
    main()
