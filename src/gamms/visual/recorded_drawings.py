"""Drawings of artists with custom drawers, as plain values for recordings and replays."""

from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.ir.draw import DrawCommands
from gamms.limits import refuse_above
from gamms.text import reason
from gamms.typing import ArtistType, IArtist, IContext
from gamms.visual.artist import ArtistGroup, make_state_key
from gamms.visual.drawing import get_drawing
from gamms.visual.legend import Block, list_blocks, make_block, make_plain_block

Recorded = dict[str, Any]  # `artist`, `layer`, `visible`, and, if it is visible, `commands` and `legend`
_POINT_BYTES = 200  # memory per point: columns, and the data painted from these


class RecordedDrawer:
    """A drawer that draws the recorded commands of the artist with a name.

    Args:
        drawings: of the context that a recording is replayed into.
        name: of the artist.
    """

    def __init__(self, drawings: "RecordedDrawings", name: str) -> None:
        self._drawings = drawings
        self._name = name

    @property
    def once_a_turn(self) -> bool:
        """Return whether the drawing is the same in all frames of a turn."""
        return self._name not in self._drawings.starts

    def __call__(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw the commands; drawings that were elsewhere at the beginning of the turn move in a straight line."""
        commands = self._drawings.commands.get(self._name)
        start = self._drawings.starts.get(self._name)
        target = get_drawing(ctx).commands
        share = float(data.get("_alpha", 1.0))
        if commands is None or target is None:
            return
        if start is not None and share < 1.0:
            commands = replace(commands, points=start.points + share * (commands.points - start.points))
        target.add_commands(commands)

    def legend(self, ctx: IContext) -> list[Block]:  # noqa: ARG002 - the arguments of every legend
        """Return the legend of the artist."""
        return self._drawings.legends.get(self._name, [])


class RecordedDrawings:
    """The drawings of a replayed recording by the names of their artists, and the recording of drawings.

    Args:
        ctx: the context.

    Attributes:
        commands: artist -> draw commands.
        starts: artist -> the same commands with the points at the beginning of the turn, for some artists.
        legends: artist -> blocks of its legend.
    """

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self.commands: dict[str, DrawCommands] = {}
        self.starts: dict[str, DrawCommands] = {}
        self.legends: dict[str, list[Block]] = {}
        self._plain: dict[str, Recorded] = {}  # the same as it was recorded
        self._static: dict[str, tuple[Any, Recorded]] = {}  # of STATIC artists, which draw when something has changed
        self._refused: set[str] = set()  # artists whose drawings cannot be recorded

    def put(self, recorded: Recorded) -> None:
        """Set the recorded drawing of an artist.

        Raises:
            BadType, BadValue, KeyError: the value is not a recorded drawing; nothing has changed.
            TooLarge (BadValue): all drawings together would exceed the memory limit.
        """
        name = recorded["artist"]
        commands = recorded.get("commands")
        if commands is None:
            for known in (self.commands, self.starts, self.legends, self._plain):
                known.pop(name, None)
            return
        drawn = DrawCommands.from_plain(commands)
        legend = recorded.get("legend", [])
        if not isinstance(legend, list):
            raise BadType("The legend of a recorded drawing must be a list.")
        start = None if "start" not in recorded else DrawCommands.from_plain({**commands, "points": recorded["start"]})
        drawn_before = chain(self.commands.items(), self.starts.items())
        drawings = [one for other, one in drawn_before if other != name]
        points = sum(len(one.points) for one in (*drawings, drawn, start) if one is not None)
        refuse_above(_POINT_BYTES * points, "What the artists of this recording draw")
        self.legends[name] = [make_block(block) for block in legend]
        self.commands[name] = drawn
        self._plain[name] = {key: recorded[key] for key in ("commands", "start", "legend") if key in recorded}
        self.starts.pop(name, None)
        if start is not None:
            self.starts[name] = start

    def clear(self) -> None:
        """Draw nothing of a recording any more."""
        for known in (self.commands, self.starts, self.legends, self._plain):
            known.clear()

    def record_drawing(self, name: str, artist: IArtist) -> Recorded:
        """Return the present drawing of an artist as plain values; errors are logged, as in pictures."""
        found: Recorded = {"artist": name, "layer": artist.get_layer(), "visible": artist.get_visible()}
        if not found["visible"] or name in self._refused:
            return found
        if isinstance(artist.get_drawer(), RecordedDrawer):
            return found | self._plain.get(name, {})
        if artist.get_artist_type() is not ArtistType.STATIC:
            return found | self._draw_artist(name, artist)
        key = get_drawing(self._ctx).map_version(), make_state_key(name, artist)
        known = self._static.get(name)
        if known is None or known[0] != key:
            known = key, self._draw_artist(name, artist)
            self._static[name] = known
        return found | known[1]

    def _draw_artist(self, name: str, artist: IArtist) -> Recorded:
        try:
            start = self._start(name, artist)
            drawn: Recorded = {"commands": ArtistGroup(self._ctx, {name: artist}).draw_artists().to_plain()}
            if start is not None and _has_moved_only(start, drawn["commands"]):
                drawn["start"] = start["points"]
        except BadValue as error:
            self._refused.add(name)
            self._ctx.logger.warning(f"Artist {name!r}: {reason(error)}")
            return {}
        try:
            legend = [make_plain_block(block) for block in list_blocks(self._ctx, {name: artist})]
        except Exception as error:  # noqa: BLE001 - a function of the user's, as a drawer is
            self._ctx.logger.error(f"The legend of artist {name!r} failed: {type(error).__name__}: {reason(error)}")  # noqa: TRY400 - ILogger has no `exception`
            legend = []
        return drawn | ({"legend": legend} if legend else {})

    def _start(self, name: str, artist: IArtist) -> dict[str, Any] | None:
        """Return an artist's drawing at the beginning of the turn; None if it is the same in all frames."""
        is_still = artist.get_artist_type() is ArtistType.STATIC or getattr(artist.get_drawer(), "once_a_turn", False)
        if is_still:
            return None
        motion = get_drawing(self._ctx).motion
        motion.begin_turn()
        return ArtistGroup(self._ctx, {name: artist}).draw_artists(0.0).to_plain() if motion.moves.rows else None


def _has_moved_only(start: dict[str, Any], end: dict[str, Any]) -> bool:
    """Return whether two drawings are the same commands at other points."""
    are_alike = all(np.array_equal(start[name], end[name]) for name in ("kind", "counts"))
    return are_alike and not np.array_equal(start["points"], end["points"])
