"""PNG: the commands as pixels, in a file."""

from gamms.ir.draw import DrawCommands
from gamms.visual.camera import Camera
from gamms.visual.color import Rgba


def png(commands: DrawCommands, camera: Camera, *, title: str, note: str, background: Rgba, dpi: float = 96.0) -> bytes:
    """The whole picture as a PNG file.

    Raises:
        MissingExtra: pygame or Pillow is not installed.
    """
    from gamms.visual.backends.pillow import png_file
    from gamms.visual.backends.raster import painted

    canvas = painted(commands, camera, title=title, note=note, background=background, dpi=dpi)
    return png_file(canvas.pixels(), dpi)
