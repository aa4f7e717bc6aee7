"""What is run to see what accuracy costs: each method's steps or tolerances, from coarse to fine.

Equal steps are t_end / (25 · 2^k), so that they meet the 201 rows of a reference, or every 2nd, 4th
or 8th of them. Tolerances are whole powers of ten, with one scalar atol, so that each run can be
repeated by `eomgen simulate --rtol --atol`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from eomgen.errors import RunError
from eomgen.run.integrators import INTEGRATORS, FixedStep, find_integrator
from eomgen.run.noise import least_tolerance
from eomgen.run.problem import Floats, Problem

Status = Literal["ok", "wrong", "failed", "over", "refused"]
"""How a run went: "ok"; "wrong": it reported success and is not right; "failed": it stopped before
the end; "over": it was stopped, having run too long; "refused": the method is not for the scene."""
Kind = Literal["explicit", "implicit", "symplectic"]

SYMPLECTIC = frozenset(
    {"semi_implicit_euler", "leapfrog", "implicit_midpoint", "gauss_4", "gauss_6"}
)
IMPLICIT = frozenset({"Radau", "Radau_differences", "BDF", "BDF_differences", "LSODA"})

COARSEST = 25
"""Fewest equal steps."""
MOST_STEPS = COARSEST * 2**18
LOOSEST, TIGHTEST = 2, 13
"""Powers of ten of rtol, 1e-2 to 1e-13."""
ATOL_SHARE = 1e-3
"""atol in parts of rtol times the smallest scale of what moves: it then rules only near zero."""
GAIN = 0.7
"""A finer run whose error is not below this times the best before gains nothing …"""
ROUNDING = 1e-6
"""… which is rounding where errors are as small as this."""


@dataclass(frozen=True)
class Rung:
    """One run to make: a method with equal steps `dt`, s, or with tolerances `rtol` and `atol`."""

    method: str
    dt: float | None = None
    rtol: float | None = None
    atol: float | None = None

    @property
    def setting(self) -> str:
        """The step or tolerance in words."""
        return f"dt {self.dt:.4g}" if self.rtol is None else f"rtol {self.rtol:.0e}"


@dataclass(frozen=True)
class Work:
    """What one run took and gave; what was not measured is nan.

    error              greatest over the rows, in parts of the motion's scale (see `measure`)
    final_error        the same at the end
    at_most            whether these two are no more than bounds, the reference not telling more
    energy_drift       greatest change of an energy that exact motion keeps, or what the works of
                       effects leave unaccounted for at the end, in parts of the motion's energy
    joint_gap          greatest gap in a joint, m
    quaternion_defect  how far the length of a quaternion was from 1 before it was scaled back
    seconds            least wall time of `repeats` runs; of a run that stopped, until then
    spread             how far above that the lower half of them stay, s
    units              counted work (see `study.cost`): the same on every machine
    steps, derivatives, jacobians   counts of one run
    reason             why it is not "ok", or an integrator's remark
    """

    rung: Rung
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
    spread: float = np.nan
    units: float = np.nan


@dataclass(frozen=True)
class Ladder:
    """How ladders are climbed.

    t_end       end of the motion, s
    first       how many equal steps the coarsest run makes
    atol_scale  atol in parts of rtol
    quick       every second rung alone
    run_time    a run that takes longer, s, ends its ladder
    most_steps  equal steps of the finest run at most
    noise       the most that rounding moves a state in a step, where the motion is fast: atol is
                no less than what a method can then meet
    """

    t_end: float
    first: int
    atol_scale: float
    quick: bool
    run_time: float
    most_steps: int = MOST_STEPS
    noise: float = 0.0


def kind(method: str) -> Kind:
    """What sort of method it is; what is new counts as explicit."""
    if method in SYMPLECTIC:
        return "symplectic"
    return "implicit" if method in IMPLICIT else "explicit"


def order(method: str) -> int | None:
    """The order that a method with equal steps has by its making; None for any other."""
    found = INTEGRATORS[method]
    return found.order if isinstance(found, FixedStep) else None


def first_steps(problem: Problem, t: Floats, y: Floats, scale: Floats) -> int:
    """How many equal steps the coarsest run makes for a motion y (n, ny) at times t (n,).

    A step is then no longer than the motion needs, at its fastest, to cross the range of a state.
    """
    rates = np.array([problem.derivative(*row) for row in zip(t.tolist(), y, strict=True)])
    fastest = float(np.max(np.abs(rates) / scale))
    steps = COARSEST
    while steps < (t[-1] - t[0]) * fastest and steps < MOST_STEPS // 16:
        steps *= 2
    return steps


def atol_scale(y: Floats, scale: Floats) -> float:
    """atol in parts of rtol for a motion y (n, ny): from the smallest scale of what moves."""
    moving = scale[np.ptp(y, axis=0) > 1e-9 * scale]
    return ATOL_SHARE * float(np.min(moving, initial=np.max(scale)))


def next_rung(ladder: Ladder, method: str, done: Mapping[Rung, Work]) -> Rung | None:
    """The next run of a method, given those that were made; None at the top of its ladder."""
    fixed = isinstance(INTEGRATORS[method], FixedStep)
    climbed: list[Work] = []
    for rung in _fixed(ladder, method) if fixed else _adaptive(ladder, method):
        if climbed and _ends(ladder, climbed, fixed):
            return None
        if rung not in done or stale(done[rung], ladder.run_time):
            return rung
        climbed.append(done[rung])
    return None


def stale(work: Work, run_time: float) -> bool:
    """Whether a run that was stopped for its time may now take longer."""
    return work.status == "over" and run_time > 1.1 * work.seconds


def _fixed(ladder: Ladder, method: str) -> list[Rung]:
    factor, steps, rungs = 4 if ladder.quick else 2, ladder.first, []
    while steps <= ladder.most_steps:
        rungs.append(Rung(method, dt=ladder.t_end / steps))
        steps *= factor
    return rungs


def _adaptive(ladder: Ladder, method: str) -> list[Rung]:
    powers = range(LOOSEST, TIGHTEST + 1, 2 if ladder.quick else 1)
    rungs = []
    for rtol in (float(f"1e-{power}") for power in powers):
        atol = max(rtol * ladder.atol_scale, least_tolerance(method, rtol) * ladder.noise)
        # Four digits: what a user can repeat by hand.
        rungs.append(Rung(method, rtol=rtol, atol=float(f"{atol:.3e}")))
    return rungs


def _ends(ladder: Ladder, climbed: Sequence[Work], fixed: bool) -> bool:
    """Whether a finer run would take too long, or tell nothing more."""
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


def methods_named(text: str | None) -> Sequence[str]:
    """The methods in `--methods A,B`, in the order of `INTEGRATORS`; all of them if None.

    Raises `RunError` for a name that is none.
    """
    if text is None:
        return tuple(INTEGRATORS)
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise RunError(f"--methods: names no integrator; known: {', '.join(INTEGRATORS)}")
    for name in names:
        find_integrator(name)
    return [name for name in INTEGRATORS if name in names]
