"""Measure again what `benchmarks/README.md` and `results.md` say, and leave the raw data: `make reproduce`.

    python scripts/reproduce.py                          # into reproduced/, in under 30 minutes
    python scripts/reproduce.py --only cases --rounds 5  # one part of it
    python scripts/reproduce.py --only upstream --upstream PYTHON   # against gamms 1.0.0, which that Python has
    python scripts/reproduce.py --only peers --peer PYTHON --peer PYTHON   # beside simulators that these have
    python scripts/reproduce.py --only cases upstream peers --upstream PYTHON --peer PYTHON --peer PYTHON --expect
                                                         # the table of benchmarks/README.md, in one run
    python scripts/reproduce.py --only gains large       # parts that take longer, only when asked for

Each part is a file of JSON with the command, how long it took, its exit status, and what it printed: records where the
program writes JSON, else lines; `results.md` is a page of them. `machine.json` says on what, `summary.json` which parts
have failed, and which ratios are out of their tolerance.
Ratios of CPU time are compared with those in `benchmarks/results`; times of single machines are not. `--expect` puts
the data of this run there, but for parts that have failed, and writes the page of it.
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
from typing import Any

import results_page

ROOT = Path(__file__).resolve().parents[1]
TOLERANCE = 1.5  # a ratio may be so many times the expected one: a busy machine adds as much
TOTAL_S = 28 * 60
LONG_S = 90 * 60
PART_S = 8 * 60  # so that no part takes the time of the others; the cases, which are last, take what is left
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
    "sizes": ["benchmarks/sizes.py"],
    "pages": ["benchmarks/viewer.py"],
    "cases": ["benchmarks/run.py", "--json", "--rounds", "{rounds}"],
}
LONGER = {  # what takes long or needs other environments: only when asked for
    "upstream": ["benchmarks/upstream.py", "--rounds", "2"],
    "peers": ["benchmarks/peers.py", "--rounds", "{rounds}"],
    "gains": ["benchmarks/planning.py", "gains"],
    "budgets": ["benchmarks/planning.py", "budget", "--seconds", "0.02", "0.05", "0.2", "--games", "500"],
    "large": ["benchmarks/solve.py", "large"],
    "populations": ["benchmarks/populations.py"],
}


def main() -> int:
    """Run the parts; return 1 if one has failed or a ratio is out of its tolerance."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "reproduced")
    parser.add_argument("--only", nargs="+", choices=[*PARTS, *LONGER], default=list(PARTS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--upstream", help="the Python of an environment with gamms 1.0.0")
    parser.add_argument("--peer", action="append", default=[], help="the Python of an environment with simulators")
    parser.add_argument("--expect", action="store_true", help="make the data of this run those to be expected")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    _write(options.out / "machine.json", machine())
    began, summary = time.monotonic(), {}
    pythons = {"upstream": ["--peer", options.upstream], "peers": [f"--python={one}" for one in options.peer]}
    if "upstream" in options.only and not options.upstream:
        parser.error("give --upstream, the Python of an environment with gamms 1.0.0")
    for part in options.only:
        command = [one.format(rounds=options.rounds) for one in (PARTS | LONGER)[part]]
        left_s = LONG_S if part in LONGER else TOTAL_S - (time.monotonic() - began)
        allowed_s = left_s if part == "cases" or part in LONGER else min(left_s, PART_S)
        summary[part] = _run(command, pythons.get(part, []), options.out / f"{part}.json", allowed_s)
        print(f"{part:12} {summary[part]}", flush=True)
        _write(options.out / "summary.json", summary)
    if "cases" in options.only:
        summary["ratios"] = _ratios(options.out / "cases.json")
        print(f"{'ratios':12} {summary['ratios']}")
        page = options.out / "results.md"
        page.write_text(results_page.page(options.out), encoding="utf-8")
        print(f"{'page':12} {page}")
    _write(options.out / "summary.json", summary)
    if options.expect:
        _expect(options.out, [part for part in options.only if summary[part] == "done"])
    return int(any(said != "done" for said in summary.values()))


def machine() -> dict[str, object]:
    """Return what the figures were taken on."""
    cpu = Path("/proc/cpuinfo")
    models = [line for line in cpu.read_text().splitlines() if "model name" in line] if cpu.exists() else []
    return {
        "processor": models[0].partition(":")[2].strip() if models else platform.processor(),
        "cores": os.cpu_count(),
        "load": _load(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "commit": _commit(),
        "libraries": {one.name: one.version for one in sorted(distributions(), key=lambda one: one.name.lower())},
    }


def _commit() -> str | None:
    found = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    return found.stdout.strip() or None


def _load() -> tuple[float, float, float] | None:
    return os.getloadavg() if hasattr(os, "getloadavg") else None


def _unnamed(arguments: list[str]) -> list[str]:
    """Return arguments with PYTHON for each path."""
    return [
        f"{one.partition('=')[0]}=PYTHON" if "=" in one else one if one.startswith("-") else "PYTHON"
        for one in arguments
    ]


def _run(command: list[str], pythons: list[str], file: Path, left_s: float) -> str:
    """Run a program, write what it printed, and say how it ended; where other Pythons are is not written."""
    began, load = time.monotonic(), _load()
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "SDL_VIDEODRIVER": "dummy"}
    with file.with_suffix(".txt").open("w+", encoding="utf-8") as printed:
        try:
            status = subprocess.run(
                [sys.executable, *command, *pythons],
                cwd=ROOT,
                env=environment,
                stdout=printed,
                stderr=subprocess.STDOUT,
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
            "command": " ".join(["python", *command, *_unnamed(pythons)]),
            "commit": _commit(),
            "load": load,
            "seconds": round(time.monotonic() - began, 1),
            "status": status,
            "output": [_record(line) for line in lines],
        },
    )
    if status is None:
        return f"out of time: the rest was not measured; see {file.name}"
    return "done" if status == 0 else f"failed with status {status}: see {file.name}"


def _record(line: str) -> object:
    """Return the record of a line of JSON, else the line."""
    try:
        return json.loads(line) if line.startswith("{") else line
    except ValueError:
        return line


def _ratios(file: Path) -> str:
    """Compare the ratios of a run with those to be expected, and name the cases that have none."""
    found = _ratios_of(file)
    expected = _ratios_of(results_page.RESULTS / file.name)
    worse = [f"{name}: {error}" for name, error in _ratios_of(file, "error").items()]
    worse += [f"{name}: not measured" for name in expected.keys() - found.keys()] if found else []
    worse += [
        f"{name}: {ratio:.3g} instead of {expected[name]:.3g}"
        for name, ratio in found.items()
        if name in expected and ratio > TOLERANCE * expected[name]
    ]
    if not found:
        worse.append("no cases were measured")
    elif not expected:
        print(f"{'ratios':12} none are expected yet, so that none can be worse: --expect makes these so")
    return "; ".join(worse) or "done"


def _ratios_of(file: Path, field: str = "ratio") -> dict[str, Any]:
    """Return a field of all records that have it, by name."""
    records = json.loads(file.read_text(encoding="utf-8"))["output"] if file.exists() else []
    return {one["name"]: one[field] for one in records if isinstance(one, dict) and "name" in one and field in one}


def _expect(out: Path, parts: list[str]) -> None:
    """Make the data of these parts those to be expected, and write the page of all."""
    results_page.RESULTS.mkdir(exist_ok=True)
    for name in parts if "cases" not in parts else [*parts, "machine"]:
        shutil.copyfile(out / f"{name}.json", results_page.RESULTS / f"{name}.json")
    results_page.write_pages()


def _write(file: Path, value: object) -> None:
    file.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
