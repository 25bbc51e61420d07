"""Call what is public with odd arguments, which must work or be refused with an error of ours, nothing half-changed.

    python scripts/fuzz_calls.py [--worlds 310] [--seed SEED]

A fault names the call that showed it first and its world, `SEED/NUMBER`; make a test of it beside what is mended.
"""

import argparse
import secrets
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "contracts"))

from calling import fuzz


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Call what is public with odd arguments.")
    parser.add_argument("--worlds", type=int, default=310, help="of 100 calls")
    parser.add_argument("--seed", default=secrets.token_hex(4))
    options = parser.parse_args()
    faults = fuzz(options.seed, options.worlds)
    print(*faults, sep="\n")
    print(f"{len(faults)} faults in {options.worlds} worlds of 100 calls with seed {options.seed}")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
