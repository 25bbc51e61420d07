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
    files: dict[str, Path]  # of the copy -> what is copied
    module: str = "strategies"  # what the scenario calls its strategies; the copy calls them `strategies`


_STRATEGIES, _RULES = "strategies.py", "rules.py"
_WHAT = {_STRATEGIES: "how its agents play", _RULES: "its own rules"}
_GAMES = {
    "pursuit": _Game(_DATA / "pursuit.yaml", {_STRATEGIES: _DATA / "pursuit.py.txt"}),
    "capture_the_flag": _Game(
        demo.FILE, {_STRATEGIES: Path(demo.__file__).parent / "strategies.py"}, "gamms.demo.strategies"
    ),
    "competition": _Game(
        _DATA / "competition.yaml",
        {_STRATEGIES: _DATA / "competition.py.txt", _RULES: _DATA / "competition_rules.py.txt"},
    ),
    **{name: _Game(_DATA / f"{name}.yaml", {}) for name in ("grid_tag", "helsinki_pursuit")},  # of shipped strategies
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
    scenario = name / f"{name.name}.yaml"
    text = game.scenario.read_text(encoding="utf-8").replace(f"{game.module}:", "strategies:")
    text = re.sub(r"^name: .*", f'name: "{name.name}"', text, count=1, flags=re.MULTILINE)
    text = text.replace(game.scenario.name, scenario.name)
    name.mkdir(parents=True)
    scenario.write_text(text, encoding="utf-8")
    for file, source_file in game.files.items():
        (name / file).write_bytes(source_file.read_bytes())
    *most, last = [f"{scenario} (the game)", *(f"{name / file} ({_WHAT[file]})" for file in game.files)]
    echo(f"Wrote {', '.join(most)}{' and ' if most else ''}{last}. Go on with\n")
    echo(f"  gamms run {scenario} --out {name / 'first'}\n  gamms run {scenario} --seeds 0:20")
