"""Gauss collocation methods: nodes and weights in extended precision.

Hairer, Nørsett, Wanner, Solving ODEs I, section II.7.
"""

import math
from dataclasses import dataclass
from functools import cache

import gmpy2
import numpy as np
from gmpy2 import mpfr
from numpy.typing import NDArray

from eomgen.study.precision.precise import BITS, Extended, digits

ExtendedArray = NDArray[np.object_]
"""An array of extended-precision numbers."""


@dataclass(frozen=True, eq=False)
class Gauss:
    """The collocation method with s stages on [0, 1].

    c     nodes (s,)
    a     weights of the stages (s, s), Butcher's matrix
    d     (s,): applied to the values at the nodes of a polynomial that is 0 at 0, its value at 1
    fall  (4, s): applied to the same values, the two middle and the two last coefficients of the
          polynomial's derivative in normalised Legendre polynomials
    """

    c: ExtendedArray
    a: ExtendedArray
    d: ExtendedArray
    fall: ExtendedArray


@cache
def gauss(stages: int) -> Gauss:
    """Gauss-Legendre collocation with that many stages. The nodes come from Newton's method on the
    Legendre polynomial. The weights are exact integrals of the Lagrange polynomials, expanded in
    Legendre polynomials.
    """
    with digits(2 * BITS):
        nodes, weights = [], []
        for i in range(stages):
            x = mpfr(-math.cos(math.pi * (i + 0.75) / (stages + 0.5)))
            for _ in range(8):  # starts with 3 digits, and each iteration doubles them
                values = _legendre(stages, x)
                slope = stages * (x * values[stages] - values[stages - 1]) / (x * x - 1)
                x -= values[stages] / slope
            values = _legendre(stages, x)
            slope = stages * (x * values[stages] - values[stages - 1]) / (x * x - 1)
            nodes.append((x + 1) / 2)
            weights.append(1 / ((1 - x * x) * slope * slope))
        at = np.array([_legendre(stages, 2 * c - 1) for c in nodes])
        # The integral of P_k(2x - 1) from 0 on is (P_{k+1} - P_{k-1}) / (2 (2k + 1)).
        before = np.array([[mpfr(-1), *row] for row in at])
        integrals = at[:, 1:] - before[:, :stages]
        a = integrals @ (at[:, :stages] * np.array(weights)[:, None]).T / 2
        d = [
            math.prod((1 - c) / (node - c) for c in nodes if c is not node) / node for node in nodes
        ]
        slopes = np.array([[_slope(nodes, i, j) for i in range(stages)] for j in range(stages)])
        kept = [stages // 2 - 1, stages // 2, stages - 2, stages - 1]
        norms = np.array([gmpy2.sqrt(mpfr(2 * k + 1)) for k in kept])
        legendre = (at[:, kept] * np.array(weights)[:, None] * norms).T
        exact = (np.array(nodes), a, np.array(d), legendre @ slopes)
    with digits():
        return Gauss(*(x * mpfr(1) for x in exact))


def _slope(nodes: list[Extended], i: int, j: int) -> Extended:
    """The derivative at node j of the polynomial that is 1 at node i and 0 at 0 and other nodes."""
    x = nodes[j]
    others = [mpfr(0), *(c for c in nodes if c is not nodes[i])]
    if i == j:
        return sum(1 / (x - c) for c in others)
    rest = [c for c in others if c is not x]
    return math.prod((x - c) / (nodes[i] - c) for c in rest) / (nodes[i] - x)


def _legendre(degree: int, x: Extended) -> list[Extended]:
    """P_0(x) … P_degree(x), by the three-term recurrence."""
    values = [mpfr(1), x]
    for k in range(1, degree):
        values.append(((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1))
    return values
