"""Writes `benchmarks/results.md` from the raw data of a run of `make reproduce`, so that its tables are that data."""

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "benchmarks" / "results.md"

sys.path.insert(0, str(ROOT / "benchmarks"))
from run import shown  # noqa: E402 - it lies beside the cases, which are no package

_GROUPS = {
    "frequent": "One call",
    "targeted": "One behaviour",
    "scenario": "Games",
    "teams": "Teams of up to a million agents",
    "learning": "Learning",
    "experiments": "Experiments",
}
_HEAD = "| case | a … | ours | floor: | takes | ours / floor | aim |\n|---|---|---|---|---|---|---|"
_INTRODUCTION = """# Results

Written by `make reproduce` (`scripts/reproduce.py --expect`) from [its raw data](results). Each case takes turns with
its floor in one process, by CPU time: medians, and the median of the ratios by round with the least and the greatest.
[Benchmarks](README.md) says more."""


def page(results: Path = RESULTS) -> str:
    """Return the page of a folder with raw data, in Markdown."""
    machine = _read(results / "machine.json")
    records = [one for one in _read(results / "cases.json")["output"] if "ratio" in one]
    parts = [_INTRODUCTION, _on(machine), "## Aims that are missed", _missed(records)]
    for group, title in _GROUPS.items():
        rows = [_row(one) for one in records if one["name"].startswith(f"{group}:")]
        parts += [f"## {title}", "\n".join([_HEAD, *rows])] if rows else []
    for file in sorted(results.glob("*.json")):
        if file.stem not in {"machine", "cases", "summary"}:
            parts += [f"## {file.stem.capitalize()}", _printed(_read(file))]
    return "\n\n".join(parts) + "\n"


def _read(file: Path) -> Any:
    return json.loads(file.read_text(encoding="utf-8"))


def _on(machine: dict[str, Any]) -> str:
    numpy = machine["libraries"].get("numpy")
    return (
        f"On {machine['cores']} cores ({machine['processor']}), load {machine['load'][0]:.1f} when it began; "
        f"{machine['system']}, Python {machine['python']}, NumPy {numpy}."
    )


def _missed(records: Iterable[dict[str, Any]]) -> str:
    rows = [one for one in records if one["aim"] is not None and one["ratio"] > one["aim"]]
    lines = [f"* {_name(one)}: {_ratio(one['ratio'])} of {one['against']}, aim {_ratio(one['aim'])}" for one in rows]
    return "\n".join(lines) or "None of those that have one."


def _row(one: dict[str, Any]) -> str:
    spread = f"{_ratio(one['ratio'])} [{_ratio(one['least'])}, {_ratio(one['greatest'])}]"
    aim = "" if one["aim"] is None else _ratio(one["aim"])
    times = f"{shown(one['seconds'])} | {one['against']} | {shown(one['floor'])}"
    return f"| {_name(one)} | {one['unit']} | {times} | {spread} | {aim} |"


def _name(one: dict[str, Any]) -> str:
    return str(one["name"].partition(": ")[2])


def _ratio(ratio: float) -> str:
    """Return a ratio that can be read: one over a number where it is small."""
    if ratio < 0.2:
        return f"1 / {1 / ratio:.3g}"
    return f"{ratio:.3g}" if ratio < 100 else f"{ratio:.0f}"


def _printed(part: dict[str, Any]) -> str:
    lines = [one if isinstance(one, str) else json.dumps(one) for one in part["output"]]
    return "\n".join([f"`{part['command']}`, {part['seconds']:.0f} s:", "", "```text", *lines, "```"])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
