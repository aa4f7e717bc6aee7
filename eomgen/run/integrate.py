"""From a problem to its trajectory: check what is asked, step, and keep what was computed."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from eomgen.run import events
from eomgen.run.checks import check_repairs, check_rest_speed, numbers
from eomgen.run.guard import OF_TOLERANCE, Guard, RoundingMonitor, monitored, repaired
from eomgen.run.integrators import EndedRunError, FixedStep, StepFailure, find_integrator
from eomgen.run.integrators.interface import Adaptive, Advance, Resume
from eomgen.run.problem import Explanation, FloatArray, Problem
from eomgen.run.progress import Progress, throttled
from eomgen.run.stepping import ANEW, Asked, adaptive_steps, begun, can_go_on, equal_steps
from eomgen.run.tally import Tally
from eomgen.run.trajectory import Event, Outcome, Trajectory
from eomgen.run.works import Account, Powers

LOOKS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Where in a long step the gaps of contacts are looked at; in an equal step at its ends."""


def integrate(
    problem: Problem,
    integrator: str,
    t_end: float,
    *,
    t_start: float = 0.0,
    dt: float | None = None,
    rtol: float = 1e-9,
    atol: float | None = None,
    samples: int | None = None,
    progress: Progress | None = None,
    max_step: float | None = None,
    max_steps: int = 10_000_000,
    rest_speed: float | None = None,
    powers: Powers | None = None,
    resume: Resume | None = None,
    guard: Guard | None = None,
    unstable: bool = False,
    tally: Tally | None = None,
) -> Trajectory:
    """Return the trajectory of `problem` from `t_start` to `t_end` > `t_start`, in s.

    integrator  a name in `eomgen.run.integrators.INTEGRATORS`
    dt          step in s of the fixed-step methods, which need it; the last one is shortened
    rtol, atol  what the adaptive methods hold the error of each step to; without `atol`, each state
                has 1e-12 of its size in `problem.sizes`, less where rtol is below 1e-9
    samples     how many rows to keep: for fixed steps every k-th one such that there are about
                this many (default: all), for adaptive methods this many equally spaced times
                (default: 1001); the first and the last are always kept
    progress    told the fraction done, at most about ten times a second
    max_step    longest step in s of the adaptive methods; without it, they may go as far as their
                error allows. Where the derivative has corners, a step that has passed over a
                contact or a pulse is made again (`run.branches`); where that cannot be told, steps
                take no more than 1/1000 of the run
    rest_speed  contacts that close more slowly than this, in m/s or rad/s, do not bounce; those
                that then neither part nor close are held, so that bouncing comes to an end;
                without it, it is √(1e-7 a size), of contacts that bounce by less than 5e-8 of the
                mechanism's size under what accelerates them, a
    powers      asks for the works of effects
    resume      what an earlier run left in `Trajectory.resume`: this one goes on from there,
                whatever `t_start` and `problem.initial` say, to the same bytes as if that one had
                not ended, if problem, method and step or tolerances are the same
    guard       watches the derivative's rounding at every step, and stops the run where digits are
                lost, or repairs it (`run.guard`); what it lets pass is what it is without
    unstable    lets equal steps of an explicit method be too long for stability, to show what they
                then do; else the run stops there and says how long they may be
    tally       kept up to date at every step, at which it may end the run

    Raises `RunError` for an argument that cannot be served. Whatever goes wrong once the run
    has begun, Ctrl-C included, ends it early instead: the trajectory then holds the finite rows
    up to there, is not `finished`, and its `message` says where, why, and what to change.
    """
    method = find_integrator(integrator)
    grid = float(t_start)
    if resume is not None:
        t_start = float(resume["t"])
        problem = replace(problem, initial=resume["y"])
        grid = float(resume.get("grid", t_start))
        if ANEW in resume:  # no step of that run was whole
            resume = None
    asked = Asked(
        integrator=integrator,
        t_start=float(t_start),
        t_end=float(t_end),
        grid=grid,
        dt=dt,
        rtol=rtol,
        atol=atol,
        samples=samples,
        max_step=max_step,
        max_steps=max_steps,
        resume=resume,
    )
    check_rest_speed(rest_speed)
    monitor = _monitor(guard, problem, method, asked) if guard else None
    derivatives, jacobians = _Count(1), _Count(2)
    counted = replace(
        problem,
        derivative=derivatives.of(monitor.derivative if monitor else problem.derivative),
        jacobian=jacobians.of(problem.jacobian),
    )
    if tally:
        counted = tally.counting(counted)
    remarks: list[str] = []
    if isinstance(method, FixedStep):
        # What is looked at on the way does not count.
        # Where extended numbers repair what doubles lose, their Jacobian has lost its digits, too.
        unseen = unstable or not method.explicit or (monitor and monitor.guard.repairs)
        looked_at = None if unseen else problem
        begin, remembered = equal_steps(asked, method, counted, looked_at)
    else:
        begin, remembered = adaptive_steps(asked, method, problem, remarks.append)

    looks = (0.0, 1.0) if isinstance(method, FixedStep) else LOOKS
    stepper = events.Stepper(begin, looks, derivatives.of)
    advances = _advances(stepper, counted, asked, monitor, rest_speed)
    account = Account(powers, problem.contacts, isinstance(method, Adaptive)) if powers else None
    run = _Run(asked.t_start, problem.initial, account)
    if can_go_on(method) and not (monitor and monitor.guard.repairs):
        run.resume = partial(begun, asked, problem)
    if tally:
        tally.begin(problem.initial)
    counts, report = (derivatives, jacobians), progress or _ignore
    outcome, trouble = _follow(run, advances, counts, problem, method, asked.t_end, report, tally)
    kept = _kept(run, problem, {**remembered, **numbers(rest_speed=rest_speed)})
    said = (trouble, monitor.words() if monitor else "", *dict.fromkeys(remarks))
    return Trajectory(
        name=problem.name,
        states=problem.states,
        t=np.array([t for t, _ in run.rows]),
        y=np.array([y for _, y in run.rows]),
        integrator=integrator,
        finished=outcome.kind == "finished",
        message=" ".join("; ".join(filter(None, said)).split()),
        counts={
            "steps": run.steps,
            "derivatives": derivatives.calls,
            "jacobians": jacobians.calls,
            "impacts": sum(event.kind == "impact" for event in run.events),
            "capped": run.capped,
            "cut": run.cut,
        },
        events=tuple(run.events),
        works=np.array(run.works) if account and account.names else None,
        work_names=account.names if account else (),
        resume=kept,
        origin=problem.origin,
        outcome=outcome,
    )


