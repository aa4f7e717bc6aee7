"""Attacks on the folder of a sweep: flips, cuts, links, pipes, edits, left-overs.

    python tests/campaigns/sweep_folders.py [--count N] [--first N]

Each sweep ends with the bytes of one that was left in peace, or is refused in a line: no wrong
number, no traceback, no hang, no change of a file elsewhere. All failures are reported, each with
the number that makes its attack again.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent))

from folder_attacks import tried


def main() -> None:
    """Try them, and say what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["EOMGEN_CACHE"] = str(Path(folder) / "store")
        counts, failures = tried(range(given.first, given.first + given.count), Path(folder))
    for failure in failures:
        print(failure)
    for name, count in sorted(counts.items()):
        print(f"{count:6d} {name}")
    took = time.monotonic() - began
    print(f"{given.count} attacks, {len(failures)} failures, {took:.0f} s")
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
