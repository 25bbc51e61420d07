"""Writes `benchmarks/results.md`, and the table of `benchmarks/README.md`, from the raw data of `make reproduce`."""

import json
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "benchmarks" / "results.md"

sys.path.insert(0, str(ROOT / "benchmarks"))
from run import shown  # noqa: E402 - it lies beside the cases, which are no package

FRONT = ROOT / "benchmarks" / "README.md"
_TABLE = re.compile(r"(?<=<!-- table -->\n).*?(?=<!-- end of the table -->)", re.DOTALL)
# A row of the table: what is played, the row of `peers.json` or `upstream.json`, and the case whose floor is shown.
_KEYS, _VECTORS = "scenario: turns of {} agents, ten keys", "scenario: 4,096 games of two pursuers, vectors in a batch"
_COMPARED = (
    ("1,000 agents walk, one Python function each", "Mesa", _KEYS.format("1,000")),
    ("2 agents walk, one Python function each", "Mesa, two agents", None),
    ("10,000 agents walk, one function in arrays", "mesa-frames", "teams: random walk of 100,000, one stream"),
    ("8 chase 30 on a grid", "PettingZoo", None),
    ("64 agents with all around them in dicts", "POGEMA", None),
    ("64 agents with all around them in arrays", "POGEMA, a team in arrays", None),
    ("64 games of 64 agents, in a batch", "POGEMA, in batch", None),
    ("1,024 games of tag, in a batch, observed", "VMAS", _VECTORS),
    ("the same game of tag, beside a compiled loop", "JaxMARL", _VECTORS),
    ("1,000 agents drive by the second", "SUMO", None),
    ("the value of a game of two turns", "OpenSpiel", None),
    ("distances to 90,000 nodes", "SciPy", None),
    ("the paper's loop, 1,000 agents", "the paper's loop, 1,000 agents", "scenario: the paper's loop, 1,000 agents"),
)

_GROUPS = {
    "frequent": "One call",
    "targeted": "One behaviour",
    "scenario": "Games",
    "teams": "Teams of up to a million agents",
    "learning": "Learning",
    "experiments": "Experiments",
}
_HEAD = "| case | a … | ours | floor: | takes | ours / floor | aim |\n|---|---|---|---|---|---|---|"
_TABLES = {"upstream": "## Against gamms 1.0.0", "peers": "## Beside other simulators", "sizes": "## Single things"}
_ENGINES = ("SQLITE", "MEMORY")
_INTRODUCTION = """# Results

Written by `make reproduce` (`scripts/reproduce.py --expect`) from [its raw data](results). Each case takes turns with
its floor in a process of its own, by CPU time: medians, and the median of the ratios by round with the least and the
greatest. [Benchmarks](README.md) says more."""


def page(results: Path = RESULTS) -> str:
    """Return the page of a folder with raw data, in Markdown."""
    machine = _read(results / "machine.json")
    records = [one for one in _read(results / "cases.json")["output"] if "ratio" in one]
    upstream, peers, sizes = (
        _read(results / f"{name}.json") if (results / f"{name}.json").exists() else None for name in _TABLES
    )
    parts = [_INTRODUCTION, _on(machine), "## Aims that are missed", _missed(records, _records(upstream))]
    parts += ["## Slower than others", _slower(_records(upstream), _records(peers))] if upstream or peers else []
    for group, title in _GROUPS.items():
        rows = [_row(one) for one in records if one["name"].startswith(f"{group}:")]
        parts += [f"## {title}", "\n".join([_HEAD, *rows])] if rows else []
    parts += [_TABLES["upstream"], _against(upstream)] if upstream else []
    parts += [_TABLES["peers"], _beside(peers)] if peers else []
    parts += [_TABLES["sizes"], _alone(sizes)] if sizes else []
    for file in sorted(results.glob("*.json")):
        if file.stem not in {"machine", "cases", "summary", *_TABLES}:
            parts += [f"## {file.stem.capitalize()}", _printed(_read(file))]
    return "\n\n".join(parts) + "\n"


