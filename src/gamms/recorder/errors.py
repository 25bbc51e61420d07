"""What is wrong with a recording."""

from gamms.errors import GammsError


class RecordingError(GammsError, ValueError):
    """A recording that is damaged, foreign, cut off or does not fit the context it is played in."""
