"""How much a motion magnifies what is not known of it, in doubles: a guess, which proves nothing.

It decides how large the remainders of proven steps may be, and how many bits they need.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eomgen.certified.balls import Balls
from eomgen.certified.recursion import Motion, Series

FloatArray = NDArray[np.float64]
ORDER = 14
"""Of the series in doubles."""
REMAINDER = 1e-12
"""What is neglected in a step, relative to the state."""
MOST = 100_000
"""Steps after which the guess ends."""


@dataclass(frozen=True, eq=False)
class Growth:
    """The size of a small change of the start along a motion, relative to its first.

    times  of the steps, (n,), s
    sizes  at these, (n,)
    """

    times: FloatArray
    sizes: FloatArray

    def share(self, t: float) -> float:
        """How small an error at a time must be, relative to the largest that may be left later."""
        later = max(1.0, float(self.sizes[np.searchsorted(self.times, t) :].max(initial=0.0)))
        return min(1.0, max(1.0, float(np.interp(t, self.times, self.sizes))) / later)

    @property
    def largest(self) -> float:
        """The greatest size."""
        return max(1.0, float(self.sizes.max()))


def growth(
    motion: Motion, fixed: Sequence[float], y: Sequence[float], t: float, t_end: float
) -> Growth:
    """That of a motion from a state at a time up to another time."""
    state, change = list(y), [1.0 / math.sqrt(len(y))] * len(y)
    size, times, sizes = 1.0, [t], [1.0]
    while t < t_end and len(times) < MOST:
        try:
            found, series = motion.plain(fixed, t, state, ORDER)
            slopes = motion.plain_change(fixed, series, change, ORDER)
        except (ArithmeticError, ValueError):
            break
        h = min(_step(found), t_end - t)
        state = [_polynomial(c, h) for c in found]
        change = [_polynomial(c, h) for c in slopes]
        length = math.hypot(*change)
        if not 0 < length < math.inf or t + h <= t:
            break
        t, size = t + h, size * length
        change = [x / length for x in change]
        times.append(t)
        sizes.append(size)
    return Growth(np.array(times), np.array(sizes))


def _step(found: Series) -> float:
    """The step whose last terms are negligible; see Jorba and Zou 2005, section 3.2."""
    size = max(1.0, *(abs(c[0]) for c in found))
    lasts = [max(abs(c[k]) for c in found) for k in (ORDER - 1, ORDER)]
    steps = [
        (REMAINDER * size / last) ** (1 / k)
        for k, last in zip((ORDER - 1, ORDER), lasts, strict=True)
        if last > 0
    ]
    return min(steps, default=math.inf)


def _polynomial(coefficients: Balls, x: float) -> float:
    found = 0.0
    for c in reversed(coefficients):
        found = found * x + c
    return found
