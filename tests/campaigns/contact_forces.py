"""Random complementarity problems of contact forces in three places: Python, the C of FMI units,
the page's JavaScript.

    python tests/campaigns/contact_forces.py [COUNT] [SEED]

Says how many have no solution that is found, how many need Lemke's method, how many agree in every
bit, and which do not agree.
"""

import sys
from pathlib import Path
from unittest import mock

sys.path.append(str(Path(__file__).parent.parent))

from complementarity import drawn, in_c, in_javascript, in_python, same

from eomgen.run import complementarity


def main() -> None:
    """Draw, solve, compare."""
    count = int(sys.argv[1]) if sys.argv[1:] else 20_000
    seed = int(sys.argv[2]) if sys.argv[2:] else 1
    problems = drawn(count, seed)
    lemke = mock.Mock(side_effect=complementarity._lemke)
    with mock.patch.object(complementarity, "_lemke", lemke):
        right = in_python(problems)
    print(f"{count} problems: {right.count(None)} without forces, {lemke.call_count} by Lemke")
    wrong = 0
    for name, found in (("C", in_c(problems)), ("JavaScript", in_javascript(problems))):
        differ = [k for k, pair in enumerate(zip(right, found, strict=True)) if not same(*pair)]
        bits = sum(a == b for a, b in zip(right, found, strict=True))
        print(f"{name}: {len(differ)} differ {differ[:10]}; {bits} equal in every bit", flush=True)
        wrong += len(differ)
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
