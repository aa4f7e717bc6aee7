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

import gmpy2
import numpy as np
import scipy.linalg
from gmpy2 import mpfr
from numpy.typing import NDArray

from eomgen.precision.precise import BITS, Long, Precise, Watch, digits
from eomgen.run.integrators.unwarned import factors
from eomgen.run.problem import Floats, Problem
from eomgen.study.accuracy import corners
from eomgen.study.accuracy.corners import Turn
from eomgen.study.accuracy.forecast import Forecast, NoStep

Longs = NDArray[np.object_]
"""An array of long numbers."""
MANY = 40
"""States from which on one Jacobian serves all stages of a step."""
MOST_CORRECTIONS = 12
NEAR = 1e-12
"""Corrections this small, in parts of the scale, are the last that doubles are worth."""
ENOUGH = 0.001
"""Part of the tolerance that stages are corrected to."""
TURNINGS = 40
SLOW = 6
"""Steps made again for the sake of one turn before that is given up, and before it is slow."""
SHRINK, GROW, SAFETY = 0.2, 3.0, 0.9
"""Bounds of how the step changes."""


@dataclass(frozen=True, eq=False)
class Gauss:
    """The method of s stages on [0, 1].

    c     nodes (s,)
    a     weights of the stages (s, s)
    d     (s,): the end of a polynomial that is 0 at 0, from its values at the nodes
    fall  (4, s): from those values, of the polynomial's slope the two middle and the two last
          coefficients in Legendre polynomials
    """

    c: Longs
    a: Longs
    d: Longs
    fall: Longs


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


def _slope(nodes: list[Long], i: int, j: int) -> Long:
    """At node j, the slope of the polynomial that is 1 at node i, 0 at the others and at 0."""
    x = nodes[j]
    others = [mpfr(0), *(c for c in nodes if c is not nodes[i])]
    if i == j:
        return sum(1 / (x - c) for c in others)
    rest = [c for c in others if c is not x]
    return math.prod((x - c) / (nodes[i] - c) for c in rest) / (nodes[i] - x)


def _legendre(degree: int, x: Long) -> list[Long]:
    """P_0(x) … P_degree(x), by their recurrence."""
    values = [mpfr(1), x]
    for k in range(1, degree):
        values.append(((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1))
    return values


@dataclass(frozen=True, eq=False)
class Step:
    """The state `y` (ny, long) at the end of a step, about how far off it is, in parts of the
    scale, the margins of corners (n, corners) at its start, at its stages, and at its end, and its
    `extent` (2, ny), between which its stages and its end lie.
    """

    y: Longs
    error: float
    margins: Floats
    extent: Floats


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
    """One step of length h from t, y, its stages corrected to a part of the tolerance.

    Raises `NoStep` if the corrections do not shrink, `ArithmeticError` or `ValueError` where f has
    no value.
    """
    times = [t + c * h for c in method.c]
    near = y.astype(float)
    moments = np.array(times, dtype=float)
    guessed = forecast(float(t), near, moments)
    correct = _solver(method, problem, float(h), moments, guessed)
    if precise.watch is None:  # else the motion in doubles would turn where this one does not
        guessed = _in_doubles(method, problem, float(h), moments, near, guessed, correct, scale)
    moves = guessed.astype(object) - y  # long: doubles would add up to doubles
    last = math.inf
    for _ in range(MOST_CORRECTIONS):
        states, slopes, margins = y + moves, [], []
        for time, state in zip(times, states.tolist(), strict=True):
            slopes.append(precise.derivative(time, state))
            margins.append(precise.watch.margins if precise.watch else [])
        residual = moves - h * (method.a @ np.array(slopes, dtype=object))
        change = correct(residual.astype(float))
        size = float(np.max(np.abs(change) / scale))
        if not size < math.inf:
            raise NoStep("the corrections are not finite")
        moves = moves - change.astype(object)
        rate = size / last
        if size == 0 or (size * rate <= ENOUGH * tolerance and last < math.inf):
            end = y + method.d @ moves
            if precise.watch:
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
    times: Floats,
    near: Floats,
    states: Floats,
    correct: Callable[[Floats], Floats],
    scale: Floats,
) -> Floats:
    """The stages as well as doubles make them: cheaper corrections first."""
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


def _margins(precise: Precise, t: Long, y: Longs) -> list[Long]:
    assert precise.watch is not None
    precise.derivative(t, y.tolist())
    return precise.watch.margins


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
        matrix = -h * np.einsum("ij,jab->iajb", method.a.astype(float), jacobians)
        matrix = matrix.reshape(stages * ny, stages * ny)
        matrix.flat[:: stages * ny + 1] += 1.0
        both = factors(matrix)

        def solve_all(residual: Floats) -> Floats:
            found = scipy.linalg.lu_solve(both, residual.ravel(), check_finite=False)
            return np.asarray(found).reshape(stages, ny)

        return solve_all

    middle = stages // 2
    jacobian = problem.jacobian(float(times[middle]), states[middle])
    values, vectors = np.linalg.eig(method.a.astype(float))
    back = np.linalg.inv(vectors)
    inverses = np.linalg.inv(np.eye(ny) - h * values[:, None, None] * jacobian)

    def solve_each(residual: Floats) -> Floats:
        parts = np.matmul(inverses, (back @ residual)[:, :, None])[:, :, 0]
        return np.asarray((vectors @ parts).real)

    return solve_each


