"""Runs made and measured: error against a reference, drift, time, and counts.

The first run keeps the rows that the error is taken from; it warms up. Then the same run is made
again without rows, and the least time counts. A run that takes long is made once. Methods are
ranked by counted work, which is the same on a busy machine.
"""

import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from eomgen.errors import RunError
from eomgen.run.integrate import integrate
from eomgen.run.integrators import EndedRunError, StepFailure
from eomgen.run.problem import Floats, Problem
from eomgen.run.tally import Tally
from eomgen.run.trajectory import Trajectory
from eomgen.run.works import Powers
from eomgen.study.accuracy.cost import meter
from eomgen.study.accuracy.ladder import Ladder, Rung, Work, next_rung
from eomgen.study.accuracy.measure import WRONG, error
from eomgen.study.accuracy.reference import Reference
from eomgen.study.timing import least_seconds

TELLS_APART = 100
"""Errors below so many times the reference's own are not told apart."""
ONCE = 0.25
"""A run that takes more than this share of the longest is made once."""
REPEATS = 0.3
"""About how long the repeated runs of one rung take, s …"""
LEAST_REPEATS, MOST_REPEATS = 2, 20
"""… and how many there are."""
WORKS_COST = 8
"""A run that books works takes at most about so many times longer."""
SAME_TIME = 1e-6
"""Rows this close, in parts of the time between two, are at one time."""
OVER = "it took too long"

Rows = Callable[[Floats, Floats], Floats]
"""Of times (n,) and states (n, ny): a number for each, (n,)."""


@dataclass(frozen=True, eq=False)
class Bench:
    """What runs are measured by.

    problem       whose motion it is
    reference     that motion, and how well it is known
    rest_speed    below which contacts do not bounce, m/s or rad/s; None: see `integrate`
    kinetic       kinetic energy, J
    energy        an energy that exact motion keeps, J; None where there is none
    energy_scale  of the motion, J
    powers        of effects, where energy is not kept but their works are known
    gap           greatest gap in a joint, m; None where there cannot be one
    """

    problem: Problem
    reference: Reference
    rest_speed: float | None
    kinetic: Rows
    energy: Rows | None
    energy_scale: float
    powers: Powers | None
    gap: Rows | None

    @property
    def floors(self) -> tuple[float, float]:
        """Errors below which nothing is told apart: over all rows, and at the end."""
        reference = self.reference
        return TELLS_APART * reference.error, TELLS_APART * reference.final_error


@dataclass
class _Defect:
    """How far from 1 the length of a quaternion was, at most."""

    largest: float = 0.0


@dataclass(frozen=True, eq=False)
class _Watched(Problem):
    """A problem that notes how long quaternions are before they are scaled to unit length."""

    defect: _Defect = field(default_factory=_Defect)

    def unit(self, y: Floats) -> Floats:
        for indices in self.quaternions:
            off = abs(math.hypot(*(float(y[i]) for i in indices)) - 1)
            self.defect.largest = max(self.defect.largest, off)
        return super().unit(y)


@dataclass(frozen=True)
class _Run:
    """A run made: its trajectory (None if it was refused), how long it took, the work counted, why
    it ended.
    """

    trajectory: Trajectory | None
    seconds: float
    units: float
    over: bool = False
    refusal: str = ""


def sweep(
    bench: Bench,
    ladder: Ladder,
    methods: Sequence[str],
    done: Mapping[Rung, Work],
    until: float = math.inf,
    notice: Callable[[Rung], None] = lambda rung: None,
) -> Iterator[Work]:
    """Make the runs that are not yet `done`, all methods' coarse ones first, and yield each.

    No run is begun when `time.perf_counter()` is past `until`. `notice` is told each before it is
    begun.
    """
    known, climbing = dict(done), list(methods)
    while climbing:
        for method in tuple(climbing):
            rung = next_rung(ladder, method, known)
            if rung is None:
                climbing.remove(method)
                continue
            if time.perf_counter() > until:
                return
            notice(rung)
            work = measure(bench, rung, ladder.run_time)
            known[rung] = work
            yield work


def left_out(ladder: Ladder, methods: Sequence[str], done: Mapping[Rung, Work]) -> list[str]:
    """Methods whose ladders are not climbed to their top."""
    return [method for method in methods if next_rung(ladder, method, done) is not None]


