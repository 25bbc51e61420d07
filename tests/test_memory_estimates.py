"""Estimates of memory, by which calls are refused, are within a factor of two of the memory that the calls take.

Each call is made at two sizes, and the growth is compared, so that fixed costs do not count. Memory of Python and NumPy
is measured by tracemalloc, and that of other libraries as the memory of a process.
"""

import ctypes
import gc
import json
import math
import subprocess
import sys
import tempfile
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import gamms
import gamms.osm
from gamms import experiment
from gamms.errors import TooLarge
from gamms.graph.networkx_bridge import Grid
from gamms.graph.tracks import read_gpx
from gamms.ir import packing
from gamms.ir.tables import make_table
from gamms.limits import MemoryBudget, allowing
from gamms.solve import pursuit
from gamms.strategies import random_walk

Call = Callable[[], object]
QUIET = {"level": "CRITICAL"}
FACTOR = 2.0


class Growth(NamedTuple):
    """The growth of the estimate and of the used memory from a small to a large call, bytes."""

    estimated: float
    used: float


def estimate_of(call: Call) -> float:
    """Return the bytes by which a call is refused."""
    try:
        with allowing(1):
            call()
    except Exception as error:
        cause: BaseException | None = error
        while not isinstance(cause, TooLarge) and cause is not None:
            cause = cause.__cause__
        if cause is None or cause.estimated is None:
            raise
        return cause.estimated
    raise AssertionError("no estimate is compared with the limit")


def traced(call: Call) -> int:
    """Return the most bytes that Python and NumPy hold during a call."""
    gc.freeze()  # or collections during the call would look through what all tests before have left
    tracemalloc.start()
    with allowing("64G"):
        result = call()
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del result
    return most


