"""Errors counted in units in the last place (ulp) of a floating-point format.

The ulp of x is the spacing of numbers of the format near x: 2^(e - p) for 2^(e-1) <= |x| < 2^e and
p bits, p = 53 for float64 and 24 for float32. A correctly rounded result is off by at most half an
ulp.

The components of a vector with the same unit form a group. Their errors are counted in ulps of the
group's greatest component: a component near 0 might be off by any number of its own ulps. For the
same reason a group that nearly vanishes, as in a motion that decays, counts in ulps of at least a
thousandth of its median size over all states. A vector's error is that of its worst component.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from eomgen.run.problem import FloatArray
from eomgen.scalars.extended import MP
from eomgen.study.verification.truth import Exact

LEAST_SCALE = 1e-3
"""Least scale of a group, relative to its median size."""
BITS = {"float64": 53, "float32": 24}
"""Of the significand of each format, including the leading bit."""


def ulp(x: Any, bits: int) -> Any:
    """The ulp of a 60-digit number that is not 0, as a 60-digit number."""
    return MP.ldexp(1, MP.frexp(x)[1] - bits)


def vector_errors(found: FloatArray, true: Exact, units: Sequence[str], bits: int) -> FloatArray:
    """Errors (n,) in ulps of vectors in columns (m, n), as this module counts them.

    `units` are those of the components. If a group is 0 at most states, its greatest size at any
    state is used instead of the median; if that is 0, too, any error is infinite. Where `found` is
    not finite, the error is nan.
    """
    finite = np.all(np.isfinite(found), axis=0)
    errors = np.where(finite, 0.0, np.nan)
    for group, scale in group_scales(true, units):
        for k in np.flatnonzero(finite):
            error = max(abs(MP.mpf(float(found[i, k])) - true[i, k]) for i in group)
            errors[k] = max(errors[k], _in_ulps(error, scale[k], bits))
    return errors


def group_scales(true: Any, units: Sequence[str]) -> list[tuple[list[int], Any]]:
    """For each group of vectors in columns (m, n): its components, and the scales (n,) in whose
    ulps its errors are counted.
    """
    found = []
    for unit in dict.fromkeys(units):
        group = [i for i, u in enumerate(units) if u == unit]
        sizes = np.max(np.abs(true[group]), axis=0)
        least = LEAST_SCALE * (sorted(sizes)[len(sizes) // 2] or max(sizes))
        found.append((group, np.maximum(sizes, least)))
    return found


def component_errors(found: FloatArray, true: Exact, bits: int) -> FloatArray:
    """Errors of all components, each in its own ulps, except those that are 0 or not finite."""
    pairs = zip(found.ravel().tolist(), true.ravel(), strict=True)
    return np.array(
        [_in_ulps(abs(MP.mpf(x) - z), z, bits) for x, z in pairs if z and np.isfinite(x)]
    )


def _in_ulps(error: Any, scale: Any, bits: int) -> float:
    if not error:
        return 0.0
    return float(error / ulp(scale, bits)) if scale else float("inf")
