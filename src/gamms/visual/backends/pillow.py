"""The one door to Pillow: PNG files."""

import io
from typing import Any

from gamms.errors import MissingExtra
from gamms.visual.backends.coverage import ByteArray


def _image_module() -> Any:
    """Pillow's `Image`.

    Raises:
        MissingExtra: it is not installed.
    """
    try:
        from PIL import Image
    except ImportError as error:
        raise MissingExtra("Writing a PNG or GIF file", "viz") from error
    return Image


def png_file(pixels: ByteArray, dpi: float) -> bytes:
    """A PNG file of RGB pixels (height, width, 3) that says how large it is on paper."""
    data = io.BytesIO()
    _image_module().fromarray(pixels).save(data, "PNG", dpi=(dpi, dpi))
    return data.getvalue()
