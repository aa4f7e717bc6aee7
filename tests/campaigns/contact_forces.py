"""Random complementarity problems of contact forces, as Python, an FMU and a page solve them.

    python tests/campaigns/contact_forces.py [COUNT] [SEED]

Says how many have no solution that is found, how many need Lemke's method, and which do not agree
in every bit.
"""

import sys
from pathlib import Path
from unittest import mock

import numpy as np

sys.path.append(str(Path(__file__).parent.parent))

from complementarity import drawn, of_unit_and_page, solution
from languages import results

from eomgen.engine import complementarity
from eomgen.engine.printed import text


def main() -> None:
    """Draw, solve, compare."""
    count = int(sys.argv[1]) if sys.argv[1:] else 20_000
    seed = int(sys.argv[2]) if sys.argv[2:] else 1
    problems = drawn(count, seed)
    lemke = mock.Mock(side_effect=complementarity.by_lemke)
    with mock.patch.object(complementarity, "by_lemke", lemke):
        none = sum(solution(*problem) is None for problem in problems)
    print(f"{count} problems: {none} without forces, {lemke.call_count} by Lemke")
    cases = [[len(b), a, b, np.zeros(len(b))] for a, b in problems]
    python, unit, page = results(text(), "complementary", cases, given=of_unit_and_page())
    wrong = 0
    for name, found in (("the FMU", unit), ("the page", page)):
        differ = [k for k, pair in enumerate(zip(python, found, strict=True)) if pair[0] != pair[1]]
        print(f"{name}: {len(differ)} differ in a bit {differ[:10]}", flush=True)
        wrong += len(differ)
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
