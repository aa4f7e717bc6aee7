"""What a run's own error is, as far as other runs of the same scene and its energy tell.

A method makes an error C τ^a at the tolerance τ, a near 1; of order p at an equal step h, C h^p.
Two runs that differ in τ alone are apart by the error of the looser one, but for the share that the
tighter one has itself; three tell the exponent. Runs of two methods are apart by the error of the
worse one. Differences are taken over the last part of the run, not at its last moment alone: a
motion swings, and so does what two runs differ by, which may pass through 0 just there; nor where
it is greatest, which a spike or an impact makes large for a moment.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from eomgen.run.problem import Floats
from eomgen.run.trajectory import Trajectory
from eomgen.study.measure import WRONG
from eomgen.study.trial import TIGHTEST_OF_ALL, Case, Tried, method_of

LAST = 0.1
"""Part of a run's time over whose rows differences are taken."""
CAUTION = 0.8
"""Of the exponent that a method has in theory: taken where one difference alone is known."""
SLOPES = (0.6, 1.2)
"""Of the exponent in theory: what a fitted one is kept to."""


@dataclass(frozen=True)
class Law:
    """quantity = factor · τ^exponent."""

    factor: float
    exponent: float

    def at(self, tolerance: float) -> float:
        """The quantity at a tolerance."""
        return self.factor * math.pow(tolerance, self.exponent)

    def tolerance(self, quantity: float) -> float:
        """The tolerance for a quantity."""
        return math.exp(math.log(quantity / self.factor) / self.exponent)


def fit(tolerances: Sequence[float], quantities: Sequence[float], expected: float) -> Law:
    """The power law through a ladder's last point, its exponent by least squares of the logarithms
    of the others, kept within `SLOPES` of the `expected` one; of one point alone it is that.
    """
    tau, e = np.log(np.asarray(tolerances)), np.log(np.asarray(quantities))
    slope = expected
    if len(tau) > 1:
        away, rise = tau[:-1] - tau[-1], e[:-1] - e[-1]
        bounds = sorted(bound * expected for bound in SLOPES)
        slope = min(max(float(away @ rise) / float(away @ away), bounds[0]), bounds[1])
    return Law(math.exp(e[-1] - slope * tau[-1]), slope)


def difference(one: Trajectory, other: Trajectory, scale: Floats) -> float:
    """How far two runs over the same time are apart, in parts of the scale: at the end, or, where
    that is more, at half the moments of the last part of the run.
    """
    start, end = float(one.t[0]), float(one.t[-1])
    since = end - LAST * (end - start)
    a, b = _rows(one, since), _rows(other, since)
    _, i, j = np.intersect1d(a[0], b[0], return_indices=True)
    apart = np.max(np.abs(a[1][i] - b[1][j]) / scale, axis=1)
    return max(float(apart[-1]), float(np.median(apart)))


def _rows(run: Trajectory, since: float) -> tuple[Floats, Floats]:
    """Rows from a time on, backwards: of those at one moment, an impact, the last comes first."""
    late = run.t >= since
    return run.t[late][::-1], run.y[late][::-1]


def remaining(gaps: Sequence[float], tolerances: Sequence[float], expected: float) -> float:
    """Error of the tightest of k >= 2 runs of one method, whose `tolerances` (k,) fall, from the
    differences (k - 1,) of each from the next.

    That of a wrong run says nothing of the next one's error, and is returned as it is. From two on
    they tell how fast the error falls now: near rounding it does no longer.
    """
    last = gaps[-1]
    if last >= WRONG or last == 0:
        return last
    slope = CAUTION * expected
    if len(gaps) > 1 and last < gaps[-2] < WRONG:
        measured = math.log(gaps[-2] / last) / math.log(tolerances[-3] / tolerances[-2])
        slope = min(measured, expected)
    elif len(gaps) > 1 and gaps[-2] <= last:
        slope = 0.0
    return last * math.pow(tolerances[-1] / tolerances[-2], slope)


def errors(runs: Sequence[Tried], scale: Floats, bounded: bool = False) -> list[float]:
    """Estimated error of each run, in parts of the scale; infinite where nothing is known.

    Of a method's looser runs their difference from its tightest, of that one what remains by the
    law; or the difference from some run of another method, where that is less. Two runs that do not
    differ at all tell nothing where steps are `bounded` otherwise: they may be the same steps.
    """
    found = []
    for run in runs:
        name = run.setting.integrator
        own = sorted((r for r in runs if r.setting.integrator == name), key=lambda r: -r.tolerance)
        others = [r for r in runs if r.setting.integrator != name]
        apart = [difference(run.trajectory, r.trajectory, scale) for r in others]
        if run is not own[-1]:
            apart.append(difference(run.trajectory, own[-1].trajectory, scale))
        elif len(own) > 1:
            pairs = pairwise(own)
            gaps = [difference(a.trajectory, b.trajectory, scale) for a, b in pairs]
            tolerances = [r.tolerance for r in own]
            if gaps[-1] > 0 or not bounded:
                apart.append(remaining(gaps, tolerances, method_of(name).exponent))
        found.append(min(apart, default=math.inf))
    return found


def by_second_run(case: Case, first: Tried) -> tuple[float, Tried]:
    """A run's error, in parts of the motion's scale, by another one, and that one.

    The other has a tenth of its tolerances, or half its step; where they are near the tightest, ten
    times them. The error is infinite where the other run comes to no end.
    """
    given, tightest = first.setting, TIGHTEST_OF_ALL
    if given.dt is not None:
        other = replace(given, dt=given.dt / 2)
    else:
        assert given.rtol is not None and given.atol is not None
        factor = 0.1 if given.rtol >= 10 * tightest else 10.0
        other = replace(given, rtol=_plain(given.rtol * factor), atol=_plain(given.atol * factor))
    second = case.run(other)
    if second.interrupted:
        raise KeyboardInterrupt
    if not (first.trajectory.finished and second.trajectory.finished):
        return math.inf, second
    apart = difference(first.trajectory, second.trajectory, case.scale(second.trajectory.y))
    ratio = second.tolerance / first.tolerance
    exponent = method_of(given.integrator).exponent * (CAUTION if given.dt is None else 1)
    # What they are apart by is one error less the other.
    return apart / abs(1 - ratio**exponent), second


def _plain(value: float) -> float:
    return float(f"{value:.6g}")
