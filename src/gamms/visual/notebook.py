"""What notebooks show: a picture of the present state, as PNG, or as SVG where pygame or Pillow is missing."""

from base64 import b64encode
from typing import TYPE_CHECKING

from gamms.errors import MissingExtra

if TYPE_CHECKING:
    from gamms.visual.engine import PictureEngine

WIDTH, HEIGHT = 900, 600


def png(engine: "PictureEngine") -> bytes | None:
    """The present state as a PNG file; None where there is nothing to make it with."""
    try:
        return engine.picture(".png", WIDTH, HEIGHT)
    except MissingExtra:
        return None


def html(engine: "PictureEngine") -> str:
    """The present state as an element of a page."""
    kind, content = "png", png(engine)
    if content is None:
        kind, content = "svg+xml", engine.picture(".svg", WIDTH, HEIGHT)
    source = f"data:image/{kind};base64,{b64encode(content).decode()}"
    return f'<img width="{WIDTH}" height="{HEIGHT}" alt="the present state" src="{source}"/>'
