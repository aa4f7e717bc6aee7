"""The error of a run, estimated from other runs of the same scene.

A method's error is about C τ^a at tolerance τ, with a near 1; with equal steps h of a method of
order p it is C h^p. Two runs that differ only in τ differ by the error of the looser one, less that
of the tighter one; three runs give the exponent. Runs of two methods differ by about the larger of
their errors. Differences are taken over the last part of a run. The last moment alone would not do:
in an oscillation the difference may pass through 0 just then. Nor would the greatest difference: a
spike or an impact makes it large for a moment.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from eomgen.run.checks import longest_steps
from eomgen.run.problem import FloatArray
from eomgen.run.trajectory import Trajectory
from eomgen.study.accuracy.measure import WRONG
from eomgen.study.accuracy.trial import Case, Setting, Tried, method_of

LAST = 0.1
"""Part of a run's time, at its end, over which differences are taken."""
NEAREST = 2
"""This many of the looser runs of a method are used to estimate the tightest run's error: errors of
much looser ones may fall faster than theory says."""
CAUTION = 0.8
"""If only one difference is known, the theoretical exponent is reduced by this factor."""
MORE = 1.5
"""Two runs count as different in their steps if one has this many times the steps of the other."""
ROUNDING, FEW = 2.0**-52, 8.0
"""An error is never stated below machine epsilon, nor, from a second run, below a few times
it."""
STRIKES = 1e-13
"""Impacts are located to 1e-14 of a step; with rigid contacts no error is stated below some times
that."""
SMALL = 1e-3
"""With equal steps, the error follows theory once differences are less than this."""
APART = 30.0
"""Errors scatter: their observed decay counts only if theory predicts a decrease by this factor."""
SCATTER = 3.0
"""The errors of multistep methods, whose orders vary, scatter more; the estimate of their remaining
error is multiplied by this."""
ALIKE = 2.0
"""The error of a run is taken as this many times its difference from a run of another method: both
may be off in the same direction, and the closest of several others is used."""
WIDER = 10.0
"""Factor between a run's tolerances and those of the run that estimates its error."""
MOSTLY = 0.3
"""If more than this share of a run's steps is at the greatest length allowed, the tolerance does
not determine its steps."""
CHANCE = 1.5
"""The error is taken to be at least this many times the difference between a run and one with other
rounding errors."""
SLOPES = (0.6, 1.2)
"""Bounds of a fitted exponent, relative to the theoretical one."""


@dataclass(frozen=True)
class Law:
    """A power law: quantity = factor · τ^exponent."""

    factor: float
    exponent: float

    def at(self, tolerance: float) -> float:
        """The quantity at the given tolerance."""
        return self.factor * math.pow(tolerance, self.exponent)

    def tolerance(self, quantity: float) -> float:
        """The tolerance at which the law gives the quantity."""
        return math.exp(math.log(quantity / self.factor) / self.exponent)


def fit(tolerances: Sequence[float], quantities: Sequence[float], expected: float) -> Law:
    """The power law through the last of a series of points. Its exponent is fitted to the others by
    least squares of the logarithms and kept within `SLOPES` times the `expected` one. A single
    point takes the expected exponent.
    """
    tau, e = np.log(np.asarray(tolerances)), np.log(np.asarray(quantities))
    slope = expected
    if len(tau) > 1:
        away, rise = tau[:-1] - tau[-1], e[:-1] - e[-1]
        bounds = sorted(bound * expected for bound in SLOPES)
        slope = min(max(float(away @ rise) / float(away @ away), bounds[0]), bounds[1])
    return Law(math.exp(e[-1] - slope * tau[-1]), slope)


def difference(one: Trajectory, other: Trajectory, scale: FloatArray) -> float:
    """The difference of two runs over the same time, relative to the scale: at the end or, if that
    is more, the median over the last part of the run.
    """
    start, end = float(one.t[0]), float(one.t[-1])
    since = end - LAST * (end - start)
    a, b = _rows(one, since), _rows(other, since)
    _, i, j = np.intersect1d(a[0], b[0], return_indices=True)
    apart = np.max(np.abs(a[1][i] - b[1][j]) / scale, axis=1, initial=0.0)
    return max(float(apart[-1]), float(np.median(apart)))


def _rows(run: Trajectory, since: float) -> tuple[FloatArray, FloatArray]:
    """Rows from a time on, in reverse. Of two rows at an impact, the later one comes first."""
    late = run.t >= since
    return run.t[late][::-1], run.y[late][::-1]


