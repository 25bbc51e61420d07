"""Games of the demo in an experiment on two workers, against the same games alone in one process."""

import tempfile
import time

from worlds import Spent


def of_demo(games=40):
    """Games of the demo on two workers with files, against `play(seed)` of each; CPU time, with that of the workers.

    Two processes that start and load the map are paid once: of 1,000 games they are a 25th of what they are of 40.
    """
    import os

    from gamms import demo, experiment, scenario

    game = scenario.load(demo.FILE)
    game.build(seed=0).terminate()  # with the map
    seeds = iter(range(1, 1_000_000))

    def ours():
        before, chosen = os.times(), [next(seeds) for _ in range(games)]
        with tempfile.TemporaryDirectory() as out:
            experiment.run(game, chosen, workers=2, out=out)
        after = os.times()
        spent = sum(
            after[part] - before[part] for part in range(4)
        )  # user and system, of this process and its children
        return Spent(spent / games)

    floor_seeds = iter(range(1, 1_000_000))

    def floor():
        begin = time.process_time()
        for _ in range(games):
            game.play(next(floor_seeds))
        return Spent((time.process_time() - begin) / games)

    return ours, floor
