"""The recorder: `ctx.record`, and compact, seekable recordings that survive crashes and are safe to open.

Read `ir/events.py` first: the kinds of events, and their effect on a state. A state is a live context (`replaying.py`)
or columns (`detached.py`); `keyframes.py` writes both. `recorder.py` is the public interface; `session.py` writes the
events of the journal and other changes (`changes.py`) by an encoder (`encoders.py`; `compat.py` writes version 2);
`replaying.py` applies a recording to a context, `recording.py` reads one without a context, `cut.py` reduces one to the
knowledge of a team. `formats/` handles only plain values: version 3 in `formats/__init__.py`; `formats/version2.py`
reads version 2, the format of gamms 1.0.0. `components.py` has recorded objects of users. Nothing in a file is ever
evaluated or imported.

May import: typing, kernels, ir and below, never another engine. To record a new event, add its kind to `ir/events.py`;
a field of the game names its kind in `ir/game_state.py`. A new format is a class in `ENCODERS`.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.recorder.errors import RecordingError
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.writer import Writer
from gamms.recorder.recorder import Recorder, RecorderBusy
from gamms.recorder.recording import Recording, open  # noqa: A004 - as `Recording` says: `gamms.recorder.open`
from gamms.recorder.states import State

__all__ = ["Reader", "Recorder", "RecorderBusy", "Recording", "RecordingError", "State", "Writer", "open"]

_suggest_names(__name__, __all__)
