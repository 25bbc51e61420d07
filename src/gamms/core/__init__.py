"""The simulation of one game, written once: plain typed Python that is compiled where a C compiler is found.

Each module is a `.py` file with a `.pxd` beside it that holds its C types. Compiled and interpreted, the same files
give the same games. Functions work on typed one-dimensional buffers and on numbers; none knows a `Context`.
Start reading at `draws.py`. May import: nothing but modules of this package.
"""