def write_pages() -> None:
    """Write the page of all results, and the table of the page that introduces them."""
    PAGE.write_text(page(), encoding="utf-8")
    FRONT.write_text(_TABLE.sub(lambda _: compare(), FRONT.read_text(encoding="utf-8")), encoding="utf-8")


def compare(results: Path = RESULTS) -> str:
    """Return the table of the front page: a case a row, beside the nearest thing in another library and a floor.

    A peer that was not measured has its reason instead of a figure; a figure of an earlier run has its date.
    """
    parts = [_read(file) for name in ("peers", "upstream") if (file := results / f"{name}.json").exists()]
    peers = {one["name"]: one for part in parts for one in _records(part)}
    floors = {one["name"]: one for one in _read(results / "cases.json")["output"] if "floor" in one}
    lines = ["| case | ours | best peer | floor | ours is |", "|---|---|---|---|---|"]
    for title, name, floor in _COMPARED:
        measured, said = _compared(peers.get(name, {}))
        least = shown(floors[floor]["floor"]) if floor in floors else ""
        lines.append(f"| {title} | {measured} | {least} | {said} |")
    return "\n".join(lines) + "\n"


def _compared(one: dict[str, Any]) -> tuple[str, str]:
    """Return the cells of a peer: our time and its time; and how many times as fast ours is."""
    if "steps" in one:
        ours, theirs, ratio = 1 / one["our_steps"], 1 / one["steps"], one["ratio"]
        peer = f"{one['name'].partition(',')[0]} {one['version']}"
    elif "MEMORY" in one:
        side, peer = one["MEMORY"], "gamms 1.0.0"
        ours, theirs, ratio = side["ours"], side["1.0.0"], side["ratio"]
    else:
        return f"| {one.get('error', 'not measured')}", ""
    dated = f" ({one['date']})" if one.get("date") else ""
    said = f"{_ratio(ratio)} x as fast" if ratio >= 1 else f"**{_ratio(1 / ratio)} x slower**"
    return f"{shown(ours)} | {peer}: {shown(theirs)}{dated}", said


def _read(file: Path) -> Any:
    return json.loads(file.read_text(encoding="utf-8"))


def _on(machine: dict[str, Any]) -> str:
    numpy = machine["libraries"].get("numpy")
    return (
        f"On {machine['cores']} cores ({machine['processor']}), load {machine['load'][0]:.1f} when it began; "
        f"{machine['system']}, Python {machine['python']}, NumPy {numpy}."
    )


def _missed(records: Iterable[dict[str, Any]], upstream: list[dict[str, Any]]) -> str:
    rows = [one for one in records if one["aim"] is not None and one["ratio"] > one["aim"]]
    lines = [f"* {_name(one)}: {_ratio(one['ratio'])} of {one['against']}, aim {_ratio(one['aim'])}" for one in rows]
    lines += [
        f"* {one['name']}: {_ratio(one[engine]['ratio'])} of the speed of 1.0.0 with {engine}, aim {aim}"
        for one in upstream
        for engine, aim in zip(_ENGINES, one["aims"], strict=True)
        if aim and engine in one and one[engine]["ratio"] < aim
    ]
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


def _records(part: dict[str, Any] | None) -> list[dict[str, Any]]:
    """Return the rows of a part that was run, without what says what was run."""
    return [one for one in part["output"] if isinstance(one, dict) and "name" in one] if part else []


def _slower(upstream: list[dict[str, Any]], peers: list[dict[str, Any]]) -> str:
    """Say where we are slower than 1.0.0 or another simulator."""
    lines = [
        f"* {one['name']}: {_ratio(one[engine]['ratio'])} of the speed of 1.0.0 with {engine}"
        for one in upstream
        for engine in _ENGINES
        if one.get(engine, {}).get("ratio", 1) < 1
    ]
    lines += [f"* {one['name']}: {_ratio(one['ratio'])} of its speed" for one in peers if one.get("ratio", 1) < 1]
    return "\n".join(lines) or "Nowhere in what was measured."


