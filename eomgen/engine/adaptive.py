"""Steps of explicit Runge-Kutta methods whose lengths follow from a tolerance.

Hairer, Norsett, Wanner, Solving ODEs I: stages and step control in sections II.4 and II.5, dense
output in II.6. What rounding takes from the state is added to its next change: Hairer, Lubich,
Wanner, Geometric Numerical Integration, section VIII.5.

Slopes k (16, STATES) and terms (7, STATES) have the sizes of DOP853.
"""

from dataclasses import dataclass
from typing import Annotated

from eomgen.engine.sums import round_off
from eomgen.engine.system import System
from eomgen.subset.words import (
    Known,
    Matrix,
    Vector,
    combined,
    inf,
    larger,
    next_after,
    ordered,
    sqrt,
    unrolled,
    zeros,
)

MADE, AT_END, UNUSUAL, EVENT, AGAIN = 0, 1, 2, 3, 4
"""Why steps ended: all were made; the next one reaches the end; it is not for these steps; the last
one ends where rigid contacts close or open; the next one must end earlier, which is the end now."""


@dataclass(slots=True)
class Bounds:
    """What steps are made with: tolerances, the longest step, s, the end of the last step, s,
    whether the terms of each step are kept, whether a step may end there that is shorter because of
    that, and whether derivatives for terms that no row needs count.
    """

    atol: Annotated[Vector, "STATES"]
    rtol: float
    longest: float
    until: float = 0.0
    dense: bool = False
    reaches: bool = False
    counts_terms: bool = True


@dataclass(slots=True)
class Progress:
    """A step of h s from t to `end`, and the greatest length of the next one, s; the derivatives so
    far; whether the terms are those of this step.
    """

    t: float = 0.0
    h: float = 0.0
    end: float = 0.0
    length: float = 0.0
    derivatives: int = 0
    is_dense: bool = False


def eighth_root(x: float) -> float:
    """x^(1/8), with the same bits wherever there is a square root."""
    return sqrt(sqrt(sqrt(x)))


def first_length(
    system: System,
    run: Bounds,
    t: float,
    y: Annotated[Vector, "STATES"],
    slope: Annotated[Vector, "STATES"],
    longest: float,
) -> float:
    """The length of the first step from y, s: section II.4, (a) to (f)."""
    if len(y) == 0:
        return longest
    scale = run.atol + abs(y) * run.rtol
    a = y / scale
    b = slope / scale
    first = ordered(a * a)
    second = ordered(b * b)
    size = sqrt(first / len(y))
    speed = sqrt(second / len(y))
    trial = 1e-6
    if size >= 1e-5 and speed >= 1e-5 and speed < inf:
        trial = 0.01 * size / speed
    trial = min(trial, longest)
    place = y + trial * slope
    ahead = system.derivative(t + trial, place)
    c = (ahead - slope) / scale
    third = ordered(c * c)
    bend = sqrt(third / len(y)) / trial
    length = max(1e-6, trial * 1e-3)
    if speed > 1e-15 or bend > 1e-15:
        length = eighth_root(0.01 / max(speed, bend))
    return min(min(100.0 * trial, length), longest)


def attempted(
    method: Known,
    system: System,
    run: Bounds,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
    k: Annotated[Matrix, "16", "STATES"],
    change: Annotated[Vector, "STATES"],
) -> float:
    """The change in a step of `at.h` s from y, with the slope k[0], before rounding. Returns its
    error, relative to the one that is allowed.
    """
    h = at.h
    for i in unrolled(range(1, method.last)):  # (II.4.1)
        place = y + h * combined(method.stages[i], k)
        k[i] = system.derivative(at.t + method.nodes[i] * h, place)
    change[:] = h * combined(method.end, k) + lost
    raw = y + change
    before = abs(y)
    after = abs(raw)
    scale = run.atol + larger(before, after) * run.rtol  # (II.4.10)
    a = combined(method.long_error, k) / scale
    b = combined(method.short_error, k) / scale
    fifth = ordered(a * a)
    third = ordered(b * b)
    size = sqrt((fifth + method.short_weight * third) * len(y))
    if size == 0.0:
        return 0.0
    return h * fifth / size  # (II.5.17)


def made(
    method: Known,
    system: System,
    run: Bounds,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
    k: Annotated[Matrix, "16", "STATES"],
    change: Annotated[Vector, "STATES"],
) -> bool:
    """Make a step from y at `at.t`, with the slope k[0], to y + `change` at `at.end`. False if it
    would have to be too short.
    """
    at.is_dense = False
    shortest = 10.0 * abs(next_after(at.t) - at.t)
    length = max(min(at.length, run.longest), shortest)
    factor = method.greatest
    while True:
        if not length >= shortest:
            return False
        at.end = min(at.t + length, run.until)
        at.h = at.end - at.t
        error = attempted(method, system, run, at, y, lost, k, change)
        at.derivatives += method.last - 1
        if error < 1.0:
            break
        length = at.h * max(method.smallest, method.safety / eighth_root(error))
        factor = 1.0
    if error != 0.0:
        factor = min(factor, method.safety / eighth_root(error))
    at.length = at.h * factor
    return True


def explicit_step(
    method: Known,
    system: System,
    run: Bounds,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
    k: Annotated[Matrix, "16", "STATES"],
    raw: Annotated[Vector, "STATES"],
) -> bool:
    """The same step, to `raw`, with the slope there, and with what rounding takes from it, which is
    then `lost`. False also if that slope is not finite.
    """
    change = zeros(len(y))
    if not made(method, system, run, at, y, lost, k, change):
        return False
    raw[:] = y + change
    k[method.last] = system.derivative(at.end, raw)
    at.derivatives += 1
    round_off(y, raw, change, lost)
    wrong = ordered(k[method.last] * 0.0)
    return wrong == 0.0


def interpolate(
    method: Known,
    system: System,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    raw: Annotated[Vector, "STATES"],
    k: Annotated[Matrix, "16", "STATES"],
    terms: Annotated[Matrix, "7", "STATES"],
) -> None:
    """The terms of the polynomial of a step from y to `raw`, with slopes up to the one at its end:
    section II.6. Nothing is done if they are known.
    """
    if at.is_dense:
        return
    h = at.h
    for i in unrolled(range(method.last + 1, len(method.nodes))):
        place = y + h * combined(method.stages[i], k)
        k[i] = system.derivative(at.t + method.nodes[i] * h, place)
        at.derivatives += 1
    terms[0] = raw - y
    terms[1] = h * k[0] - terms[0]
    terms[2] = 2.0 * terms[0] - h * (k[method.last] + k[0])
    for i in unrolled(range(len(method.dense))):
        terms[3 + i] = h * combined(method.dense[i], k)
    at.is_dense = True


def within(
    at: Progress,
    y: Annotated[Vector, "STATES"],
    terms: Annotated[Matrix, "7", "STATES"],
    t: float,
    place: Annotated[Vector, "STATES"],
) -> None:
    """The state at a time within a step whose terms are known."""
    x = (t - at.t) / at.h
    rest = 1.0 - x
    found = zeros(len(y))
    for i in unrolled(range(6, -1, -1)):
        found = (found + terms[i]) * (rest if i % 2 else x)
    place[:] = found + y
