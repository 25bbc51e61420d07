"""The encoders that write the logs of a session, one class per format version."""

import os
from collections.abc import Callable
from typing import Any

from gamms.ir.events import Log
from gamms.ir.packing import to_bytes
from gamms.plain import to_plain
from gamms.recorder.compat import Version2Encoder
from gamms.recorder.formats.writer import Output, Writer
from gamms.recorder.keyframes import Keyframe
from gamms.recorder.session import RecordingSession
from gamms.typing.context import HostContext
from gamms.versions import __version__


class Version3Encoder:
    """Writes the container of docs/recording-format.md.

    Args:
        output: destination.
        header: function that returns the header of a session.
    """

    holds_looks_and_drawings = True

    def __init__(self, output: Output, header: Callable[[RecordingSession], dict[str, Any]]) -> None:
        self._output = output
        self._header = header
        self._writer: Writer = None  # type: ignore[assignment] # until it begins
        self._beginning: tuple[bytes, Keyframe] | None = None

    @property
    def is_current(self) -> bool:
        """Return whether flushed data can be read at once."""
        return self._output.can_overwrite

    def begin(self, session: RecordingSession, *, is_final: bool) -> None:
        """Write the beginning of a recording, provisionally or finally."""
        if not is_final and not self._output.can_overwrite:
            return
        header = self._header(session)
        beginning = to_bytes(header, "The header"), session.begin
        if self._beginning is None or self._beginning[0] != beginning[0] or self._beginning[1] is not beginning[1]:
            self._output.return_to(0)
            self._writer = Writer(self._output, header)
            self._writer.keyframe(session.begin)
            self._beginning = beginning

    def add(self, logs: list[Log]) -> None:
        """Write the logs of turns."""
        for log in logs:
            self._writer.add_turn(log)

    @property
    def values(self) -> int:
        """The number of events with a value written so far."""
        return self._writer.values

    @property
    def blocks(self) -> int:
        """The number of final blocks written so far."""
        return self._output.blocks

    def write_keyframe(self, keyframe: Keyframe) -> None:
        """Write a keyframe."""
        self._writer.keyframe(keyframe)

    def flush(self) -> None:
        """Make written data readable even if the program dies."""
        self._writer.flush()

    def close(self) -> None:
        """Write the end block."""
        self._writer.close()


ENCODERS: dict[int, type[Version2Encoder | Version3Encoder]] = {2: Version2Encoder, 3: Version3Encoder}
"""Format version -> encoder class."""


def make_header(ctx: HostContext, session: RecordingSession, options: dict[str, Any]) -> dict[str, Any]:
    """Return the header of a recording: without host, user or path, and without time unless given."""
    created = options.get("created")
    if created is None and (epoch := os.environ.get("SOURCE_DATE_EPOCH")):
        created = int(epoch)
    scenario = ctx.game.internals.scenario
    return {
        "format": 3,
        "package": __version__,
        "seed": session.seed,
        "created": created,
        "provenance": options.get("provenance"),
        **({} if scenario is None else {"scenario": {**to_plain(scenario), "seed": session.seed}}),
        "world": ctx.graph.storage.pack() if session.world is None else session.world,
        **({"visuals": session.visuals} if session.visuals["artists"] or "team_colors" in session.visuals else {}),
        **({"drawings": session.drawings.first} if session.drawings.first else {}),
    }
