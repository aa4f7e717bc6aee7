"""Errors counted in units in the last place (ulp) of a floating-point format.

The ulp of x is the distance of neighbouring numbers of the format about x: 2^(e - p) for
2^(e-1) <= |x| < 2^e and p bits, p = 53 for float64 and 24 for float32. A result that is rounded
once, and correctly, is off by half a ulp at most.

Of a vector the components of one unit are a group, and an error is counted in ulps of the group's
greatest component: by itself a component that happens to be near 0 might be off by any number of
its own. The vector's error is that of its worst component.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from eomgen.program.digits import MP
from eomgen.run.problem import Floats
from eomgen.study.truth import Exact

BITS = {"float64": 53, "float32": 24}
"""Of the significand of each format, the leading one included."""


def ulp(x: Any, bits: int) -> Any:
    """The ulp of a 60-digit number that is not 0, as one."""
    return MP.ldexp(1, MP.frexp(x)[1] - bits)


def vector_errors(found: Floats, true: Exact, units: Sequence[str], bits: int) -> Floats:
    """Errors (n,) of vectors (n of length m, in columns: (m, n)) in ulps, as this page counts them.

    `units` are those of the components. A group that is 0 altogether counts in ulps of the
    greatest it is in any of the columns; where that is 0, too, any error is infinite. What was
    found and is not finite has nan as its error.
    """
    groups = [[i for i, u in enumerate(units) if u == unit] for unit in dict.fromkeys(units)]
    sizes = np.abs(true)
    errors = np.zeros(found.shape[1])
    for group in groups:
        largest = max(sizes[group].ravel(), default=MP.mpf(0))
        for k in range(found.shape[1]):
            if not np.all(np.isfinite(found[:, k])):
                errors[k] = np.nan
                continue
            off = max(abs(MP.mpf(float(found[i, k])) - true[i, k]) for i in group)
            scale = max(sizes[group, k]) or largest
            errors[k] = max(errors[k], _in_ulps(off, scale, bits))
    return errors


def component_errors(found: Floats, true: Exact, bits: int) -> Floats:
    """Errors of all components, each in its own ulps, those left out that are 0 or not finite."""
    pairs = zip(found.ravel().tolist(), true.ravel(), strict=True)
    return np.array(
        [_in_ulps(abs(MP.mpf(x) - z), z, bits) for x, z in pairs if z and np.isfinite(x)]
    )


def _in_ulps(off: Any, scale: Any, bits: int) -> float:
    if not off:
        return 0.0
    return float(off / ulp(scale, bits)) if scale else float("inf")
