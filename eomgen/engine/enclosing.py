"""Enclosures of functions along a part of a step, from their values at five points.

On a part the functions are interpolated by polynomials of degree 4, whose Bernstein coefficients
enclose them (Farouki, The Bernstein polynomial basis, Computer Aided Geometric Design 29 (2012),
379).
"""

import math

import numpy as np

from eomgen.subset.words import Row

LAST = 4
"""Degree of the polynomials."""
AT = (1 - np.cos(np.pi * np.arange(LAST + 1) / LAST)) / 2
"""Chebyshev points of a part, 0 to 1, with both ends: where the functions are evaluated."""
_TO_BERNSTEIN = np.linalg.inv(
    np.array([[math.comb(LAST, i) * x**i * (1 - x) ** (LAST - i) for i in range(5)] for x in AT])
)
_TO_CHEBYSHEV = np.linalg.inv(np.polynomial.chebyshev.chebvander(2 * AT - 1, LAST))
INNER = AT[1:-1]
"""The inner ones of these points, (3,)."""
FACTORS = np.vstack((_TO_BERNSTEIN, _TO_CHEBYSHEV[-2:]))
"""(7, 5): from values at the points, the Bernstein and the last two Chebyshev coefficients."""
ENCLOSING = tuple(Row(enumerate(row)) for row in FACTORS.tolist())
"""The same, as rows of sums."""
