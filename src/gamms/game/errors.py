"""What the turn engine raises on purpose."""

from gamms.errors import GammsError, Meddling

__all__ = ["IllegalAction", "Meddling"]


class IllegalAction(GammsError, ValueError):
    """An action that is not legal, or nonsense."""
