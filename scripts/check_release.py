"""Build the distribution, install it into empty environments, and play the games of the README there.

    python scripts/check_release.py                              # no extra, each extra alone, all of them
    python scripts/check_release.py --extras none viz --python python3.12 --python python3.13
    python scripts/check_release.py --oldest                     # the lower bounds of pyproject.toml, exactly
    python scripts/check_release.py --large                      # also extras with libraries of more than 200 MB
    python scripts/check_release.py --extras torch --first torch==2.13.0  # a build that is installed before

The wheel must have a compiled core and the bytes of a second build in another folder, and an editable install of the
unpacked sdist must have a compiled core, too. Each environment also plays a scenario, a batch, an experiment and a
tournament, each under a timeout.
Needs an index or a folder of wheels that pip finds; `build` and `twine` are put into an environment of their own. Where
`uv` is found it installs, else pip. Prints a line for each environment; the exit status is 1 if a check has failed,
or an extra cannot be installed. Interpreters that are not found are named and skipped, unless there is no other.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]
LARGE = {"train", "torch", "torchrl", "onnx", "ray"}
NOT_HERE = {"solve"} if os.name == "nt" else set()  # there are no wheels of OpenSpiel for Windows
FILES = {
    "LICENSE",
    "NOTICE",
    "README.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "MANIFEST.in",
    "Makefile",
    "pyproject.toml",
    "setup.py",
    "tests",
    "docs",
    "src",
    "tools",
}
BIN = "Scripts" if os.name == "nt" else "bin"
FENCE = re.compile(r"^```python([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
IS_COMPILED = "import gamms.core; assert gamms.core.is_compiled, 'the core is interpreted'"
COMMANDS = (
    "gamms demo --no-film --max-turns 40",
    "gamms new hunt",
    "gamms run hunt/hunt.yaml --max-turns 30 --out hunt/first",
    "gamms run hunt/hunt.yaml --max-turns 30 --seeds 0:3 --jobs 2 --out hunt/three",
    "gamms verify hunt/first/game.ggr",
)
_MOST_SECONDS = 300  # for one command: each takes a few seconds
_CONTEXT = "import gamms\nctx = gamms.create_context(seed=1)\nctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))\n"
_HUNT = "import gamms\nhunt = gamms.scenario.load('hunt/hunt.yaml').replace(max_turns=3)\n"
GAMES = {  # the core, many games, and games in other processes
    "the compiled core": IS_COMPILED,
    "a batch": _HUNT + "with hunt.batch(8) as games: games.run()",
    "an experiment": _HUNT + "assert not gamms.experiment.run(hunt, range(4), workers=2).errors()",
    "a tournament": _HUNT
    + "open('walk.py', 'w').write('def walk(state): state[\\'action\\'] = state[\\'legal\\'][0]')\n"
    "entries = dict.fromkeys(['ann', 'bob'], 'walk.py:walk')\n"
    "table = gamms.tournament.run(hunt, entries=entries, seeds=range(1), out='cup')\n"
    "assert not any(row['faults'] for row in table.rows), table.rows",
}
PROBES = {  # what an extra is for; without it, each raises MissingExtra
    "viz": _CONTEXT + "ctx.visual.save('a.png'); ctx.visual.save('a.pdf')",
    "video": _CONTEXT + "with ctx.visual.film('a.mp4'): ctx.game.run(max_turns=2)",
    "notebook": _HUNT + "hunt.play(seed=1).to_pandas('teams')",
    "rl": _HUNT + "gamms.rl.parallel_env(hunt).reset(seed=1)",
    "osm": "import gamms\nopen('a.osm', 'w').write('<osm></osm>')\n"
    "try: gamms.osm.graph_from_xml('a.osm')\nexcept gamms.errors.BadFile: pass",
    "osm-online": "import gamms\ntry: gamms.osm.graph_from_place('Nowhere')\nexcept gamms.errors.NetworkError: pass",
    "llm": "import gamms; gamms.llm.Strategy('http://localhost:1/v1', 'm', 'Go.')",
    "accel": "import gamms; gamms.experiment.statistics.estimate_mean([1.0, 2.0, 4.0])",
    "frames": _CONTEXT + "ctx.graph.frames.to_polars(); ctx.graph.frames.to_igraph()",
    "plot": _HUNT + "gamms.experiment.run(hunt, range(2), {'max_turns': [1, 2]}).plot()",
    "parquet": _HUNT + "import os; gamms.experiment.run(hunt, range(2), out='rows')\n"
    "if not os.path.exists('rows/rows.parquet'): raise gamms.errors.MissingExtra('rows.parquet', 'parquet')",
    "ray": _HUNT + "gamms.experiment.run(hunt, range(2), executor='ray')",
    "ros": "import gamms\ntry: gamms.bridge.rosbridge('ws://127.0.0.1:1', timeout_s=1)\n"
    "except gamms.errors.NetworkError: pass",
    "solve": "import gamms; walk = {'count': 1, 'strategy': 'gamms.strategies:random_walk'}\n"
    "field = {'grid': {'width': 2, 'height': 1}}\n"
    "sides = {'a': walk, 'b': walk}\n"
    "gamms.solve.openspiel(gamms.scenario.Scenario(map=field, max_turns=2, teams=sides), reward='turns')",
    "torch": _HUNT + "try: import torch\nexcept ImportError: raise gamms.errors.MissingExtra('', 'torch') from None\n"
    "with hunt.batch(2) as games: torch.from_dlpack(games.observe('pursuers').vector().values)",
    "torchrl": _HUNT + "gamms.rl.torchrl_env(hunt, num_games=2).rollout(2)",
    "train": _HUNT + "gamms.rl.sb3_env(hunt, num_games=2, team='pursuers').reset()",
    "onnx": "import gamms\ntry: gamms.rl.networks.load_onnx_logits(b'', 'a.onnx')\nexcept gamms.errors.BadFile: pass",
    "web": _HUNT + "with gamms.web.serve(hunt) as live: live.wait()",
}


def main() -> int:
    """Check what is asked for; return the exit status."""
    options = _options()
    with tempfile.TemporaryDirectory(prefix="gamms release ") as name:
        folder = Path(name)
        wheel, failures = _built(folder)
        for python in options.python:
            for extras in _sets(options):
                constraints = _constraints(folder, extras, options.first) if options.oldest else []
                said = _checked(folder / "environment", python, [wheel, *constraints], extras, options.first)
                which = "oldest" if options.oldest else "newest"
                print(f"{Path(python).name:10} {which} {','.join(extras) or 'no extra':40} {said}", flush=True)
                failures += said.startswith("FAILED")
        print(f"{failures} failed" if failures else "all is well")
    return 1 if failures else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", action="append", help="an interpreter, more than once for several; this one")
    parser.add_argument("--extras", nargs="+", choices=["none", "all", *sorted(EXTRAS.keys() - {"dev"})])
    parser.add_argument("--oldest", action="store_true", help="install the lower bounds of pyproject.toml")
    parser.add_argument(
        "--first", nargs="+", default=[], help="requirements to install before, such as a build of torch"
    )
    parser.add_argument("--large", action="store_true", help=f"also {', '.join(sorted(LARGE))}")
    options = parser.parse_args()
    named = options.python or [sys.executable]
    options.python = [python for python in named if shutil.which(python) is not None]
    for python in named:
        if python not in options.python:
            print(f"{python}: not found here, skipped")
    if not options.python:
        parser.error("there is no interpreter to check")
    return options


def _sets(options: argparse.Namespace) -> list[list[str]]:
    """Return the sets of extras to install, each into an environment of its own."""
    single = sorted(EXTRAS.keys() - {"dev"} - (set() if options.large else LARGE) - NOT_HERE)
    wanted = options.extras or ["none", *single, "all"]
    if not options.large and options.extras is None:
        print(f"skipped without --large: {', '.join(sorted(LARGE))}")
    return [[] if one == "none" else single if one == "all" else [one] for one in wanted]


def _built(folder: Path) -> tuple[Path, int]:
    """Build both distributions and look at what is in them; return the wheel and how many checks have failed."""
    tools = _environment(folder / "tools", sys.executable)
    _install(tools, ["build", "twine"])
    out = folder / "dist"
    _run([tools, "-m", "build", "--outdir", out, ROOT], folder)
    [wheel], [source] = out.glob("*.whl"), out.glob("*.tar.gz")
    twine = _run([tools, "-m", "twine", "check", "--strict", wheel, source], folder, check=False)
    with tarfile.open(source) as archive:
        names = {name.split("/", 2)[1] for name in archive.getnames() if "/" in name}
    missing = FILES - names
    with zipfile.ZipFile(wheel) as archive:
        inside = archive.namelist()
    junk = [one for one in inside if not re.match(r"gamms/|gamms_engine-[^/]+\.dist-info/", one)]
    junk += [one for one in inside if one.endswith((".pyc", ".c"))]
    notices = [
        one for one in ("LICENSE", "NOTICE", "ATTRIBUTION.md", "OFL.txt") if not any(one in path for path in inside)
    ]
    problems = [twine.stdout] * (twine.returncode != 0)
    problems += [f"not in the sdist: {sorted(missing)}"] * bool(missing) + [f"junk in the wheel: {junk}"] * bool(junk)
    problems += [f"not in the wheel: {notices}"] * bool(notices)
    if wheel.name.endswith("-py3-none-any.whl"):
        problems.append(f"{wheel.name} has no compiled core: a release has one for each platform")
    problems += _problems_of_sources(folder, tools, source, wheel)
    print(f"{wheel.name} ({wheel.stat().st_size / 1e6:.1f} MB), {source.name} ({source.stat().st_size / 1e6:.1f} MB)")
    print("\n".join(problems) or "twine check: passed; contents: as they should be", flush=True)
    return wheel, len(problems)


def _problems_of_sources(folder: Path, tools: Path, source: Path, wheel: Path) -> list[str]:
    """Build the wheel again from the unpacked sdist, and install that as editable; return what is wrong."""
    with tarfile.open(source) as archive:
        archive.extractall(folder / "sources", filter="data")
    [checkout] = (folder / "sources").iterdir()
    _run([tools, "-m", "build", "--wheel", "--outdir", folder / "again", checkout], folder)
    [again] = (folder / "again").iterdir()
    problems = []
    if again.name != wheel.name or again.read_bytes() != wheel.read_bytes():
        problems.append(f"a second build in another folder gives another wheel, {again.name}")
    inside = _environment(folder / "editable", sys.executable)
    _install(inside, ["-e", checkout])
    done = _run([inside, "-c", IS_COMPILED], folder, check=False)
    if done.returncode:
        problems.append(f"editable: {_last(done.stderr)}")
    return problems


def _checked(folder: Path, python: str, installed: list[str | Path], extras: list[str], first: list[str]) -> str:
    """Install the wheel with some extras into an empty environment, and say what came of the games."""
    shutil.rmtree(folder, ignore_errors=True)
    inside = _environment(folder / "env", python)
    wheel, *constraints = installed
    named = f"{wheel}[{','.join(extras)}]" if extras else str(wheel)
    try:
        if first:
            _install(inside, first)
        _install(inside, [named, *constraints])
    except subprocess.CalledProcessError as error:
        return f"FAILED, cannot be installed: {_last(error.stderr)}"
    games = folder / "games ünd spaces"
    games.mkdir()
    notes = []
    for what, command in _commands(inside, games, extras):
        try:
            done = _run(command, games, check=False, seconds=_MOST_SECONDS)
        except subprocess.TimeoutExpired:
            return f"FAILED {what}: not over after {_MOST_SECONDS} s"
        needed = re.search(r"MissingExtra.*\(extra '([\w-]+)'\): pip install \"", done.stderr)
        if what in PROBES and what not in extras:
            if not needed:
                return f"FAILED {what} does not ask for its extra: {_last(done.stderr) or 'no error'}"
        elif needed and needed[1] not in _with_named(extras):
            notes.append(f"{what} asks for {needed[1]}")
        elif done.returncode:
            return f"FAILED {what}: {_last(done.stderr)}"
    return "; ".join(["passed", *notes])


def _commands(python: Path, games: Path, extras: list[str]) -> list[tuple[str, list[str | Path]]]:
    """Return what is run in an environment: the commands and fences of the README, and what the extras are for."""
    commands: list[tuple[str, list[str | Path]]] = [
        (line, [python.with_name("gamms" + python.suffix), *line.split()[1:]]) for line in COMMANDS
    ]
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for i, (tags, code) in enumerate(FENCE.findall(text)):
        if "no-run" not in tags:
            (games / f"readme{i}.py").write_text(code, encoding="utf-8")
            commands.append((f"README game {i + 1}", [python, f"readme{i}.py"]))
    commands += [(what, [python, "-c", code]) for what, code in GAMES.items()]
    wanted = set(PROBES) if not extras else set(PROBES) & set(extras)
    return [*commands, *((extra, [python, "-c", PROBES[extra]]) for extra in sorted(wanted))]


def _constraints(folder: Path, extras: list[str], first: list[str]) -> list[str | Path]:
    """Write the lower bounds of what is to be installed, and was not installed before, as a file of constraints."""
    lines = PROJECT["dependencies"] + [one for extra in _with_named(extras) for one in EXTRAS[extra]]
    bounds = {match[1]: match[2] for one in lines if (match := re.match(r"([\w-]+)>=([\d.]+)", one))}
    bounds = {name: bound for name, bound in bounds.items() if not any(one.startswith(f"{name}==") for one in first)}
    file = folder / "oldest.txt"
    file.write_text("".join(f"{name}=={bound}\n" for name, bound in bounds.items()), encoding="utf-8")
    return ["--constraint", file]


def _with_named(extras: list[str]) -> list[str]:
    """Return extras, and those that they refer to."""
    found = list(extras)
    for extra in found:
        named = (re.search(r"\[(.*)\]", one) for one in EXTRAS[extra] if one.startswith(PROJECT["name"]))
        found += [one for match in named if match for one in match[1].split(",") if one not in found]
    return found


def _environment(folder: Path, python: str) -> Path:
    """Make an empty environment; return its Python."""
    found = shutil.which(python) or python
    if shutil.which("uv"):
        _run(["uv", "venv", "--python", found, folder], ROOT)
    else:
        _run([found, "-m", "venv", folder], ROOT)
    return folder / BIN / ("python.exe" if os.name == "nt" else "python")


def _install(python: Path, arguments: list[str | Path] | list[str]) -> None:
    tool = ["uv", "pip", "install", "--python", python] if shutil.which("uv") else [python, "-m", "pip", "install"]
    _run([*tool, *arguments], ROOT)


def _run(
    command: list[str | Path], folder: Path, *, check: bool = True, seconds: float | None = None
) -> "subprocess.CompletedProcess[str]":
    """Run a command without what changes Python's path or the form of the core, and end it after `seconds`."""
    ours = ("PYTHON", "VIRTUAL_ENV", "GAMMS_CORE")
    clean = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    return subprocess.run(
        list(map(str, command)),
        cwd=folder,
        env=clean,
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=check,
        timeout=seconds,
    )


def _last(text: str) -> str:
    return (text.strip().splitlines() or [""])[-1][:160]


if __name__ == "__main__":
    sys.exit(main())
