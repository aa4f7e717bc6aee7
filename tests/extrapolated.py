"""Motions with some 40 digits, by a method that shares nothing with series: extrapolation."""

from collections.abc import Callable, Sequence
from typing import Any

from mpmath import mp

from eomgen.program.extended import evaluator
from eomgen.program.program import Program

Rate = Callable[[Any, Sequence[Any]], list[Any]]


def rate_of(program: Program, states: Sequence[str], values: dict[str, float]) -> Rate:
    """Its derivative with 60 digits."""
    run = evaluator(program, "derivative")
    return lambda t, y: run({**values, "t": t, **dict(zip(states, y, strict=True))})


def moved(rate: Rate, t: Any, y: Sequence[Any], h: Any) -> list[Any]:
    """The state after a step, with some 40 digits: the modified midpoint rule, extrapolated;
    Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, II.9.
    """
    table: list[list[list[Any]]] = []
    for k in range(1, 16):
        n = 2 * k
        d = h / n
        old, new = list(y), [a + d * b for a, b in zip(y, rate(t, y), strict=True)]
        for i in range(1, n):
            slope = rate(t + i * d, new)
            old, new = new, [a + 2 * d * b for a, b in zip(old, slope, strict=True)]
        slope = rate(t + h, new)
        row = [[(a + b + d * c) / 2 for a, b, c in zip(old, new, slope, strict=True)]]
        for j in range(1, k):
            factor = mp.mpf(k * k) / (k - j) ** 2 - 1
            row.append(
                [a + (a - b) / factor for a, b in zip(row[-1], table[-1][j - 1], strict=True)]
            )
        table.append(row)
    return table[-1][-1]
