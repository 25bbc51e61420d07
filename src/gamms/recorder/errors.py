"""What the recorder raises on purpose."""

from gamms.errors import GammsError


class RecordingError(GammsError, ValueError):
    """A recording that is damaged, foreign or absurdly large, or that can no longer be written."""
