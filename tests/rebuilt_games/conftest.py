"""Makes the games of this folder, those among the examples, and the package `plain_game` importable."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "examples"), str(HERE.parent / "reference")]