def _kept(run: "_Run", problem: Problem, remembered: Resume) -> Resume:
    """What a later run needs to go on, and to tell whether it is the same motion; none where it
    cannot.
    """
    stands = run.resume() if run.resume else {}
    if not stands:
        return {}
    rate = np.full(len(problem.states), np.nan)  # not known, if it is interrupted
    stops = (ArithmeticError, ValueError, StepFailure, KeyboardInterrupt)
    with np.errstate(all="ignore"), suppress(*stops):
        rate = np.array(problem.derivative(float(stands["t"]), stands["y"]))
    return {**stands, **remembered, "derivative": rate}


def _monitor(
    guard: Guard, problem: Problem, method: FixedStep | Adaptive, asked: Asked
) -> RoundingMonitor:
    """A guard at its work on a run, held to what the run's tolerance asks for, too.

    Raises `RunError` for repairs that cannot be made.
    """
    if guard.repairs:
        check_repairs(problem, asked.resume is not None)
    tight = OF_TOLERANCE * asked.rtol if isinstance(method, Adaptive) else guard.bound
    return RoundingMonitor(guard, problem, min(guard.bound, tight))


@dataclass
class _Count:
    """How often functions of t and y are called, and where one last raised an error.

    `axes` is the number of axes of their values, which are nan at a state that is not finite: then
    a method rejects the step that led there.
    """

    axes: int
    calls: int = 0
    failed: tuple[float, FloatArray] | None = None

    def of(
        self, function: Callable[[float, FloatArray], FloatArray]
    ) -> Callable[[float, FloatArray], FloatArray]:
        """The same function, its calls counted here."""

        def counted(t: float, y: FloatArray) -> FloatArray:
            self.calls += 1
            try:
                return function(t, y)
            except (ArithmeticError, ValueError):
                if not np.isfinite(y).all():
                    return np.full((len(y),) * self.axes, np.nan)
                self.failed = float(t), np.array(y)
                raise

        return counted


@dataclass
class _Run:
    """How far a run has come: time and state, rows kept and works there, steps made, events met."""

    t: float
    y: FloatArray
    account: Account | None
    rows: list[tuple[float, FloatArray]] = field(default_factory=list)
    works: list[FloatArray] = field(default_factory=list)
    steps: int = 0
    capped: int = 0
    cut: int = 0
    events: list[Event] = field(default_factory=list)
    resume: Callable[[], Resume] | None = None

    def __post_init__(self) -> None:
        self._keep()

    def take(self, advance: Advance) -> None:
        """Go on to the end of a step, or through a strike."""
        if self.account:
            self.works.extend(self.account.book(self.t, self.y, advance))
        self.t, self.y = advance.t, advance.y
        self.rows.extend(advance.samples)
        self.steps += advance.is_step
        self.capped += advance.capped
        self.cut += advance.cut
        self.events.extend(advance.events)
        self.resume = advance.resume or self.resume

    def end(self) -> None:
        """Keep the last state, too, where no row has its time."""
        if self.t > self.rows[-1][0]:
            self._keep()

    def _keep(self) -> None:
        self.rows.append((self.t, self.y))
        if self.account:
            self.works.append(self.account.total)


