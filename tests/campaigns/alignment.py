"""Mechanisms 1e-17 to 1 off alignment: right, reported, or refused; twenty thousand of them.

    python tests/campaigns/alignment.py [--count N] [--first N] [--closed N]

What `test_alignment` tries a few of, by number, so that it can be run in parts: all failures are
reported, each with the number that makes it again. In every N-th case the closed form is among the
routes, which takes a second or two.
"""

import argparse
import gc
import sys
import time
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent))

from aligned_trees import case
from test_alignment import WELL, tried

BATCH = 500


def main() -> None:
    """Try them, and say what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--closed", type=int, default=50)
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    start = time.process_time()
    gc.disable()  # a quarter of the time goes into it, and there is nothing much to find
    for number in range(given.first, given.first + given.count):
        outcome = tried(case(number), closed=number % given.closed == 0)
        counts[outcome if outcome in WELL else "silent"] += 1
        if outcome not in WELL:
            print(f"{number}: {outcome}", flush=True)
        if (number + 1) % BATCH == 0:
            spent = time.process_time() - start
            print(f"to {number + 1}: {dict(counts)}, {spent:.0f} s", flush=True)
            gc.collect()
    print(f"{given.count} cases: {dict(counts)}")
    sys.exit(counts["silent"] > 0)


if __name__ == "__main__":
    main()
