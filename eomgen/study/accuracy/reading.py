"""Results of a work-precision study: observed orders, cheapest runs, savings by the Jacobian."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from eomgen.study.accuracy.ladder import Work
from eomgen.study.accuracy.work_precision import Bench

TARGETS = (1e-3, 1e-6, 1e-9)
AGREE = 0.05
"""Slopes count as equal if each differs from their median by at most this part of it."""
LEAST_SLOPES = 2
LEAST = 0.5
"""Slopes below this come from rounding."""
DIFFERENCES = "_differences"
"""Suffix of methods that compute their Jacobian by finite differences."""


@dataclass(frozen=True)
class Order:
    """The observed order: the slope of log error over log step, from step `coarse` to `fine`, s."""

    value: float
    coarse: float
    fine: float


def observed_order(works: Sequence[Work]) -> Order | None:
    """The order that runs of one method with equal steps show; None if they show none.

    The asymptotic range is found without knowing the order: of all ranges of steps over which the
    slopes from one step to the next are nearly equal, the one with the finest steps and, among
    those, the longest. Only measured errors of "ok" runs count, and only slopes above `LEAST`. The
    order is the slope of a straight line fitted to the range.
    """
    usable = [
        work for work in works if work.status == "ok" and not work.at_most[0] and work.error > 0
    ]
    steps = np.log([work.setting.dt or np.nan for work in usable])
    errors = np.log([work.error for work in usable])
    if len(usable) <= LEAST_SLOPES:
        return None
    slopes = np.diff(errors) / np.diff(steps)
    found: list[slice] = []
    for start in range(len(slopes)):
        for stop in range(start + LEAST_SLOPES, len(slopes) + 1):
            part = slopes[start:stop]
            middle = float(np.median(part))
            if middle > LEAST and float(np.max(np.abs(part - middle))) <= AGREE * middle:
                found.append(slice(start, stop + 1))
    if not found:
        return None
    span = max(found, key=lambda stretch: (stretch.stop, -stretch.start))
    slope = float(np.polyfit(steps[span], errors[span], 1)[0])
    return Order(slope, float(np.exp(steps[span][0])), float(np.exp(steps[span][-1])))


def cost_of(bench: Bench) -> Callable[[Work], float]:
    """By what runs are ranked: counted work, as wall time would rank them differently from hour to
    hour, or their time in compiled code, of which the counted work knows little.
    """
    return (lambda work: work.seconds) if bench.compiled else (lambda work: work.units)


def cheapest(
    works: Iterable[Work], target: float, cost: Callable[[Work], float] = lambda work: work.units
) -> list[Work]:
    """Of each method the "ok" run with the least cost whose error is within the target, cheapest
    first.
    """
    best: dict[str, Work] = {}
    for work in works:
        if work.status == "ok" and work.error <= target:
            method = work.setting.integrator
            if method not in best or cost(work) < cost(best[method]):
                best[method] = work
    return sorted(best.values(), key=cost)


def saved_by_jacobian(works: Iterable[Work]) -> dict[str, float]:
    """By method: median ratio of the time with finite differences to that with the Jacobian.

    It is taken over runs with the same tolerances that are both "ok".
    """
    times = {
        (work.setting.integrator, work.setting.rtol, work.setting.atol): work.seconds
        for work in works
        if work.status == "ok"
    }
    ratios: dict[str, list[float]] = {}
    for (method, *tolerances), seconds in times.items():
        other = times.get((f"{method}{DIFFERENCES}", *tolerances))  # type: ignore[arg-type]
        if other is not None:
            ratios.setdefault(method, []).append(other / seconds)
    return {method: median(found) for method, found in ratios.items()}