def remaining(
    gaps: Sequence[float], tolerances: Sequence[float], expected: float, caution: float = CAUTION
) -> float:
    """The error of the tightest of k >= 2 runs of one method, estimated from the differences
    `gaps` (k - 1,) between successive runs, whose `tolerances` (k,) decrease.

    With one difference, the theoretical exponent times `caution` is used. With more, the decay of
    the differences gives the exponent, if the tolerances are far enough apart: near rounding the
    error stops falling. The difference of a wrong run says nothing of the next run's error and is
    returned unchanged.
    """
    last = gaps[-1]
    if last >= WRONG or last == 0:
        return last
    slope = caution * expected
    for gap, tolerance in zip(gaps[-2::-1], tolerances[-3::-1], strict=True):
        ratio = tolerance / tolerances[-2]
        if ratio**expected >= APART and 0 < gap < WRONG:
            slope = min(max(math.log(gap / last) / math.log(ratio), 0.0), expected)
            break
    return last * math.pow(tolerances[-1] / tolerances[-2], slope)


def errors(runs: Sequence[Tried], scale: FloatArray, case: Case) -> list[float]:
    """Estimated error of each run, relative to the scale; infinite if nothing is known.

    The error of a method's looser run is its difference from the tightest one; that of the tightest
    run is what remains by its power law. A smaller difference from a run of another method is used
    instead. If steps are bounded otherwise, two runs may share most of their steps: they are
    compared only if one took `MORE` times as many. Impacts at rigid contacts have a fixed tolerance
    of their own; there the tightest run's error is its full difference from the next one.
    """
    found = []
    for run in runs:
        name = run.setting.integrator
        others = [r for r in runs if r.setting.integrator != name]
        apart = [ALIKE * difference(run.trajectory, r.trajectory, scale) for r in others]
        own = _reporting(
            sorted((r for r in runs if r.setting.integrator == name), key=lambda r: r.tolerance),
            case,
        )
        if run is not own[-1] and (run in own or not case.bounded or _more(own[-1], run)):
            apart.append(difference(run.trajectory, own[-1].trajectory, scale))
        elif run is own[-1] and len(own) > 1:
            gaps = [difference(a.trajectory, b.trajectory, scale) for a, b in pairwise(own)]
            tolerances = [r.tolerance for r in own]
            method = method_of(name)
            scatter = SCATTER if method.multistep else 1.0
            struck = case.problem.contacts is not None
            caution = 1.0 if method.equal_steps and gaps[-1] < SMALL else CAUTION
            caution = 0.0 if case.bounded else caution
            left = remaining(gaps, tolerances, method.exponent, caution)
            apart.append(scatter * (gaps[-1] if struck else left))
        found.append(max(min(apart, default=math.inf), ROUNDING))
    return found


def _reporting(own: Sequence[Tried], case: Case) -> list[Tried]:
    """Of a method's runs, given tightest first, those that can be compared, tightest last."""
    ladder = [own[0]]
    for run in own[1:]:
        if not case.bounded or _more(ladder[-1], run):
            ladder.append(run)
    return ladder[::-1]


def _more(one: Tried, other: Tried) -> bool:
    """Whether `other` took clearly fewer steps than `one`."""
    return one.trajectory.counts["steps"] >= MORE * other.trajectory.counts["steps"]


@dataclass(frozen=True)
class Estimate:
    """A run's error relative to the motion's scale, from a `second` run; infinite if that failed.

    last  of the last state
    most  of any row, which is at time `at`, s; with contacts, a row may be before an impact in one
          run and after it in the other: then the same as `last`
    """

    last: float
    most: float
    at: float
    second: Tried


def representable(run: Tried, scale: FloatArray) -> tuple[float, int]:
    """The error from rounding the last state to doubles, half a unit in the last place relative to
    the scale: the largest of all states, and the index of that state.
    """
    floors = np.spacing(np.abs(run.trajectory.y[-1])) / 2 / scale
    worst = int(np.argmax(floors))
    return float(floors[worst]), worst


