"""Games as text."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "reference")]  # for `gallery_turns`, and for the plain game
