"""Rodas5P: a Rosenbrock method of order 5 for stiff problems, with the exact Jacobian.

A step solves eight linear systems with one matrix and needs no Newton iteration. The method is
L-stable and stiffly accurate; its error estimate has order 4, its dense output, too. Steps are
chosen as in RODAS: Hairer, Wanner, Solving ODEs II, sections IV.7 and IV.8, with Gustafsson's
predictive control.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from eomgen.engine.adaptive import Bounds, Progress
from eomgen.engine.elimination import Factors, factored, solve_by
from eomgen.engine.rodas_5p_coefficients import (
    COUPLINGS,
    DENSE,
    END,
    GAMMA,
    IN_TIME,
    NODES,
    PLACES,
)
from eomgen.engine.sums import round_off
from eomgen.engine.system import StiffSystem
from eomgen.subset.words import (
    Matrix,
    Row,
    Vector,
    combined,
    copy,
    inf,
    larger,
    nan,
    next_after,
    ordered,
    sqrt,
    unrolled,
    zeros,
)

STAGES = len(NODES)
AT, FROM, TO, BETWEEN = (
    tuple(Row(enumerate(row)) for row in rows) for rows in (PLACES, COUPLINGS, (END,), DENSE)
)
"""The rows of factors of sums over the solutions u_j of a step: for the place of each stage, for
its equation, for the end, and for the dense output."""
SAFETY, SMALLEST, GREATEST = 0.9, 0.2, 6.0
"""Factor for the next step's length, and its bounds."""
LEAST_ERROR = 0.01
"""An error below this counts as this, where the next step's length depends on two steps."""
NEGLIGIBLE = 1e-30
"""Errors up to this count as none."""
ASIDE = 2.0**-10
"""The derivative with respect to time is a difference quotient over twice this part of the step,
within the step, with an error of order 2."""


@dataclass(slots=True)
class Rodas:
    """What steps are made with, and what one leaves.

    t_bound, longest  no step leads beyond, or is longer
    rtol, atol     tolerances
    positions      number of states that are positions, which come first
    timed          whether the derivative depends on time
    h_abs, h_last, error, lost
                   the length of the next step; that of the last one, 0 before the first, and its
                   error relative to the tolerance; what rounding took from the state, which is
                   added to the next change (Hairer, Lubich, Wanner, Geometric Numerical
                   Integration, section VIII.5)
    end, last, change
                   where the step ends, the state there, and its change
    solutions      the u_j; in Python `Solutions`
    dense          the sums of the dense output
    derivatives, factorisations  how many there were
    """

    atol: Annotated[Vector, "STATES"]
    lost: Annotated[Vector, "STATES"]
    last: Annotated[Vector, "STATES"]
    change: Annotated[Vector, "STATES"]
    solutions: Annotated[Matrix, "STAGES", "STATES"]
    dense: Annotated[Matrix, "3", "STATES"]
    t_bound: float
    longest: float
    rtol: float
    positions: int
    timed: bool
    h_abs: float = 0.0
    h_last: float = 0.0
    error: float = 1.0
    end: float = 0.0
    derivatives: int = 0
    factorisations: int = 0


def rms(n: int, x: Annotated[Vector, "n"], scale: Annotated[Vector, "n"]) -> float:
    """The root of the mean square of x / scale, summed in order; 0 of no values."""
    if n == 0:
        return 0.0
    part = x / scale
    total = ordered(part * part)
    return sqrt(total / n)


_ROWS = (*(row for both in zip(AT[1:], FROM[1:], strict=True) for row in both), *TO, *BETWEEN)
_NUMBERS = {id(row): i for i, row in enumerate(_ROWS)}
_ADDED = tuple(np.array([[dict(row).get(j, 0.0)] for row in _ROWS[2 * j :]]) for j in range(STAGES))


class Solutions:
    """The solutions u_j of n states, as Python keeps them: each is added to all sums over them at
    once, for NumPy takes longer to begin an operation than to add some numbers.
    """

    def __init__(self, n: int) -> None:
        self._sums = np.zeros((len(_ROWS), n))

    def __setitem__(self, j: int, u: Vector) -> None:
        """Add solution j to all sums behind its stage; each begins with 0, and so none is -0."""
        if j == 0:
            np.add(_ADDED[0] * u, 0.0, self._sums)
        else:
            self._sums[2 * j :] += _ADDED[j] * u

    def combined(self, row: Row) -> Vector:
        """The sum with the factors of a row."""
        found: Vector = self._sums[_NUMBERS[id(row)]]
        return found


def fifth_root(x: float) -> float:
    """x^(1/5) by Newton's method, with the same bits wherever there is a square root. Far from 1,
    where steps are not chosen by it, it is not exact.
    """
    eighth = sqrt(sqrt(sqrt(x)))
    root = eighth * sqrt(eighth) * sqrt(sqrt(sqrt(eighth)))
    for _ in range(4):
        square = root * root
        root -= (root - x / (square * square)) / 5.0
    return root


