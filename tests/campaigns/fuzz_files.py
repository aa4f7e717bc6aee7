"""Hostile scenes through `check`, and hostile archives of runs through their reader.

    python tests/campaigns/fuzz_files.py [--scenes N] [--archives N] [--first N]

Of each comes a refusal in a few lines, or it is taken: no traceback, nothing that a terminal would
obey, no hang, no memory beyond bounds. All failures are reported, each with the number that makes
its file again (`hostile.scene_file`, `hostile.archive_file`).
"""

import argparse
import os
import resource
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent))

from hostile import ARCHIVES, SCENES, tried

BATCH = 500


def main() -> None:
    """Try them, and say what came of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--scenes", type=int, default=50_000)
    parser.add_argument("--archives", type=int, default=20_000)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        os.environ["EOMGEN_CACHE"] = str(Path(folder) / "store")
        for kind, count in ((SCENES, given.scenes), (ARCHIVES, given.archives)):
            counts: Counter[str] = Counter()
            last = given.first + count
            for first in range(given.first, last, BATCH):
                found, failures = tried(kind, range(first, min(first + BATCH, last)), Path(folder))
                counts, failed = counts + found, failed + len(failures)
                for failure in failures:
                    print(failure, flush=True)
                if (first - given.first) % (2 * BATCH) == 0:
                    print(f"{kind} to {first + BATCH}: {dict(counts)}", flush=True)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1000
            print(f"{count} of kind {kind}: {dict(counts)}, {failed} failures, peak {peak} MB")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
