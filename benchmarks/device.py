"""Measure batches in arrays of PyTorch: agent-steps a second by device and number of games, beside NumPy.

    python benchmarks/device.py --device cuda          # 4,096 to 65,536 games; needs pip install ".[torch]"
    python benchmarks/device.py --device cpu --games 1024 16384 --threads 1

Games are of 5 against 5 on Helsinki. `walk` has a time limit alone, in `tag` red tags blue, in `policy` red goes where
tensors say that were made of what `observe` gives, in `chase` red goes after the blue that it sees within 200 m. NumPy
and PyTorch take turns in one process; the figures are medians of wall time, and `reads` are how many arrays the host
has read in a turn.
"""

import argparse
import statistics
import time

TURNS = 50
WALK, CHASE = "gamms.strategies:random_walk", "gamms.strategies:chase"
LIMIT = {"rule": "time_limit", "with": {"turns": 10**6}}
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
CASES = {
    "walk": (WALK, [LIMIT]),
    "tag": (WALK, [TAG, LIMIT]),
    "policy": (WALK, [TAG, LIMIT]),
    "chase": (CHASE, [LIMIT]),
}


def scenario_of(name):
    """The scenario of a case."""
    from gamms.scenario import Scenario

    strategy, rules = CASES[name]
    red = {"count": 5, "strategy": strategy}
    sensors = {"near": {"type": "AGENT_RANGE", "sensor_range": 200.0}}
    if name == "chase":
        red["sensors"] = ["near"]
    teams = {"red": red, "blue": {"count": 5, "strategy": WALK}}
    return Scenario(map={"helsinki": {}}, teams=teams, sensors=sensors, rules=rules)


def played(games, name):
    """Play some turns."""
    for _ in range(TURNS):
        if name == "policy":
            view = games.observe("red")
            games.step({"red": (view.node + view.turn[:, None]) % view.counts})
        else:
            games.step()


def timed(games, name, wait):
    """Agent-steps a second."""
    wait()
    started = time.perf_counter()
    played(games, name)
    wait()
    return len(games) * 10 * TURNS / (time.perf_counter() - started)


def main():
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--games", type=int, nargs="+", default=[4096, 16384, 65536])
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=list(CASES))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, help="of PyTorch on the CPU")
    options = parser.parse_args()
    import torch

    if options.threads:
        torch.set_num_threads(options.threads)
    wait = torch.cuda.synchronize if options.device.startswith("cuda") else (lambda: None)
    print(f"torch {torch.__version__}, {options.device}, {torch.get_num_threads()} threads of the CPU")
    print(f"{'case':8}{'games':>8}{'numpy /s':>14}{'torch /s':>14}{'ratio':>8}{'reads':>8}")
    for name in options.cases:
        for number in options.games:
            scenario = scenario_of(name)
            with scenario.batch(number) as plain, scenario.batch(number, xp=torch, device=options.device) as there:
                for games in (plain, there):  # the first turns make tables
                    played(games, name)
                before = there.library.num_reads
                pairs = [(timed(plain, name, wait), timed(there, name, wait)) for _ in range(options.rounds)]
                reads = (there.library.num_reads - before) / (TURNS * options.rounds)
                ours, theirs = (statistics.median(column) for column in zip(*pairs, strict=True))
                ratio = statistics.median(b / a for a, b in pairs)
                print(f"{name:8}{number:8}{ours:14,.0f}{theirs:14,.0f}{ratio:8.2f}{reads:8.1f}", flush=True)


if __name__ == "__main__":
    main()
