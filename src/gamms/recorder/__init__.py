"""The recorder room: recordings that are compact, seekable, whole after a crash, and safe to open.

Read `formats/__init__.py` first: it says how a recording is made up. This room knows plain values only, no context.
May import: typing, kernels, ir and below, never another room. To add a file format, write one file in `formats/`.
"""

from gamms.recorder.errors import RecordingError
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.writer import Writer

__all__ = ["Reader", "RecordingError", "Writer"]
