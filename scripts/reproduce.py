"""Measure again what `benchmarks/results.md` says, and leave the raw data: `make reproduce`.

    python scripts/reproduce.py                          # into reproduced/, in under 30 minutes
    python scripts/reproduce.py --only cases --rounds 5  # one part of it
    python scripts/reproduce.py --peer OTHER/python      # and against the gamms 1.0.0 that another Python has

Each part is a file of JSON with the command, how long it took, its exit status, and what it printed: records where the
program writes JSON, else lines. `machine.json` says on what, `summary.json` which ratios are out of their tolerance.
Ratios of CPU time are compared with those in `benchmarks/results`; times of single machines are not. `--expect` puts
the data of this run there, and writes the page of it.
"""

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import time
from importlib.metadata import distributions
from pathlib import Path

import results_page

ROOT = Path(__file__).resolve().parents[1]
TOLERANCE = 1.5  # a ratio may be so many times the expected one: a busy machine adds as much
TOTAL_S = 28 * 60
PARTS = {  # what is run -> its command
    "laws": [
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "tests/batch/test_laws.py",
        "tests/release/test_counts.py",
    ],
    "games": ["-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/docs/test_docs.py", "-k", "example"],
    "planning": ["benchmarks/planning.py", "speed"],
    "values": ["benchmarks/solve.py"],
    "spectators": ["benchmarks/spectators.py", "100", "{rounds}"],
    "pages": ["benchmarks/viewer.py"],
    "cases": ["benchmarks/run.py", "--json", "--rounds", "{rounds}"],
}


def main() -> int:
    """Run the parts; return 1 if one has failed or a ratio is out of its tolerance."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "reproduced")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--peer", help="the Python of an environment with gamms 1.0.0")
    parser.add_argument("--expect", action="store_true", help="make the data of this run those to be expected")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    _write(options.out / "machine.json", machine())
    began, summary = time.monotonic(), {}
    for part in options.only:
        command = [one.format(rounds=options.rounds) for one in PARTS[part]]
        summary[part] = _run(command, options.out / f"{part}.json", TOTAL_S - (time.monotonic() - began))
        print(f"{part:12} {summary[part]}", flush=True)
    if options.peer:
        command = ["benchmarks/run.py", "--rounds", "1", "--peer", options.peer, "paper's loop", "sense"]
        summary["peer"] = _run(command, options.out / "peer.json", TOTAL_S - (time.monotonic() - began))
    if "cases" in options.only:
        summary["ratios"] = _ratios(options.out / "cases.json")
        print(f"{'ratios':12} {summary['ratios']}")
    _write(options.out / "summary.json", summary)
    if options.expect:
        _expect(options.out)
    return int(any(said != "done" for said in summary.values()))


def machine() -> dict[str, object]:
    """Return what the figures were taken on."""
    cpu = Path("/proc/cpuinfo")
    models = [line for line in cpu.read_text().splitlines() if "model name" in line] if cpu.exists() else []
    commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    return {
        "processor": models[0].partition(":")[2].strip() if models else platform.processor(),
        "cores": os.cpu_count(),
        "load": os.getloadavg() if hasattr(os, "getloadavg") else None,
        "system": platform.platform(),
        "python": platform.python_version(),
        "commit": commit.stdout.strip() or None,
        "libraries": {one.name: one.version for one in sorted(distributions(), key=lambda one: one.name.lower())},
    }


def _run(command: list[str], file: Path, left_s: float) -> str:
    """Run a program, write what it printed, and say how it ended."""
    began = time.monotonic()
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "SDL_VIDEODRIVER": "dummy"}
    with file.with_suffix(".txt").open("w+", encoding="utf-8") as printed:
        try:
            status = subprocess.run(
                [sys.executable, *command],
                cwd=ROOT,
                env=environment,
                stdout=printed,
                timeout=max(1.0, left_s),
                check=False,
            ).returncode
        except subprocess.TimeoutExpired:
            status = None
        printed.seek(0)
        lines = printed.read().splitlines()
    file.with_suffix(".txt").unlink()
    _write(
        file,
        {
            "command": " ".join(["python", *command]),
            "seconds": round(time.monotonic() - began, 1),
            "status": status,
            "output": [json.loads(line) if line.startswith("{") else line for line in lines],
        },
    )
    if status is None:
        return "out of time: the rest was not measured"
    return "done" if status == 0 else f"failed with status {status}: see {file.name}"


def _ratios(file: Path) -> str:
    """Compare the ratios of a run with those to be expected."""
    found = _ratios_of(file)
    expected = _ratios_of(results_page.RESULTS / file.name)
    worse = [
        f"{name}: {ratio:.3g} instead of {expected[name]:.3g}"
        for name, ratio in found.items()
        if name in expected and ratio > TOLERANCE * expected[name]
    ]
    return "; ".join(worse) or ("done" if found else "no cases were measured")


def _ratios_of(file: Path) -> dict[str, float]:
    records = json.loads(file.read_text(encoding="utf-8"))["output"] if file.exists() else []
    return {one["name"]: one["ratio"] for one in records if "ratio" in one}


def _expect(out: Path) -> None:
    """Make the data of a run those to be expected, and write the page of them."""
    results_page.RESULTS.mkdir(exist_ok=True)
    for file in out.glob("*.json"):
        shutil.copyfile(file, results_page.RESULTS / file.name)
    results_page.PAGE.write_text(results_page.page(), encoding="utf-8")


def _write(file: Path, value: object) -> None:
    file.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
