"""What a page shows besides the map and the discs of agents: signs, colors and captions, made as pictures are made.

A game is followed in a context of its own, whose artists draw each turn in both themes. The viewer paints these draw
commands; it knows no rule. `docs/page-format.md` describes what comes of it.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Self

import numpy as np

from gamms.errors import BadValue
from gamms.ir import events as kinds
from gamms.ir import packed_bytes
from gamms.ir.events import DECISIONS, Log, events_of
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.plain import Plain, is_same
from gamms.recorder.replaying import Replayer
from gamms.recorder.resuming import opened_context
from gamms.text import as_digits, as_text
from gamms.typing import IArtist
from gamms.visual.artist import ArtistGroup
from gamms.visual.captions import captions_of, ending
from gamms.visual.drawers.marks import drawn_marks
from gamms.visual.drawers.rules import teams_of_rules
from gamms.visual.legend import Row, blocks_of, plain_block
from gamms.visual.recorded_drawings import RecordedDrawer
from gamms.visual.themes import THEMES
from gamms.web.bundle import VIEWER_THEMES

SHOWN = 0x07000000  # the kind of the event that says what a page shows from a turn on; no recording has it
_STEPS = 1 << 15  # of the larger side of the map: on a city some centimetres
_PIXEL_STEP = 2.0**-4
_UNMARKED = {"tag", "respawned", *DECISIONS}  # kinds of events that are too many for the line of turns
_SIGNS = {  # the letters for signs of legends
    "flag": "⚑",
    "ring": "○",
    "band": "▒",
    "goal": "◎",
    "arc": "◔",
    "square": "◇",
    "gauge": "▬",
    "tag": "⊗",
    "cross": "✕",
    "tick": "✓",
    "curve": "⌒",
    "line": "─",
    "dot": "•",
    "field": "◗",
}

Drawn = dict[str, Any]


class Painter:
    """Follows a game, and says what a page shows of it.

    Args:
        header: of the recording of the game, with its map.
        state: how the game begins, as a keyframe.
    """

    def __init__(self, header: Mapping[str, Plain], state: dict[str, Plain]) -> None:
        self._ctx: Any = opened_context(0, None, is_quiet=True)
        self._ctx.record.is_replaying = True  # so that recorded drawings stay
        self._replayer = Replayer(self._ctx)
        self._replayer.begin_with(dict(header), state)
        sides: Any = header.get("sides") or ()
        self._sides = [side for side in sides if side is not None]
        self._commands: dict[str, Drawn] = {}  # what artists drew last in the first theme, by name
        self._drawings: dict[str, Drawn] = {}
        self._colors: dict[str, Any] = {}
        self._scores: dict[str, Any] = {}
        self._changes()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the context."""
        self._ctx.terminate()

    def present(self) -> Drawn:
        """Return all that is shown at present."""
        return {"drawings": list(self._drawings.values()), "colors": self._colors}

    def restore(self, state: dict[str, Plain]) -> None:
        """Become what a keyframe says."""
        self._replayer.apply(kinds.SNAPSHOT, state)
        self._changes()

    def turn(self, log: Log) -> Log:
        """Play the log of a turn, and return an event that says what a page shows from then on; none: as before."""
        self._replayer.play_log(log)
        changes = self._changes()
        captions = list(self._captions(log))
        if captions:
            changes["captions"] = captions
        return [(SHOWN, changes)] if changes else []

    def _changes(self) -> Drawn:
        """Return what is shown otherwise than before."""
        found: Drawn = {}
        colors = self._team_colors()
        if colors != self._colors:
            found["colors"] = self._colors = colors
        drawings = self._changed_drawings()
        if drawings:
            found["drawings"] = drawings
        return found

    def _team_colors(self) -> dict[str, Any]:
        """Return side -> its color in each theme."""
        drawing = self._ctx.visual.drawing
        more = [*self._sides, *sorted(teams_of_rules(self._ctx))]
        found: dict[str, Any] = {}
        for theme in VIEWER_THEMES:
            with drawing.themed(THEMES[theme]):
                for side, color in drawing.group_colors(more).items():
                    found.setdefault(side, {})[theme] = list(color)
        return found

    # -- drawings -----------------------------------------------------------------------------------------------

    def _changed_drawings(self) -> list[Drawn]:
        """Return the drawings of the artists that draw something else than before."""
        first, second = VIEWER_THEMES
        artists = self._signs(first)
        drawn = {name: self._commands_of(name, artist, first) for name, artist in artists.items()}
        now = {name: commands for name, commands in drawn.items() if commands is not None}
        changed = [name for name, one in now.items() if not is_same(one, self._commands.get(name))]
        gone = self._commands.keys() - now.keys()
        self._commands = now
        others = self._signs(second) if changed else {}
        for name in sorted(gone):
            del self._drawings[name]
        for name in changed:
            other = self._commands_of(name, others.get(name, artists[name]), second) or now[name]
            self._drawings[name] = self._drawing(name, artists[name], now[name], other)
        return [self._drawings[name] for name in changed] + [{"artist": name} for name in sorted(gone)]

    def _signs(self, theme: str) -> dict[str, IArtist]:
        with self._ctx.visual.drawing.themed(THEMES[theme]):
            signs: dict[str, IArtist] = self._ctx.visual.artists.signs()
        return signs

    def _commands_of(self, name: str, artist: IArtist, theme: str) -> Drawn | None:
        """Return what an artist draws in a theme, as plain values, with its layer and legend; None: nothing."""
        if not artist.get_visible():
            return None
        with self._ctx.visual.drawing.themed(THEMES[theme]):
            commands = ArtistGroup(self._ctx, {name: artist}).commands()
            legend = [plain_block(block) for block in blocks_of(self._ctx, {name: artist})]
        try:
            plain = commands.to_plain()
        except BadValue:  # it has too many points
            return None
        if not len(plain["kind"]) and not legend:
            return None
        facts = getattr(artist.get_drawer(), "facts", None)
        return {
            "layer": artist.get_layer(),
            "commands": plain,
            "legend": legend,
            "facts": {} if facts is None else facts(self._ctx),
        }

    def _drawing(self, name: str, artist: IArtist, first: Drawn, second: Drawn) -> Drawn:
        """Return a drawing as a page has it, with the colors of both themes."""
        drawer, step = artist.get_drawer(), self._ctx.visual.drawing.of_map(_step)
        found: Drawn = {
            "artist": name,
            "layer": int(first["layer"]),
            "in_fog": bool(getattr(drawer, "is_in_fog", False)),
            "follows": not getattr(drawer, "once_a_turn", False),
            **painted(first["commands"], second["commands"], step),
        }
        legend = [_with_letters(block) for block in first["legend"]]
        if legend:
            found["legend"] = legend
        if first["facts"]:
            found["facts"] = first["facts"]
        marks = drawn_marks(artist)
        if marks:
            shifts = [(one.shift[0] * one.least_px, one.shift[1] * one.least_px) for one in marks]
            found["marks"] = {
                "names": [one.name for one in marks],
                "places": np.array([one.current_position for one in marks], np.float64),
                "shifts": np.array(shifts, np.float64),
                "radius": float(marks[0].least_px),
            }
        if isinstance(drawer, RecordedDrawer) and name in self._ctx.visual.artists.drawings.starts:
            found["start"] = _in_steps(self._ctx.visual.artists.drawings.starts[name].points, step)
        return found

    # -- captions -----------------------------------------------------------------------------------------------

    def _captions(self, log: Log) -> Iterator[Drawn]:
        """Yield the captions of a turn: `words`, the `agent` that they are about, whether `marked` and `major`."""
        events, later = list[Any](), list[Drawn]()
        for kind, data in events_of(log):
            if kind in (kinds.GAME_EVENT, kinds.USER_EVENT):
                events.append(data)
            elif kind == kinds.GAME_SCORES:
                later += self._rises(data["scores"])
            elif kind == kinds.GAME_OVER and data:
                winner = data.get("winner")
                agent = None if winner is None else as_text(winner)
                later.append({"words": ": ".join(ending(data)), "agent": agent, "major": True, "marked": True})
        is_marked = any(event.get("kind") not in _UNMARKED for event in events)
        for words, name in captions_of(events):
            yield {"words": words, "agent": None if name is None else str(name), "major": False, "marked": is_marked}
        yield from later

    def _rises(self, scores: Any) -> Iterator[Drawn]:
        """Yield the scores that have risen."""
        now = {as_text(of): score for of, score in dict(scores).items() if isinstance(score, int | float)}
        for of, score in now.items():
            if score > self._scores.get(of, 0):
                yield {"words": f"{of} {as_digits(score)}", "agent": of, "major": True, "marked": True}
        self._scores = now


