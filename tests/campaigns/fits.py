"""Do the intervals of `fit` cover the truth as often as they say?

    python tests/campaigns/fits.py [--count 200] [CASE …]

For each experiment of `tests/fit_cases.py`, with seeded noise: how often the interval of each value
has the true one in it, in all, and the motions and the time, of the processor, of a fit.
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parent.parent))

from fit_cases import CASES, Case

import eomgen


def covered(case: Case, seeds: range) -> tuple[dict[str, int], float, float]:
    """How many intervals of each value cover it, and motions and seconds of a fit."""
    counts: dict[str, int] = {}
    motions, begun = 0, time.process_time()
    for seed in seeds:
        data, options = case.draw(seed)
        fit = eomgen.fit(case.source, data, case.names, **options)
        motions += fit.motions
        for name, (low, high) in fit.intervals.items():
            counts[name] = counts.get(name, 0) + (low <= case.true(name) <= high)
    spent = time.process_time() - begun
    return counts, motions / len(seeds), spent / len(seeds)


def main() -> None:
    """Print a line for each experiment, and one for all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE")
    parser.add_argument("--count", type=int, default=200)
    given = parser.parse_args()
    hits = tries = 0
    for name in given.cases or CASES:
        case = CASES[name]
        case.draw(0)
        counts, motions, spent = covered(case, range(given.count))
        hits, tries = hits + sum(counts.values()), tries + len(counts) * given.count
        share = sum(counts.values()) / len(counts) / given.count
        each = ", ".join(f"{n} {100 * x / given.count:.1f}" for n, x in counts.items())
        print(
            f"{name:13} {100 * share:5.1f} %  {motions:5.1f} motions {1e3 * spent:6.1f} ms  {each}"
        )
    print(f"{'all':13} {100 * hits / tries:5.1f} % of {tries} intervals")


if __name__ == "__main__":
    main()
