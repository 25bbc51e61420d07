"""Games of the demo in an experiment on two workers, against the same games alone in one process."""

import os
import tempfile
import time
from pathlib import Path

from worlds import Spent


def of_demo(games=8):
    """Games of the demo on two workers with files, against `play(seed)` of each; CPU time, with that of the workers.

    The workers have begun and have loaded the map: 1,000 games pay that once. It needs Linux, which says in /proc what
    processes have spent.
    """
    from gamms import demo, experiment, scenario
    from gamms.workers import WorkerPool

    game, workers = scenario.load(demo.FILE), WorkerPool(2)
    game.build(seed=0).terminate()  # with the map
    seeds = iter(range(1, 1_000_000))

    def played(number):
        chosen = [next(seeds) for _ in range(number)]
        with tempfile.TemporaryDirectory() as out:
            experiment.run(game, chosen, executor=workers, workers=2, out=out)

    def ours():
        before = time.process_time() + _spent_by_children()
        played(games)
        return Spent((time.process_time() + _spent_by_children() - before) / games)

    floor_seeds = iter(range(5, 1_000_000))  # the same games

    def floor():
        begin = time.process_time()
        for _ in range(games):
            game.play(next(floor_seeds))
        return Spent((time.process_time() - begin) / games)

    played(4)
    return ours, floor


def _spent_by_children():
    """Return the seconds of CPU of the processes that this one has begun, and that live."""
    numbers = [one for task in Path("/proc/self/task").iterdir() for one in (task / "children").read_text().split()]
    stats = [Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split() for number in numbers]
    return sum(int(one[11]) + int(one[12]) for one in stats) / os.sysconf("SC_CLK_TCK")
