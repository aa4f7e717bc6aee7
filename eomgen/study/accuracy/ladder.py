"""The runs of a work-precision diagram: each method's steps or tolerances, from coarse to fine.

Equal steps are t_end / (25 · 2^k), so that they meet the 201 rows of a reference, or every 2nd, 4th
or 8th of them. Tolerances are powers of ten, with one scalar atol, so that `eomgen simulate --rtol
--atol` can repeat each run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from eomgen.base.errors import RunError
from eomgen.run.integrators import INTEGRATORS, FixedStep, find_integrator
from eomgen.run.noise import least_tolerance
from eomgen.run.problem import FloatArray, Problem
from eomgen.study.accuracy.trial import Setting
from eomgen.tables.integrators import GENERAL

Status = Literal["ok", "wrong", "failed", "over", "refused"]
"""How a run went: "ok"; "wrong": it reported success but is wrong; "failed": it stopped before the
end; "over": it was stopped for its time; "refused": the method cannot run the scene."""


COARSEST = 25
"""Least number of equal steps."""
MOST_STEPS = COARSEST * 2**18
LOOSEST, TIGHTEST = 2, 13
"""Negated powers of ten of rtol: from 1e-2 to 1e-13."""
ATOL_SHARE = 1e-3
"""atol relative to rtol times the smallest scale of a state that moves: so rtol dominates except
near zero."""
GAIN = 0.7
"""A finer run gains nothing if its error is not below this times the best one before …"""
ROUNDING = 1e-6
"""… and errors as small as this then consist of rounding."""


@dataclass(frozen=True)
class Work:
    """The result of one run; what was not measured is nan.

    error              greatest over the rows, relative to the motion's scale (see `measure`)
    final_error        the same at the end
    at_most            whether these two are only bounds, because the reference is not more accurate
    energy_drift       greatest change of a conserved energy, or the energy at the end that the work
                       of effects does not explain, relative to the motion's energy
    joint_gap          greatest gap in a joint, m
    quaternion_defect  greatest difference of a quaternion's length from 1 before normalisation
    seconds            least time of the processor of `repeats` runs; of a stopped run, that until
                       then
    spread             median time less the least, s
    units              counted work (see `study.accuracy.methods`): the same on every machine
    steps, derivatives, jacobians   counts of one run
    reason             why it is not "ok", and what to change; or an integrator's remark
    stopped_at         the time at which a failed run stopped, s
    """

    setting: Setting
    status: Status
    seconds: float
    repeats: int
    error: float = np.nan
    final_error: float = np.nan
    at_most: tuple[bool, bool] = (False, False)
    energy_drift: float = np.nan
    joint_gap: float = np.nan
    quaternion_defect: float = np.nan
    steps: int = 0
    derivatives: int = 0
    jacobians: int = 0
    reason: str = ""
    stopped_at: float = np.nan
    spread: float = np.nan
    units: float = np.nan


@dataclass(frozen=True)
class Ladder:
    """The rules by which each method's steps or tolerances are chosen.

    t_end       end of the motion, s
    first       number of equal steps in the coarsest run
    atol_scale  atol relative to rtol
    quick       whether to make only every second run
    run_time    a run that takes longer, s, is stopped, and its method gets no finer one
    most_steps  greatest number of equal steps
    noise       greatest rounding error of a state in a step where the motion is fast: atol is at
                least what a method can then meet
    """

    t_end: float
    first: int
    atol_scale: float
    quick: bool
    run_time: float
    most_steps: int = MOST_STEPS
    noise: float = 0.0


def order(method: str) -> int | None:
    """The theoretical order of a method with equal steps; None for other methods."""
    found = INTEGRATORS[method]
    return found.order if isinstance(found, FixedStep) else None


def first_steps(problem: Problem, t: FloatArray, y: FloatArray, scale: FloatArray) -> int:
    """The number of equal steps in the coarsest run of a motion y (n, ny) at times t (n,).

    Its step is at most the time in which a state would cross its range at its greatest rate.
    """
    rates = np.array([problem.derivative(*row) for row in zip(t.tolist(), y, strict=True)])
    fastest = float(np.max(np.abs(rates) / scale))
    steps = COARSEST
    while steps < (t[-1] - t[0]) * fastest and steps < MOST_STEPS // 16:
        steps *= 2
    return steps


def atol_scale(y: FloatArray, scale: FloatArray) -> float:
    """atol relative to rtol for a motion y (n, ny), from the smallest scale of a state that
    moves.
    """
    moving = scale[np.ptp(y, axis=0) > 1e-9 * scale]
    return ATOL_SHARE * float(np.min(moving, initial=np.max(scale)))


def next_setting(ladder: Ladder, method: str, done: Mapping[Setting, Work]) -> Setting | None:
    """The next run of a method, given those made; None if its finest run was made."""
    fixed = isinstance(INTEGRATORS[method], FixedStep)
    climbed: list[Work] = []
    for setting in _fixed(ladder, method) if fixed else _adaptive(ladder, method):
        if climbed and _ends(ladder, climbed, fixed):
            return None
        if setting not in done or stale(done[setting], ladder.run_time):
            return setting
        climbed.append(done[setting])
    return None


def stale(work: Work, run_time: float) -> bool:
    """Whether a run that was stopped for its time may now take longer."""
    return work.status == "over" and run_time > 1.1 * work.seconds


def _fixed(ladder: Ladder, method: str) -> list[Setting]:
    factor, steps, found = 4 if ladder.quick else 2, ladder.first, []
    while steps <= ladder.most_steps:
        found.append(Setting(method, dt=ladder.t_end / steps))
        steps *= factor
    return found


def _adaptive(ladder: Ladder, method: str) -> list[Setting]:
    powers = range(LOOSEST, TIGHTEST + 1, 2 if ladder.quick else 1)
    found = []
    for rtol in (float(f"1e-{power}") for power in powers):
        atol = max(rtol * ladder.atol_scale, least_tolerance(method, rtol) * ladder.noise)
        # With four digits a user can repeat it by hand.
        found.append(Setting(method, rtol=rtol, atol=float(f"{atol:.3e}")))
    return found


def _ends(ladder: Ladder, climbed: Sequence[Work], fixed: bool) -> bool:
    """Whether a finer run would take too long or show nothing more."""
    last = climbed[-1]
    if last.status in ("over", "refused"):
        return True
    factor = 4 if ladder.quick else 2
    if fixed and last.status != "failed" and last.seconds * factor > ladder.run_time:
        return True
    if all(work.at_most[0] for work in climbed[-2:]) and len(climbed) > 1:
        return True
    errors = [work.error for work in climbed]
    return len(climbed) > 2 and all(
        work.status == "ok" and error < ROUNDING and error > GAIN * min(errors[:k])
        for k, (work, error) in enumerate(zip(climbed, errors, strict=True))
        if k >= len(climbed) - 2
    )


def methods_named(names: Sequence[str] | None) -> Sequence[str]:
    """The methods of these names, in the order of `INTEGRATORS`; if None, `GENERAL`.

    Raises `RunError` for an unknown name, or if there is none.
    """
    if names is None:
        return GENERAL
    if not names:
        raise RunError(f"--methods: names no integrator; known: {', '.join(INTEGRATORS)}")
    for name in names:
        find_integrator(name)
    return [name for name in INTEGRATORS if name in names]
