"""Steps by Taylor series of the solution, of an order that follows from the tolerance.

A step is as long as its last two terms stay below the tolerance: Jorba and Zou, A software package
for the numerical integration of ODEs by means of high-order Taylor methods, Experimental
Mathematics 14 (2005), section 3. So no step is refused, and its polynomial is its dense output.
What rounding takes from the state is added to its next change.

The coefficients come from recurrences (section 2) in two functions that are given, the text of
which `eomgen.program.taylor_text` writes for a mechanism. Sums of products, which take most of the
operations, are computed for all products at once.
"""

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Protocol

import numpy as np

from eomgen.engine.adaptive import Bounds, Progress
from eomgen.engine.sums import round_off
from eomgen.subset.words import (
    Matrix,
    Vector,
    Whole,
    exp,
    inf,
    log,
    unrolled,
    with_arrays,
    zeros,
)

LOOKED_AT = 6
"""So many terms say how long a step may be. Series without so many in a row are hardly ever met."""
HARDLY = 0.2
"""Terms before the last two may allow a length that is greater by this factor's exponential."""
LOWEST, HIGHEST = 8, 24
"""The lowest and the highest order."""
AT_ONCE = 4
"""So many sums are computed at once; the number of products is a multiple of it."""


class Recurrences(Protocol):
    """The series of a mechanism; see `eomgen.program.taylor_text`."""

    def started(
        self,
        t: float,
        y: Annotated[Vector, "STATES"],
        first: Annotated[Vector, "FIRST"],
        rates: Annotated[Vector, "STATES"],
    ) -> None:
        """Coefficients 0 of all series that are needed later, and 1 of the states."""

    def extended(
        self,
        k: int,
        first: Annotated[Vector, "FIRST"],
        sums: Annotated[Vector, "PRODUCTS"],
        state: Annotated[Vector, "STATES"],
        rates: Annotated[Vector, "STATES"],
        left: Annotated[Vector, "PRODUCTS"],
        right: Annotated[Vector, "PRODUCTS"],
    ) -> None:
        """Coefficients k of the factors of all products, and k + 1 of the states, from those before
        and the sums of products.
        """

    def sums_of_products(
        self,
        k: int,
        left: Annotated[Matrix, "ORDERS", "PRODUCTS"],
        right: Annotated[Matrix, "ORDERS", "PRODUCTS"],
        sums: Annotated[Vector, "PRODUCTS"],
    ) -> None:
        """As `convolved`, with as many products at once as the place can."""


@dataclass(slots=True)
class Terms:
    """Where coefficients are computed: the first ones, sums of products, and those of factors; and
    the order of steps.
    """

    first: Annotated[Vector, "FIRST"]
    sums: Annotated[Vector, "PRODUCTS"]
    left: Annotated[Matrix, "ORDERS", "PRODUCTS"]
    right: Annotated[Matrix, "ORDERS", "PRODUCTS"]
    order: int = 0


@cache
def _factors(k: int) -> tuple[Whole, Whole]:
    """The numbers of the left and of the right factors of each sum's products, in order."""
    left = np.array([*range(2, k - 1), *range(1, k, max(1, k - 2))], np.int64)
    return left, k - left


def _by_numpy(k: int, left: Matrix, right: Matrix, sums: Vector) -> None:
    """As `convolved`."""
    i, j = _factors(k)
    sums[:] = np.add.reduce(left[i] * right[j], axis=0, initial=0.0)


@with_arrays(_by_numpy)
def convolved(
    k: int,
    left: Annotated[Matrix, "ORDERS", "PRODUCTS"],
    right: Annotated[Matrix, "ORDERS", "PRODUCTS"],
    sums: Annotated[Vector, "PRODUCTS"],
) -> None:
    """Sums over i from 1 to k - 1 of the products left[i] right[k - i]. Those with the last
    coefficients, which have only just been computed, are added last.
    """
    n = 0
    while n < len(sums):
        total = zeros(AT_ONCE)
        for i in range(2, k - 1):
            for j in unrolled(range(AT_ONCE)):
                total[j] += left[i, n + j] * right[k - i, n + j]
        if k > 1:
            for j in unrolled(range(AT_ONCE)):
                total[j] += left[1, n + j] * right[k - 1, n + j]
        if k > 2:
            for j in unrolled(range(AT_ONCE)):
                total[j] += left[k - 1, n + j] * right[1, n + j]
        for j in unrolled(range(AT_ONCE)):
            sums[n + j] = total[j]
        n += AT_ONCE


