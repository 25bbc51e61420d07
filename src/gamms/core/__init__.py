"""The simulation of one game, written once: plain typed Python that is compiled where a C compiler is found.

Each module is a `.py` file with a `.pxd` beside it that holds its C types. Compiled and interpreted, the same files
give the same games; `form.py` chooses between them. Functions work on typed one-dimensional buffers and on numbers;
none knows a `Context`. Start reading at `draws.py`. May import: nothing but modules of this package.
"""

from pathlib import Path

from gamms.core.form import choose as _choose

__all__ = ["is_compiled"]

is_compiled: bool = _choose(__name__, Path(__path__[0]))
"""Whether compiled modules run. If not, the same text runs interpreted: the same games, slower."""
