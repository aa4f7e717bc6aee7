"""The constants of DOP853 as the C templates take them."""

from collections.abc import Callable
from typing import Any

from eomgen.run.integrators import dormand_prince_8 as dop853
from eomgen.run.integrators.dop853_coefficients import NODES, Row


def constants(summed: Callable[[Row], Any]) -> dict[str, object]:
    """All constants by their names in the templates; `summed` writes a sum over slopes."""
    return {
        "slopes": dop853.SLOPES,
        "nodes": [repr(node) for node in NODES],
        "stages": [(i, summed(dop853.SUMS[i])) for i in range(1, 12)],
        "end_sum": summed(dop853.SUMS[dop853.AT_END]),
        "long_error": summed(dop853.SUMS[dop853.LONG_ERROR]),
        "short_error": summed(dop853.SUMS[dop853.SHORT_ERROR]),
        "dense_stages": [
            (i, summed(dop853.SUMS[dop853.AT_DENSE + i - 13])) for i in range(13, dop853.SLOPES)
        ],
        "dense": [summed(row) for row in dop853.SUMS[dop853.IN_DENSE :]],
        "safety": repr(dop853.SAFETY),
        "smallest": repr(dop853.SMALLEST),
        "greatest": repr(dop853.GREATEST),
        "short_weight": repr(dop853.SHORT_WEIGHT),
    }


def written_out(row: Row) -> str:
    """A sum over slopes. It begins with 0 and so is never -0, as where all factors are added."""
    return " + ".join(["0.0", *(f"{row[j]!r} * k[{j}][j]" for j in sorted(row))])
