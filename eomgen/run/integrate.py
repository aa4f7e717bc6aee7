"""From a problem to its trajectory: check what is asked, step, and keep what was computed."""

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from eomgen.errors import RunError
from eomgen.run.integrators import (
    INTEGRATORS,
    FixedStep,
    StepFailure,
    adaptive,
    find_integrator,
    fixed_step,
)
from eomgen.run.integrators.interface import Adaptive, Advance
from eomgen.run.problem import Floats, Problem
from eomgen.run.progress import Progress, throttled
from eomgen.run.trajectory import Trajectory

SMALLEST_RTOL = 2.3e-14
"""SciPy raises any rtol below 100 times the machine epsilon; we would rather say so."""
ADAPTIVE_SAMPLES = 1001
MOST_SAMPLES = 1_000_000


def integrate(
    problem: Problem,
    integrator: str,
    t_end: float,
    *,
    t_start: float = 0.0,
    dt: float | None = None,
    rtol: float = 1e-9,
    atol: float = 1e-12,
    samples: int | None = None,
    progress: Progress | None = None,
    max_steps: int = 10_000_000,
) -> Trajectory:
    """Return the trajectory of `problem` from `t_start` to `t_end` > `t_start`, in s.

    integrator  a name in `eomgen.run.integrators.INTEGRATORS`
    dt          step in s of the fixed-step methods, which need it; the last one is shortened
    rtol, atol  what the adaptive methods hold the error of each step to
    samples     how many rows to keep: for fixed steps every k-th one such that there are about
                this many (default: all), for adaptive methods this many equally spaced times
                (default: 1001); the first and the last are always kept
    progress    told the fraction done, at most about ten times a second

    Raises `RunError` for an argument that cannot be served. Whatever goes wrong once the run
    has begun, Ctrl-C included, ends it early instead: the trajectory then holds the finite rows
    up to there, is not `finished`, and its `message` says where, why, and what to change.
    """
    method = find_integrator(integrator)
    t_start, t_end = float(t_start), float(t_end)
    _check_times(t_start, t_end)
    _check_tolerances(rtol, atol)
    if samples is not None and samples < 2:
        raise RunError(f"samples: {samples} is too few; give at least 2, the first and the last")
    if samples is not None and samples > MOST_SAMPLES:
        raise RunError(f"samples: {samples} is too many; give at most {MOST_SAMPLES}")

    derivative, jacobian = _Counted(problem.derivative), _Counted(problem.jacobian)
    counted = replace(problem, derivative=derivative, jacobian=jacobian)
    if isinstance(method, FixedStep):
        dt, every = _check_steps(integrator, t_end - t_start, dt, samples, max_steps)
        advances = fixed_step.advances(method, counted, t_start, t_end, dt, every)
    else:
        _check_no_step(integrator, dt)
        rows = samples or ADAPTIVE_SAMPLES
        advances = adaptive.advances(
            method, counted, t_start, t_end, rtol=rtol, atol=atol, samples=rows, max_steps=max_steps
        )

    run = _Run(t_start, problem.initial, [(t_start, problem.initial)])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        trouble = _follow(
            run, advances, counted, problem, method, t_end, throttled(progress or _ignore)
        )
    # LSODA says why it failed in a warning only.
    remarks = "; ".join(dict.fromkeys(str(warning.message) for warning in caught))
    message = "; ".join(part for part in (trouble, remarks) if part)
    calls = {"derivatives": derivative.calls, "jacobians": jacobian.calls}
    return Trajectory(
        name=problem.name,
        states=problem.states,
        t=np.array([t for t, _ in run.rows]),
        y=np.array([y for _, y in run.rows]),
        integrator=integrator,
        finished=not trouble,
        message=" ".join(message.split()),
        counts={"steps": run.steps, **calls},
    )


@dataclass
class _Counted:
    """A function of t and y that counts its calls, and keeps where it raised an error."""

    function: Callable[[float, Floats], Floats]
    calls: int = 0
    failed: tuple[float, Floats] | None = None

    def __call__(self, t: float, y: Floats) -> Floats:
        self.calls += 1
        try:
            return self.function(t, y)
        except (ArithmeticError, ValueError):
            self.failed = float(t), np.array(y)
            raise


@dataclass
class _Run:
    """How far a run has come: time and state, the rows kept, the steps made."""

    t: float
    y: Floats
    rows: list[tuple[float, Floats]]
    steps: int = 0