def measure(bench: Bench, rung: Rung, run_time: float) -> Work:
    """Make a run, again for its time, and once more for its works; none takes more than `run_time`.

    Raises `KeyboardInterrupt` if a run was interrupted.
    """
    problem, defect = bench.problem, _Defect()
    if problem.quaternions:
        fields = {name: getattr(problem, name) for name in Problem.__dataclass_fields__}
        problem = _Watched(**fields, defect=defect)
    first = _run(bench, problem, rung, run_time, len(bench.reference.t))
    if first.trajectory is None:
        return Work(rung, "refused", first.seconds, 1, reason=first.refusal)
    if first.over:
        return _worked(Work(rung, "over", first.seconds, 1, reason=OVER), first)
    if not first.trajectory.finished:
        failed = Work(rung, "failed", first.seconds, 1, reason=first.trajectory.message)
        return _worked(failed, first)
    last = first
    times: list[float] = []
    if first.seconds < ONCE * run_time:
        while len(times) < LEAST_REPEATS or (
            len(times) < MOST_REPEATS and sum(times) + times[-1] < REPEATS
        ):
            # Rows between steps have defects of their own; only the steps' are looked for here.
            defect.largest = 0.0
            last = _run(bench, problem, rung, math.inf, 2)
            times.append(last.seconds)
    found, end = errors(first.trajectory, bench.reference)
    floors = bench.floors
    wrong = not found < WRONG
    reason = first.trajectory.message
    if wrong:
        reason = f"reported success, but is {found:.2g} of the motion's own scale off"
    work = Work(
        rung,
        "wrong" if wrong else "ok",
        min(times, default=first.seconds),
        max(1, len(times)),
        error=max(found, floors[0]),
        final_error=max(end, floors[1]),
        at_most=(found < floors[0], end < floors[1]),
        energy_drift=_energy_drift(bench, rung, first, run_time),
        joint_gap=_greatest(bench.gap, first.trajectory),
        quaternion_defect=defect.largest if problem.quaternions else math.nan,
        reason=reason,
        spread=statistics.median(times) - min(times) if times else math.nan,
    )
    return _worked(work, last)


def _worked(work: Work, run: _Run) -> Work:
    assert run.trajectory is not None
    counts = run.trajectory.counts
    return replace(
        work,
        units=run.units,
        steps=counts["steps"],
        derivatives=counts["derivatives"],
        jacobians=counts["jacobians"],
    )


def _run(
    bench: Bench,
    problem: Problem,
    rung: Rung,
    limit: float,
    rows: int,
    powers: Powers | None = None,
) -> _Run:
    t = bench.reference.t
    over, tally = False, Tally()
    begin = time.perf_counter()

    def told(fraction: float) -> None:
        nonlocal over
        if time.perf_counter() - begin > limit:
            over = True
            raise EndedRunError(OVER)

    # Fewer steps than rows: all are kept.
    few = rung.dt is not None and (t[-1] - t[0]) / rung.dt < rows
    try:
        trajectory = integrate(
            problem,
            rung.method,
            float(t[-1]),
            t_start=float(t[0]),
            dt=rung.dt,
            samples=None if few and rows > 2 else rows,
            rest_speed=bench.rest_speed,
            progress=told,
            powers=powers,
            tally=tally,
            rtol=rung.rtol or 1.0,  # which equal steps do not look at
            atol=rung.atol or 1.0,
        )
    except StepFailure:
        raise
    except RunError as refusal:
        return _Run(None, time.perf_counter() - begin, math.nan, refusal=str(refusal))
    seconds = time.perf_counter() - begin
    if trajectory.outcome.kind == "interrupted":
        raise KeyboardInterrupt
    units = meter(problem, rung.method)(tally)
    return _Run(trajectory, seconds, units, over=over and not trajectory.finished)


def errors(trajectory: Trajectory, reference: Reference) -> tuple[float, float]:
    """A finished run's error, in parts of the motion's scale: greatest of all rows, and the last.

    Compared are the times that both have. Two rows of one time are those before and after an
    impact: the later one counts.
    """
    t, close = reference.t, SAME_TIME * (reference.t[1] - reference.t[0])
    rows = np.searchsorted(trajectory.t, t + close, side="right") - 1
    there = (rows >= 0) & (np.abs(trajectory.t[rows] - t) <= close)
    assert there[-1], "a finished run has a row at the end"
    y, true = trajectory.y[rows[there]], reference.y[there]
    return error(y, true, reference.scale), error(y[-1], true[-1], reference.scale)


def _greatest(rows: Rows | None, trajectory: Trajectory) -> float:
    return math.nan if rows is None else float(np.max(rows(trajectory.t, trajectory.y)))


def _energy_drift(bench: Bench, rung: Rung, first: _Run, run_time: float) -> float:
    """See `Work`; nan where it is not known, or would take too long to find."""
    trajectory = first.trajectory
    assert trajectory is not None
    with np.errstate(all="ignore"):
        if bench.energy is not None:
            energy = bench.energy(trajectory.t, trajectory.y)
            return float(np.max(np.abs(energy - energy[0]))) / bench.energy_scale
        if bench.powers is None or WORKS_COST * first.seconds > run_time:
            return math.nan
        booked = _run(bench, bench.problem, rung, run_time, 2, bench.powers).trajectory
        if booked is None or not booked.finished or booked.works is None:
            return math.nan
        ends = bench.kinetic(booked.t[[0, -1]], booked.y[[0, -1]])
        return float(abs(ends[1] - ends[0] - booked.works[-1].sum())) / bench.energy_scale


def call_times(problem: Problem, reference: Reference) -> tuple[float, float]:
    """Least time of a derivative and of a Jacobian halfway through the motion, s."""
    middle = len(reference.t) // 2
    t, y = float(reference.t[middle]), reference.y[middle]
    derivative, jacobian = least_seconds(
        [lambda: problem.derivative(t, y), lambda: problem.jacobian(t, y)]
    )
    return derivative, jacobian
