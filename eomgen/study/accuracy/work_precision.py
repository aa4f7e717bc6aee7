"""Runs made and measured: error against a reference, drift, time, and counts.

The first run keeps the rows from which the error is taken, and warms up. It is then repeated
without rows, and the least time of the processor counts. A long run is made once.
"""

import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from eomgen.base.errors import RunError
from eomgen.run.failure import StepFailure
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.trajectory import Trajectory
from eomgen.run.works import Powers
from eomgen.study.accuracy.ladder import Ladder, Work, next_setting
from eomgen.study.accuracy.measure import WRONG, error
from eomgen.study.accuracy.reference import Reference
from eomgen.study.accuracy.trial import Case, Setting, Tried
from eomgen.study.timing import least_seconds

TELLS_APART = 100
"""Errors below this many times the reference's own are not resolved."""
ONCE = 0.25
"""A run that takes more than this part of the time allowed is made once."""
REPEATS = 0.1
"""About how long the repeated runs of one setting take together, s …"""
LEAST_REPEATS, MOST_REPEATS = 2, 20
"""… and how many there are."""
WORKS_COST = 8
"""A run that integrates the works of effects takes at most about this many times longer."""
SAME_TIME = 1e-6
"""Rows count as simultaneous if they are this close, relative to the time between two rows."""
OVER = "it took too long"

Rows = Callable[[FloatArray, FloatArray], FloatArray]
"""A function of times (n,) and states (n, ny) that gives a number for each, (n,)."""


@dataclass(frozen=True, eq=False)
class Bench:
    """What runs are measured against.

    problem       the problem to integrate
    reference     its motion, and the error bound of that
    rest_speed    speed below which contacts do not bounce, m/s or rad/s; None: see `integrate`
    kinetic       kinetic energy, J
    energy        a conserved energy, J; None if there is none
    energy_scale  scale of the motion's energy, J
    powers        of effects, if energy is not conserved but their works are known
    gap           greatest gap in a joint, m; None if there cannot be one
    compiled      whether runs are made in compiled code
    """

    problem: Problem
    reference: Reference
    rest_speed: float | None
    kinetic: Rows
    energy: Rows | None
    energy_scale: float
    powers: Powers | None
    gap: Rows | None
    compiled: bool = False

    @property
    def floors(self) -> tuple[float, float]:
        """Errors below which nothing is resolved: over all rows, and at the end."""
        reference = self.reference
        return TELLS_APART * reference.error, TELLS_APART * reference.final_error


@dataclass
class _Defect:
    """Greatest difference of a quaternion's length from 1."""

    largest: float = 0.0


@dataclass(frozen=True, eq=False)
class _Watched(Problem):
    """A problem that records the length of quaternions before they are normalised."""

    defect: _Defect = field(default_factory=_Defect)

    def unit(self, y: FloatArray) -> FloatArray:
        for indices in self.quaternions:
            off = abs(math.hypot(*(float(y[i]) for i in indices)) - 1)
            self.defect.largest = max(self.defect.largest, off)
        return super().unit(y)


def sweep(
    bench: Bench,
    ladder: Ladder,
    methods: Sequence[str],
    done: Mapping[Setting, Work],
    until: float = math.inf,
    notice: Callable[[Setting], None] = lambda setting: None,
) -> Iterator[Work]:
    """Make the runs that are not yet `done`, the coarse ones of all methods first; yield each.

    No run starts after `time.perf_counter()` has passed `until`. `notice` is called before each.
    """
    known, climbing = dict(done), list(methods)
    while climbing:
        for method in tuple(climbing):
            setting = next_setting(ladder, method, known)
            if setting is None:
                climbing.remove(method)
                continue
            if time.perf_counter() > until:
                return
            notice(setting)
            if bench.compiled and not any(other.integrator == method for other in known):
                with suppress(RunError):
                    _run(bench, setting, math.inf, 2)  # which compiles its steps
            work = measure(bench, setting, ladder.run_time)
            known[setting] = work
            yield work


def left_out(ladder: Ladder, methods: Sequence[str], done: Mapping[Setting, Work]) -> list[str]:
    """The methods whose finest run has not been made."""
    return [method for method in methods if next_setting(ladder, method, done) is not None]