def _follow(
    run: _Run,
    advances: Iterator[Advance],
    counted: Problem,
    problem: Problem,
    method: FixedStep | Adaptive,
    t_end: float,
    progress: Progress,
) -> str:
    """Carry `run` on to `t_end`; return "" or, if it stops before, the trouble in one line."""
    t_start = run.t
    try:
        with np.errstate(all="ignore"):
            _check_start(problem, run)
            for advance in advances:
                if not _is_finite(advance):
                    raise StepFailure(f"the state left the finite numbers; {method.remedy}")
                run.t, run.y = advance.t, advance.y
                run.rows.extend(advance.samples)
                run.steps += 1
                progress((run.t - t_start) / (t_end - t_start))
        return ""
    except KeyboardInterrupt:
        trouble = f"interrupted at t = {run.t:.6g}"
    except StepFailure as failure:
        why = problem.explain(run.t, run.y, problem.initial)
        cause = f"{str(failure).partition(';')[0]}: {why}" if why else str(failure)
        trouble = f"stopped at {_place(problem, run)}: {cause}"
    # Plain Python arithmetic raises where NumPy would give inf or nan: math.exp(1000), 1 / 0.0,
    # math.sqrt(-1); a ValueError is also how SciPy's factorizations refuse a nan.
    except (ArithmeticError, ValueError) as error:
        plain = f"{type(error).__name__}: {error}; {method.remedy}"
        trouble = f"stopped at {_place(problem, run)}: {_why(counted, run, plain)}"
    if run.t > run.rows[-1][0]:
        run.rows.append((run.t, run.y))
    return trouble


def _why(problem: Problem, run: _Run, error: str) -> str:
    """What had no value in the step from where a run has come to, or else the bare error."""
    for function in (problem.derivative, problem.jacobian):
        assert isinstance(function, _Counted)
        if function.failed is not None:
            t, y = function.failed
            here = t == run.t and np.array_equal(y, run.y)
            why = problem.explain(t, y, problem.initial)
            if why:
                return f"{'there' if here else 'in the next step'} {why}"
            return f"the Jacobian: {error}" if function is problem.jacobian else error
    why = problem.explain(run.t, run.y, problem.initial)
    return f"there {why}" if why else error


def _check_start(problem: Problem, run: _Run) -> None:
    """Raise `StepFailure` if there is no finite derivative to start from.

    SciPy's choice of a first step would take a nan and never come back.
    """
    slope = problem.derivative(run.t, run.y)
    assert slope.shape == run.y.shape, f"derivative has shape {slope.shape}"
    if not np.isfinite(slope).all():
        raise StepFailure("the derivative there is not finite; change the initial state")


def _is_finite(advance: Advance) -> bool:
    return bool(
        np.isfinite(advance.y).all() and all(np.isfinite(y).all() for _, y in advance.samples)
    )


def _place(problem: Problem, run: _Run) -> str:
    pairs = zip(problem.states, run.y.tolist(), strict=True)
    return ", ".join([f"t = {run.t:.6g}", *(f"{state}={value:.6g}" for state, value in pairs)])


def _ignore(fraction: float) -> None:
    """Take no notice of progress."""


def _check_times(t_start: float, t_end: float) -> None:
    for name, time in (("t_start", t_start), ("t_end", t_end)):
        if not math.isfinite(time):
            raise RunError(f"{name}: {time:g} is not a finite time")
    if t_end <= t_start:
        raise RunError(f"t_end: {t_end:g} is not after t_start = {t_start:g}")


def _check_tolerances(rtol: float, atol: float) -> None:
    for name, tolerance in (("rtol", rtol), ("atol", atol)):
        if not (math.isfinite(tolerance) and tolerance > 0):
            raise RunError(f"{name}: {tolerance:g} is not a positive number")
    if rtol < SMALLEST_RTOL:
        raise RunError(f"rtol: {rtol:g} is too small; the smallest allowed is {SMALLEST_RTOL:g}")


def _check_no_step(integrator: str, dt: float | None) -> None:
    if dt is not None:
        fixed = [name for name, method in INTEGRATORS.items() if isinstance(method, FixedStep)]
        raise RunError(
            f"dt: {integrator} chooses its own steps; leave --dt out, "
            f"or take one of {', '.join(fixed)}"
        )


def _check_steps(
    integrator: str, span: float, dt: float | None, samples: int | None, max_steps: int
) -> tuple[float, int]:
    """Return the step and that every how-manieth is kept."""
    if dt is None:
        raise RunError(f"dt: {integrator} needs a step; give e.g. --dt 0.001")
    if not (math.isfinite(dt) and dt > 0):
        raise RunError(f"dt: {dt:g} is not a positive step; give e.g. --dt 0.001")
    steps = fixed_step.count_steps(span, dt)
    if steps > max_steps:
        raise RunError(f"dt: {dt:g} takes {steps:g} steps, but at most {max_steps} are made")
    every = 1 if samples is None else math.ceil(steps / (samples - 1))
    return float(dt), every
