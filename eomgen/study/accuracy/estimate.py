"""The error of a run, estimated from a second run of the same scene.

A method's error is about C τ^a at tolerance τ, with a near 1; with equal steps h of a method of
order p it is C h^p. Two runs that differ only in τ differ by the error of the looser one, less that
of the tighter one. The second run's constants are also perturbed by rounding errors, and its steps
rounded at random, so the difference shows what rounding does.

Differences are taken over the last part of a run. The last moment alone would not do: in an
oscillation the difference may pass through 0 just then. Nor would the greatest difference: a spike
or an impact makes it large for a moment.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eomgen.run.checks import longest_steps
from eomgen.run.problem import FloatArray
from eomgen.run.trajectory import Trajectory
from eomgen.study.accuracy.methods import Method, method_of
from eomgen.study.accuracy.trial import Case, Setting, Tried, plain

LAST = 0.1
"""Part of a run's time, at its end, over which differences are taken."""
ROUNDING = 8 * 2.0**-52
"""No error is stated below a few times machine epsilon."""
STRIKES = 1e-13
"""Impacts are located to 1e-14 of a step; with rigid contacts no error is stated below some times
that."""
WIDER, SHORTER = 10.0, 16
"""Factor between the tolerances of two runs, and how many times shorter equal steps are where
something may lie between them."""
MOSTLY = 0.3
"""If more than this share of a run's steps is at the greatest length allowed, the tolerance does
not determine its steps."""
CHANCE = 2.0
"""The error is taken to be at least this many times the difference between a run and one with other
rounding errors."""


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


def second_of(case: Case, run: Tried, factor: float = WIDER) -> tuple[Setting, Case]:
    """The setting and case of a run that estimates another's error: `factor` times its tolerances,
    or half its step.

    Methods with equal steps cannot repeat a step over which they passed something, so the second
    one has much shorter steps where something may lie between them. If other bounds determine most
    steps, the tolerance would not change them. Then the bound that the user gave is doubled;
    without one, steps are bounded to half their greatest length.
    """
    given, problem = run.setting, case.problem
    if given.dt is not None:
        unseen = problem.corners or (problem.scrutiny and problem.scrutiny.localised)
        within = SHORTER if problem.scrutiny and unseen else 2
        return replace(given, dt=given.dt / within), case
    assert given.rtol is not None
    atol = None if given.atol is None else plain(given.atol * factor)
    setting = replace(given, rtol=plain(given.rtol * factor), atol=atol)
    counts, bound = run.trajectory.counts, case.kept.get("max_step")
    if bound is not None:
        return setting, replace(case, kept={**case.kept, "max_step": 2 * bound})
    if counts["capped"] > MOSTLY * counts["steps"]:
        _, unchecked = longest_steps(None, case.t_end)
        return given, replace(case, kept={**case.kept, "max_step": unchecked / 2})
    return setting, case


def work_of_both(method: Method) -> float:
    """Work of a run and of the one that estimates its error, relative to that of the run."""
    return 1 + (2.0 if method.equal_steps else math.pow(WIDER, -method.growth))


def estimated(
    case: Case, run: Tried, second: Tried, scale: FloatArray, samples: Sequence[Tried] = ()
) -> Estimate:
    """A run's error from a second one (`second_of`), whose constants were perturbed by rounding.

    samples  runs with the same setting and other perturbations of the constants

    The difference from a looser run is mostly the error of that one, and so an upper bound of the
    run's own. It is not much larger if errors do not fall with the tolerance, as near rounding. The
    difference from a tighter run is the run's own error less that one's.
    """
    if not all(other.trajectory.finished for other in (run, second, *samples)):
        return Estimate(math.inf, math.inf, math.nan, second)
    one, two = run.trajectory, second.trajectory
    exponent = method_of(run.setting.integrator).exponent
    share = min(abs(1 - math.pow(second.tolerance / run.tolerance, exponent)), 1.0) or 1.0
    floor = max(representable(run, scale)[0], ROUNDING)
    floor = floor if case.problem.contacts is None else max(floor, STRIKES)
    noise = max((difference(one, each.trajectory, scale) for each in samples), default=0.0)
    last = max(difference(one, two, scale) / share, CHANCE * noise, floor)
    if case.problem.contacts is not None:
        return Estimate(last, last, float(one.t[-1]), second)
    most, at = _greatest(one, two, scale)
    return Estimate(last, max(last, most / share), at, second)


def _greatest(one: Trajectory, two: Trajectory, scale: FloatArray) -> tuple[float, float]:
    """The greatest difference of rows at equal times, relative to the scale, and its time, s."""
    t, i, j = np.intersect1d(one.t, two.t, return_indices=True)
    apart = np.max(np.abs(one.y[i] - two.y[j]) / scale, axis=1, initial=0.0)
    worst = int(np.argmax(apart))
    return float(apart[worst]), float(t[worst])


def by_second_run(case: Case, run: Tried) -> Estimate:
    """A run's error from a second run with perturbed constants, which is made here: a tighter one
    or, near the tightest tolerance, a looser one.
    """
    tightest = method_of(run.setting.integrator).tightest
    tighter = run.setting.dt is None and run.tolerance >= WIDER * tightest
    setting, case = second_of(case, run, 1 / WIDER if tighter else WIDER)
    second = case.run(setting, moved=0)
    if second.interrupted:
        raise KeyboardInterrupt
    return estimated(case, run, second, case.scale(second.extent))
