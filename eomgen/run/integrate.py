"""Integration of a problem: checks of the arguments, the steps, and the trajectory."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from eomgen.base.options import taking
from eomgen.run import events
from eomgen.run.calls import Calls, Count
from eomgen.run.checks import check_repairs
from eomgen.run.failure import NOT_FINITE
from eomgen.run.guard import OF_TOLERANCE, Guard, RoundingMonitor, monitored, repaired
from eomgen.run.integrators import EndedRunError, FixedStep, StepFailure
from eomgen.run.integrators.interface import Adaptive, Advance, Resume
from eomgen.run.integrators.stability import UnstableStepError
from eomgen.run.margins import Seen
from eomgen.run.options import Wanted
from eomgen.run.passage import Passage
from eomgen.run.problem import Explanation, FloatArray, Problem
from eomgen.run.progress import throttled
from eomgen.run.projection import Violations
from eomgen.run.rows import Record, all_finite
from eomgen.run.shaking import Shaken
from eomgen.run.singular import watched
from eomgen.run.stepping import Asked, Steps, begun, can_go_on, steps_of
from eomgen.run.trajectory import Event, Outcome, Trajectory
from eomgen.run.works import Account


@taking(Wanted)
def integrate(wanted: Wanted) -> Trajectory:
    """Return the trajectory of `problem` from `t_start` to `t_end` > `t_start`, in s.

    Raises `RunError` for an invalid argument. An error after the run has begun, Ctrl-C included,
    ends it early instead: the trajectory then holds the finite rows up to there, is not `finished`,
    and its `message` says where it stopped, why, and what to change.
    """
    asked, problem = Asked.of(wanted)
    plan = _planned(asked, problem)
    run, advances = plan.run(), plan.advances()
    outcome, trouble = _follow(plan, run, advances)
    return _trajectory(plan, run, outcome, plan.message(trouble))


@dataclass(frozen=True)
class _Plan:
    """How a run is made.

    asked, problem  what is asked
    counted   the problem whose calls are counted, and whose constraints are watched
    calls     these calls
    steps     how its steps are made
    monitor   of its rounding errors, if they are guarded
    passage   through change points of its constraints, if they may be
    remarks   those of the method so far
    """

    asked: Asked
    problem: Problem
    counted: Problem
    calls: Calls
    steps: Steps
    monitor: RoundingMonitor | None
    passage: Passage | None
    remarks: list[str]

    def run(self) -> "_Run":
        """The run before its first step."""
        asked, problem, method = self.asked, self.problem, self.asked.method
        account = None
        if asked.powers:
            account = Account(asked.powers, problem.contacts, isinstance(method, Adaptive))
        run = _Run(asked.t_start, problem.initial, account)
        if can_go_on(method) and not asked.repairs:
            run.resume = partial(begun, asked, problem)
        if asked.tally:
            asked.tally.begin(problem.initial)
        return run

    def advances(self) -> Iterator[Advance]:
        """Its steps, with event location if it has contacts, checked by its guard."""
        asked, problem, monitor = self.asked, self.counted, self.monitor
        t_start, begin = asked.t_start, self.steps.begin
        if monitor and asked.repairs:
            return repaired(monitor, begin, problem, t_start, asked.max_steps)
        if problem.contacts is None:
            advances = begin(problem, t_start, 0, asked.resume)
        else:
            advances = events.advances(
                events.Stepper(begin, self.steps.strikes, self.calls.derivatives.of),
                problem,
                t_start,
                asked.t_end,
                rest_speed=asked.rest_speed,
                max_steps=asked.max_steps,
                resume=asked.resume,
            )
        held = problem.projection or problem.solved_loops
        if held:
            advances = watched(held, advances, t_start, problem.initial, self.passage)
        return monitored(monitor, advances, t_start, problem.initial) if monitor else advances

    def message(self, trouble: str) -> str:
        """What is said of the run, beside what troubled it."""
        repaired = self.monitor.words() if self.monitor else ""
        through = self.passage.words() if self.passage else ""
        notes = (trouble, repaired, through, *dict.fromkeys(self.remarks))
        return " ".join("; ".join(filter(None, notes)).split())


def _planned(asked: Asked, problem: Problem) -> _Plan:
    """The plan of a run. Raises `RunError` for an invalid argument."""
    calls, remarks = Calls(Count(1), Count(2)), list[str]()
    monitor = _monitor(asked.guard, problem, asked) if asked.guard else None
    counted = _counted(asked, problem, calls, monitor)
    steps = steps_of(asked, problem, counted, calls, remarks.append)

    def beyond(t: float, y: FloatArray, made: int) -> Iterator[Advance]:
        return steps.begin(replace(counted, initial=y), t, made)

    passage = None
    if counted.projection and counted.contacts is None and not asked.repairs:
        passage = Passage(counted, beyond, steps.rows, asked.t_end)
    return _Plan(asked, problem, counted, calls, steps, monitor, passage, remarks)


def _counted(
    asked: Asked, problem: Problem, calls: Calls, monitor: RoundingMonitor | None
) -> Problem:
    """The problem of a run whose calls are counted, and whose constraints are watched."""
    functions: dict[str, Any] = {
        "derivative": calls.derivatives.of(monitor.derivative if monitor else problem.derivative),
        "jacobian": calls.jacobians.of(problem.jacobian),
    }
    if problem.projection:
        violations = Violations(len(problem.projection.names))
        functions["projection"] = replace(problem.projection, violations=violations, seen=Seen())
    if problem.solved_loops:
        functions["solved_loops"] = replace(problem.solved_loops, seen=Seen())
    counted = problem.having(**functions)
    if asked.tally:
        counted = asked.tally.counting(counted)
    seed, method = problem.scrutiny.seed if problem.scrutiny else None, asked.method
    if seed is not None and isinstance(method, Adaptive) and "lost" not in method.memory:
        counted = counted.having(derivative=Shaken(counted.derivative, seed).derivative)
    return counted


def _trajectory(plan: _Plan, run: "_Run", outcome: Outcome, message: str) -> Trajectory:
    """The trajectory of a run that has ended."""
    account, problem, calls, held = run.account, plan.problem, plan.calls, plan.counted.projection
    t, y = run.rows.arrays()
    violations: dict[str, tuple[float, float]] = {}
    if held and held.violations:
        largest = zip(held.violations.before.tolist(), held.violations.after.tolist(), strict=True)
        violations = dict(zip(held.names, largest, strict=True))
    return Trajectory(
        name=problem.name,
        states=problem.states,
        t=t,
        y=y,
        integrator=plan.asked.integrator,
        finished=outcome.kind == "finished",
        message=message,
        counts={
            "steps": run.steps,
            "derivatives": calls.derivatives.calls,
            "jacobians": calls.jacobians.calls,
            "impacts": sum(event.kind == "impact" for event in run.events),
            "capped": run.capped,
            "cut": run.cut,
        },
        events=tuple(run.events),
        works=np.array(run.works) if account and account.names else None,
        work_names=account.names if account else (),
        resume=_kept(run, problem, plan.steps.settings),
        origin=problem.origin,
        outcome=outcome,
        violations=violations,
    )


def _kept(run: "_Run", problem: Problem, settings: Resume) -> Resume:
    """What a later run needs to continue, and to check that it is the same motion; empty if it
    cannot continue.
    """
    kept = run.resume() if run.resume else {}
    if not kept:
        return {}
    try:
        with np.errstate(all="ignore"):
            rate = np.array(problem.derivative(float(kept["t"]), kept["y"]))
    except (ArithmeticError, ValueError, StepFailure, KeyboardInterrupt):  # it is not known
        rate = np.full(len(problem.states), np.nan)
    return {**kept, **settings, "derivative": rate}


def _monitor(guard: Guard, problem: Problem, asked: Asked) -> RoundingMonitor:
    """The monitor of a guarded run; its bound is at most that of the run's tolerance.

    Raises `RunError` if the run cannot be repaired.
    """
    if guard.repairs:
        check_repairs(problem, asked.method, asked.resume is not None)
    tight = OF_TOLERANCE * asked.rtol if isinstance(asked.method, Adaptive) else guard.bound
    return RoundingMonitor(guard, problem, min(guard.bound, tight))


@dataclass
class _Run:
    """A run so far: time and state, rows kept and works there, steps made, events."""

    t: float
    y: FloatArray
    account: Account | None
    rows: Record = field(default_factory=Record)
    works: list[FloatArray] = field(default_factory=list)
    steps: int = 0
    capped: int = 0
    cut: int = 0
    events: list[Event] = field(default_factory=list)
    resume: Callable[[], Resume] | None = None

    def __post_init__(self) -> None:
        self._keep()

    def take(self, advance: Advance) -> None:
        """Record a step or an impact."""
        if self.account:
            self.works.extend(self.account.book(self.t, self.y, advance))
        self.t, self.y = advance.t, advance.y
        self.rows.extend(advance.samples)
        self.steps += advance.steps
        self.capped += advance.capped
        self.cut += advance.cut
        self.events.extend(advance.events)
        self.resume = advance.resume or self.resume

    def end(self) -> None:
        """Keep the last state if no row has its time."""
        if self.t > self.rows.last:
            self._keep()

    def _keep(self) -> None:
        self.rows.add(self.t, self.y)
        if self.account:
            self.works.append(self.account.total)


def _follow(plan: _Plan, run: _Run, advances: Iterator[Advance]) -> tuple[Outcome, str]:
    """Make the steps of a run; return the outcome and, if it did not finish, a message."""
    problem, calls, asked, method = plan.problem, plan.calls, plan.asked, plan.asked.method
    report = throttled(asked.progress or _ignore)
    try:
        with np.errstate(all="ignore"):
            _check_start(problem, run)
            for advance in advances:
                if not all_finite(advance.y):
                    raise StepFailure(NOT_FINITE, method.remedy)
                run.take(advance)
                calls.derivatives.calls += advance.derivatives
                calls.jacobians.calls += advance.jacobians
                if asked.tally:
                    asked.tally.take(advance, calls.derivatives.calls, calls.jacobians.calls)
                report((run.t - asked.t_start) / asked.span)
        return Outcome(), ""
    except KeyboardInterrupt:
        run.end()
        return Outcome("interrupted", "interrupted"), f"interrupted at t = {run.t:.6g}"
    except EndedRunError as end:
        run.end()
        return Outcome("ended", end.reason), f"stopped at {_place(problem, run)}: {end}"
    except StepFailure as failure:
        # A shorter step mends one that is too long, whatever effect makes the motion fast.
        unstable = isinstance(failure, UnstableStepError) and isinstance(method, FixedStep)
        why = None if unstable else problem.explain(run.t, run.y, problem.initial)
        outcome = (
            Outcome("stopped", f"{failure.reason}: {why.reason}", why.remedy, failure.dead)
            if why
            else Outcome("stopped", failure.reason, failure.remedy, failure.dead)
        )
    # Python's floats raise where NumPy would give inf or nan: math.exp(1000), 1 / 0.0,
    # math.sqrt(-1). SciPy's factorisations raise a ValueError for a nan.
    except (ArithmeticError, ValueError) as error:
        plain = Explanation(f"{type(error).__name__}: {error}", method.remedy)
        outcome = Outcome("stopped", *_explained(calls, problem, run, plain))
    run.end()
    return outcome, f"stopped at {_place(problem, run)}: {outcome}"


def _explained(calls: Calls, problem: Problem, run: _Run, error: Explanation) -> Explanation:
    """The model's explanation of an error in the step after (run.t, run.y), else the error itself.

    The state at which the derivative or the Jacobian raised the error is explained first, then the
    one that the step started from.
    """

    def explain(t: float, y: FloatArray, where: str) -> Explanation | None:
        why = problem.explain(t, y, problem.initial)
        return why and Explanation(f"{where} {why.reason}", why.remedy)

    failed = calls.derivatives.failed or calls.jacobians.failed
    why = None
    if failed and not (failed[0] == run.t and np.array_equal(failed[1], run.y)):
        why = explain(*failed, "in the next step")
    if calls.jacobians.failed and not calls.derivatives.failed:
        error = Explanation(f"the Jacobian: {error.reason}", error.remedy)
    return why or explain(run.t, run.y, "there") or error


def _check_start(problem: Problem, run: _Run) -> None:
    """Raise `StepFailure` if the derivative at the start is not finite.

    With a nan, SciPy's choice of the first step would not end.
    """
    slope = problem.derivative(run.t, run.y)
    assert slope.shape == run.y.shape, f"derivative has shape {slope.shape}"
    if not all_finite(slope):
        raise StepFailure("the derivative there is not finite", "change the initial state")


def _place(problem: Problem, run: _Run) -> str:
    pairs = zip(problem.states, run.y.tolist(), strict=True)
    return ", ".join([f"t = {run.t:.6g}", *(f"{state}={value:.6g}" for state, value in pairs)])


def _ignore(fraction: float) -> None:
    """Do nothing with the progress."""
