"""Zeros of functions of one variable, by Brent's method.

Algorithms for Minimization without Derivatives, chapter 4, with the arithmetic of SciPy's `brentq`.
The function is not called from here: `begun` and `gone_on` say where its value is wanted.
"""

from dataclasses import dataclass

from eomgen.subset.words import inf

MOST = 100
"""Greatest number of iterations."""
RTOL = 4 * 2.0**-52
"""Smallest relative tolerance."""
FOUND, WANTED, SAME_SIGN, NOT_A_NUMBER, UNFINISHED = 0, 1, 2, 3, 4
"""What a search answers: its zero is `here`; the value at `here` is wanted; the function has the
same sign at both ends; it is not a number; there were `MOST` iterations."""


@dataclass(slots=True)
class Search:
    """A search so far: the last three points and the values there, and the last two steps."""

    xtol: float = 0.0
    rtol: float = 0.0
    before: float = 0.0
    here: float = 0.0
    across: float = 0.0
    at_before: float = 0.0
    at_here: float = 0.0
    at_across: float = 0.0
    last: float = 0.0
    step: float = 0.0
    made: int = 0


def begun(search: Search, a: float, b: float, at_a: float, at_b: float) -> int:
    """Begin between a and b, where the function has these values, of different signs."""
    search.before = a
    search.here = b
    search.across = a
    search.at_before = at_a
    search.at_here = at_b
    search.at_across = 0.0
    search.last = 0.0
    search.step = 0.0
    search.made = 0
    if (at_a < 0.0 and at_b < 0.0) or (at_a > 0.0 and at_b > 0.0):
        return SAME_SIGN
    return chosen(search)


def gone_on(search: Search, value: float) -> int:
    """Go on with the function's value at `here`."""
    search.at_here = value
    search.made += 1
    if search.made == MOST:
        return UNFINISHED
    return chosen(search)


def chosen(search: Search) -> int:
    """Choose the next point, to within xtol + rtol |here| of the zero if it is the last."""
    if search.at_before != search.at_before or search.at_here != search.at_here:
        return NOT_A_NUMBER
    differ = (search.at_before < 0.0) != (search.at_here < 0.0)
    if differ and search.at_before != 0.0 and search.at_here != 0.0:
        search.across = search.before
        search.at_across = search.at_before
        search.step = search.here - search.before
        search.last = search.step
    if abs(search.at_across) < abs(search.at_here):
        search.before = search.here
        search.here = search.across
        search.across = search.before
        search.at_before = search.at_here
        search.at_here = search.at_across
        search.at_across = search.at_before
    least = (search.xtol + search.rtol * abs(search.here)) / 2.0
    half = (search.across - search.here) / 2.0
    if search.at_here == 0.0 or abs(half) < least:
        return FOUND
    found = inf
    if abs(search.last) > least and abs(search.at_here) < abs(search.at_before):
        found = interpolated(search)
    if 2.0 * abs(found) < min(abs(search.last), 3.0 * abs(half) - least):
        search.last = search.step
        search.step = found
    else:
        search.last = half
        search.step = half
    search.before = search.here
    search.at_before = search.at_here
    if abs(search.step) > least:
        search.here = search.here + search.step
    elif half > 0.0:
        search.here = search.here + least
    else:
        search.here = search.here - least
    return WANTED


def interpolated(search: Search) -> float:
    """The distance from `here` to the zero of a line, or of a hyperbola if the three points differ;
    not finite if there is none.
    """
    before = search.before
    here = search.here
    if before == search.across:
        below = search.at_here - search.at_before
        if below == 0.0:
            return inf
        return -search.at_here * (here - before) / below
    if before == here or search.across == here:
        return inf
    one = (search.at_before - search.at_here) / (before - here)
    other = (search.at_across - search.at_here) / (search.across - here)
    over = search.at_across * other - search.at_before * one
    below = other * one * (search.at_across - search.at_before)
    if below == 0.0:
        return inf
    return -search.at_here * over / below
