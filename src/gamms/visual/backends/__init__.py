"""Backends: functions that turn draw commands into the bytes of a picture file.

`backend(commands, camera, *, title, note, background, dpi) -> bytes`; it reads nothing but the columns. A new
format is one file here and one line below; an installed package adds one through the entry point group
`gamms.backends`. `gamms.testing.check_backend` says whether it keeps the contract.

Pixels are painted by `raster.py` on the surfaces of `pygame.py`; optional libraries have one file each.
"""

from collections.abc import Callable

from gamms.plugins import Registry
from gamms.visual.backends import png, svg

Backend = Callable[..., bytes]

FORMATS: Registry[bytes] = Registry("picture format", "gamms.backends")
FORMATS.register(".svg")(svg.svg)
FORMATS.register(".png")(png.png)
