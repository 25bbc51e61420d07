"""`gamms gallery`: list the games that come with GAMMS, play one, or write a page with all."""

import json
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer

from gamms.cli.output import echo, make_console, make_rich_table, record_game
from gamms.errors import MissingExtra
from gamms.folders import make_folder, remove_link, write_whole

if TYPE_CHECKING:
    from gamms.game import Result
    from gamms.scenario import Scenario

_STILL = 340  # pixels: less than 60 kB, on the streets of Helsinki, too
_STYLE = """
:root { color-scheme: light dark; font: 16px/1.5 system-ui, sans-serif }
body { max-width: 72rem; margin: 2rem auto; padding: 0 1rem }
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(20rem, 1fr)); gap: 2rem }
img { width: 100%; aspect-ratio: 4 / 3; object-fit: cover; border: 1px solid #8886; border-radius: 6px }
h2 { margin: .5rem 0 0; font-size: 1.1rem }
p { margin: .3rem 0 } code { font-size: .9em } summary { cursor: pointer }
"""
_PAGE = """<!DOCTYPE html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Games that come with GAMMS</title><style>{style}</style>
<h1>Games that come with GAMMS</h1>
<p>A picture opens the game, which plays in this browser, offline. Each is a scenario file and at most a page of code:
<code>gamms gallery NAME</code> plays it, <code>gamms new mine --from NAME</code> copies it.</p>
<main>
{cards}
</main></html>
"""
_CARD = """<article id="{name}">
<a href="{name}.html"><picture><source media="(prefers-color-scheme: dark)" srcset="{dark}"><img src="{still}"
alt="{title} after turn {turn} of {turns}"></picture></a>
<h2><a href="{name}.html">{title}</a></h2>
<p>{description}</p>
<p>{ending}</p>
<p>{wins}</p>
<details><summary>What it is about</summary>{about}</details>
</article>"""


class GalleryStatistics(NamedTuple):
    """The statistics of a gallery game, from `data/gallery/results.json`.

    Attributes:
        games: the number of games, with the seeds from 0 on.
        wins: team ("" for none) -> its number of wins, and the ends of the 95 % interval of their share.
        turns: the median length of a game.
        scores: for a game without winners, score -> its mean, and the ends of the 95 % interval of the mean.
    """

    games: int
    wins: dict[str, tuple[int, float, float]]
    turns: int
    scores: dict[str, tuple[float, float, float]]

    def __str__(self) -> str:
        """Name the shares of the teams, or the mean scores, with their intervals."""
        shares = [
            f"{team or 'no team'} {won / self.games:.0%} ({low:.0%} to {high:.0%})"
            for team, (won, low, high) in self.wins.items()
        ]
        means = [f"{key} {mean:.0f} ({low:.0f} to {high:.0f})" for key, (mean, low, high) in self.scores.items()]
        return f"{', '.join(shares + means)} of {self.games} games, median length {self.turns} turns"


def gallery(
    name: Annotated[
        str | None, typer.Argument(help="The game to play; without one, all are listed.", metavar="[NAME]")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="The same seed plays the same game; by default that of the file.", metavar="SEED")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="The folder for game.html, result.json and game.ggr; by default gamms-NAME.", metavar="DIR"),
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option(help="Write a page with pictures that play all games, or the one of this name.", metavar="DIR"),
    ] = None,
) -> None:
    """List games that come with GAMMS, or play one."""
    from gamms import scenario

    if page is not None:
        _write_page(page, [name] if name else list(scenario.gallery()), seed)
    elif name is not None:
        _play(name, seed, out or Path(f"gamms-{name}"))
    elif seed is not None or out is not None:
        raise typer.BadParameter("this option needs the name of a game.", param_hint="--out" if out else "--seed")
    else:
        _print_list()


def list_statistics() -> dict[str, GalleryStatistics]:
    """Return the statistics of the gallery's games, by name."""
    from gamms import scenario

    file = next(iter(scenario.gallery().values())).with_name("results.json")
    results = json.loads(file.read_text(encoding="utf-8"))
    return {name: GalleryStatistics(**({"scores": {}} | found)) for name, found in results.items()}


def describe_game(game: "Scenario") -> list[str]:
    """Return the paragraphs at the head of a scenario file: the modeled problem, and good strategies."""
    lines = [] if game.file is None else game.file.read_text(encoding="utf-8").splitlines()
    head = next(i for i, line in enumerate([*lines, ""]) if not line.startswith("#"))
    text = "\n".join(line.removeprefix("#").strip() for line in lines[:head])
    return [" ".join(part.split()) for part in text.split("\n\n")]


