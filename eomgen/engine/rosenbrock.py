"""Rodas5P: a Rosenbrock method of order 5 for stiff problems, with the exact Jacobian.

A step solves eight linear systems with one matrix and needs no Newton iteration. The method is
L-stable and stiffly accurate; its error estimate has order 4, its dense output, too. Steps are
chosen as in RODAS: Hairer, Wanner, Solving ODEs II, sections IV.7 and IV.8, with Gustafsson's
predictive control.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

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
from eomgen.engine.system import StiffSystem
from eomgen.subset.words import (
    Known,
    Matrix,
    Vector,
    copy,
    inf,
    larger,
    nan,
    next_after,
    ordered,
    sqrt,
    unrolled,
    with_arrays,
    zeros,
)

STAGES = len(NODES)
SUMS = (
    *(row for both in zip(PLACES[1:], COUPLINGS[1:], strict=True) for row in both),
    END,
    *DENSE,
)
"""All sums over the solutions u_j of a step: for each stage after the first that of its place and
that of its equation, then those of the end and of the dense output."""
AT_END, IN_DENSE, MANY_SUMS = 2 * (STAGES - 1), 2 * STAGES - 1, len(SUMS)
"""The number of the sum `END`, and of the first of `DENSE`, and how many there are."""
COLUMNS = tuple(
    tuple((i, row[j]) for i, row in enumerate(SUMS) if i >= 2 * j and j < len(row))
    for j in range(STAGES)
)
"""The sums to which solution j adds, with its factors: those of stage j + 1 and all behind it."""
_ADDED = tuple(
    np.array([[row[j] if j < len(row) else 0.0] for row in SUMS[2 * j :]]) for j in range(STAGES)
)
SAFETY, SMALLEST, GREATEST = 0.9, 0.2, 6.0
"""Factor for the next step's length, and its bounds."""
POWER = -1 / 5
LEAST_ERROR = 0.01
"""An error below this counts as this, where the next step's length depends on two steps."""
NEGLIGIBLE = 1e-30
"""Errors up to this count as none."""
ASIDE = 2.0**-10
"""The derivative with respect to time is a difference quotient over twice this part of the step,
within the step, with an error of order 2."""
MADE, TOO_SHORT = 1, 0
"""What a step returns: it is made; its length would be less than the spacing between numbers."""


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
    sums           see `SUMS`
    derivatives, factorisations  how many there were
    """

    t_bound: float
    longest: float
    rtol: float
    positions: int
    timed: bool
    h_abs: float
    h_last: float
    error: float
    end: float
    derivatives: int
    factorisations: int
    atol: Annotated[Vector, "STATES"]
    lost: Annotated[Vector, "STATES"]
    last: Annotated[Vector, "STATES"]
    change: Annotated[Vector, "STATES"]
    sums: Annotated[Matrix, "MANY_SUMS", "STATES"]


def rms(n: int, x: Annotated[Vector, "n"], scale: Annotated[Vector, "n"]) -> float:
    """The root of the mean square of x / scale, summed in order; 0 of no values."""
    if n == 0:
        return 0.0
    part = x / scale
    total = ordered(part * part)
    return sqrt(total / n)


def _add_solution(n: int, i: int, u: Vector, sums: Matrix) -> None:
    if i == 0:
        np.add(_ADDED[0] * u, 0.0, sums)
    else:
        sums[2 * i :] += _ADDED[i] * u


@with_arrays(_add_solution)
def add_solution(
    n: int, i: Known, u: Annotated[Vector, "n"], sums: Annotated[Matrix, "MANY_SUMS", "n"]
) -> None:
    """Add solution i to all sums that depend on it; each begins with 0, and so none is -0."""
    for k, a in unrolled(COLUMNS[i]):
        if i == 0:
            sums[k, :] = 0.0 + a * u
        else:
            sums[k, :] = sums[k] + a * u


def rodas_step(
    system: StiffSystem, run: Rodas, factors: Factors, t: float, y: Annotated[Vector, "STATES"]
) -> int:
    """Make a step from y at t, of the length that is due or shorter ones until one succeeds."""
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
            rest = run.last - y
            run.lost[:] = (y - (run.last - rest)) + (run.change - rest)
            return MADE
        if error < inf:
            length *= max(SMALLEST, SAFETY * error**POWER)
        else:
            length *= SMALLEST
        rejected = True
    return TOO_SHORT


def next_factor(run: Rodas, h: float, error: float, rejected: bool) -> float:
    """The next step's length by that of this one, h, which has the given error."""
    factor = GREATEST
    if error > NEGLIGIBLE:
        factor = SAFETY * error**POWER
        if run.h_last != 0.0:
            ratio = error * error / run.error
            factor = min(factor, SAFETY * (h / run.h_last) * ratio**POWER)
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
    """Compute the solutions u_j of a step, the sums over them, and the state at the end; returns
    the error, relative to the tolerance.
    """
    n = len(y)
    u = copy(slope)
    for i in unrolled(range(STAGES)):
        if i > 0:
            place = y + run.sums[2 * i - 2]
            u = system.derivative(t + NODES[i] * h, place)
            u = u + run.sums[2 * i - 1] / h
        if run.timed:
            u = u + (h * IN_TIME[i]) * in_time
        solve_by(factors, u)
        add_solution(n, i, u, run.sums)
    run.change[:] = run.sums[AT_END] + run.lost
    run.last[:] = y + run.change
    run.derivatives += STAGES - 1
    scale = run.atol + larger(abs(y), abs(run.last)) * run.rtol
    error = rms(n, u, scale)
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
    """An estimate of the error of the dense output in the middle of a step.

    It is a step of Newton's method from there. Where a stiff motion follows a slow one, steps may
    be so long that their ends are right and what lies between is not.
    """
    rise = (run.last - y) + (run.sums[IN_DENSE + 1] + run.sums[IN_DENSE + 2]) / 4.0
    bend = run.sums[IN_DENSE] + (run.sums[IN_DENSE + 1] + run.sums[IN_DENSE + 2] / 2.0) / 2.0
    middle = (y + run.last) / 2.0 + bend / 4.0
    missing = system.derivative(t + h / 2.0, middle)
    missing = missing - rise / h
    run.derivatives += 1
    solve_by(factors, missing)
    return rms(len(y), missing, scale)


def rodas_within(
    system: StiffSystem,
    run: Rodas,
    y: Annotated[Vector, "STATES"],
    x: float,
    state: Annotated[Vector, "STATES"],
) -> None:
    """The state at the part x of the last step, which began with y."""
    back = 1.0 - x
    bend = x * (run.sums[IN_DENSE + 1] + x * run.sums[IN_DENSE + 2])
    state[:] = back * y + x * (run.last + back * (run.sums[IN_DENSE] + bend))
