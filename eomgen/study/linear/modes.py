"""Modes, stability and controllability of a linear system."""

import math
from dataclasses import dataclass

import numpy as np

from eomgen.run.problem import FloatArray

SLOW = 1e-7
"""Smaller rates, 1/s, count as 0: rounding splits the double eigenvalue 0 of a motion without force
by about the square root of the machine epsilon."""
FINE = 1e-6
"""Rates below this fraction of the fastest also count as 0."""
INDEPENDENT = 1e-10
"""A direction is independent of others if its component normal to them exceeds this fraction."""


@dataclass(frozen=True)
class Mode:
    """An eigenvalue, or with `angular_frequency` > 0 a conjugate pair: `rate` ± i
    `angular_frequency`, 1/s.
    """

    rate: float
    angular_frequency: float

    @property
    def frequency(self) -> float:
        """Frequency of the oscillation, Hz."""
        return self.angular_frequency / (2 * math.pi)

    @property
    def damping(self) -> float:
        """Ratio -Re λ / |λ|: 0 undamped, 1 without oscillation, negative if it grows."""
        size = math.hypot(self.rate, self.angular_frequency)
        return -self.rate / size if size else 0.0


def modes(a: FloatArray) -> list[Mode]:
    """The modes of ẋ = a x, sorted by falling growth rate, then by rising frequency."""
    values = np.linalg.eigvals(a) if a.size else np.zeros(0, complex)
    small = max(SLOW, FINE * float(np.max(np.abs(values), initial=0.0)))
    found = []
    for value in values.tolist():
        rate = value.real if abs(value.real) > small else 0.0
        frequency = value.imag if abs(value.imag) > small else 0.0
        if frequency >= 0.0:
            found.append(Mode(rate, frequency))
    return sorted(found, key=lambda mode: (-mode.rate, mode.angular_frequency))


def stability(found: list[Mode]) -> str:
    """One word: 'unstable', 'stable' (asymptotically), or 'marginal'."""
    if any(mode.rate > 0 for mode in found):
        return "unstable"
    return "stable" if all(mode.rate < 0 for mode in found) else "marginal"


def controllable_rank(a: FloatArray, b: FloatArray) -> int:
    """Dimension of the controllable subspace: the rank of [b, a b, a² b, …].

    It is the size of an orthonormal basis that is extended by `a` times its newest part: the powers
    themselves would soon lose their digits.
    """
    size = float(np.linalg.norm(a, 2)) if a.size else 0.0
    new = b / np.maximum(np.linalg.norm(b, axis=0), np.finfo(np.float64).tiny)
    basis, least = np.zeros((len(a), 0)), INDEPENDENT
    while basis.shape[1] < len(a):
        for _ in range(2):  # repeated, because one Gram-Schmidt pass loses orthogonality
            new = new - basis @ (basis.T @ new)
        left, values, _ = np.linalg.svd(new, full_matrices=False)
        fresh = left[:, values > least]
        if not fresh.shape[1]:
            break
        basis = np.hstack([basis, fresh])
        new, least = a @ fresh, INDEPENDENT * size
    return int(basis.shape[1])
