"""Zeros of functions of one variable by `eomgen.engine.roots`: SciPy takes longer to load than most
runs with contacts to compute.
"""

from collections.abc import Callable

from eomgen.engine.roots import (
    FOUND,
    MOST,
    NOT_A_NUMBER,
    RTOL,
    SAME_SIGN,
    UNFINISHED,
    WANTED,
    Search,
    begun,
    gone_on,
)

WRONG = {
    SAME_SIGN: "a function whose zero is sought has the same sign at both ends",
    NOT_A_NUMBER: "a function whose zero is sought is not a number",
    UNFINISHED: f"a zero is not found in {MOST} iterations",
}


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
    search = Search(xtol, rtol)
    answer = begun(search, a, b, *values)
    while answer == WANTED:
        answer = gone_on(search, function(search.here))
    if answer != FOUND:
        raise ValueError(WRONG[answer])
    return search.here
