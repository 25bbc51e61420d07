"""`gamms new`: a folder with a copy of a game that comes with GAMMS."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gamms.cli.output import RECORDING, echo
from gamms.errors import BadValue
from gamms.folders import make_folder, write_whole

if TYPE_CHECKING:
    from gamms.scenario import Scenario

_DEMO = "gamms.demo.strategies"  # the module of the demo's strategies in its scenario
_WHAT = {"strategies": "its strategies and other code", "rules": "its own rules", "board": "its map and own rules"}


def new(
    name: Annotated[Path, typer.Argument(help="The name of the game, and of its folder.", metavar="NAME")],
    source: Annotated[
        str, typer.Option("--from", help="The game to begin with: one of `gamms gallery`.", metavar="GAME")
    ] = "pursuit",
) -> None:
    """Write a small game to begin with: a scenario and strategies."""
    from gamms.scenario import from_gallery

    game = from_gallery(source)
    if not re.fullmatch(r"\w[\w-]*", name.name):
        raise BadValue(f"{str(name)!r} cannot be the name of a game: use letters, digits, _ and -.")
    if name.exists():
        raise BadValue(f"{str(name)!r} already exists. Choose another name; `gamms new` never overwrites files.")
    scenario = name / f"{name.name}.yaml"
    text = "" if game.file is None else game.file.read_text(encoding="utf-8")
    files = _find_code(game)
    copies = {module: _name_copy(module, source) for module in files}
    for module, copy in copies.items():
        text = re.sub(rf"(?<![\w.]){re.escape(module)}(?=:\w)", copy, text)
        text = text.replace(f"{module}.py", f"{copy}.py")
    text = re.sub(r"^name: .*", f'name: "{name.name}"', text, flags=re.MULTILINE)
    text = text.replace(f"{source}.yaml", scenario.name)
    with make_folder(name):
        try:
            write_whole(scenario, text.encode())
            for module, copy in copies.items():
                code = files[module].read_text(encoding="utf-8")
                for other, renamed in copies.items():
                    code = code.replace(f"from .{other} import ", f"from .{renamed} import ")
                write_whole(name / f"{copy}.py", code.encode())
        except BaseException:
            for one in name.iterdir():
                one.unlink()
            raise
    written = [f"{scenario} (the game)", *(f"{name / copy}.py ({_WHAT[copy]})" for copy in copies.values())]
    *most, last = written
    echo(f"Wrote {', '.join(most)}{' and ' if most else ''}{last}. What next:\n")
    recording = name / "first" / RECORDING
    next_commands = {
        f"gamms run {scenario} --out {name / 'first'}": "play it: a result, a picture, a recording",
        f"gamms run {scenario} --window": "watch it in a window (extra viz)",
        f"gamms render {recording} {name.name}.html": "a page that replays it in any browser",
        f"gamms render {recording} {name.name}.mp4": "a film (extra video)",
        f"gamms run {scenario} --seeds 0:50": "play fifty games and count who wins",
    }
    width = max(map(len, next_commands))
    for command, what in next_commands.items():
        echo(f"  {command:<{width}}  # {what}")


def _name_copy(module: str, source: str) -> str:
    """Return the name of the copy of a module of a game."""
    return "strategies" if module == _DEMO else module.removeprefix(source).removeprefix("_") or "strategies"


def _find_code(game: "Scenario") -> dict[str, Path]:
    """Return the files of a game's own code, by the names of their modules in the scenario."""
    from gamms import demo

    own = {found.module: found.file for found in game.code() if found.file is not None}
    if any(found.module == _DEMO for found in game.code()):
        own[_DEMO] = Path(demo.__file__).parent / "strategies.py"
    return own
