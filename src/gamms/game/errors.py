"""What the turn engine raises on purpose."""

from gamms.errors import GammsError


class IllegalAction(GammsError, ValueError):
    """An action that is not legal, or nonsense."""


class Meddling(GammsError, RuntimeError):
    """A strategy changed the world otherwise than by its action."""
