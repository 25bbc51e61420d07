"""What notebooks show: a picture of the present state, as PNG, or as SVG where pygame or Pillow is missing."""

from base64 import b64encode
from typing import Protocol

from gamms.errors import MissingExtra

WIDTH, HEIGHT = 900, 600


class _Pictured(Protocol):
    def picture(self, format: str, /, width: int, height: int) -> bytes: ...


def png(engine: _Pictured) -> bytes | None:
    """The present state as a PNG file; None where there is nothing to make it with."""
    try:
        return engine.picture(".png", WIDTH, HEIGHT)
    except MissingExtra:
        return None


def html(engine: _Pictured) -> str:
    """The present state as an element of a page."""
    kind, content = "png", png(engine)
    if content is None:
        kind, content = "svg+xml", engine.picture(".svg", WIDTH, HEIGHT)
    source = f"data:image/{kind};base64,{b64encode(content).decode()}"
    return f'<img width="{WIDTH}" height="{HEIGHT}" alt="the present state" src="{source}"/>'
