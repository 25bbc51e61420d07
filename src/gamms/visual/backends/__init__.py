"""Backends: functions that turn draw commands into the bytes of a picture file.

`backend(commands, camera, *, title, note, background) -> bytes`; it reads nothing but the columns. A new
format is one file here and one line below; an installed package adds one through the entry point group
`gamms.backends`.
"""

from collections.abc import Callable

from gamms.plugins import Registry
from gamms.visual.backends import svg

Backend = Callable[..., bytes]

FORMATS: Registry[bytes] = Registry("picture format", "gamms.backends")
FORMATS.register(".svg")(svg.svg)