def _advances(
    stepper: events.Stepper,
    problem: Problem,
    asked: Asked,
    monitor: RoundingMonitor | None,
    rest_speed: float | None,
) -> Iterator[Advance]:
    """The steps of a run, from strike to strike if it has contacts, and under its guard."""
    t_start, resume = asked.t_start, asked.resume
    if monitor and monitor.guard.repairs:
        return repaired(monitor, stepper.begin, problem, t_start, asked.max_steps)
    if problem.contacts is None:
        advances = stepper.begin(problem, t_start, 0, resume)
    else:
        advances = events.advances(
            stepper,
            problem,
            t_start,
            asked.t_end,
            rest_speed=rest_speed,
            max_steps=asked.max_steps,
            resume=resume,
        )
    return monitored(monitor, advances, t_start, problem.initial) if monitor else advances


def _follow(
    run: _Run,
    advances: Iterator[Advance],
    counts: tuple[_Count, _Count],
    problem: Problem,
    method: FixedStep | Adaptive,
    t_end: float,
    progress: Progress,
    tally: Tally | None,
) -> tuple[Outcome, str]:
    """Carry `run` on to `t_end`; return how that ended and, if before, the trouble in one line."""
    t_start, report = run.t, throttled(progress)
    try:
        with np.errstate(all="ignore"):
            _check_start(problem, run)
            for advance in advances:
                if not _is_finite(advance):
                    raise StepFailure("the state overflows or is not a number", method.remedy)
                run.take(advance)
                if tally:
                    tally.take(advance, counts[0].calls, counts[1].calls)
                report((run.t - t_start) / (t_end - t_start))
        return Outcome(), ""
    except KeyboardInterrupt:
        run.end()
        return Outcome("interrupted", "interrupted"), f"interrupted at t = {run.t:.6g}"
    except EndedRunError as end:
        run.end()
        return Outcome("ended", end.reason), f"stopped at {_place(problem, run)}: {end}"
    except StepFailure as failure:
        why = problem.explain(run.t, run.y, problem.initial)
        outcome = (
            Outcome("stopped", f"{failure.reason}: {why.reason}", why.remedy)
            if why
            else Outcome("stopped", failure.reason, failure.remedy)
        )
    # Plain Python arithmetic raises where NumPy would give inf or nan: math.exp(1000), 1 / 0.0,
    # math.sqrt(-1); a ValueError is also how SciPy's factorizations refuse a nan.
    except (ArithmeticError, ValueError) as error:
        plain = Explanation(f"{type(error).__name__}: {error}", method.remedy)
        outcome = Outcome("stopped", *_explained(counts, problem, run, plain))
    run.end()
    return outcome, f"stopped at {_place(problem, run)}: {outcome}"


def _explained(
    counts: tuple[_Count, _Count], problem: Problem, run: _Run, error: Explanation
) -> Explanation:
    """The model's explanation of an error in the step after (run.t, run.y), else the error itself.

    The state at which the derivative or the Jacobian raised the error is explained first, then the
    one that the step started from.
    """

    def explain(t: float, y: FloatArray, where: str) -> Explanation | None:
        why = problem.explain(t, y, problem.initial)
        return why and Explanation(f"{where} {why.reason}", why.remedy)

    failed = next((count for count in counts if count.failed is not None), None)
    why = None
    if failed is not None and failed.failed is not None:
        t, y = failed.failed
        if not (t == run.t and np.array_equal(y, run.y)):
            why = explain(t, y, "in the next step")
    if failed is counts[1]:
        error = Explanation(f"the Jacobian: {error.reason}", error.remedy)
    return why or explain(run.t, run.y, "there") or error


def _check_start(problem: Problem, run: _Run) -> None:
    """Raise `StepFailure` if there is no finite derivative to start from.

    SciPy's choice of a first step would take a nan and never come back.
    """
    slope = problem.derivative(run.t, run.y)
    assert slope.shape == run.y.shape, f"derivative has shape {slope.shape}"
    if not np.isfinite(slope).all():
        raise StepFailure("the derivative there is not finite", "change the initial state")


def _is_finite(advance: Advance) -> bool:
    return bool(
        np.isfinite(advance.y).all() and all(np.isfinite(y).all() for _, y in advance.samples)
    )


def _place(problem: Problem, run: _Run) -> str:
    pairs = zip(problem.states, run.y.tolist(), strict=True)
    return ", ".join([f"t = {run.t:.6g}", *(f"{state}={value:.6g}" for state, value in pairs)])


def _ignore(fraction: float) -> None:
    """Take no notice of progress."""
