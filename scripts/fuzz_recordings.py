"""Read mutated recordings, which must end in `RecordingError` or in a prefix of what was written.

    python scripts/fuzz_recordings.py [--count 100000] [--seed SEED] [--games 2000]

A failure names its mutant, `SEED/NUMBER`; keep it as a test in tests/recorder/test_fuzz.py.
"""

import argparse
import secrets
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "recorder"))

from fuzzing import fuzz
from fuzzing_games import fuzz_games


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Read mutated recordings.")
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--games", type=int, default=2_000, help="of whole games with right checksums")
    parser.add_argument("--seed", default=secrets.token_hex(4))
    options = parser.parse_args()
    print(f"{options.count} mutants, and {options.games} of games, with seed {options.seed}")
    start = time.perf_counter()
    fuzz(options.seed, options.count)
    fuzz_games(options.seed, options.games)
    print(f"all were refused or read, in {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