def _step(columns: GraphColumns) -> float:
    """Return a power of two in whose multiples points are written: small on the map, and small in pixels."""
    extent = float(np.ptp(columns.xy, axis=0).max()) if len(columns.xy) else 0.0
    return min(_PIXEL_STEP, float(2.0 ** np.floor(np.log2(extent / _STEPS)))) if extent > 0.0 else _PIXEL_STEP


def _in_steps(points: FloatArray, step: float) -> bytes:
    """Return points as two columns of integers, the differences of x and those of y, which are small along a line."""
    columns = np.rint(points.T / step).astype(np.int64)
    return b"".join(packed_bytes.column(packed_bytes.steps(column)) for column in columns)


def painted(light: Drawn, dark: Drawn, step: float) -> Drawn:
    """Return the `commands` of a drawing as a page has them, and the `colors` of their styles in each theme.

    Args:
        light: the commands as plain values.
        dark: the same in the dark theme.
        step: points are written in multiples of it.
    """
    commands = {**light, "step": step, "points": _in_steps(light["points"], step)}
    del commands["color"]
    inks = [light["color"], dark["color"] if len(dark["color"]) == len(light["color"]) else light["color"]]
    styles, rows = np.unique(np.concatenate(inks, axis=1), axis=0, return_inverse=True)
    commands["style"] = rows.ravel().astype(np.int32)
    colors = {theme: styles[:, 4 * i : 4 * i + 4].astype(np.uint8) for i, theme in enumerate(VIEWER_THEMES)}
    return {"commands": commands, "colors": colors}


def _with_letters(block: dict[str, Any]) -> dict[str, Any]:
    """Return a block of a legend whose rows have letters for signs."""
    if "rows" not in block:
        return block
    rows = [Row(*row) for row in block["rows"]]
    return {**block, "rows": [(list(row.color), row.name, row.value, _SIGNS.get(row.sign, "")) for row in rows]}
