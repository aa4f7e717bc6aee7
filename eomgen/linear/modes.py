"""What a linear system does by itself and what its inputs can do: modes, stability, control."""

import math
from dataclasses import dataclass

import numpy as np

from eomgen.run.problem import Floats

SLOW = 1e-7
"""Rates below this, 1/s, are no motion but rounding: a mode without a force has a double 0, which
rounding pulls apart by the square root of the machine epsilon."""
FINE = 1e-6
"""The same for rates below this share of the fastest."""
INDEPENDENT = 1e-10
"""Directions of the state are independent if what is new in them is more than this share."""


@dataclass(frozen=True)
class Mode:
    """An eigenvalue, or with `turn` > 0 a conjugate pair: `rate` ± i `turn`, 1/s."""

    rate: float
    turn: float

    @property
    def frequency(self) -> float:
        """Of the oscillation, Hz."""
        return self.turn / (2 * math.pi)

    @property
    def damping(self) -> float:
        """Ratio -Re λ / |λ|: 0 undamped, 1 where it no longer swings, negative where it grows."""
        size = math.hypot(self.rate, self.turn)
        return -self.rate / size if size else 0.0


def modes(a: Floats) -> list[Mode]:
    """The modes of ẋ = a x, the fastest growing first, then the slowest oscillation."""
    values = np.linalg.eigvals(a) if a.size else np.zeros(0, complex)
    small = max(SLOW, FINE * float(np.max(np.abs(values), initial=0.0)))
    found = []
    for value in values.tolist():
        rate = value.real if abs(value.real) > small else 0.0
        turn = value.imag if abs(value.imag) > small else 0.0
        if turn >= 0.0:
            found.append(Mode(rate, turn))
    return sorted(found, key=lambda mode: (-mode.rate, mode.turn))


def stability(found: list[Mode]) -> str:
    """In a word: 'unstable', 'stable' (asymptotically), or 'marginal' between the two."""
    if any(mode.rate > 0 for mode in found):
        return "unstable"
    return "stable" if all(mode.rate < 0 for mode in found) else "marginal"


def controllable_rank(a: Floats, b: Floats) -> int:
    """Dimensions of the state that inputs can reach: the rank of [b, a b, a² b, …].

    Taken from an orthonormal basis that grows by what `a` makes of its newest part, since the
    powers themselves lose their digits within a few.
    """
    size = float(np.linalg.norm(a, 2)) if a.size else 0.0
    new = b / np.maximum(np.linalg.norm(b, axis=0), np.finfo(np.float64).tiny)
    basis, least = np.zeros((len(a), 0)), INDEPENDENT
    while basis.shape[1] < len(a):
        for _ in range(2):  # once is not enough, twice is: Gram and Schmidt lose orthogonality
            new = new - basis @ (basis.T @ new)
        left, values, _ = np.linalg.svd(new, full_matrices=False)
        fresh = left[:, values > least]
        if not fresh.shape[1]:
            break
        basis = np.hstack([basis, fresh])
        new, least = a @ fresh, INDEPENDENT * size
    return int(basis.shape[1])