def resident(call: Call) -> int:
    """Return the most bytes that this process holds more during a call; Linux only."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")  # resets the maximum
    before = memory_of_process("VmRSS")
    with allowing("64G"):
        result = call()
    most = memory_of_process("VmHWM")
    del result
    return most - before


def memory_of_process(name: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) << 10 for line in lines if line.startswith(name))


def growth(make: Callable[[int], Call], sizes: tuple[int, int], measure: Callable[[Call], int] = traced) -> Growth:
    calls = [make(size) for size in sizes]
    with allowing("64G"):
        calls[0]()  # makes what is made once
    estimates = [estimate_of(call) for call in calls]
    found = [measure(call) for call in calls]
    return Growth(estimates[1] - estimates[0], found[1] - found[0])


def assert_near(found: Growth) -> None:
    assert found.used / FACTOR <= found.estimated <= found.used * FACTOR, found.estimated / found.used


# -- games and maps in Python and NumPy ---------------------------------------------------------------------------


def game(agents: int, speed: float | None = None, turns: int = 20, **settings: object) -> gamms.context.Context:
    ctx = gamms.create_context(seed=1, logger_config=QUIET, **settings)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(8, 8))
    for number in range(agents):
        team = ("red", "blue")[number % 2]
        ctx.agent.create_agent(f"a{number}", start_node_id=number % 64, team=team, speed=speed, strategy=random_walk)
    ctx.game.add(gamms.rules.time_limit(turns))
    return ctx


def played(ctx: gamms.context.Context, games: int, **options: object) -> Call:
    def call() -> object:
        batch = ctx.game.batch(games, **options)
        batch.run()
        return batch

    return call


def attached_grid(size: int) -> Call:
    def call() -> object:
        ctx = gamms.create_context(logger_config=QUIET)
        ctx.graph.attach_networkx_graph(gamms.graph.grid(size, size))
        return ctx

    return call


def played_grid(size: int) -> Call:
    def call() -> object:
        ctx = gamms.create_context(seed=1, logger_config=QUIET)
        ctx.graph.attach_networkx_graph(Grid(size, size))
        ctx.agent.create_agent("a", start_node_id=0, team="red", strategy=random_walk)
        ctx.game.add(gamms.rules.time_limit(2))
        return ctx, played(ctx, 2)()

    return call


def geojson(lines: int) -> Call:
    file = Path(tempfile.mkdtemp()) / "lines.geojson"
    places = [[[24.0 + 1e-4 * line, 60.0 + 1e-4 * step] for step in range(10)] for line in range(lines)]
    features = [
        {
            "type": "Feature",
            "properties": {"name": f"street {line}", "maxspeed": "50"},
            "geometry": {"type": "LineString", "coordinates": place},
        }
        for line, place in enumerate(places)
    ]
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return lambda: gamms.osm.graph_from_geojson(file, 1e5, retain_all=True)


def gpx(points: int) -> Call:
    file = Path(tempfile.mkdtemp()) / "track.gpx"
    fixes = "".join(f'<trkpt lat="60.{point:06}" lon="24.9"/>' for point in range(points))
    head = '<gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>'
    file.write_text(f"{head}{fixes}</trkseg></trk></gpx>")
    return lambda: read_gpx(file)


def sample(points: int) -> Call:
    return lambda: experiment.sample({f"k{number}": (0.0, 1.0) for number in range(4)}, points, method="random")


def table(rows: int) -> Call:
    given = [{f"column_{row % 40}": row} for row in range(rows)]
    return lambda: make_table(given)


def chased(size: int) -> Call:
    streets = gamms.graph.grid(size, size)
    return lambda: pursuit(streets, pursuers=2)


BY_METRES = {"game": {"speed_unit": "metres"}}
CASES: dict[str, tuple[Callable[[int], Call], tuple[int, int]]] = {
    "a grid of networkx": (attached_grid, (15, 40)),
    "a grid with games": (played_grid, (40, 100)),
    "games of a batch": (lambda games: played(game(10), games), (200, 800)),
    "games by metres": (lambda games: played(game(10, 12.0, **BY_METRES), games), (100, 400)),
    "agents of a batch": (lambda agents: played(game(agents), 2), (50, 200)),
    "reserved names": (lambda names: played(game(2), 1, most_agents={"red": names}), (200, 800)),
    "a GeoJSON file": (geojson, (200, 800)),
    "a GPX file": (gpx, (2_000, 8_000)),
    "a sample": (sample, (500, 2_000)),
    "a table with gaps": (table, (500, 2_000)),
    "a pursuit": (chased, (10, 14)),
}


@pytest.mark.parametrize(("make", "sizes"), CASES.values(), ids=CASES)
def test_an_estimate_is_near_the_memory_that_is_used(make, sizes):
    assert_near(growth(make, sizes))


# -- recordings ---------------------------------------------------------------------------------------------------


def least_allowance(call: Call) -> float:
    """Return the least limit under which a call that counts while it works is not refused, to five per cent."""
    low = 1.0
    high = 1e9
    while high / low > 1.05:
        middle = math.sqrt(low * high)
        try:
            with allowing(int(middle)):
                call()
        except TooLarge:
            low = middle
        else:
            high = middle
    return high


@pytest.mark.parametrize(
    ("suffix", "smaller", "larger"),
    [
        (".csv", {"agents": 20}, {"agents": 80}),
        (".csv", {"agents": 20}, {"agents": 20, "turns": 80}),
        (".gpx", {"agents": 20}, {"agents": 20, "turns": 80}),
    ],
)
def test_the_estimate_of_tracks_is_near_the_memory_that_is_used(tmp_path, suffix, smaller, larger):
    allowances = []
    used = []
    for number, size in enumerate((smaller, larger)):
        file = tmp_path / f"{number}.ggr"
        ctx = game(**size)
        ctx.graph.graph.crs = "EPSG:32635"
        ctx.game.run(record=file)
        with gamms.recorder.open(file) as recording:

            def call(recording=recording):
                return recording.export(tmp_path / f"tracks{suffix}")

            call()  # makes what is made once
            used.append(traced(call))
            allowances.append(least_allowance(call))
    assert_near(Growth(allowances[1] - allowances[0], used[1] - used[0]))


VALUES: dict[str, Callable[[int], object]] = {
    "numbers": lambda count: [number / 7.0 for number in range(count)],
    "names": lambda count: [f"agent_{number}" for number in range(count)],
    "states": lambda count: [{"x": number / 7.0, "y": number, "name": f"a{number}"} for number in range(count)],
    "a dict": lambda count: {f"key_{number}": number / 7.0 for number in range(count)},
    "an array": lambda count: np.random.default_rng(1).random(count),
}


@pytest.mark.parametrize("make", VALUES.values(), ids=VALUES)
def test_the_memory_that_a_recorded_value_is_charged_is_near_the_memory_that_is_used(make):
    charged = []
    used = []
    for count in (2_000, 8_000):
        data = packing.pack(make(count), "a value")
        budget = MemoryBudget(1 << 30, "it")
        used.append(traced(lambda data=data, budget=budget: packing.unpack(data, packing.Decoder(budget))))
        charged.append(budget.total - budget.left)
    assert_near(Growth(charged[1] - charged[0], used[1] - used[0]))


# -- maps of OpenStreetMap, pictures and films, in a process of their own --------------------------------------------


def city(side: int) -> Path:
    """Write a street grid whose nodes are a little out of line."""
    nodes = [
        f'<node id="{row * side + column + 1}" lat="{60 + 9e-4 * row + 1e-4 * math.sin(column):.6f}" '
        f'lon="{24 + 18e-4 * column + 2e-4 * math.sin(row):.6f}"/>'
        for row in range(side)
        for column in range(side)
    ]
    tags = {"highway": "residential", "name": "Main street", "maxspeed": "50", "lanes": "2"}
    inside = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())
    lines = [range(row * side, row * side + side) for row in range(side)]
    lines += [range(column, side * side, side) for column in range(side)]
    ways = [
        f'<way id="{way}">{"".join(f"<nd ref={chr(34)}{node + 1}{chr(34)}/>" for node in line)}{inside}</way>'
        for way, line in enumerate(lines, 1)
    ]
    file = Path(tempfile.mkdtemp()) / "city.osm"
    file.write_text(f'<osm version="0.6">{"".join(nodes)}{"".join(ways)}</osm>')
    return file


def attached_city(side: int) -> Call:
    file = city(side)

    def call() -> object:
        ctx = gamms.create_context(logger_config=QUIET)
        graph = gamms.osm.graph_from_file(file, 10.0)
        ctx.graph.attach_networkx_graph(graph)
        return ctx, graph

    return call


def filled_city(side: int) -> Call:
    file = city(side)
    graphs = [gamms.osm.graph_from_file(file, 10.0) for _ in range(3)]
    return lambda: list(graphs.pop() if len(graphs) > 1 else graphs[0])


def picture(size: int) -> Call:
    ctx = game(2)
    file = Path(tempfile.mkdtemp()) / "picture.png"
    return lambda: ctx.visual.save(file, width=size, height=size)


def frame(size: int) -> Call:
    ctx = game(2)
    return lambda: ctx.visual.frame(size, size)


def film(suffix: str) -> Callable[[int], Call]:
    def make(size: int) -> Call:
        ctx = game(2)
        file = Path(tempfile.mkdtemp()) / f"film{suffix}"

        def call() -> None:
            with ctx.visual.film(file, width=size, height=size):
                for _ in range(3):
                    ctx.game.step()

        return call

    return make


IN_A_PROCESS: dict[str, tuple[Callable[[int], Call], tuple[int, int]]] = {
    "a city": (attached_city, (20, 40)),
    "a city in dicts of networkx": (filled_city, (15, 30)),
    "a picture": (picture, (400, 1000)),
    "a frame": (frame, (400, 1000)),
    "an MP4 film": (film(".mp4"), (320, 800)),
    "a GIF film": (film(".gif"), (200, 500)),
}


@pytest.mark.skipif(sys.platform != "linux", reason="the memory of a process is read from /proc")
def test_estimates_for_other_libraries_are_near_the_memory_of_the_process():
    run = subprocess.run([sys.executable, __file__], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    found = json.loads(run.stdout.splitlines()[-1])
    assert found.keys() == IN_A_PROCESS.keys()
    for name, (estimated, used) in found.items():
        assert used / FACTOR <= estimated <= used * FACTOR, (name, estimated / used)


if __name__ == "__main__":
    sys.stdout.write(json.dumps({name: growth(*case, resident) for name, case in IN_A_PROCESS.items()}))
