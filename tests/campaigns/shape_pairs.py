"""Distances and normals of contacts between shapes, beside MuJoCo's `mj_geomDistance`.

    python tests/campaigns/shape_pairs.py [--count 10000]

At random poses at which they do not touch. Printed are the greatest differences of distances, m,
and of components of normals.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from shape_pairs import PAIRS, differences

BOUND = 1e-9


def main() -> int:
    """Compare all pairs; the exit code is 1 if one is beyond the bound."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    given = parser.parse_args()
    beyond = False
    for pair in PAIRS:
        distance, normal = np.abs(differences(*pair, seed=0, count=given.count)).max(axis=0)
        beyond |= max(distance, normal) > BOUND
        print(f"{' and '.join(pair)}: distance {distance:.1e}, normal {normal:.1e}", flush=True)
    return int(beyond)


if __name__ == "__main__":
    sys.exit(main())
