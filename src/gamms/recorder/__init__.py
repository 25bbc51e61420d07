"""The recorder room: `ctx.record`, and recordings that are compact, seekable, whole after a crash, and safe to open.

Read `recorder.py` first, then `session.py` (what is written), `replaying.py` (what is read into a context),
`recording.py` (what is read without one) and `fold.py` (how states follow from events). `formats/` knows plain values
only: version 3 in `formats/__init__.py`, version 2, that of gamms 1.0.0, in `formats/version2.py`. `components.py` has
the user's own recorded objects. Nothing in a file is ever evaluated or imported. May import: typing, kernels, ir and
below, never another room. To record something new, note it in `ir.events` and say in `fold.py` and `replaying.py`
what it does; a new format is one file in `formats/`.
"""

from gamms.recorder.errors import RecordingError
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.writer import Writer
from gamms.recorder.recorder import Recorder, RecorderBusy
from gamms.recorder.recording import Recording, State, open  # noqa: A004 - as `Recording` says: `gamms.recorder.open`

__all__ = ["Reader", "Recorder", "RecorderBusy", "Recording", "RecordingError", "State", "Writer", "open"]
