"""Random trees over 24 decades of everything: right, or refused; a hundred thousand of them.

    python tests/campaigns/silent_errors.py [--count N] [--first N]

What `test_no_silent_error` tries a few hundred of, by number, so that it can be run in parts: all
failures are reported, each with the number that makes it again.
"""

import argparse
import gc
import sys
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent))

from test_no_silent_error import WELL, case, tried

BATCH = 500


def main() -> None:
    """Try them, and say what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    gc.disable()  # a quarter of the time goes into it, and there is nothing much to find
    for number in range(given.first, given.first + given.count):
        outcome = tried(*case(number))
        counts[outcome if outcome in WELL else "silent"] += 1
        if outcome not in WELL:
            print(f"{number}: {outcome}", flush=True)
        if (number + 1) % BATCH == 0:
            print(f"to {number + 1}: {dict(counts)}", flush=True)
            gc.collect()
    print(f"{given.count} trees: {dict(counts)}")
    sys.exit(counts["silent"] > 0)


if __name__ == "__main__":
    main()
