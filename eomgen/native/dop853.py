"""The constants of DOP853 as the C templates take them."""

from collections.abc import Callable
from typing import Any

from eomgen.engine.embedded import DOP853
from eomgen.subset.words import Row


def constants(summed: Callable[[Row], Any]) -> dict[str, object]:
    """All constants by their names in the templates; `summed` writes a sum over slopes."""
    many, last = len(DOP853.nodes), DOP853.last
    return {
        "slopes": many,
        "nodes": [repr(node) for node in DOP853.nodes],
        "stages": [(i, summed(DOP853.stages[i])) for i in range(1, last)],
        "end_sum": summed(DOP853.end),
        "long_error": summed(DOP853.long_error),
        "short_error": summed(DOP853.short_error),
        "dense_stages": [(i, summed(DOP853.stages[i])) for i in range(last + 1, many)],
        "dense": [summed(row) for row in DOP853.dense],
        "safety": repr(DOP853.safety),
        "smallest": repr(DOP853.smallest),
        "greatest": repr(DOP853.greatest),
        "short_weight": repr(DOP853.short_weight),
    }


def written_out(row: Row) -> str:
    """A sum over slopes. It begins with 0 and so is never -0, as where all factors are added."""
    return " + ".join(["0.0", *(f"{a!r} * k[{j}][j]" for j, a in row)])
