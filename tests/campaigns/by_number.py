"""Cases at random, each made again by its number: right, or refused in a line.

    python tests/campaigns/by_number.py KIND [--count N] [--first N]

alignment  mechanisms 1e-17 to 1 off alignment; in every 50th the closed form is among the routes,
           which takes a second or two
trees      random trees over 24 decades of everything
scenes     scenes with something wrong in them, through the reader: a message or a model
files      hostile scenes, through `check`: a refusal in a few lines, or taken; no traceback,
           nothing that a terminal would obey, no hang, no memory beyond bounds
archives   the same of hostile archives of runs, through their reader
folders    attacks on the folder of a sweep, flips, cuts, links, pipes, edits, left-overs: it ends
           with the bytes of one that was left in peace, or is refused; no file elsewhere changes

Tests try the first few of each. All failures are reported, each with the number that makes its case
again, so that a campaign can be run in parts.
"""

import argparse
import gc
import os
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

sys.path += [str(Path(__file__).parent.parent / room) for room in ("", "dynamics")]

import aligned_trees
import folder_attacks
import fuzzing
import hostile
import test_alignment
import test_no_silent_error
from campaign import among, counted

BATCH = 500


def alignment(number: int) -> str:
    case = aligned_trees.case(number)
    return among(test_alignment.tried(case, closed=number % 50 == 0), test_alignment.WELL)


def trees(number: int) -> str:
    case = test_no_silent_error.case(number)
    return among(test_no_silent_error.tried(*case), test_no_silent_error.WELL)


KINDS: dict[str, tuple[Callable[[Path], Callable[[int], str]], int]] = {
    "alignment": (lambda folder: alignment, 20_000),
    "trees": (lambda folder: trees, 100_000),
    "scenes": (lambda folder: fuzzing.outcome, 1_000_000),
    "files": (lambda folder: partial(hostile.outcome, hostile.SCENES, folder), 50_000),
    "archives": (lambda folder: partial(hostile.outcome, hostile.ARCHIVES, folder), 20_000),
    "folders": (lambda folder: partial(folder_attacks.outcome, folder), 5000),
}
"""What comes of a number, given a folder for files, and how many are tried."""


def main() -> int:
    """Try them, and say what came of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--count", type=int)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    made, usual = KINDS[given.kind]
    numbers = range(given.first, given.first + (given.count or usual))
    counts: Counter[str] = Counter()
    failed, start = 0, time.process_time()
    gc.disable()  # a quarter of the time goes into it, and there is nothing much to find
    with tempfile.TemporaryDirectory() as folder:
        os.environ["EOMGEN_CACHE"] = str(Path(folder) / "store")
        outcome = made(Path(folder))
        for batch in (numbers[i : i + BATCH] for i in range(0, len(numbers), BATCH)):
            found, failures = counted(outcome, batch)
            counts, failed = counts + found, failed + len(failures)
            for failure in failures:
                print(failure, flush=True)
            spent, peak = time.process_time() - start, resource.getrusage(resource.RUSAGE_SELF)
            print(
                f"{given.kind} to {batch.stop}: {dict(sorted(counts.items()))}, {failed} failures, "
                f"{spent:.0f} s, peak {peak.ru_maxrss // 1000} MB",
                flush=True,
            )
            gc.collect()
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
