"""Draws ten seconds of the demo's recording as one animated SVG that follows an agent: the picture of the README.

`python scripts/animate_game.py GAME.ggr OUT.svg`. A frame shows what the library's film shows, drawn by the library's
writer of SVG. The ground is drawn once and moved; lines of SVG that change are shown for the frames that have them. The
same recording gives the same bytes. Where SVG is not animated, the first frame is shown.
"""

import sys
from collections.abc import Iterator
from itertools import count, groupby
from math import ceil
from pathlib import Path
from typing import NamedTuple

import gamms
from gamms.context import Context
from gamms.ir.draw import DrawCommands
from gamms.typing import IArtist
from gamms.visual.artist import ArtistGroup
from gamms.visual.backends.svg import write_svg
from gamms.visual.camera import Camera
from gamms.visual.captions import CaptionBar, Captions
from gamms.visual.labels import Labels
from gamms.visual.page import Page, make_style

TITLE = "Capture the flag in central Helsinki: blue_1 takes the red flag and brings it home"
FOLLOWED = "blue_1"
FIRST, LAST = 136, 234  # turns
WIDTH, HEIGHT = 820, 460  # pixels
VIEW_M = 500.0
FRAMES_PER_TURN = 2
FRAME_SECONDS = 0.045
HELD_SECONDS = 1.5  # the last frame
CAPTION_TURNS = 15
GROUND_LAYER = 12  # map and territories, which are the same in all frames, are on this layer and below
PAPER = (252, 252, 250, 255)  # of the light theme

Lines = list[str]


class Frame(NamedTuple):
    """A frame of the film."""

    camera: Camera
    moving: DrawCommands
    around: DrawCommands  # names, captions, and the source of the map


def main(game: Path, out: Path) -> None:
    """Draw the animated picture of a recording."""
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx, gamms.recorder.open(game) as recording:
        frames: list[Frame] = []
        turns = count(1)
        captions = Captions(ctx, ctx.visual.drawing)
        captions.turns = CAPTION_TURNS
        labels = Labels()

        def end_turn() -> None:
            if FIRST <= next(turns) <= LAST:
                frames.extend(frames_of_turn(ctx, captions.make_captions(), labels))

        ctx.visual.after_turn.append(end_turn)
        for _ in ctx.record.replay(recording):
            if len(frames) == FRAMES_PER_TURN * (LAST - FIRST + 1):
                break
        out.write_text(animated(ground_of(ctx), frames), encoding="utf-8")


def frames_of_turn(ctx: Context, bar: CaptionBar, labels: Labels) -> Iterator[Frame]:
    """Yield the frames of the turn that was just played."""
    visual = ctx.visual
    if visual.viewpoint.followed is None:
        visual.follow(FOLLOWED, VIEW_M)
    visual.drawing.motion.begin_turn()
    style = make_style(ctx, captions=True, legend=False, street_names=False)
    artists = {name: one for name, one in artists_of(ctx).items() if one.get_layer() > GROUND_LAYER}
    page = Page(WIDTH, HEIGHT, (), style)
    for step in range(1, FRAMES_PER_TURN + 1):
        share = step / FRAMES_PER_TURN
        camera = page.find_camera(visual.viewpoint, share)
        assert camera is not None
        moving = ArtistGroup(ctx, artists).draw_artists(share)
        yield Frame(camera, moving, page.draw_parts(camera, None, ctx, artists, labels, bar))


def artists_of(ctx: Context) -> dict[str, IArtist]:
    """Return the artists that draw, but for the views of sensors."""
    return ctx.visual.artists.list_shown(sensors=False)


def ground_of(ctx: Context) -> DrawCommands:
    """Return the drawings of the map and the territories."""
    artists = {name: one for name, one in artists_of(ctx).items() if one.get_layer() <= GROUND_LAYER}
    return ArtistGroup(ctx, artists).draw_artists(1.0)