def _print_list() -> None:
    from gamms import scenario

    rows = [(name, scenario.from_gallery(name).spec.description or "") for name in scenario.gallery()]
    make_console().print(make_rich_table(("game", ""), rows, right=False))
    first = next(name for name, _ in rows if name == "patrol")
    echo(
        f"\nPlay one:      gamms gallery {first}\nChange one:    gamms new mine --from {first}\n"
        "See them all:  gamms gallery --page games"
    )


def _play(name: str, seed: int | None, out: Path) -> None:
    from gamms import scenario

    game = scenario.from_gallery(name)
    result = _record_game(game, seed, out, out / "game.html", is_kept=True)
    echo(f"{game.spec.name}: {result}")
    echo(
        f"\nWrote {out / 'game.html'} (the game, to be opened in a browser), {out / 'result.json'} (the "
        f"result) and {out / 'game.ggr'} (every move; gamms replay).\nIts file is {game.file}; to change it: "
        f"gamms new mine --from {name}"
    )


def _record_game(game: "Scenario", seed: int | None, folder: Path, html: Path, *, is_kept: bool) -> "Result":
    """Play a game, save its result and recording in a folder, and write the page that replays it."""
    from gamms import recorder

    with game.build(seed) as ctx, record_game(ctx, folder, is_kept=is_kept) as recording:
        result = ctx.game.run(progress=True)
    result.save(remove_link(folder / "result.json"))
    with recorder.open(recording) as whole:
        whole.save(html)
    return result


def _write_page(folder: Path, names: list[str], seed: int | None) -> None:
    """Write `index.html`, with a replay and a still of each game; skip games whose library is missing."""
    from gamms import scenario

    games = {name: scenario.from_gallery(name) for name in names}
    known = list_statistics()
    cards = []
    index = folder / "index.html"
    with make_folder(folder):
        for name, game in games.items():
            echo(f"{name} ...")
            try:
                cards.append(_make_card(name, game, seed, folder, str(known[name]) if name in known else ""))
            except scenario.ScenarioError as error:
                if len(games) == 1 or not isinstance(error.__cause__, MissingExtra):
                    raise
                echo(f"Left out: {name}. {error.__cause__}", err=True)
        write_whole(index, _PAGE.format(style=_STYLE, cards="\n".join(cards)).encode())
    echo(f"Wrote {index}.")


def _make_card(name: str, game: "Scenario", seed: int | None, folder: Path, wins: str) -> str:
    """Play a game, write its replay and its still, and return its card for the page."""
    with TemporaryDirectory() as scratch:
        result = _record_game(game, seed, Path(scratch), remove_link(folder / f"{name}.html"), is_kept=False)
        turn = result.turns // 3
        recording = Path(scratch) / "game.ggr"
        still = _write_still(recording, folder / name, turn, "light")
        dark = _write_still(recording, folder / f"{name}_dark", turn, "dark")
    texts: dict[str, Any] = {
        "name": name,
        "still": still.name,
        "dark": dark.name,
        "turn": turn,
        "turns": result.turns,
        "title": game.spec.name or name,
        "description": game.spec.description or "",
        "ending": f"Here: {result.headline()}.",
        "wins": wins and f"By the baselines: {wins}.",
    }
    paragraphs = "".join(f"<p>{escape(part)}</p>" for part in describe_game(game))
    return _CARD.format(**{key: escape(str(text)) for key, text in texts.items()}, about=paragraphs)


def _write_still(recording: Path, file: Path, turn: int, theme: Literal["light", "dark"]) -> Path:
    """Write a picture of where the agents are after a turn, as PNG if Pillow is installed, else as SVG; return it."""
    from gamms.rendering import RenderOptions, render

    for suffix in (".png", ".svg"):
        found = file.with_suffix(suffix)
        try:
            options = RenderOptions(
                last=turn,
                width=_STILL,
                height=_STILL * 3 // 4,
                theme=theme,
                captions=False,
                labels=False,
                scale_bar=False,
                legend=False,
                crop=True,
            )
            render(recording, remove_link(found), options)
        except MissingExtra:
            continue
        return found
    raise AssertionError("SVG needs no library")
