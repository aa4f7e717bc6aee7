"""Explicit Runge-Kutta methods as data: a Butcher tableau that proves its own order."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from eomgen.run.problem import Floats

_ROUNDOFF = 1e-14


@dataclass(frozen=True)
class ButcherTableau:
    """Coefficients of an explicit method of s stages: a (s, s), weights b (s,), nodes c (s,).

    Made only if a is strictly lower triangular, every row of a sums to its node, and the order
    conditions hold up to the stated order (1 to 4); else `ValueError` names what fails.
    Hairer, Norsett, Wanner, Solving ODEs I, section II.1, and theorem II.2.13.
    """

    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]
    order: int

    def __post_init__(self) -> None:
        a, b, c = self._arrays
        stages = len(b)
        if a.shape != (stages, stages) or c.shape != (stages,):
            raise ValueError(f"tableau: a {a.shape}, b {b.shape} and c {c.shape} do not fit")
        if np.any(np.triu(a)):
            raise ValueError("tableau: not explicit, a is not strictly lower triangular")
        if np.max(np.abs(a.sum(axis=1) - c)) > _ROUNDOFF:
            raise ValueError("tableau: the rows of a do not sum to c")
        if self.order not in (1, 2, 3, 4):
            raise ValueError(f"tableau: order {self.order} is not among 1, 2, 3, 4")
        for order, condition, value, wanted in _order_conditions(a, b, c):
            if order <= self.order and abs(value - wanted) > _ROUNDOFF:
                raise ValueError(f"tableau: not of order {order}, {condition} is {value:.6g}")

    @cached_property
    def _arrays(self) -> tuple[Floats, Floats, Floats]:
        a, b, c = (np.array(part, dtype=np.float64) for part in (self.a, self.b, self.c))
        return a, b, c

    def step(
        self, derivative: Callable[[float, Floats], Floats], t: float, y: Floats, h: float
    ) -> Floats:
        """Return y(t + h), shape (ny,), stage after stage."""
        a, b, _ = self._arrays
        slopes = np.empty((len(b), len(y)))
        for i, node in enumerate(self.c):
            slopes[i] = derivative(t + node * h, y + h * (a[i, :i] @ slopes[:i]))
        return y + h * (b @ slopes)


def _order_conditions(a: Floats, b: Floats, c: Floats) -> list[tuple[int, str, float, float]]:
    """One condition per rooted tree: (order, how it reads, its value, the value it must have)."""
    return [
        (1, "sum b = 1", b.sum(), 1),
        (2, "b c = 1/2", b @ c, 1 / 2),
        (3, "b c^2 = 1/3", b @ c**2, 1 / 3),
        (3, "b a c = 1/6", b @ a @ c, 1 / 6),
        (4, "b c^3 = 1/4", b @ c**3, 1 / 4),
        (4, "(b c) a c = 1/8", (b * c) @ a @ c, 1 / 8),
        (4, "b a c^2 = 1/12", b @ a @ c**2, 1 / 12),
        (4, "b a a c = 1/24", b @ a @ a @ c, 1 / 24),
    ]
