"""The recorder: `ctx.record`, and recordings that are compact, seekable, whole after a crash, and safe to open.

Read `ir/events.py` first: what can happen, and what it does to a state. A state is a live context (`replaying.py`) or
columns (`detached.py`), and both are written as `keyframes.py` says. `recorder.py` is what users call; `session.py`
writes what the journal notes and what has changed beside it (`changes.py`), by an encoder (`encoders.py`; `compat.py`
writes version 2); `replaying.py` applies a recording to a context, `recording.py` reads one without, `cut.py` makes one
of what a team knew. `formats/` knows plain values only: version 3 in `formats/__init__.py`; `formats/version2.py` reads
version 2, that of gamms 1.0.0. `components.py` has the user's own recorded objects. Nothing in a file is ever
evaluated or imported.

May import: typing, kernels, ir and below, never another engine. To record something new, add its kind to
`ir/events.py`; a field of the game names its own in `ir/game_state.py`. A new format is a class in `ENCODERS`.
"""

from gamms.recorder.errors import RecordingError
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.writer import Writer
from gamms.recorder.recorder import Recorder, RecorderBusy
from gamms.recorder.recording import Recording, open  # noqa: A004 - as `Recording` says: `gamms.recorder.open`
from gamms.recorder.states import State

__all__ = ["Reader", "Recorder", "RecorderBusy", "Recording", "RecordingError", "State", "Writer", "open"]
