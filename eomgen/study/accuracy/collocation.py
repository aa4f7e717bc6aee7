"""Gauss collocation of high order in extended precision: y' = f(t, y) to twenty and more digits.

A step finds the polynomial of degree s that satisfies the equation at the s Gauss points. The
method has order 2s, conserves quadratic invariants, is symmetric and A-stable, and so handles stiff
motion. Hairer, Nørsett, Wanner, Solving ODEs I, section II.7; Hairer, Wanner, Solving ODEs II,
sections IV.5 and IV.8.

Only the stages and their residuals are in extended precision. The rest need not be as exact:
`forecast` predicts the stages, and Newton's method corrects them with a matrix that is formed and
factored in doubles.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from gmpy2 import mpfr

from eomgen.run.integrators.unwarned import factors
from eomgen.run.problem import FloatArray, Problem
from eomgen.study.accuracy import corners
from eomgen.study.accuracy.corners import BranchChange
from eomgen.study.accuracy.forecast import Forecast, NoStep
from eomgen.study.accuracy.gauss import ExtendedArray, Gauss, gauss
from eomgen.study.precision.precise import BITS, CornerBranches, Extended, Precise

MANY = 40
"""From this many states on, one Jacobian serves all stages of a step."""
MOST_CORRECTIONS = 12
NEAR = 1e-12
"""Corrections in doubles end when they are this small, relative to the scale."""
ENOUGH = 0.001
"""Stages are corrected to this part of the tolerance."""
TURNINGS = 40
SLOW = 6
"""Times that a step may be repeated to locate one branch change: before the run fails, and before
a smoother margin is looked for."""
SHRINK, GROW, SAFETY = 0.2, 3.0, 0.9
"""Bounds of the factor by which a step's length changes, and a safety factor."""


@dataclass(frozen=True, eq=False)
class Step:
    """A step's result.

    y        the state (ny,) at its end, in extended precision
    error    the estimated error of y, relative to the scale
    margins  (n, corners): the corners' margins at its start, its stages and its end
    extent   (2, ny): least and greatest value of each state at its stages and its end
    """

    y: ExtendedArray
    error: float
    margins: FloatArray
    extent: FloatArray


def advance(
    method: Gauss,
    precise: Precise,
    forecast: Forecast,
    t: Extended,
    y: ExtendedArray,
    h: Extended,
    tolerance: float,
) -> Step:
    """One step of length h, s, from y at t; its stages are corrected to a part of the tolerance.

    Raises `NoStep` if the corrections do not converge, `ArithmeticError` or `ValueError` where f is
    not defined.
    """
    problem, scale = forecast.problem, forecast.scale
    times = [t + c * h for c in method.c]
    near = y.astype(float)
    node_times = np.array(times, dtype=float)
    guessed = forecast(float(t), near, node_times)
    correct = _solver(method, problem, float(h), node_times, guessed)
    if (
        precise.corner_branches is None
    ):  # with corners, doubles might take another branch than this step
        guessed = _in_doubles(method, problem, float(h), node_times, near, guessed, correct, scale)
    moves = guessed.astype(object) - y  # in extended precision: sums of doubles would be doubles
    last = math.inf
    for _ in range(MOST_CORRECTIONS):
        states, slopes, margins = y + moves, [], []
        for time, state in zip(times, states.tolist(), strict=True):
            slopes.append(precise.derivative(time, state))
            margins.append(precise.corner_branches.margins if precise.corner_branches else [])
        residual = moves - h * (method.a @ np.array(slopes, dtype=object))
        change = correct(residual.astype(float))
        size = float(np.max(np.abs(change) / scale))
        if not size < math.inf:
            raise NoStep("the corrections are not finite")
        moves = moves - change.astype(object)
        rate = size / last
        if size == 0 or (size * rate <= ENOUGH * tolerance and last < math.inf):
            end = y + method.d @ moves
            if precise.corner_branches:
                margins = [_margins(precise, t, y), *margins, _margins(precise, t + h, end)]
            passed = np.vstack([(y + moves).astype(float), end.astype(float)])
            extent = np.array([passed.min(axis=0), passed.max(axis=0)])
            error = _error(method, moves, scale)
            return Step(end, error, np.array(margins, dtype=float), extent)
        if rate > 0.5:
            raise NoStep("the corrections do not shrink")
        last = size
    raise NoStep("the corrections shrink too slowly")


