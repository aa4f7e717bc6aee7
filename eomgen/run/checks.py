"""Checks of the arguments of a run, and defaults that depend on them."""

import math

import numpy as np

from eomgen.base.errors import RunError
from eomgen.run.integrators import INTEGRATORS, Adaptive, FixedStep, fixed_step
from eomgen.run.noise import least_tolerance
from eomgen.run.problem import FloatArray, Problem

LEAST_STEPS = 1000
"""Least number of steps of an adaptive method if longer ones cannot be checked for branches."""
MOST_SAMPLES = 1_000_000
ATOL, OF_RTOL, LEAST_ATOL = 1e-12, 1e-3, 1e-15
"""The default atol, relative to the size of each state: `OF_RTOL` rtol, but at most `ATOL` and at
least `LEAST_ATOL`. For rtol below 1e-9 a constant atol would dominate the error; an atol below a
few units in the last place, or below the rounding error of a stiff step, cannot be met."""


def longest_steps(max_step: float | None, span: float) -> tuple[float, float]:
    """The longest step of an adaptive method, s, and the longest one that cannot be checked for
    branches that it passes over. Raises `RunError` if `max_step` is not positive.
    """
    if max_step is None:
        return math.inf, span / LEAST_STEPS
    if not (math.isfinite(max_step) and max_step > 0):
        raise RunError(f"max_step: {max_step:g} is not a positive step; give e.g. --max-step 0.01")
    return max_step, max_step


def check_times(t_start: float, t_end: float) -> None:
    """Raise `RunError` unless t_start < t_end and both are finite."""
    for name, time in (("t_start", t_start), ("t_end", t_end)):
        if not math.isfinite(time):
            raise RunError(f"{name}: {time:g} is not a finite time")
    if t_end <= t_start:
        raise RunError(f"t_end: {t_end:g} is not after t_start = {t_start:g}")


def numbers(**values: float | None) -> dict[str, FloatArray]:
    """Numbers as arrays of shape (), nan for None."""
    return {name: np.array(math.nan if x is None else x) for name, x in values.items()}


def allowed_errors(
    problem: Problem, method: str, rtol: float, atol: float | None, span: float
) -> float | FloatArray:
    """`atol` if given, else the default: for each state (ny,) if the problem has sizes."""
    if atol is not None:
        return atol
    if not problem.sizes:
        return _relative(rtol)
    return errors_of_sizes(np.array(problem.sizes), problem, method, rtol, span)


def errors_of_sizes(
    sizes: FloatArray, problem: Problem, method: str, rtol: float, span: float
) -> FloatArray:
    """The default atol for states of these sizes, (ny,) or (ny, n), with the noise of `problem`."""
    relative = _relative(rtol)
    if relative < ATOL and problem.noise is not None:
        least = least_tolerance(method, rtol) * problem.noise(span)
        least = least.reshape(-1, *[1] * (sizes.ndim - 1))
        return np.asarray(np.minimum(np.maximum(relative * sizes, least), ATOL * sizes))
    return np.asarray(relative * sizes)


def _relative(rtol: float) -> float:
    """The default atol, relative to sizes."""
    return min(ATOL, max(OF_RTOL * rtol, LEAST_ATOL))


def check_tolerances(method: FixedStep | Adaptive, rtol: float, atol: float | None) -> None:
    """Raise `RunError` for tolerances that are not positive, or that the method cannot meet."""
    least = method.smallest_rtol if isinstance(method, Adaptive) else 0.0
    for name, tolerance in (("rtol", rtol), ("atol", atol)):
        if tolerance is None:
            continue
        if not (math.isfinite(tolerance) and tolerance > 0):
            raise RunError(f"{name}: {tolerance:g} is not a positive number")
    if rtol < least:
        raise RunError(f"rtol: {rtol:g} is too small; the smallest allowed is {least:g}")


def check_samples(samples: int | None) -> None:
    """Raise `RunError` for too few or too many rows."""
    if samples is not None and samples < 2:
        raise RunError(f"samples: {samples} is too few; give at least 2, the first and the last")
    if samples is not None and samples > MOST_SAMPLES:
        raise RunError(f"samples: {samples} is too many; give at most {MOST_SAMPLES}")


def check_rest_speed(rest_speed: float | None) -> None:
    """Raise `RunError` for a speed that is not positive."""
    if rest_speed is not None and not (math.isfinite(rest_speed) and rest_speed > 0):
        raise RunError(f"rest_speed: {rest_speed:g} is not a positive speed, in m/s")


def check_repairs(problem: Problem, method: FixedStep | Adaptive, resumed: bool) -> None:
    """Raise `RunError` for a run that cannot be repaired in extended precision."""
    if isinstance(method, Adaptive) and method.series:
        raise RunError("guard: Taylor series cannot be repaired; take --integrator DOP853")
    if problem.contacts is not None:
        raise RunError(
            "guard: a run with rigid contacts cannot be repaired; let it stop instead (--guard)"
        )
    if resumed:
        raise RunError(
            "guard: a run that continues another cannot be repaired; let it stop instead (--guard)"
        )


def check_no_step(integrator: str, dt: float | None) -> None:
    """Raise `RunError` if a step is given for a method that chooses its own."""
    if dt is not None:
        fixed = [name for name, method in INTEGRATORS.items() if isinstance(method, FixedStep)]
        raise RunError(
            f"dt: {integrator} chooses its own steps; leave --dt out, "
            f"or take one of {', '.join(fixed)}"
        )


def check_series(problem: Problem, integrator: str, series: str) -> None:
    """Raise `RunError` if a problem does not have the Taylor series that a method needs."""
    if series not in problem.series:
        raise RunError(
            f"integrator: {integrator} is only for single runs of scenes; take --integrator DOP853"
        )
    problem.series[series]()


def check_steps(
    integrator: str, span: float, dt: float | None, samples: int | None, max_steps: int
) -> tuple[float, int]:
    """The step, and k if every k-th state is kept. Raises `RunError` for an invalid step."""
    if dt is None:
        raise RunError(f"dt: {integrator} needs a step; give e.g. --dt 0.001")
    if not (math.isfinite(dt) and dt > 0):
        raise RunError(f"dt: {dt:g} is not a positive step; give e.g. --dt 0.001")
    steps = fixed_step.count_steps(span, dt)
    if steps > max_steps:
        raise RunError(f"dt: {dt:g} takes {steps:g} steps, but at most {max_steps} are allowed")
    every = 1 if samples is None else math.ceil(steps / (samples - 1))
    return float(dt), every
