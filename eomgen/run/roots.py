"""Zeros of functions of one variable.

By Brent's method (Algorithms for Minimization without Derivatives, chapter 4), with the arithmetic
of SciPy's `brentq`: SciPy takes longer to load than most runs with contacts to compute.
`templates/c/checks.c.jinja` repeats this for compiled steps.
"""

import math
from collections.abc import Callable

MOST = 100
"""Greatest number of iterations."""
RTOL = 4 * 2.0**-52
"""Smallest relative tolerance."""


def root(
    function: Callable[[float], float],
    a: float,
    b: float,
    values: tuple[float, float],
    *,
    xtol: float,
    rtol: float = RTOL,
) -> float:
    """A point x between a and b at which a function with these `values` there, of different signs,
    crosses 0, to within xtol + rtol |x|.

    Raises `ValueError` if the function is not a number somewhere, or after `MOST` iterations.
    """
    before, here, across = a, b, a
    at_before, at_here = values
    if (at_before < 0 and at_here < 0) or (at_before > 0 and at_here > 0):
        raise ValueError("a function whose zero is sought has the same sign at both ends")
    at_across = last = step = 0.0
    for _ in range(MOST):
        if math.isnan(at_before) or math.isnan(at_here):
            raise ValueError("a function whose zero is sought is not a number")
        if at_before and at_here and (at_before < 0) != (at_here < 0):
            across, at_across = before, at_before
            last = step = here - before
        if abs(at_across) < abs(at_here):
            before, here, across = here, across, here
            at_before, at_here, at_across = at_here, at_across, at_here
        least, half = (xtol + rtol * abs(here)) / 2, (across - here) / 2
        if at_here == 0 or abs(half) < least:
            return here
        found = math.inf
        if abs(last) > least and abs(at_here) < abs(at_before):
            places, heights = (before, here, across), (at_before, at_here, at_across)
            found = _interpolated(places, heights)
        if 2 * abs(found) < min(abs(last), 3 * abs(half) - least):
            last, step = step, found
        else:
            last = step = half
        before, at_before = here, at_here
        here += step if abs(step) > least else least if half > 0 else -least
        at_here = function(here)
    raise ValueError(f"a zero is not found in {MOST} iterations")


def _interpolated(places: tuple[float, float, float], heights: tuple[float, float, float]) -> float:
    """The distance from the middle one of three places to the zero of a line, or of a hyperbola if
    they differ; not finite if there is none.
    """
    (before, here, across), (at_before, at_here, at_across) = places, heights
    try:
        if before == across:
            return -at_here * (here - before) / (at_here - at_before)
        one = (at_before - at_here) / (before - here)
        other = (at_across - at_here) / (across - here)
        over = at_across * other - at_before * one
        return -at_here * over / (other * one * (at_across - at_before))
    except ZeroDivisionError:
        return math.inf
