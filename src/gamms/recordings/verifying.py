"""Whether a recording is whole, and gives itself when it is replayed and recorded."""

import io
import os
from pathlib import Path

from gamms.errors import GammsError
from gamms.recorder import Reader, RecordingError
from gamms.recorder import open as opened
from gamms.recorder.maps import HASH
from gamms.recordings.comparing import first_difference
from gamms.recordings.contexts import with_map


def verify(path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None) -> None:
    """Read all of a recording of version 3, then replay it into a fresh context and record that.

    Args:
        path: of the recording.
        map: a file that `ctx.graph.save` wrote, for a recording that does not hold its map.

    Raises:
        RecordingError (ValueError): the first thing that is wrong: the recording was not finished, a block or the
            index is damaged, it cannot be replayed, it comes out otherwise than it went in, or the map is another.
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
            f"it, {name}, and cannot be replayed without. Give that map: --map FILE.gamms."
        )
    before, after = Path(path).read_bytes(), re_recorded(path, map)
    if before != after:
        raise RecordingError(f"Replayed and recorded again, it is another recording: {_parting(before, after)}")


def re_recorded(path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None) -> bytes:
    """What comes out when a recording of version 3 is replayed into a fresh context and recorded there.

    Raises:
        RecordingError (ValueError): it cannot be replayed.
    """
    stream = io.BytesIO()
    with with_map(map) as ctx:
        ctx.record.start(stream)
        try:
            for _ in ctx.record.replay(path):
                pass
        except GammsError as error:
            raise RecordingError(f"It cannot be replayed: {error}") from error
        ctx.record.stop()
    return stream.getvalue()


def _parting(before: bytes, after: bytes) -> str:
    """Where they part, as a sentence."""
    pairs = enumerate(zip(before, after, strict=False))
    at = next((at for at, (one, other) in pairs if one != other), min(len(before), len(after)))
    place = f"from byte {at} on, of {len(before)} and {len(after)}"
    with opened(io.BytesIO(before)) as first, opened(io.BytesIO(after)) as second:
        difference = first_difference(first, second)
    return f"{place}, though the games are the same." if difference is None else f"{place}. {difference}."
