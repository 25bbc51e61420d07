"""The versions that a recording and a result name, so that a game can be played again."""

import sys
from functools import cache


@cache
def package_version() -> str:
    """Return the version of GAMMS."""
    from importlib.metadata import version

    return version("gamms")


@cache
def versions() -> dict[str, str]:
    """Return the versions of GAMMS and of what draws and computes for it."""
    import numpy as np

    return {"gamms": package_version(), "python": sys.version.split()[0], "numpy": np.__version__}