def _in_doubles(
    method: Gauss,
    problem: Problem,
    h: float,
    times: FloatArray,
    near: FloatArray,
    states: FloatArray,
    correct: Callable[[FloatArray], FloatArray],
    scale: FloatArray,
) -> FloatArray:
    """The stages corrected as far as doubles allow: these corrections are cheaper."""
    a, last = method.a.astype(float), math.inf
    for _ in range(MOST_CORRECTIONS):
        slopes = np.array([problem.derivative(t, y) for t, y in zip(times, states, strict=True)])
        change = correct(states - near - h * (a @ slopes))
        size = float(np.max(np.abs(change) / scale))
        if not size < 0.1 * last:
            break
        states, last = states - change, size
        if size < NEAR:
            break
    return states


def _margins(precise: Precise, t: Extended, y: ExtendedArray) -> list[Extended]:
    assert precise.corner_branches is not None
    precise.derivative(t, y.tolist())
    return precise.corner_branches.margins


def _solver(
    method: Gauss, problem: Problem, h: float, times: FloatArray, states: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    """A function that solves (I - h A ⊗ J) Δ = r for Δ (stages, ny) in doubles.

    Small systems use the Jacobian of every stage. Large ones use one for all stages; then the
    eigenvectors of A split the system into one of ny equations for each eigenvalue. Solving ODEs
    II, IV.8.
    """
    stages, ny = states.shape
    if ny < MANY:
        jacobians = np.array([problem.jacobian(t, y) for t, y in zip(times, states, strict=True)])
        matrix = -h * np.einsum("ij,jab->iajb", method.a.astype(float), jacobians)
        matrix = matrix.reshape(stages * ny, stages * ny)
        matrix.flat[:: stages * ny + 1] += 1.0
        both = factors(matrix)

        def solve_all(residual: FloatArray) -> FloatArray:
            found = scipy.linalg.lu_solve(both, residual.ravel(), check_finite=False)
            return np.asarray(found).reshape(stages, ny)

        return solve_all

    middle = stages // 2
    jacobian = problem.jacobian(float(times[middle]), states[middle])
    values, vectors = np.linalg.eig(method.a.astype(float))
    back = np.linalg.inv(vectors)
    inverses = np.linalg.inv(np.eye(ny) - h * values[:, None, None] * jacobian)

    def solve_each(residual: FloatArray) -> FloatArray:
        parts = np.matmul(inverses, (back @ residual)[:, :, None])[:, :, 0]
        return np.asarray((vectors @ parts).real)

    return solve_each


def _error(method: Gauss, moves: ExtendedArray, scale: FloatArray) -> float:
    """Estimated error at the end of a step, relative to the scale, from the decay of the Legendre
    coefficients of the derivative.

    The error at the end comes from coefficients s and higher. As the quadrature is exact up to
    degree 2s - 1, it comes from products of two coefficients whose indices add up to 2s or more. So
    the decay from the middle to the last coefficients is extrapolated twice as far again. If
    coefficients decay like q^k that gives q^(2s); if they decay algebraically, as after a kink, the
    estimate stays modest.
    """
    fall = np.abs(method.fall @ moves).astype(float) / scale
    middle, last = np.max(fall[:2], axis=0), np.max(fall[2:], axis=0)
    share = np.divide(last, middle, out=np.ones_like(last), where=middle > last)
    return float(np.max(last * share * share))


class _Progress:
    """The current state of the integration, and the length and stages of the next step."""

    def __init__(
        self, ladder: Sequence[int], t: Extended, y: ExtendedArray, length: Extended
    ) -> None:
        self.t, self.y, self.length, self.made = t, y, length, 0
        self.extent = np.array([y.astype(float)] * 2)
        self.ladder, self.stages = ladder, ladder[-1]

    def take(self, h: Extended, step: Step, tolerance: float, *, spare: bool) -> None:
        """Go on to the end of a step. `spare`: the next row, not its error, limited its length."""
        self.t, self.y, self.made = self.t + h, step.y, self.made + 1
        self.extent[0] = np.minimum(self.extent[0], step.extent[0])
        self.extent[1] = np.maximum(self.extent[1], step.extent[1])
        factor = _factor(step.error, tolerance, self.stages)
        self.length = max(h * factor, self.length) if factor > 1 else h * factor
        fewer = self.ladder[max(self.ladder.index(self.stages) - 1, 0)]
        serve = step.error ** (fewer / self.stages) <= 0.01 * tolerance
        if not spare:
            self.stages = self.ladder[-1]
        elif serve:
            self.stages = fewer

    def again(self, h: Extended, error: float, tolerance: float) -> None:
        """Prepare to repeat a step: with the most stages, or with a shorter step.

        Raises `NoStep` if the step becomes too short.
        """
        if self.stages == self.ladder[-1]:
            self.length = h * min(_factor(error, tolerance, self.stages), SAFETY)
        self.stages = self.ladder[-1]
        if self.length < abs(self.t) * 1e-25 or self.length < 1e-25:
            raise NoStep(f"steps shrink to nothing at t = {float(self.t):.6g}")


def _factor(error: float, tolerance: float, stages: int) -> float:
    factor = SAFETY * (tolerance / error) ** (0.5 / stages) if error else GROW
    return min(max(factor, SHRINK), GROW)


@dataclass(frozen=True, eq=False)
class Row:
    """The motion at one of the requested times.

    y       the state (ny,), in extended precision
    steps   the number of steps made so far
    extent  (2, ny): least and greatest value of each state so far
    """

    y: ExtendedArray
    steps: int
    extent: FloatArray


def rows(
    ladder: Sequence[int],
    precise: Precise,
    problem: Problem,
    scale: FloatArray,
    times: FloatArray,
    tolerance: float,
    report: Callable[[float], None] = lambda t: None,
) -> Iterator[Row]:
    """The motion at each of `times`, s, ascending; the first is the start.

    ladder     numbers of stages, ascending; a step uses the fewest that are accurate enough
    tolerance  of each step's error, relative to the scale
    report     called with the time, s, at which each attempted step begins; may raise to end it

    Every row and every branch change ends a step, so that rows are as accurate as the end. The
    precision must be set (`digits`) whenever this generator is resumed. Raises `NoStep` if a step
    becomes too short, or if locating a branch change fails.
    """
    start = np.array(precise.initial, dtype=object)
    current = _Progress(ladder, mpfr(float(times[0])), start, mpfr(float(times[1] - times[0])))
    forecast = Forecast(problem, scale, lambda: report(float(current.t)))
    yield Row(start, 0, current.extent)
    for end in times[1:]:
        target = mpfr(float(end))
        change, tried, h = None, 0, mpfr(0)
        while current.t < target:
            report(float(current.t))
            left = target - current.t
            count = max(1, math.ceil(left / current.length * 0.999))
            h = left / count if change is None else h + h * change.beyond
            method = gauss(current.stages)
            try:
                step = advance(method, precise, forecast, current.t, current.y, h, tolerance)
                error = step.error
            except (ArithmeticError, ValueError):  # raised by f, by LU factors, or as `NoStep`
                error = math.inf
            if not error <= tolerance:
                current.again(h, error, tolerance)
                change = None
                continue
            if precise.corner_branches:
                slow = tried > SLOW
                again, change = _changed(
                    precise.corner_branches, method, step.margins, change, slow=slow
                )
                tried += again
                if tried > TURNINGS:
                    raise NoStep(f"corners change branch too often at t = {float(current.t):.6g}")
                if again:
                    continue
            current.take(h, step, tolerance, spare=current.length > left)
            tried = 0
            if count == 1 and abs(target - current.t) <= abs(target) * 2.0 ** (3 - BITS):
                current.t = target
        yield Row(current.y, current.made, current.extent)


def _changed(
    corner_branches: CornerBranches,
    method: Gauss,
    margins: FloatArray,
    change: BranchChange | None,
    *,
    slow: bool,
) -> tuple[bool, BranchChange | None]:
    """Whether a step must be repeated because a corner changes its branch in it, and where the
    step must end then. Branches that change at its start, or at its end if it is accepted, are
    switched here.
    """
    abscissas = np.array([0.0, *method.c.tolist(), 1.0], dtype=float)
    if change is not None:
        if not corners.is_there(change, margins):
            change = corners.nearer(change, abscissas, margins)
            return True, corners.simpler(change, abscissas, margins) if slow else change
        for corner in corners.changed_at_the_end(change, margins):
            corner_branches.branches[corner] = not corner_branches.branches[corner]
        return False, None
    late = corners.wrong_from_the_start(corner_branches.branches, margins)
    for corner in late:
        corner_branches.branches[corner] = not corner_branches.branches[corner]
    if late:
        return True, None
    found = corners.first_change(corner_branches.branches, abscissas, margins)
    return found is not None, found