def _expanded(of: Any, t: float, y: Vector, order: int, room: Terms, rows: Matrix) -> None:
    """As `expanded`, with numbers in lists where they are taken one by one."""
    first, n = room.first.tolist(), room.left.shape[1]
    state, rates = y.tolist(), [0.0] * len(y)
    left, right = [0.0] * n, [0.0] * n
    of.started(t, state, first, rates)
    rows[0], rows[1] = y, rates
    for k in range(1, order):
        of.sums_of_products(k, room.left, room.right, room.sums)
        state, rates = rates, [0.0] * len(y)
        of.extended(k, first, room.sums.tolist(), state, rates, left, right)
        room.left[k], room.right[k], rows[k + 1] = left, right, rates


@with_arrays(_expanded)
def expanded(
    of: Recurrences,
    t: float,
    y: Annotated[Vector, "STATES"],
    order: int,
    room: Terms,
    rows: Annotated[Matrix, "ORDERS", "STATES"],
) -> None:
    """The Taylor coefficients of the solution from y at t on, up to an order of at least 2."""
    rows[0] = y
    of.started(t, y, room.first, rows[1])
    for k in range(1, order):
        of.sums_of_products(k, room.left, room.right, room.sums)
        of.extended(k, room.first, room.sums, rows[k], rows[k + 1], room.left[k], room.right[k])


def order_of(rtol: float) -> int:
    """The order for a relative tolerance. Measured on pendulums of 2 and 10 links: the time for an
    error is within a tenth of the least one.
    """
    order = LOWEST
    wanted = 5.0 - log(rtol) / 2.0
    while order < HIGHEST and order < wanted:
        order += 1
    return order


def reach(
    run: Bounds,
    order: int,
    rows: Annotated[Matrix, "ORDERS", "STATES"],
    y: Annotated[Vector, "STATES"],
) -> float:
    """The length of a step, s: at its end the last two terms are still below the tolerance.

    Both vanish where the motion is symmetric in time, as of a pendulum let go at a right angle,
    whose series have every fourth term. So some terms before say how fast terms fall, too: they
    may allow hardly more than the last ones.
    """
    allowed = run.atol + run.rtol * abs(y)
    larger = -inf
    fall = log(run.rtol) / order  # that of the tolerance
    for k in range(order, order - LOOKED_AT, -1):
        term = abs(rows[k]) / allowed
        largest = 0.0
        for j in range(len(y)):
            largest = max(largest, term[j])
        if largest > 0.0:
            slope = log(largest) / k
            if k < order - 1:  # the fall of terms, by that of the tolerance from here to the end
                slope = log(largest * run.rtol) / k - fall - HARDLY
            larger = max(larger, slope)
    length = exp(-larger)
    return min(length, run.longest)


def change_after(
    h: float,
    order: int,
    rows: Annotated[Matrix, "ORDERS", "STATES"],
    change: Annotated[Vector, "STATES"],
) -> None:
    """The change of the state after h s, by Horner's rule."""
    change[:] = rows[order]
    for k in range(order - 1, 0, -1):
        change[:] = change * h + rows[k]
    change[:] = change * h


def series_step(
    order: int,
    rows: Annotated[Matrix, "ORDERS", "STATES"],
    run: Bounds,
    at: Progress,
    y: Annotated[Vector, "STATES"],
    lost: Annotated[Vector, "STATES"],
    raw: Annotated[Vector, "STATES"],
) -> None:
    """Make a step within bounds from y at `at.t` to `raw` at `at.end`; what rounding takes from
    that is then `lost`.
    """
    change = zeros(len(y))
    at.end = min(at.t + at.length, run.until)
    at.h = at.end - at.t
    at.derivatives += order
    change_after(at.h, order, rows, change)
    change[:] = change + lost
    raw[:] = y + change
    round_off(y, raw, change, lost)
