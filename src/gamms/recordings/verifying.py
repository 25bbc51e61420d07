"""Whether a recording is whole, agrees with itself, and gives itself when it is replayed and recorded."""

import io
import os
from pathlib import Path
from typing import Any

from gamms.errors import GammsError
from gamms.ir.packing import to_bytes
from gamms.recorder import Reader, Recording, RecordingError
from gamms.recorder import open as opened
from gamms.recorder.maps import HASH
from gamms.recordings.comparing import differences
from gamms.recordings.contexts import with_map
from gamms.text import as_text, reason


def verify(path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None) -> None:
    """Read all of a recording of version 3, work out its keyframes anew, then replay it and record that.

    What is recorded must be the same events, to the last bit; the same bytes, where the same versions of GAMMS and zlib
    pack them.

    Args:
        path: of the recording.
        map: a file that `ctx.graph.save` wrote, for a recording that does not hold its map.

    Raises:
        RecordingError (ValueError): the first thing that is wrong: the recording was not finished, a block or the
            index is damaged, a keyframe says something else than the turns before it, it cannot be replayed, it comes
            out otherwise than it went in, or the map is another.
        BadFile (ValueError): the map is damaged.
        OSError: one of the files cannot be read.
    """
    with opened(path, graph=map) as recording:  # which says what to do with version 2
        name = recording.header.get(HASH)
    with Reader(path) as reader:
        reader.verify()
        if reader.warning:
            raise RecordingError(reader.warning)
    if name is not None and map is None:
        raise RecordingError(
            "What can be read without its map is whole; but this recording does not hold its map, only the SHA-256 of "
            f"it, {as_text(name)}, and cannot be replayed without. Give that map: --map FILE.gamms."
        )
    _check_keyframes(path)
    before, after = Path(path).read_bytes(), re_recorded(path, map)
    if before != after and (part := _parting(before, after)) is not None:
        raise RecordingError(f"Replayed and recorded again, it is another recording: {part} is not the same.")


class _Walker(Reader):
    """Knows no keyframe but the first, so that every state follows from all turns before."""

    def keyframe_before(self, turn: int) -> int:
        """The start."""
        return super().keyframe_before(min(turn, 0))

    def keyframe(self, turn: int) -> tuple[int, dict[str, Any]] | None:
        """That of the start."""
        return super().keyframe(min(turn, 0))


def _check_keyframes(path: str | os.PathLike[str]) -> None:
    """Compare what every keyframe says with what follows from the turns before it.

    Raises:
        RecordingError: one says something else.
    """
    with Reader(path) as reader, _Walker(path) as walker:
        told, walked = Recording(reader), Recording(walker)
        turns, turn = [], reader.keyframe_before(told.turns)
        while turn > 0:
            turns.append(turn)
            turn = reader.keyframe_before(turn - 1)
        for turn in reversed(turns):
            difference = next(differences(walked.state(turn), told.state(turn), ("", "")), None)
            if difference is not None:
                raise RecordingError(
                    f"The keyframe after turn {turn} is not what follows from the turns before it. {difference}."
                )


def _parting(before: bytes, after: bytes) -> str | None:
    """In which part two recordings differ; None if they only are cut into other blocks, or packed otherwise."""
    with Reader(io.BytesIO(before)) as first, Reader(io.BytesIO(after)) as second:
        if first.turns != second.turns:
            return "the number of turns"
        if _packed(first.header) != _packed(second.header):
            return "the header"
        parting = (turn for turn in range(first.turns) if _packed(first.log(turn)) != _packed(second.log(turn)))
        turn = next(parting, None)
        return None if turn is None else f"turn {turn + 1}"


def _packed(value: Any) -> bytes:
    return to_bytes(value, "The recording")


class _Whole(io.BytesIO):
    """Bytes that no reader needs before the recording is finished, so that no turn has to be there at its end."""

    def seekable(self) -> bool:
        """Not while it is written."""
        return False


def re_recorded(path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None) -> bytes:
    """What comes out when a recording of version 3 is replayed into a fresh context and recorded there.

    Raises:
        RecordingError (ValueError): it cannot be replayed.
    """
    stream = _Whole()
    with with_map(map) as ctx:
        ctx.record.start(stream)
        try:
            for _ in ctx.record.replay(path):
                pass
        except GammsError as error:
            raise RecordingError(f"It cannot be replayed: {reason(error)}") from error
        ctx.record.stop()
    return stream.getvalue()
