"""A million scenes with something wrong in them: a message or a model comes of each.

    python tests/campaigns/fuzz_scenes.py [--count N] [--first N]

All failures are reported, each with the number that makes its scene again (`fuzzing.scene`).
"""

import argparse
import sys
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent))

from fuzzing import tried

BATCH = 1000


def main() -> None:
    """Try them, and say what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    longest, failed = 0.0, 0
    last = given.first + given.count
    for first in range(given.first, last, BATCH):
        found, slowest, failures = tried(range(first, min(first + BATCH, last)))
        counts, longest, failed = counts + found, max(longest, slowest), failed + len(failures)
        for failure in failures:
            print(failure, flush=True)
        if (first - given.first) % (50 * BATCH) == 0:
            print(f"to {first + BATCH}: {dict(counts)}, longest {longest:.2f} s", flush=True)
    print(f"{given.count} scenes: {dict(counts)}, {failed} failures, longest {longest:.2f} s")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
