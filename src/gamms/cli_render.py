"""The command that makes a picture or a film of a recording: render."""

from pathlib import Path
from typing import Annotated

import typer

from gamms.cli_output import bounded, echo, one_sentence
from gamms.progress import progress


def add_to(app: typer.Typer) -> None:
    """Offer this command."""
    app.command()(bounded(render))


def render(  # noqa: PLR0913, PLR0917 - one argument per option
    file: Annotated[Path, typer.Argument(help="A recording, .ggr.", show_default=False)],
    out: Annotated[Path, typer.Argument(help="What is written: .mp4, .gif, .png or .svg.", show_default=False)],
    turns: Annotated[
        str, typer.Option(help="Turns to film, 100:200, 100: or :200; a picture shows the last one.", metavar="FROM:TO")
    ] = ":",
    follow: Annotated[str | None, typer.Option(help="Keep this agent in the middle.", metavar="AGENT")] = None,
    view: Annotated[
        float | None,
        typer.Option(help="With --follow: how much is seen, in metres (map units). By default some hundred."),
    ] = None,
    fog: Annotated[str | None, typer.Option(help="Show only what this team's sensors see.", metavar="TEAM")] = None,
    width: Annotated[int, typer.Option(help="Pixels.")] = 1280,
    height: Annotated[int, typer.Option(help="Pixels.")] = 720,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 30.0,
    frames_per_turn: Annotated[int, typer.Option(help="More of them show a turn more slowly.")] = 5,
    title: Annotated[str, typer.Option(help="A line above the picture.")] = "",
    map: Annotated[
        Path | None, typer.Option("--map", help="The map of a recording of version 2, .gamms.", metavar="FILE")
    ] = None,
) -> None:
    """Make a film of a recording, or a picture of one of its turns."""
    first, last = _parsed_turns(turns)
    with one_sentence(), progress() as show:
        from gamms import rendering

        options = rendering.RenderOptions(first, last, follow, view, fog, width, height, fps, frames_per_turn, title)
        shown = rendering.render(file, out, options, map=map, show=show)
    is_film = out.suffix.lower() in (".mp4", ".gif")
    echo(f"Wrote {out} ({f'{shown} turns' if is_film else f'after turn {shown}'}).")


def _parsed_turns(text: str) -> tuple[int | None, int | None]:
    """First and last turn of `100:200`, `100:`, `:200`, or `100` for that turn alone."""
    first, colon, last = text.partition(":")
    try:
        begin, end = (int(part) if part.strip() else None for part in (first, last if colon else first))
    except ValueError:
        raise typer.BadParameter(f"{text!r}: give 100:200, 100:, :200 or 100.", param_hint="--turns") from None
    return (None if begin == 0 else begin), end
