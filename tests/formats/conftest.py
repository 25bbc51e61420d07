"""The tests of the formats find both readers beside them."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