def animated(ground: DrawCommands, frames: list[Frame]) -> str:
    """Return an SVG that shows the frames again and again."""
    cameras = [frame.camera for frame in frames]
    scale = cameras[0].scale
    left, right = min(one.left for one in cameras), max(one.left for one in cameras)
    top, bottom = max(one.top for one in cameras), min(one.top for one in cameras)
    size = ceil((right - left) * scale) + WIDTH, ceil((top - bottom) * scale) + HEIGHT
    whole = Camera(*size, left, top, scale)  # sees what all frames see
    moves = [f"{(left - one.left) * scale:.0f} {(one.top - top) * scale:.0f}" for one in cameras]
    still = [line for line in elements_of(ground, whole) if "<circle" not in line]  # nodes have half a pixel
    moving = shown_in_turn([elements_of(frame.moving, whole) for frame in frames])
    around = shown_in_turn([elements_of(frame.around, frame.camera) for frame in frames])
    opening, _, paper, group = (
        write_svg(frames[0].around, cameras[0], title=TITLE, background=PAPER).decode().split("\n")[:4]
    )
    lines = [opening, f"<title>{TITLE}</title>", paper, group]
    lines += [f'<g transform="translate({moves[0]})">', moved(moves), *still, *moving, "</g>"]
    return "\n".join([*lines, *around, "</g>", "</svg>", ""])


def elements_of(commands: DrawCommands, camera: Camera) -> Lines:
    """Return the elements of the SVG of some drawings, one a line."""
    opening_lines, closing_lines = 4, 3
    return write_svg(commands, camera, title=TITLE, background=PAPER).decode().split("\n")[opening_lines:-closing_lines]


def shown_in_turn(frames: list[Lines]) -> Lines:
    """Return elements that show in each frame its own lines; lines that all frames have are there once."""
    everywhere = set(frames[0]).intersection(*frames)
    lasting = [line for line in frames[0] if line in everywhere]
    between = [parts_between(lasting, lines) for lines in frames]
    found: Lines = []
    for i, parts in enumerate(zip(*between, strict=True)):
        begin = 0
        for part, run in groupby(parts):
            end = begin + len(list(run))
            if part:
                found += [*opened(begin, end, len(frames)), *part, "</g>"]
            begin = end
        found += lasting[i : i + 1]
    return found


def parts_between(lasting: Lines, lines: Lines) -> list[tuple[str, ...]]:
    """Return the lines of a frame before, between and after the lasting ones."""
    parts: list[Lines] = [[]]
    for line in lines:
        if len(parts) <= len(lasting) and line == lasting[len(parts) - 1]:
            parts.append([])
        else:
            parts[-1].append(line)
    if len(parts) <= len(lasting):
        raise ValueError("The lasting elements of a frame have another order: animate it with fewer layers.")
    return [tuple(part) for part in parts]


def opened(begin: int, end: int, frames: int) -> Lines:
    """Return the beginning of a group that is shown from one frame to another."""
    times = [0] * (begin > 0) + [begin] + [end] * (end < frames)
    values = ["none"] * (begin > 0) + ["inline"] + ["none"] * (end < frames)
    return [f'<g display="{values[0]}">', animation("display", values, times, frames)]


def moved(moves: list[str]) -> str:
    """Return the element that moves the ground in each frame."""
    values = animation("transform", moves, [*range(len(moves))], len(moves))
    return values.replace("<animate ", '<animateTransform type="translate" ', 1)


def animation(name: str, values: list[str], frames: list[int], total: int) -> str:
    """Return the element that sets an attribute to values at the beginning of frames."""
    seconds = total * FRAME_SECONDS + HELD_SECONDS
    times = ";".join(f"{frame * FRAME_SECONDS / seconds:.5f}".rstrip("0").rstrip(".") for frame in frames)
    return (
        f'<animate attributeName="{name}" calcMode="discrete" dur="{seconds:g}s" repeatCount="indefinite" '
        f'values="{";".join(values)}" keyTimes="{times}"/>'
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
