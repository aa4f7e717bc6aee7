"""Linear systems at equal times, with inputs that are held between them."""

from dataclasses import dataclass

import numpy as np

from eomgen.base.displays import Displayed
from eomgen.base.errors import RunError
from eomgen.base.frozen import Frozen
from eomgen.run.problem import FloatArray


@dataclass(frozen=True, eq=False, repr=False)
class Discrete(Frozen, Displayed):
    """x⁺ = A x + B u: deviations a `period`, s, later, under inputs that are held.

    A (n, n), B (n, nu)  exact for the linear system, by the exponential of one matrix
    Q (n, n)             covariance of what noise has added to x meanwhile; 0 without noise
    state_names          of the n deviations; `input_names` of the nu inputs
    """

    shown = ("period", "state_names", "input_names", "A", "B", "Q")

    A: FloatArray
    B: FloatArray
    Q: FloatArray
    period: float
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]


def discrete_of(
    A: FloatArray,
    B: FloatArray,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    period: float,
    noise: FloatArray | None,
) -> Discrete:
    """ẋ = A x + B u at equal times: C. F. Van Loan, IEEE Trans. Automatic Control 23 (1978) 395.

    names  of states and inputs
    noise  (n, n), spectral density of white noise in ẋ, the units of ẋ squared times s

    Raises `RunError` for a period that is not positive, or noise of another shape.
    """
    from scipy.linalg import expm

    if not (np.isfinite(period) and period > 0):
        raise RunError(f"period: {period:g} is not a positive time; give one in s")
    n, nu = B.shape
    density = np.zeros((n, n)) if noise is None else np.asarray(noise, dtype=float)
    if density.shape != (n, n):
        raise RunError(f"noise: has shape {density.shape}, not ({n}, {n})")
    held = expm(period * np.block([[A, B], [np.zeros((nu, n + nu))]]))
    both = expm(period * np.block([[-A, density], [np.zeros((n, n)), A.T]]))
    after = both[n:, n:].T
    added = after @ both[:n, n:]
    return Discrete(
        A=held[:n, :n],
        B=held[:n, n:],
        Q=(added + added.T) / 2,
        period=float(period),
        state_names=names[0],
        input_names=names[1],
    )
