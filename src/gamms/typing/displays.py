"""How things show themselves in notebooks, for rooms that cannot draw."""

from gamms.plugins import Registry

displays: Registry[str] = Registry("kind of thing to show", "gamms.displays")
"""What makes HTML of a thing. The hall answers to "recording": it takes one that is open."""