def rodas_step(
    system: StiffSystem, run: Rodas, factors: Factors, t: float, y: Annotated[Vector, "STATES"]
) -> bool:
    """Make a step from y at t, of the length that is due or shorter ones until one succeeds. False
    if it would be shorter than the spacing between numbers.
    """
    shortest = 10.0 * abs(next_after(t) - t)
    length = max(min(run.h_abs, run.longest), shortest)
    slope = system.derivative(t, y)
    matrix = system.jacobian(t, y)
    in_time = zeros(len(y))
    run.derivatives += 1
    if run.timed:
        aside = (min(t + length, run.t_bound) - t) * ASIDE
        near = system.derivative(t + aside, y)
        far = system.derivative(t + 2.0 * aside, y)
        in_time[:] = (4.0 * (near - slope) - (far - slope)) / (2.0 * aside)
        run.derivatives += 2
    rejected = False
    while length >= shortest:
        run.end = min(t + length, run.t_bound)
        h = run.end - t
        length = h
        run.factorisations += 1
        error = nan
        if factored(factors, 1.0 / (h * GAMMA), run.positions, matrix):
            error = rodas_attempted(system, run, factors, t, h, y, slope, in_time)
        if error < 1.0:
            run.h_abs = length * next_factor(run, h, error, rejected)
            run.h_last = h
            run.error = max(LEAST_ERROR, error)
            round_off(y, run.last, run.change, run.lost)
            return True
        if error < inf:
            length *= max(SMALLEST, SAFETY / fifth_root(error))
        else:
            length *= SMALLEST
        rejected = True
    return False


def next_factor(run: Rodas, h: float, error: float, rejected: bool) -> float:
    """The next step's length by that of this one, h, which has the given error."""
    factor = GREATEST
    if error > NEGLIGIBLE:
        factor = SAFETY / fifth_root(error)
        if run.h_last != 0.0:
            ratio = error * error / run.error
            factor = min(factor, SAFETY * (h / run.h_last) / fifth_root(ratio))
        factor = min(GREATEST, max(SMALLEST, factor))
    if rejected:
        return min(1.0, factor)
    return factor


def rodas_attempted(
    system: StiffSystem,
    run: Rodas,
    factors: Factors,
    t: float,
    h: float,
    y: Annotated[Vector, "STATES"],
    slope: Annotated[Vector, "STATES"],
    in_time: Annotated[Vector, "STATES"],
) -> float:
    """Compute the solutions u_j of a step and the state at the end; returns the error, relative to
    the tolerance.
    """
    u = copy(slope)
    for i in unrolled(range(STAGES)):
        if i > 0:
            place = y + combined(AT[i], run.solutions)
            u = system.derivative(t + NODES[i] * h, place)
            u = u + combined(FROM[i], run.solutions) / h
        if run.timed:
            u = u + (h * IN_TIME[i]) * in_time
        solve_by(factors, u)
        run.solutions[i] = u
    run.change[:] = combined(TO[0], run.solutions) + run.lost
    run.last[:] = y + run.change
    run.derivatives += STAGES - 1
    scale = run.atol + larger(abs(y), abs(run.last)) * run.rtol
    error = rms(len(y), u, scale)
    if error < 1.0:
        within = error_within(system, run, factors, t, h, y, scale)
        if not within <= error:
            error = within
    return error


def error_within(
    system: StiffSystem,
    run: Rodas,
    factors: Factors,
    t: float,
    h: float,
    y: Annotated[Vector, "STATES"],
    scale: Annotated[Vector, "STATES"],
) -> float:
    """The sums of the dense output, and an estimate of its error in the middle of a step.

    It is a step of Newton's method from there. Where a stiff motion follows a slow one, steps may
    be so long that their ends are right and what lies between is not.
    """
    for i in unrolled(range(3)):
        run.dense[i] = combined(BETWEEN[i], run.solutions)
    rise = (run.last - y) + (run.dense[1] + run.dense[2]) / 4.0
    bend = run.dense[0] + (run.dense[1] + run.dense[2] / 2.0) / 2.0
    middle = (y + run.last) / 2.0 + bend / 4.0
    missing = system.derivative(t + h / 2.0, middle)
    missing = missing - rise / h
    run.derivatives += 1
    solve_by(factors, missing)
    return rms(len(y), missing, scale)


def rodas_within(
    run: Rodas,
    y: Annotated[Vector, "STATES"],
    x: float,
    state: Annotated[Vector, "STATES"],
) -> None:
    """The state at the part x of the last step, which began with y."""
    back = 1.0 - x
    bend = x * (run.dense[1] + x * run.dense[2])
    state[:] = back * y + x * (run.last + back * (run.dense[0] + bend))


def rosenbrock_step(
    system: StiffSystem,
    stiff: Rodas,
    factors: Factors,
    run: Bounds,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    raw: Annotated[Vector, "STATES"],
) -> bool:
    """Make a step within bounds from y at `at.t` to `raw` at `at.end`. False if there is none."""
    stiff.h_abs = at.length
    stiff.derivatives = 0
    stiff.t_bound = run.until
    if not rodas_step(system, stiff, factors, at.t, y):
        return False
    at.h = stiff.h_last
    at.end = stiff.end
    at.length = stiff.h_abs
    at.derivatives += stiff.derivatives
    raw[:] = stiff.last
    return True
