"""Estimates by weighted least squares, and what the measurements say of them.

Each measured quantity has noise of its own deviation. Where that is not given it is estimated from
the residuals, and the fit repeated with it until it stays: feasible generalised least squares,
which for a single quantity without priors is ordinary least squares. A prior is one more residual.
Intervals are those of the linearised model: Seber and Wild, Nonlinear Regression, 2.1 and 5.1.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from eomgen.base.errors import RunError
from eomgen.fitting.inertias import Chart
from eomgen.run.problem import FloatArray

CERTAIN = 0.95
"""Probability with which an interval covers the true value."""
SMALL = 1e-6
"""A combination of values counts as without effect if it changes what is measured by less than
this part of what its single members do: sensitivities are known to about 1e-8."""
LEAST = 1e-3
"""A member of a combination that takes part in it by less than this is left out."""
ROUNDS, SETTLED = 20, 1e-4
"""Most fits with other weights, and the change of deviations that ends them."""
TOLERANCE = 1e-9
"""Of the optimiser, relative; below the errors of the motion nothing is gained."""
MOST = 200
"""Most motions of a search."""
REFUSED = (
    "the search has ended at values beyond which the scene has no motion; begin elsewhere, or give "
    "bounds"
)
_EPSILON = float(np.finfo(float).eps)


class Residuals(NamedTuple):
    """Residuals (N,), predicted less measured, and their derivatives by the values (N, n); nan
    where a motion cannot go on.
    """

    values: FloatArray
    slopes: FloatArray


@dataclass(frozen=True, eq=False)
class Sought:
    """What is estimated.

    start       (n,) where the search begins
    low, high   (n,) bounds
    mean, sigma (n,) of priors; sigma is inf without one
    chart       coordinates in which is searched
    """

    start: FloatArray
    low: FloatArray
    high: FloatArray
    mean: FloatArray
    sigma: FloatArray
    chart: Chart = field(default_factory=Chart)


@dataclass(frozen=True, eq=False)
class Weighed:
    """What is measured.

    groups  (N,) the number of the quantity of each residual
    noise   its deviation for each quantity; nan if it is to be estimated
    scale   for each quantity the deviation that the search begins with
    """

    groups: Any
    noise: FloatArray
    scale: FloatArray


@dataclass(frozen=True, eq=False)
class Estimate:
    """An estimate.

    values      (n,)
    covariance  (n, n); inf for values that are not determined
    half        (n,) half the length of each interval
    rank        of the derivatives, those of priors among them
    unknown     combinations of values that leave what is measured as it is, (n,) each, relative to
                the values
    residuals   (N,) at these values
    noise       the deviation of each quantity
    calls       number of motions with sensitivities
    why         why the search has ended, if not because it has converged; else ""
    """

    values: FloatArray
    covariance: FloatArray
    half: FloatArray
    rank: int
    unknown: Sequence[FloatArray]
    residuals: FloatArray
    noise: FloatArray
    calls: int
    why: str


def estimated(
    evaluate: Callable[[FloatArray], Residuals], sought: Sought, weighed: Weighed
) -> Estimate:
    """The values with the least sum of squares.

    Raises `RunError` if there is no motion at the start, or fewer measurements than values.
    """
    calls = _Calls(evaluate)
    if (count := len(weighed.groups) + int(np.isfinite(sought.sigma).sum())) < len(sought.start):
        raise RunError(
            f"data: {count} samples and priors are fewer than the {len(sought.start)} values that "
            "are fitted; fit fewer"
        )
    first = calls.at(sought.start)
    if not (np.isfinite(first.values).all() and np.isfinite(first.slopes).all()):
        raise RunError(
            "parameters: at the values where the search begins the motion does not reach the last "
            "sample; give others"
        )
    known = np.isfinite(weighed.noise)
    noise = np.where(known, weighed.noise, weighed.scale)
    values, why = sought.start, ""
    for _ in range(ROUNDS):
        values, why = _fitted(calls, sought, noise[weighed.groups], values)
        found = calls.at(values)
        before = noise
        noise = np.where(known, weighed.noise, _deviations(found, sought, noise, weighed.groups))
        alone = len(noise) == 1 and not np.isfinite(sought.sigma).any()
        if why or alone or np.all(np.abs(noise - before) <= SETTLED * before):
            break
    return _judged(calls, sought, noise, weighed.groups, values, why, bool(known.all()))


class _Calls:
    """Residuals by values, of which the last are kept."""

    def __init__(self, evaluate: Callable[[FloatArray], Residuals]) -> None:
        self._evaluate, self.made, self.refused = evaluate, 0, False
        self._last: tuple[bytes, Residuals] | None = None

    def at(self, values: FloatArray) -> Residuals:
        """The residuals."""
        key = values.tobytes()
        if self._last is None or self._last[0] != key:
            self.made += 1
            self._last = key, self._evaluate(values)
        self.refused = not np.isfinite(self._last[1].values).all()
        return self._last[1]


def _whole(found: Residuals, sought: Sought, noise: FloatArray, values: FloatArray) -> Residuals:
    """Residuals relative to their deviations, with those of priors."""
    given = np.isfinite(sought.sigma)
    own = (values - sought.mean)[given] / sought.sigma[given]
    rows = np.diag(1.0 / sought.sigma)[given]
    return Residuals(
        np.concatenate((found.values / noise, own)),
        np.concatenate((found.slopes / noise[:, None], rows)),
    )


def _fitted(
    calls: _Calls, sought: Sought, noise: FloatArray, start: FloatArray
) -> tuple[FloatArray, str]:
    """The values with the least weighted sum of squares, and why the search has ended otherwise."""
    # Imported here because plans are checked without SciPy.
    from scipy.optimize import least_squares

    def whole(values: FloatArray) -> Residuals:
        return _whole(calls.at(values), sought, noise, values)

    def residuals(coordinates: FloatArray) -> FloatArray:
        return whole(sought.chart.outward(coordinates)[0]).values

    def slopes(coordinates: FloatArray) -> FloatArray:
        values, by = sought.chart.outward(coordinates)
        return np.asarray(whole(values).slopes @ by)

    found = least_squares(
        residuals,
        sought.chart.inward(np.clip(start, sought.low, sought.high)),
        slopes,
        bounds=(sought.low, sought.high),
        x_scale="jac",
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=TOLERANCE,
        max_nfev=MOST,
    )
    values = sought.chart.outward(found.x)[0]
    if found.status == 0:
        return values, f"the search has not converged after {MOST} motions"
    return values, REFUSED if calls.refused else ""


def _deviations(found: Residuals, sought: Sought, noise: FloatArray, groups: Any) -> FloatArray:
    """The deviation of each quantity by its residuals, of which the fit takes degrees of freedom:
    the sum of their leverages.
    """
    whole = _whole(found, sought, noise[groups], sought.mean)
    of = _decomposed(whole.slopes)
    leverages = np.sum(of.left[: len(groups), of.sizes > SMALL] ** 2, axis=1)
    squares = np.bincount(groups, found.values**2, len(noise))
    free = np.bincount(groups, 1.0 - leverages, len(noise))
    least = _EPSILON * np.maximum(noise, np.finfo(float).tiny)
    return np.maximum(np.sqrt(squares / np.maximum(free, _EPSILON)), least)


class _Decomposed(NamedTuple):
    """U S Vᵀ of a matrix whose columns, of these lengths, are divided by them: U, S relative to its
    largest, that one, and Vᵀ.
    """

    left: FloatArray
    lengths: FloatArray
    sizes: FloatArray
    largest: float
    right: FloatArray


def _decomposed(slopes: FloatArray) -> _Decomposed:
    lengths = np.linalg.norm(slopes, axis=0)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    left, sizes, right = np.linalg.svd(slopes / lengths, full_matrices=False)
    largest = float(sizes.max(initial=0.0)) or 1.0
    return _Decomposed(left, lengths, sizes / largest, largest, right)


def _judged(
    calls: _Calls,
    sought: Sought,
    noise: FloatArray,
    groups: Any,
    values: FloatArray,
    why: str,
    certain: bool,
) -> Estimate:
    """The estimate with what the measurements say of it; `certain` if the noise is known."""
    from scipy.special import ndtri, stdtrit

    found = calls.at(values)
    whole = _whole(found, sought, noise[groups], values)
    of = _decomposed(whole.slopes)
    is_known = of.sizes > SMALL
    rank = int(is_known.sum())
    root = of.right[is_known].T / (of.sizes[is_known] * of.largest) / of.lengths[:, None]
    covariance = root @ root.T
    unknown = _reduced(of.right[~is_known] / of.lengths, values)
    for direction in unknown:
        lost = direction != 0.0
        covariance[lost], covariance[:, lost] = np.nan, np.nan
        covariance[lost, lost] = np.inf
    freedom = len(whole.values) - rank
    upper = 0.5 + 0.5 * CERTAIN
    quantile = ndtri(upper) if certain else stdtrit(max(freedom, 1), upper)
    half: FloatArray = float(quantile) * np.sqrt(np.diag(covariance))
    if not (freedom or certain):
        half[:] = np.inf
    return Estimate(values, covariance, half, rank, unknown, found.values, noise, calls.made, why)


def determined(slopes: FloatArray, values: FloatArray) -> tuple[int, list[FloatArray]]:
    """The rank of derivatives (N, n) by values, and the combinations that these do not tell."""
    of = _decomposed(slopes)
    is_known = of.sizes > SMALL
    return int(is_known.sum()), _reduced(of.right[~is_known] / of.lengths, values)


def told(direction: FloatArray, names: Sequence[str]) -> str:
    """A line about values that are not told, or not apart."""
    taking_part = [(name, x) for name, x in zip(names, direction.tolist(), strict=True) if x]
    if len(taking_part) == 1:
        return f"{taking_part[0][0]} has no effect on what is measured"
    changes = ", ".join(f"{name} by {x:+.3g} %" for name, x in taking_part)
    together = " and ".join(name for name, _ in taking_part)
    return f"{together} cannot be told apart: nothing measured changes if {changes} change together"


def _reduced(directions: FloatArray, values: FloatArray) -> list[FloatArray]:
    """A basis of the space of some directions with as few members as there can be, relative to the
    values that are not 0: its reduced row echelon form.
    """
    rows = directions / np.where(values != 0.0, values, 1.0)
    for done in range(len(rows)):
        row, column = divmod(int(np.argmax(np.abs(rows[done:]))), rows.shape[1])
        rows[[done, done + row]] = rows[[done + row, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= np.outer(rows[others, column], rows[done])
        rows[done:][np.abs(rows[done:]) < 1e-12] = 0.0
    rows[np.abs(rows) < LEAST] = 0.0
    return list(rows)
