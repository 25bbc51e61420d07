"""Follow the pages about TorchRL, BenchMARL, RLlib and OpenSpiel in empty environments: install, train, and compare.

    python scripts/check_neighbors.py                     # all pages: some minutes each, and gigabytes of PyTorch
    python scripts/check_neighbors.py rllib openspiel     # these
    python scripts/check_neighbors.py --refresh torchrl   # also write what was printed into the page

The commands are those of the page. A program has learned if each trained team wins more often against a random walk
than a random walk does, with intervals that do not overlap; CFR has if its exploitability fell to a tenth. The exit
status is 1 if a command has failed or a program has not learned.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import pages

PAGES = {name: pages.DOCS / "howto" / f"{name}.md" for name in ("torchrl", "benchmarl", "rllib", "openspiel")}
_COMMANDS = re.compile(r"^```bash\n(.*?)^```\n\n```text\n(.*?)^```", re.MULTILINE | re.DOTALL)
_ROW = re.compile(
    r"^(random walk|trained) +(random walk|trained) +wins\.taggers .* ([\d.]+) +([\d.]+) +([\d.]+)$", re.MULTILINE
)
_GAP = re.compile(r"exploitability ([\d.]+)")
_MOST_SECONDS = 3600  # for one command: most time goes into downloads


def main() -> int:
    """Follow the pages that are asked for; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", choices=[*PAGES, []], metavar="PAGE", help=f"of {', '.join(PAGES)}; all")
    parser.add_argument("--refresh", action="store_true", help="write what programs print into the pages")
    options = parser.parse_args()
    failures = 0
    for name in options.pages or PAGES:
        try:
            printed = follow(PAGES[name])
        except subprocess.SubprocessError as error:
            print(f"{name}: FAILED, {error}", flush=True)
            failures += 1
            continue
        print(printed, flush=True)
        has_learned = is_better(printed)
        print(f"{name}: {'passed' if has_learned else 'FAILED, nothing was learned'}", flush=True)
        failures += not has_learned
        if options.refresh and has_learned:
            text = PAGES[name].read_text(encoding="utf-8")
            start, end = _COMMANDS.search(text).span(2)
            PAGES[name].write_text(text[:start] + printed + text[end:], encoding="utf-8")
    return 1 if failures else 0


def follow(page: Path) -> str:
    """Run the commands of a page in an empty environment; return what the last one, its program, prints."""
    *installs, program = commands_of(page)
    with tempfile.TemporaryDirectory(prefix="gamms neighbors ") as folder:
        environment = Path(folder) / "env"
        subprocess.run([sys.executable, "-m", "venv", environment], check=True)
        inside = environment / ("Scripts" if os.name == "nt" else "bin")
        variables = {key: value for key, value in os.environ.items() if key not in {"PYTHONPATH", "VIRTUAL_ENV"}}
        variables["PATH"] = f"{inside}{os.pathsep}{os.environ['PATH']}"
        variables["RL_LOGGING_LEVEL"] = "WARNING"  # of TorchRL, which writes to the output
        given = {"shell": True, "env": variables, "cwd": pages.ROOT, "timeout": _MOST_SECONDS}
        for command in installs:
            subprocess.run(f"{command} --quiet", check=True, **given)
        return subprocess.run(program, check=True, **given, stdout=subprocess.PIPE, encoding="utf-8").stdout


def commands_of(page: Path) -> list[str]:
    """Return the commands of a page, of which the last runs its program."""
    return _COMMANDS.search(page.read_text(encoding="utf-8"))[1].splitlines()


def is_better(printed: str) -> bool:
    """Return whether a program has learned, by what it prints."""
    gaps = [float(one) for one in _GAP.findall(printed)]
    if gaps:
        return gaps[-1] <= gaps[0] / 10
    wins = {(taggers, runners): (float(low), float(high)) for taggers, runners, _, low, high in _ROW.findall(printed)}
    low, high = wins["random walk", "random walk"]
    return wins["trained", "random walk"][0] > high and wins["random walk", "trained"][1] < low


if __name__ == "__main__":
    sys.exit(main())
