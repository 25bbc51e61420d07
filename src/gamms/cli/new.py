"""`gamms new`: a folder with a small game, or with a copy of one that comes with GAMMS."""

import re
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from gamms import demo
from gamms.cli.output import echo
from gamms.errors import BadValue, UnknownName

_DATA = demo.FILE.parent


class _Game(NamedTuple):
    scenario: Path
    strategies: Path
    module: str  # what the scenario calls its strategies; the copy calls them `strategies`


_GAMES = {
    "pursuit": _Game(_DATA / "pursuit.yaml", _DATA / "pursuit.py.txt", "strategies"),
    "capture_the_flag": _Game(demo.FILE, Path(demo.__file__).parent / "strategies.py", "gamms.demo.strategies"),
}


def new(
    name: Annotated[Path, typer.Argument(help="The name of the game, and of its folder.", metavar="NAME")],
    source: Annotated[
        str, typer.Option("--from", help=f"The game to begin with: {' or '.join(_GAMES)}.", metavar="GAME")
    ] = "pursuit",
) -> None:
    """Write a small game to begin with: a scenario and strategies."""
    game = _GAMES.get(source)
    if game is None:
        raise UnknownName("game", source, _GAMES)
    if not re.fullmatch(r"\w[\w-]*", name.name):
        raise BadValue(f"{str(name)!r} cannot be the name of a game: use letters, digits, _ and -.")
    if name.exists():
        raise BadValue(f"There is {str(name)!r} already: choose another name, for nothing is written over.")
    scenario, strategies = name / f"{name.name}.yaml", name / "strategies.py"
    text = game.scenario.read_text(encoding="utf-8").replace(f"{game.module}:", "strategies:")
    text = re.sub(r"^name: .*", f'name: "{name.name}"', text, count=1, flags=re.MULTILINE)
    text = text.replace(game.scenario.name, scenario.name)
    name.mkdir(parents=True)
    scenario.write_text(text, encoding="utf-8")
    strategies.write_bytes(game.strategies.read_bytes())
    echo(f"Wrote {scenario} (the game) and {strategies} (how its agents play). Go on with\n")
    echo(f"  gamms run {scenario} --out {name / 'first'}\n  gamms run {scenario} --seeds 0:20")
