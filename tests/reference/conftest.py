"""Games that are played by the library and by the reference, and compared."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # for the package `plain_game`, and for random scenarios