def looser(case: Case, run: Tried) -> tuple[Setting, Case]:
    """The setting and case of a run that estimates another's error: ten times its tolerances, or
    twice its step.

    If other bounds determine most steps, the tolerance would not change them. Then the bound that
    the user gave is doubled; without one, steps are bounded to half their greatest length.
    """
    given = run.setting
    if given.dt is not None:
        return replace(given, dt=2 * given.dt), case
    assert given.rtol is not None
    atol = None if given.atol is None else _plain(given.atol * WIDER)
    setting = replace(given, rtol=_plain(given.rtol * WIDER), atol=atol)
    counts, bound = run.trajectory.counts, case.kept.get("max_step")
    if bound is not None:
        return setting, replace(case, kept={**case.kept, "max_step": 2 * bound})
    if counts["capped"] > MOSTLY * counts["steps"]:
        _, unseen = longest_steps(None, case.t_end)
        return given, replace(case, kept={**case.kept, "max_step": unseen / 2})
    return setting, case


def by_looser_run(
    case: Case,
    run: Tried,
    second: Tried,
    others: Sequence[Tried],
    samples: Sequence[Tried],
    scale: FloatArray,
) -> Estimate:
    """A run's error from a second one (`looser`), whose constants were perturbed by rounding.

    others   looser runs of the same method
    samples  runs with the same setting and other perturbations of the constants

    The difference is mostly the error of the second run and so an upper bound of the run's own. It
    is not much larger if errors do not fall with the tolerance, as with LSODA near rounding, or if
    rounding causes them. Errors of equal steps fall as theory predicts, except for rounding, which
    the samples show. As two runs may agree by accident, the estimate is at least what the
    differences of the `NEAREST` other runs give when extrapolated by theory, and at least what the
    samples differ by.
    """
    if not all(other.trajectory.finished for other in (second, *samples)):
        return Estimate(math.inf, math.inf, math.nan, second)
    method, one = method_of(run.setting.integrator), run.trajectory
    floor = max(representable(run, scale)[0], FEW * ROUNDING)
    floor = floor if case.problem.contacts is None else max(floor, STRIKES)
    last = difference(one, second.trajectory, scale)
    if samples and method.equal_steps and last < SMALL:
        last /= math.pow(second.tolerance / run.tolerance, CAUTION * method.exponent)
    last = max(last, floor)
    for other in sorted(others, key=lambda other: other.tolerance)[:NEAREST]:
        gap = difference(one, other.trajectory, scale)
        theory = math.pow(other.tolerance / run.tolerance, CAUTION * method.exponent)
        if gap < WRONG:
            last = max(last, gap / theory)
    for sample in samples:
        last = max(last, CHANCE * difference(one, sample.trajectory, scale))
    if case.problem.contacts is not None:
        return Estimate(last, last, float(one.t[-1]), second)
    most, at = _greatest(one, second.trajectory, scale)
    return Estimate(last, max(last, most), at, second)


def _greatest(one: Trajectory, two: Trajectory, scale: FloatArray) -> tuple[float, float]:
    """The greatest difference of rows at equal times, relative to the scale, and its time, s."""
    t, i, j = np.intersect1d(one.t, two.t, return_indices=True)
    apart = np.max(np.abs(one.y[i] - two.y[j]) / scale, axis=1, initial=0.0)
    worst = int(np.argmax(apart))
    return float(apart[worst]), float(t[worst])


def by_second_run(case: Case, first: Tried) -> Estimate:
    """A run's error from a second run with perturbed constants, which is made here.

    The second run has a tenth of the tolerances, or half the step; near the tightest tolerance it
    has ten times the tolerances.
    """
    given = first.setting
    if given.dt is not None:
        other = replace(given, dt=given.dt / 2)
    else:
        assert given.rtol is not None
        factor = 0.1 if given.rtol >= 10 * method_of(given.integrator).tightest else 10.0
        atol = None if given.atol is None else _plain(given.atol * factor)
        other = replace(given, rtol=_plain(given.rtol * factor), atol=atol)
    second = case.run(other, moved=0)
    if second.interrupted:
        raise KeyboardInterrupt
    one, two = first.trajectory, second.trajectory
    if not (one.finished and two.finished):
        return Estimate(math.inf, math.inf, math.nan, second)
    exponent = method_of(given.integrator).exponent * (CAUTION if given.dt is None else 1)
    # The difference of the two is one error less the other.
    share = min(abs(1 - math.pow(second.tolerance / first.tolerance, exponent)), 1.0)
    scale = case.scale(second.extent)
    last = difference(one, two, scale) / share
    if case.problem.contacts is not None:
        return Estimate(last, last, float(one.t[-1]), second)
    most, at = _greatest(one, two, scale)
    return Estimate(last, max(last, most / share), at, second)


def _plain(value: float) -> float:
    return float(f"{value:.6g}")
