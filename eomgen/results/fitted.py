"""What a fit has found."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Values that measurements tell; see `fit`.

    name        of the scene
    values      by name: those of parameters, and of initial states, with the number of the
                experiment if there are several: `theta[0]`
    intervals   of these, each of which covers the true value with a probability of 95 %
    covariance  (n, n), in the order of `values`; inf and nan where the data do not tell
    rank        of the derivatives of what is measured by the values, and of priors: n if these can
                be told apart
    notes       a line for each combination of values that cannot, and for what else is to be known
    residuals   by measured name, for each experiment: what the motion has less what was measured,
                (n,), nan where there is no sample
    noise       by measured name the standard deviation of its noise, given or estimated
    left_out    columns of the data that are neither inputs nor measured quantities
    motions     number of motions with sensitivities that the search took
    compiled    whether they were computed in compiled code
    """

    name: str
    values: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    covariance: FloatArray
    rank: int
    notes: tuple[str, ...]
    residuals: Mapping[str, tuple[FloatArray, ...]]
    noise: Mapping[str, float]
    left_out: tuple[str, ...]
    motions: int
    compiled: bool

    @property
    def correlation(self) -> FloatArray:
        """Correlations of the values, (n, n); nan where the data do not tell."""
        deviations = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore"):
            return np.asarray(self.covariance / np.outer(deviations, deviations))

    def __repr__(self) -> str:
        words = (
            f"{name} = {rounded(value, high - value)}"
            for (name, value), (_, high) in zip(
                self.values.items(), self.intervals.values(), strict=True
            )
        )
        return f"Fit of {self.name}: {', '.join(words)}"


def rounded(value: float, half: float) -> str:
    """A value with half the length of its interval, to two digits of that."""
    if not (math.isfinite(half) and half > 0.0):
        return f"{value:.6g}{' (not known)' if not math.isfinite(half) else ''}"
    digits = 1 - math.floor(math.log10(half))
    if not -4 < digits < 7:
        places = digits + math.floor(math.log10(abs(value) or half)) + 1
        return f"{value:.{max(places, 1)}g} ± {half:.2g}"
    return f"{value:.{max(digits, 0)}f} ± {half:.{max(digits, 0)}f}"