def measure(bench: Bench, setting: Setting, run_time: float) -> Work:
    """Make a run, repeat it for its time, and once more for its works; each within `run_time`, s.

    Raises `KeyboardInterrupt` if a run was interrupted.
    """
    problem, defect = bench.problem, _Defect()
    watched = bool(problem.quaternions) and not bench.compiled
    if watched:
        fields = {name: getattr(problem, name) for name in Problem.__dataclass_fields__}
        bench = replace(bench, problem=_Watched(**fields, defect=defect))
    begin = time.process_time()
    try:
        first = _run(bench, setting, run_time, len(bench.reference.t))
    except StepFailure:
        raise
    except RunError as refusal:
        return Work(setting, "refused", time.process_time() - begin, 1, reason=str(refusal))
    if first.cut:
        return _worked(Work(setting, "over", first.busy, 1, reason=OVER), first)
    if not first.trajectory.finished:
        outcome, stopped_at = first.trajectory.outcome, float(first.trajectory.t[-1])
        failed = Work(setting, "failed", first.busy, 1, reason=str(outcome), stopped_at=stopped_at)
        return _worked(failed, first)
    last = first
    times: list[float] = []
    if first.busy < ONCE * run_time:
        while len(times) < LEAST_REPEATS or (
            len(times) < MOST_REPEATS and sum(times) + times[-1] < REPEATS
        ):
            # Interpolated rows have defects of their own; only those of the steps count here.
            defect.largest = 0.0
            last = _run(bench, setting, math.inf, 2)
            times.append(last.busy)
    found, end = errors(first.trajectory, bench.reference)
    floors = bench.floors
    wrong = not found < WRONG
    reason = first.trajectory.message
    if wrong:
        reason = f"reported success, but its relative error is {found:.2g}"
    quaternion_defect = defect.largest if watched else math.nan
    work = Work(
        setting,
        "wrong" if wrong else "ok",
        min(times, default=first.busy),
        max(1, len(times)),
        error=max(found, floors[0]),
        final_error=max(end, floors[1]),
        at_most=(found < floors[0], end < floors[1]),
        energy_drift=_energy_drift(bench, first, run_time),
        joint_gap=_greatest(bench.gap, first.trajectory),
        quaternion_defect=quaternion_defect,
        reason=reason,
        spread=statistics.median(times) - min(times) if times else math.nan,
    )
    return _worked(work, last)


def _worked(work: Work, run: Tried) -> Work:
    counts = run.trajectory.counts
    return replace(
        work,
        units=run.work,
        steps=counts["steps"],
        derivatives=counts["derivatives"],
        jacobians=counts["jacobians"],
    )


def _run(
    bench: Bench, setting: Setting, limit: float, rows: int, powers: Powers | None = None
) -> Tried:
    """A run that is ended after `limit`, s of the processor."""
    t_end = float(bench.reference.t[-1])
    # If there are fewer steps than rows, all steps are kept.
    few = setting.dt is not None and t_end / setting.dt < rows and rows > 2
    kept = {"samples": None if few else rows, "rest_speed": bench.rest_speed}
    case, due = Case(bench.problem, t_end, {}, kept), time.process_time() + limit
    tried = case.run(setting, due=due, clock=time.process_time, powers=powers)
    if tried.interrupted:
        raise KeyboardInterrupt
    return tried


def errors(trajectory: Trajectory, reference: Reference) -> tuple[float, float]:
    """A finished run's error, relative to the motion's scale: of all rows, and of the last.

    The times that both have are compared. Of two rows at an impact, the later one counts.
    """
    t, close = reference.t, SAME_TIME * (reference.t[1] - reference.t[0])
    rows = np.searchsorted(trajectory.t, t + close, side="right") - 1
    there = (rows >= 0) & (np.abs(trajectory.t[rows] - t) <= close)
    assert there[-1], "a finished run has a row at the end"
    y, true = trajectory.y[rows[there]], reference.y[there]
    return error(y, true, reference.scale), error(y[-1], true[-1], reference.scale)


def _greatest(rows: Rows | None, trajectory: Trajectory) -> float:
    return math.nan if rows is None else float(np.max(rows(trajectory.t, trajectory.y)))


def _energy_drift(bench: Bench, first: Tried, run_time: float) -> float:
    """See `Work`; nan if it is unknown, or would take too long to find."""
    trajectory = first.trajectory
    with np.errstate(all="ignore"):
        if bench.energy is not None:
            energy = bench.energy(trajectory.t, trajectory.y)
            return float(np.max(np.abs(energy - energy[0]))) / bench.energy_scale
        if bench.powers is None or WORKS_COST * first.busy > run_time:
            return math.nan
        booked = _run(bench, first.setting, run_time, 2, bench.powers).trajectory
        if not booked.finished or booked.works is None:
            return math.nan
        ends = bench.kinetic(booked.t[[0, -1]], booked.y[[0, -1]])
        return float(abs(ends[1] - ends[0] - booked.works[-1].sum())) / bench.energy_scale


def call_times(problem: Problem, reference: Reference) -> tuple[float, float]:
    """Least time of a derivative and of a Jacobian at half the motion's time, s."""
    middle = len(reference.t) // 2
    t, y = float(reference.t[middle]), reference.y[middle]
    derivative, jacobian = least_seconds(
        [lambda: problem.derivative(t, y), lambda: problem.jacobian(t, y)]
    )
    return derivative, jacobian
