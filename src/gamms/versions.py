"""The versions that a recording and a result name, so that a game can be played again."""

import sys

__version__ = "2.0.0rc1"  # pyproject.toml reads it here


def versions() -> dict[str, str]:
    """Return the versions of GAMMS and of what draws and computes for it."""
    import numpy as np

    return {"gamms": __version__, "python": sys.version.split()[0], "numpy": np.__version__}