def _error(method: Gauss, moves: Longs, scale: Floats) -> float:
    """What the end is off, in parts of the scale, by how Legendre coefficients of the slope fall.

    The end has to do with coefficients from number s on, and, as the method integrates
    polynomials of degree 2s - 1 exactly, with no less than two of them that add up to 2s. So the
    fall from the middle to the last is carried on as far again, twice: where coefficients fall as
    powers of q, that makes q^(2s); where as powers of their number, after a kink, it is modest.
    """
    fall = np.abs(method.fall @ moves).astype(float) / scale
    middle, last = np.max(fall[:2], axis=0), np.max(fall[2:], axis=0)
    share = np.divide(last, middle, out=np.ones_like(last), where=middle > last)
    return float(np.max(last * share * share))


class _Way:
    """How far rows have come, and what the next step is to be."""

    def __init__(self, ladder: Sequence[int], t: Long, y: Longs, length: Long) -> None:
        self.t, self.y, self.length, self.made = t, y, length, 0
        self.extent = np.array([y.astype(float)] * 2)
        self.ladder, self.stages = ladder, ladder[-1]

    def take(self, h: Long, step: Step, tolerance: float, *, spare: bool) -> None:
        """Go on to the end of a step; where it was short only because of a row, with `spare`."""
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

    def again(self, h: Long, error: float, tolerance: float) -> None:
        """Try once more, with more stages or else a shorter step.

        Raises `NoStep` if steps shrink to nothing.
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
    """The state `y` (ny, long) at a time, how many `steps` were made up to then, and the `extent`
    (2, ny) between which all states were.
    """

    y: Longs
    steps: int
    extent: Floats


def rows(
    ladder: Sequence[int],
    precise: Precise,
    problem: Problem,
    scale: Floats,
    times: Floats,
    tolerance: float,
    told: Callable[[float], None] = lambda t: None,
) -> Iterator[Row]:
    """The motion at each of `times`, ascending; the first is the start.

    ladder     numbers of stages, ascending; a step takes the least that serve
    tolerance  what each step's error is held to, in parts of the scale
    told       where each step begins, s, whether it is taken or not; may raise to end it

    Every row ends a step, so that rows are as accurate as the end; so does every turn of a corner.
    Long numbers must be on (`digits`) wherever this is resumed. Raises `NoStep` if steps shrink to
    nothing, or corners turn again and again.
    """
    start = np.array(precise.initial, dtype=object)
    way = _Way(ladder, mpfr(float(times[0])), start, mpfr(float(times[1] - times[0])))
    forecast = Forecast(problem, scale, float(times[-1]), lambda: told(float(way.t)))
    yield Row(start, 0, way.extent)
    for end in times[1:]:
        target = mpfr(float(end))
        turn, tried, h = None, 0, mpfr(0)
        while way.t < target:
            told(float(way.t))
            left = target - way.t
            count = max(1, math.ceil(left / way.length * 0.999))
            h = left / count if turn is None else h + h * turn.beyond
            method = gauss(way.stages)
            try:
                step = advance(
                    method, precise, problem, forecast, scale, way.t, way.y, h, tolerance
                )
                error = step.error
            except (ArithmeticError, ValueError):  # of floats, of factors, of a step
                error = math.inf
            if not error <= tolerance:
                way.again(h, error, tolerance)
                turn = None
                continue
            if precise.watch:
                slow = tried > SLOW
                again, turn = _turned(precise.watch, method, step.margins, turn, slow=slow)
                tried += again
                if tried > TURNINGS:
                    raise NoStep(f"corners turn again and again at t = {float(way.t):.6g}")
                if again:
                    continue
            way.take(h, step, tolerance, spare=way.length > left)
            tried = 0
            if count == 1 and abs(target - way.t) <= abs(target) * 2.0 ** (3 - BITS):
                way.t = target
        yield Row(way.y, way.made, way.extent)


def _turned(
    watch: Watch, method: Gauss, margins: Floats, turn: Turn | None, *, slow: bool
) -> tuple[bool, Turn | None]:
    """Whether a step is to be made again because of corners, and up to which turn; turns those that
    are there at its start, or at its end, if it is taken.
    """
    places = np.array([0.0, *method.c.tolist(), 1.0], dtype=float)
    if turn is not None:
        if not corners.is_there(turn, margins):
            turn = corners.nearer(turn, places, margins)
            return True, corners.simpler(turn, places, margins) if slow else turn
        for corner in corners.turned_at_the_end(turn, margins):
            watch.ways[corner] = not watch.ways[corner]
        return False, None
    late = corners.wrong_from_the_start(watch.ways, margins)
    for corner in late:
        watch.ways[corner] = not watch.ways[corner]
    if late:
        return True, None
    found = corners.first_turn(watch.ways, places, margins)
    return found is not None, found
