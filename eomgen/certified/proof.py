"""Boxes that hold a motion at given times, by proven steps."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from eomgen.certified.balls import (
    SHORT,
    Ball,
    Balls,
    ball,
    matrix,
    middle,
    precision,
    radius,
)
from eomgen.certified.growth import Growth, growth
from eomgen.certified.recursion import Fixed, Motion
from eomgen.certified.steps import Pace, Plan, Spread, step_from

SPARE = 1e-3
"""The part of the wanted radius that all remainders together may take."""
GUARD_BITS = 20
"""Bits beyond those that the wanted radius and the growth ask for."""
TRIES = 4
"""How often the same motion is tried, each time with smaller remainders and more bits."""
MOST_BITS = 4096
FIRST = 1e-3
"""First step, s."""
LOST = 1e-2
"""A radius that grew by this much from the start is beyond what is to be proven."""


@dataclass(frozen=True, eq=False)
class Proof:
    """Boxes that hold the state at times, as far as they were proven.

    rows     a box for each time that was reached, balls (n, ny)
    reached  up to which time the motion is proven, s
    plan     with which this was proven
    steps    number of steps, of the last try
    """

    rows: list[Balls]
    reached: float
    plan: Plan
    steps: int

    @property
    def radius(self) -> float:
        """The greatest radius of any component at any time."""
        return max((radius(x) for row in self.rows for x in row), default=math.inf)


def prove(
    motion: Motion,
    values: dict[str, Ball],
    start: Balls,
    times: Sequence[float],
    wanted: float,
) -> Proof:
    """Boxes that hold the motion from every state in the box `start` at increasing times,
    with radii of at most `wanted` if the start is a point.

    values  of parameters and inputs that do not vary, by name
    """
    with precision(SHORT):
        fixed = [float(x.mid()) for x in motion.fixed(values)]
    guess = growth(motion, fixed, [float(x.mid()) for x in start], times[0], times[-1])
    size = max(1.0, *(abs(float(x)) for x in start))
    bits = math.log2(size * guess.largest / wanted) + GUARD_BITS
    plan = _plan(wanted * SPARE, guess, bits, times[-1] - times[0])
    exact = all(x.is_exact() for x in start)
    found: Proof | None = None
    for _ in range(TRIES):
        new = _proven(motion, values, start, times, plan, guess)
        if found is None or (new.reached, -new.radius) > (found.reached, -found.radius):
            found = new
        if not exact or (new.reached == times[-1] and new.radius <= wanted):
            break
        short = new.radius / wanted if new.reached == times[-1] else 1e6
        short = min(max(10.0, 3 * short), 1e12)
        bits = plan.bits + math.log2(short)
        if bits > MOST_BITS:
            break
        plan = _plan(plan.tolerance / short, guess, bits, times[-1] - times[0])
    assert found is not None
    return found


def _plan(tolerance: float, guess: Growth, bits: float, span: float) -> Plan:
    """The order with the fewest operations for steps of this accuracy: operations are as order² and
    steps as ε^(1/order), so it is ln(1/ε) / 2; see Jorba and Zou 2005, section 3.1.
    """
    share = tolerance * FIRST / max(span, FIRST) / guess.largest
    return Plan(tolerance, math.ceil(bits), max(12, round(math.log(1 / share) / 2)))


def _proven(
    motion: Motion,
    values: dict[str, Ball],
    start: Balls,
    times: Sequence[float],
    plan: Plan,
    guess: Growth,
) -> Proof:
    n, begin, end = len(start), times[0], times[-1]
    with precision(plan.bits):
        fixed: Fixed = motion.fixed(values)
        centre = [middle(x) for x in start]
        spread = Spread(
            matrix([[ball(float(i == j)) for j in range(n)] for i in range(n)]),
            [x - c for x, c in zip(start, centre, strict=True)],
        )
    limit = LOST + 10 * max(radius(x) for x in spread.box)
    rows, t, pace, steps = [start], ball(begin), Pace(FIRST), 0
    while len(rows) < len(times):
        # The last step ends just behind the end: beyond it nothing may be known of the motion.
        pace = replace(pace, h=min(pace.h, end - float(t) + 4 * math.ulp(end)))
        local = plan.tolerance * pace.h / (end - begin) * guess.share(float(t))
        step, pace = step_from(
            motion, fixed, (t, centre, spread), pace, replace(plan, tolerance=local)
        )
        if step is None:
            break
        while len(rows) < len(times) and ball(times[len(rows)]) <= step.until:
            rows.append(step.box(times[len(rows)]))
        centre, spread = step.end()
        t, steps = step.until, steps + 1
        with precision(SHORT):
            if not max(radius(x) for x in spread.hull()) < limit:
                break
    return Proof(rows, min(float(t), end), plan, steps)
