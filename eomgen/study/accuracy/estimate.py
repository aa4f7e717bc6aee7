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

from eomgen.run.checks import longest_steps
from eomgen.run.problem import Floats
from eomgen.run.trajectory import Trajectory
from eomgen.study.accuracy.measure import WRONG
from eomgen.study.accuracy.trial import TIGHTEST_OF_ALL, Case, Setting, Tried, method_of

LAST = 0.1
"""Part of a run's time over whose rows differences are taken."""
CAUTION = 0.8
"""Of the exponent that a method has in theory: taken where one difference alone is known."""
MORE = 1.5
"""Times the steps: other steps."""
ROUNDING, FEW = 2.0**-52, 8.0
"""No state of doubles is known to less; and by a second run no run is known to less than a few
times that."""
STRIKES = 1e-13
"""Moments of strikes are found to 1e-14 of a step: nor is a run among rigid contacts known to less
than some times that."""
SMALL = 1e-3
"""Once differences are less than this, errors of equal steps fall as theory has it."""
APART = 30.0
"""By so much must an error have become less by theory for its fall to be seen: errors scatter."""
SCATTER = 3.0
"""Those of multistep methods, whose orders change, too, scatter more: what remains of theirs is
taken so many times."""
ALIKE = 2.0
"""Runs of two methods are taken to be off by so many times what they differ by, for they may be off
alike; and it is the nearest of several that is asked."""
WIDER = 10.0
"""Times a run's tolerances: those of the run that tells its error."""
MOSTLY = 0.3
"""Share of a run's steps: with so many as long as any may be, its tolerance does not make them."""
CHANCE = 1.5
"""Times what a run and another sample of rounding differ by: the error is taken to be no less."""
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


def remaining(
    gaps: Sequence[float], tolerances: Sequence[float], expected: float, caution: float = CAUTION
) -> float:
    """Error of the tightest of k >= 2 runs of one method, whose `tolerances` (k,) fall, from the
    differences (k - 1,) of each from the next.

    Where one difference alone is known, `caution` times the exponent is taken.

    That of a wrong run says nothing of the next one's error, and is returned as it is. From two on
    they tell how fast the error falls now, if they are far enough apart: near rounding it does no
    longer.
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


def errors(runs: Sequence[Tried], scale: Floats, case: Case) -> list[float]:
    """Estimated error of each run, in parts of the scale; infinite where nothing is known.

    Of a method's looser runs their difference from its tightest, of that one what remains by the
    law; or the difference from some run of another method, where that is less. Where steps are
    bounded otherwise, two runs may be the same steps but for a few: they tell of each other only if
    one took `MORE` times as many, and how errors fall is not seen from fewer than three. Rigid
    contacts close within a fixed tolerance of their own, which no law of the method's knows: there
    nothing is taken to remain less than two runs differ by.
    """
    found = []
    for run in runs:
        name = run.setting.integrator
        others = [r for r in runs if r.setting.integrator != name]
        apart = [ALIKE * difference(run.trajectory, r.trajectory, scale) for r in others]
        own = _telling(
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


def _telling(own: Sequence[Tried], case: Case) -> list[Tried]:
    """Of a method's runs, the tightest first, those that tell of each other, the tightest last."""
    ladder = [own[0]]
    for run in own[1:]:
        if not case.bounded or _more(ladder[-1], run):
            ladder.append(run)
    return ladder[::-1]


def _more(one: Tried, other: Tried) -> bool:
    """Whether one run took clearly more steps than the other."""
    return one.trajectory.counts["steps"] >= MORE * other.trajectory.counts["steps"]


@dataclass(frozen=True)
class Estimate:
    """A run's error in parts of the motion's scale, by a `second` run, infinite if that breaks off.

    last  of the last state
    most  of any row, that at the time `at`, s; with contacts, where a row may lie before an impact
          in one run and after it in the other, of the last state, too
    """

    last: float
    most: float
    at: float
    second: Tried


def representable(run: Tried, scale: Floats) -> tuple[float, int]:
    """What rounding of the last state to doubles may make its error, and of which state: half a
    unit in the last place, in parts of the scale.
    """
    floors = np.spacing(np.abs(run.trajectory.y[-1])) / 2 / scale
    worst = int(np.argmax(floors))
    return float(floors[worst]), worst


def looser(case: Case, run: Tried) -> tuple[Setting, Case]:
    """What tells a run's error: ten times its tolerances, or twice its step.

    Where most steps are kept short for other reasons, that makes no other steps: they are to be
    twice as long where the user bounds them, and half as long where nothing else can be had.
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
    scale: Floats,
) -> Estimate:
    """A run's error by a second one as `looser` has it, whose constants were moved by rounding.

    others   looser runs of the same method
    samples  of the same setting, with constants moved in other ways

    What the two differ by is the error of the second, mostly; so it is more than that of the run,
    but not by much where errors do not fall with the tolerance, as those of LSODA near rounding, or
    where rounding makes them. Those of equal steps fall as theory has it, but for rounding, which
    samples tell of. Two runs may be near each other by accident: no less is stated than
    what the others' differences make, carried on by theory, nor than what samples tell of rounding.
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
    for other in others:
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


def _greatest(one: Trajectory, two: Trajectory, scale: Floats) -> tuple[float, float]:
    """The greatest difference of rows at the same times, in parts of the scale, and when."""
    t, i, j = np.intersect1d(one.t, two.t, return_indices=True)
    apart = np.max(np.abs(one.y[i] - two.y[j]) / scale, axis=1)
    worst = int(np.argmax(apart))
    return float(apart[worst]), float(t[worst])


def by_second_run(case: Case, first: Tried) -> Estimate:
    """A run's error by another run, which is made here, with constants moved by rounding.

    The other has a tenth of its tolerances, or half its step; where they are near the tightest, ten
    times them.
    """
    given, tightest = first.setting, TIGHTEST_OF_ALL
    if given.dt is not None:
        other = replace(given, dt=given.dt / 2)
    else:
        assert given.rtol is not None
        factor = 0.1 if given.rtol >= 10 * tightest else 10.0
        atol = None if given.atol is None else _plain(given.atol * factor)
        other = replace(given, rtol=_plain(given.rtol * factor), atol=atol)
    second = case.run(other, moved=0)
    if second.interrupted:
        raise KeyboardInterrupt
    one, two = first.trajectory, second.trajectory
    if not (one.finished and two.finished):
        return Estimate(math.inf, math.inf, math.nan, second)
    exponent = method_of(given.integrator).exponent * (CAUTION if given.dt is None else 1)
    # What they are apart by is one error less the other; near rounding that is all there is.
    share = min(abs(1 - math.pow(second.tolerance / first.tolerance, exponent)), 1.0)
    scale = case.scale(second.extent)
    last = difference(one, two, scale) / share
    if case.problem.contacts is not None:
        return Estimate(last, last, float(one.t[-1]), second)
    most, at = _greatest(one, two, scale)
    return Estimate(last, max(last, most / share), at, second)


def _plain(value: float) -> float:
    return float(f"{value:.6g}")
