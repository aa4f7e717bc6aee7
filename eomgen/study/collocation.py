"""Gauss collocation of high order in long numbers: y' = f(t, y) to twenty and more digits.

A step sets up the polynomial of degree s that satisfies the equation at the s Gauss points. It is
of order 2s at its end, keeps quadratic invariants, is symmetric, and A-stable, so that stiff motion
is no trouble. Hairer, Nørsett, Wanner, Solving ODEs I, section II.7; Hairer, Wanner, Solving ODEs
II, sections IV.5 and IV.8.

What takes part in getting there need not be as exact as where one gets: the stages are forecast by
LSODA, and corrected by Newton's method with a matrix and its factors in doubles. Only what is
corrected, and how far off it is, is in long numbers.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy.linalg
from gmpy2 import mpfr
from numpy.typing import NDArray
from scipy.integrate import LSODA

from eomgen.run.problem import Floats, Problem
from eomgen.study.precise import BITS, Long, Precise, digits

Longs = NDArray[np.object_]
"""An array of long numbers."""
FORECAST = 1e-10
"""Relative tolerance of the forecast; what it is off makes the first correction."""
ASTRAY = 1e-6
"""A forecast this far off, in parts of the scale, begins anew."""
MANY = 40
"""States from which on one Jacobian serves all stages of a step."""
MOST_CORRECTIONS = 12
SHRINK, GROW, SAFETY = 0.2, 3.0, 0.9
"""Bounds of how the step changes."""


class NoStep(ArithmeticError):
    """A step that cannot be made; the text says why."""


@dataclass(frozen=True, eq=False)
class Gauss:
    """The method of s stages on [0, 1].

    c  nodes (s,)           a  weights of the stages (s, s), in long numbers and in doubles
    d  (s,): the end of a polynomial that is 0 at 0, from its values at the nodes
    legendre (s, s): from values at the nodes to coefficients in normalised Legendre polynomials
    """

    c: Longs
    a: Longs
    a_double: Floats
    d: Longs
    legendre: Floats


@cache
def gauss(stages: int) -> Gauss:
    """Gauss-Legendre collocation: nodes by Newton's method on the Legendre polynomial, weights by
    integrating the Lagrange polynomials, expanded in Legendre polynomials, exactly.
    """
    with digits(2 * BITS):
        nodes, weights = [], []
        for i in range(stages):
            x = mpfr(-math.cos(math.pi * (i + 0.75) / (stages + 0.5)))
            for _ in range(8):  # from 3 digits on, each doubles them
                values = _legendre(stages, x)
                slope = stages * (x * values[stages] - values[stages - 1]) / (x * x - 1)
                x -= values[stages] / slope
            values = _legendre(stages, x)
            slope = stages * (x * values[stages] - values[stages - 1]) / (x * x - 1)
            nodes.append((x + 1) / 2)
            weights.append(1 / ((1 - x * x) * slope * slope))
        at = np.array([_legendre(stages, 2 * c - 1) for c in nodes], dtype=object)
        # The integral of P_k(2x - 1) from 0 on is (P_{k+1} - P_{k-1}) / (2 (2k + 1)).
        integrals = np.array(
            [
                [row[0] + row[1] if k == 0 else row[k + 1] - row[k - 1] for k in range(stages)]
                for row in at
            ],
            dtype=object,
        )
        a = integrals @ (at[:, :stages] * np.array(weights, dtype=object)[:, None]).T / 2
        d = [
            math.prod((1 - c) / (node - c) for c in nodes if c is not node) / node for node in nodes
        ]
        norms = np.sqrt(2.0 * np.arange(stages) + 1.0)
        legendre = (
            norms[:, None] * (at[:, :stages].astype(float) * np.array(weights, float)[:, None]).T
        )
    with digits():
        c_, a_, d_ = (np.array([mpfr(x) for x in np.ravel(m)], dtype=object) for m in (nodes, a, d))
    square = a_.reshape(stages, stages)
    return Gauss(c_, square, square.astype(float), d_, legendre)


def _legendre(degree: int, x: Long) -> list[Long]:
    """P_0(x) … P_degree(x), by their recurrence."""
    values = [mpfr(1), x]
    for k in range(1, degree):
        values.append(((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1))
    return values


class Forecast:
    """The motion ahead, roughly: what one double-precision run yields, begun anew as it strays."""

    def __init__(self, problem: Problem, scale: Floats, t_end: float) -> None:
        self._problem, self._scale, self._t_end = problem, scale, t_end
        self._pieces: list[Any] = []
        self._solver: Any = None

    def __call__(self, t: float, y: Floats, times: Floats) -> Floats:
        """States (len(times), ny) at `times`, ascending and not before t, of the motion through y.

        Raises `NoStep` if it does not get there.
        """
        if self._solver is None or not self._reaches(t, t):
            self._begin(t, y)
        shift = y - self._at(t)
        if np.max(np.abs(shift) / self._scale) > ASTRAY:
            self._begin(t, y)
            shift = np.zeros_like(y)
        while not self._reaches(t, times[-1]):
            self._go_on()
        self._pieces = [piece for piece in self._pieces if piece.t >= t]
        return np.array([self._at(float(time)) + shift for time in times])

    def _begin(self, t: float, y: Floats) -> None:
        self._pieces = []
        self._solver = LSODA(
            self._problem.derivative,
            t,
            y.copy(),
            2 * self._t_end,  # of which it will not use more than it is asked for
            rtol=FORECAST,
            atol=FORECAST * self._scale,
            jac=self._problem.jacobian,
        )
        self._go_on()

    def _go_on(self) -> None:
        before = self._solver.t
        complaint = self._solver.step()
        if self._solver.status == "failed" or not np.isfinite(self._solver.y).all():
            raise NoStep(complaint or "the forecast failed")
        if self._solver.t > before:
            self._pieces.append(self._solver.dense_output())

    def _reaches(self, t: float, end: float) -> bool:
        pieces = self._pieces
        return bool(pieces) and pieces[0].t_old <= t and pieces[-1].t >= end

    def _at(self, t: float) -> Floats:
        piece = next(piece for piece in self._pieces if piece.t >= t)
        return np.asarray(piece(t))


@dataclass(frozen=True, eq=False)
class Step:
    """The state `y` (ny, long) at the end of a step, and about how far off it is, in parts of the
    scale.
    """

    y: Longs
    error: float


def advance(
    method: Gauss,
    precise: Precise,
    problem: Problem,
    forecast: Forecast,
    scale: Floats,
    t: Long,
    y: Longs,
    h: Long,
    tolerance: float,
) -> Step:
    """One step of length h from t, y, its stages corrected to a hundredth of the tolerance.

    Raises `NoStep` if the corrections do not shrink, `ArithmeticError` where f has no value.
    """
    times = [t + c * h for c in method.c]
    near = y.astype(float)
    moments = np.array(times, dtype=float)
    guessed = forecast(float(t), near, moments)
    correct = _solver(method, problem, float(h), moments, guessed)
    moves = guessed.astype(object) - y  # long: doubles would add up to doubles
    last = math.inf
    for _ in range(MOST_CORRECTIONS):
        states = y + moves
        slopes = np.array(list(map(precise.derivative, times, states.tolist())), dtype=object)
        residual = moves - h * (method.a @ slopes)
        change = correct(residual.astype(float))
        size = float(np.max(np.abs(change) / scale))
        if not size < math.inf:
            raise NoStep("the corrections are not finite")
        moves = moves - change.astype(object)
        rate = size / last
        if (size * rate <= 0.01 * tolerance and last < math.inf) or size == 0:
            return Step(y + method.d @ moves, _error(method, slopes, h, scale))
        if rate > 0.5:
            raise NoStep("the corrections do not shrink")
        last = size
    raise NoStep("the corrections shrink too slowly")


def _solver(
    method: Gauss, problem: Problem, h: float, times: Floats, states: Floats
) -> Callable[[Floats], Floats]:
    """What solves Δ - h A J Δ = r (stages, ny) for Δ in doubles, well enough to correct with.

    Small systems take the Jacobian of every stage. Large ones take one for all: A's eigenvectors
    then part the system into one of ny equations for each eigenvalue. Solving ODEs II, IV.8.
    """
    stages, ny = states.shape
    if ny < MANY:
        jacobians = np.array([problem.jacobian(t, y) for t, y in zip(times, states, strict=True)])
        matrix = -h * np.einsum("ij,jab->iajb", method.a_double, jacobians)
        matrix = matrix.reshape(stages * ny, stages * ny)
        matrix.flat[:: stages * ny + 1] += 1.0
        factors = scipy.linalg.lu_factor(matrix, overwrite_a=True, check_finite=False)

        def solve_all(residual: Floats) -> Floats:
            found = scipy.linalg.lu_solve(factors, residual.ravel(), check_finite=False)
            return np.asarray(found).reshape(stages, ny)

        return solve_all

    middle = stages // 2
    jacobian = problem.jacobian(float(times[middle]), states[middle])
    values, vectors = np.linalg.eig(method.a_double)
    back = np.linalg.inv(vectors)
    inverses = np.linalg.inv(np.eye(ny) - h * values[:, None, None] * jacobian)

    def solve_each(residual: Floats) -> Floats:
        parts = np.matmul(inverses, (back @ residual)[:, :, None])[:, :, 0]
        return np.asarray((vectors @ parts).real)

    return solve_each


def _error(method: Gauss, slopes: Longs, h: Long, scale: Floats) -> float:
    """What the end is off, in parts of the scale, by how fast Legendre coefficients of the slope
    fall.

    What the slope lacks is orthogonal to polynomials of degree s - 1, and so meets only that part
    of what carries it to the end which is not one: both fall alike. So where the last coefficients
    are a share q of the first, the end is off by about q².
    """
    parts = np.abs(method.legendre @ slopes.astype(float)) * (float(h) / scale)
    whole, last = float(np.max(parts)), float(np.max(parts[-2:]))
    return last * last / whole if whole else 0.0


def rows(
    ladder: Sequence[int],
    precise: Precise,
    problem: Problem,
    scale: Floats,
    times: Floats,
    tolerance: float,
) -> Iterator[tuple[Longs, int]]:
    """The state at each of `times` (ascending; the first is the start) and the steps made so far.

    ladder     numbers of stages, ascending; a step takes the least that serve
    tolerance  what each step's error is held to, in parts of the scale

    Every row ends a step, so that rows are as accurate as the end. Long numbers must be on
    (`digits`) wherever this is resumed. Raises `NoStep` if steps shrink to nothing.
    """
    forecast = Forecast(problem, scale, float(times[-1]))
    t = mpfr(float(times[0]))
    y = np.array(precise.initial, dtype=object)
    made, stages, length = 0, ladder[-1], mpfr(float(times[1] - times[0]))
    yield y, made
    for end in times[1:]:
        target = mpfr(float(end))
        while t < target:
            count = max(1, math.ceil((target - t) / length * 0.999))
            h = (target - t) / count
            method = gauss(stages)
            try:
                step = advance(method, precise, problem, forecast, scale, t, y, h, tolerance)
                error = step.error
            except ArithmeticError:
                error = math.inf
            factor = SAFETY * (tolerance / error) ** (0.5 / stages) if error else GROW
            factor = min(max(factor, SHRINK), GROW)
            if error <= tolerance:
                y, made = step.y, made + 1
                t = target if count == 1 else t + h
                length = max(h * factor, length) if factor > 1 else h * factor
                stages = _fewest(ladder, stages, error, tolerance, length > target - t)
            else:
                length, stages = h * min(factor, SAFETY), ladder[-1]
                if length < abs(t) * 1e-16 or length < 1e-18:
                    raise NoStep(f"steps shrink to nothing at t = {float(t):.6g}")
        yield y, made


def _fewest(ladder: Sequence[int], stages: int, error: float, tolerance: float, spare: bool) -> int:
    """The stages of the next step, after one of some stages and error: the fewest that would have
    served by far, where steps could be longer than rows let them; else the most.
    """
    if not spare:
        return ladder[-1]
    served = (n for n in ladder if error ** (n / stages) <= 0.01 * tolerance)
    return next(served, ladder[-1])
