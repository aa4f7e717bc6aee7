"""The stages of a step of DOP853 for few states, written out in Python's own numbers.

NumPy takes longer to begin an operation than Python to add a few numbers. The sums are those of
`dormand_prince_8`, term by term in the same order, so that they have the same bits.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from eomgen.loading import load_source
from eomgen.run.integrators.dop853_coefficients import NODES, Row

MOST = 12
"""Greatest number of states for which this is quicker."""

Stages = Callable[..., tuple[list[Any], list[float], list[float], list[float]]]
"""`stages(fun, t, h, y, f)` for lists y and f of ny numbers: the slopes 1 to 11, as arrays, and the
sums for the change of y, the error of order 5 and that of order 3."""


@cache
def written_out(ny: int, sums: tuple[tuple[tuple[int, float], ...], ...]) -> Stages:
    """The stages for `ny` states. `sums` has the factors of stages 1 to 11, then those of the
    change and of both errors.
    """
    head = ("from numpy import array", "def stages(fun, t, h, y, f):")
    source = "\n    ".join(_lines(ny, sums))
    made: Stages = load_source("\n".join((*head, f"    {source}\n")), f"dop853_{ny}").stages
    return made


def _lines(ny: int, sums: Sequence[Sequence[tuple[int, float]]]) -> list[str]:
    lines = [f"{_names('y', ny)} = y", f"{_names('k0_', ny)} = f"]
    for i in range(1, 12):
        places = (f"y{n} + h * ({_sum(sums[i - 1], n)})" for n in range(ny))
        lines.append(f"s{i} = fun(t + {NODES[i]!r} * h, array([{', '.join(places)}]))")
        lines.append(f"{_names(f'k{i}_', ny)} = s{i}.tolist()")
    ends = (f"[{', '.join(_sum(row, n) for n in range(ny))}]" for row in sums[11:])
    slopes = ", ".join(f"s{i}" for i in range(1, 12))
    lines.append(f"return [{slopes}], {', '.join(ends)}")
    return lines


def _names(letter: str, ny: int) -> str:
    return "".join(f"{letter}{n}, " for n in range(ny)).strip()


def _sum(row: Sequence[tuple[int, float]], n: int) -> str:
    """A sum for state n. It begins with 0, as where all factors are added."""
    return " + ".join(["0.0", *(f"{factor!r} * k{j}_{n}" for j, factor in row)])


def terms_of(rows: Sequence[Row]) -> tuple[tuple[tuple[int, float], ...], ...]:
    """The terms of sums in the order of the slopes."""
    return tuple(tuple(sorted(row.items())) for row in rows)
