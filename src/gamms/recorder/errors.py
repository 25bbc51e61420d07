"""What the recorder raises on purpose."""

from gamms.errors import GammsError


class RecordingError(GammsError, ValueError):
    """A recording that is damaged, foreign or absurdly large, or that can no longer be written."""


class RecorderBusy(GammsError, RuntimeError):
    """What was asked for does not go with what the recorder is doing."""


DAMAGES = (
    KeyError,
    TypeError,
    ValueError,
    IndexError,
    AttributeError,
    OverflowError,
)  # raised by data that no recorder wrote


UNFIT = (GammsError, *DAMAGES)  # the same, where it is handed to a context


class Damaged(GammsError, ValueError):
    """A state is not right, or an event does not fit the state it happens to."""
