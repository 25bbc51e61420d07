"""Measure GAMMS against floors: what bare Python or NumPy needs for the same result. `make bench` runs it.

    python benchmarks/run.py                     # every case, with its ratio to its floor
    python benchmarks/run.py --peer OTHER/python # and against an earlier release that another Python has

`catalog.py` lists the cases. Each takes turns with its floor in a process of its own; the figures are medians over
rounds, the ratio is the median of the ratios by round, with the least and the greatest. The clock is CPU time.
`upstream.py` compares with 1.0.0.
"""

import argparse
import gc
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from worlds import Spent


def measure(case, rounds):
    """Seconds per operation of the case and of its floor, one pair per round."""
    work, floor = case.make()
    for once in (work, floor):  # the first time of each is not counted
        once()
    return [(_timed(work), _timed(floor)) for _ in range(rounds)]


def _timed(fn):
    gc.collect()  # so that none pays for what the other has left
    started = time.process_time()
    done = fn()
    return float(done) if isinstance(done, Spent) else (time.process_time() - started) / done


def run_here(names, rounds):
    """One line of JSON per case, each from a process of its own: what others leave in memory slows games by a tenth."""
    import catalog  # here, for it loads all that is measured

    for case in catalog.CASES:
        if not names or any(name in case.name for name in names):
            command = [sys.executable, __file__, "--case", case.name, "--rounds", str(rounds)]
            subprocess.run(command, check=True)


def run_case(name, rounds):
    """One line of JSON for the case of this name."""
    import catalog

    (case,) = (case for case in catalog.CASES if case.name == name)
    try:
        pairs = measure(case, rounds)
    except Exception as error:  # noqa: BLE001 - a peer may lack a feature; the others are still of interest
        print(json.dumps({"name": case.name, "error": f"{type(error).__name__}: {error}"[:100]}), flush=True)
        return
    ratios = sorted(work / floor for work, floor in pairs)
    record = {
        "name": case.name,
        "unit": case.unit,
        "against": case.floor,
        "aim": case.aim,
        "seconds": statistics.median(work for work, _ in pairs),
        "floor": statistics.median(floor for _, floor in pairs),
        "ratio": statistics.median(ratios),
        "least": ratios[0],
        "greatest": ratios[-1],
    }
    print(json.dumps(record), flush=True)


def run_in(python, arguments):
    """The same in the environment of another Python, which must not find our package."""
    command = [python, __file__, "--json", *arguments]
    paths = {key: value for key, value in os.environ.items() if key != "PYTHONPATH" or python == sys.executable}
    output = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=paths).stdout
    return {record["name"]: record for record in map(json.loads, output.splitlines())}


def main():
    """Parse, run, print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="run only cases whose name contains one of these")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--peer", help="the Python of another environment with a package named gamms")
    parser.add_argument("--json", action="store_true", help="one JSON object per case instead of a table")
    parser.add_argument("--case", help="run the case of this name, in this process, as --json does")
    options = parser.parse_args()
    if options.case:
        run_case(options.case, options.rounds)
        return
    if options.json:
        run_here(options.names, options.rounds)
        return
    arguments = [*options.names, "--rounds", str(options.rounds)]
    ours = run_in(sys.executable, arguments)
    theirs = run_in(options.peer, arguments) if options.peer else {}
    print(f"{'case':44}{'ours':>12}{'floor':>12}{'ratio to floor':>24}{'peer / ours':>14}")
    for name, record in ours.items():
        if "error" in record:
            print(f"{name:44}  {record['error']}")
            continue
        ratio = f"{record['ratio']:.2f} [{record['least']:.2f}, {record['greatest']:.2f}]"
        peer = theirs.get(name, {})
        against = f"{peer['seconds'] / record['seconds']:.1f}x" if "seconds" in peer else ""
        print(f"{name:44}{shown(record['seconds']):>12}{shown(record['floor']):>12}{ratio:>24}{against:>14}")


def shown(seconds):
    """Return a time with the unit that fits it."""
    for scale, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "us")):
        if seconds * scale >= 1.0:
            return f"{seconds * scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


if __name__ == "__main__":
    main()