def _against(part: dict[str, Any]) -> str:
    """Return the table of rows of programs that 1.0.0 has run, too."""
    told = next(one for one in part["output"] if isinstance(one, dict) and "1.0.0" in one and "name" not in one)
    versions = ", ".join(f"{name} {number}" for name, number in told["1.0.0"].items())
    head = ["what", "a …", "1.0.0, SQLITE", "MEMORY", "ours", *(f"faster than {one}, aim" for one in _ENGINES)]
    rows = [head, ["---"] * len(head)]
    for one in _records(part):
        sides = [one.get(engine) for engine in _ENGINES]
        unit, _, of = one["unit"].partition(" ")
        show = shown if unit == "s" else "{:.3g} bytes".format
        times = [show(side["1.0.0"]) if side else "" for side in sides]
        ours = show((sides[1] or sides[0])["ours"])
        ratios = [_faster(side, aim) if side else "" for side, aim in zip(sides, one["aims"], strict=True)]
        rows.append([one["name"], of.removeprefix("an ").removeprefix("a "), *times, ours, *ratios])
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return f"{_made(part)}; PYTHON has {versions}. Ours is the same with both.\n\n{table}"


def _alone(part: dict[str, Any]) -> str:
    """Return the table of figures that are measured against nothing."""
    rows = [f"{_made(part)}.", "", "| | |", "|---|---|"]
    for one in _records(part):
        figure = shown(one["value"]) if one["unit"] == "s" else f"{one['value']:,.3g} {one['unit']}"
        rows.append(f"| {one['name']} | {figure} |")
    return "\n".join(rows)


def _made(part: dict[str, Any]) -> str:
    """Say how the data of a part were made."""
    on = f", commit {part['commit'][:8]}, load {part['load'][0]:.1f}" if part.get("commit") and part.get("load") else ""
    return f"`{part['command']}`, {part['seconds']:.0f} s{on}"


def _faster(side: dict[str, Any], aim: float | None) -> str:
    """Return how many times as fast we are, with the least and the greatest, and what was aimed at."""
    ratios = [_ratio(side[name]) for name in ("ratio", "least", "greatest")]
    return f"{ratios[0]} [{ratios[1]}, {ratios[2]}]" + ("" if aim is None else f", {aim:g}")


def _beside(part: dict[str, Any]) -> str:
    """Return the table of other simulators; those that were not measured are named with the reason."""
    rows = [
        "| | what it computes in a step of an agent | steps/s | ours | what ours computes | steps/s | ours / peer |"
    ]
    rows.append("|" + "---|" * 7)
    for one in _records(part):
        if "ratio" not in one:
            rows.append(f"| {one['name']} | {one['error']} | | | | | |")
            continue
        theirs, ours = (f"{float(f'{one[side]:.3g}'):,.0f}" for side in ("steps", "our_steps"))
        measured = f", {one['date']}" if one.get("date") else ""  # apart from the others
        unit = "" if one.get("unit", "agent-step") == "agent-step" else f", a {one['unit']} instead of a step"
        rows.append(
            f"| {one['name']} ({one['version']}{measured}): {one['game']}{unit} | {one['computes']} | {theirs} "
            f"| {one['our_game']} | {one['we_compute']} | {ours} | {_ratio(one['ratio'])} |"
        )
    return f"{_made(part)}. These are not the same games.\n\n" + "\n".join(rows)


def _printed(part: dict[str, Any]) -> str:
    lines = [one if isinstance(one, str) else json.dumps(one) for one in part["output"]]
    return "\n".join([f"{_made(part)}:", "", "```text", *lines, "```"])


if __name__ == "__main__":
    write_pages()
