"""The versions stored in recordings and results, so that a game can be reproduced."""

import sys

__version__ = "2.0.0rc1"  # pyproject.toml reads it here


def versions() -> dict[str, str]:
    """Return the versions of GAMMS and of the libraries that affect results."""
    import numpy as np

    return {"gamms": __version__, "python": sys.version.split()[0], "numpy": np.__version__}
