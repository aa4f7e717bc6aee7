"""Stiffness of a motion, and the effect of rounding errors on its steps.

A derivative in doubles is that of a state a few units in the last place away: for a spring of k N/m
and a mass of m kg at s m, its error is k ε s/m. An implicit step of h solves y = h f(y), so that an
error δf moves its end by (I - h J)^-1 h δf, which is greatest for h about 1/|λ| of the fast modes,
and less than h δf. If the tolerance is below that, steps shrink until the run stops.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eomgen.run.problem import FloatArray, Problem

PROBES = 8
"""Number of neighbours of a state, each a unit in the last place away, at which the derivative is
evaluated."""
STEPS = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Lengths of the steps considered, in time constants 1/|λ| of the fastest mode."""
ROTATION = np.exp(0.25j * np.pi)
"""Steps are rotated by this factor in the complex plane, so that I - h J is not singular for
growing or oscillating modes; with error control, steps are never near that."""
MANY, DAMPED = 1e4, 100.0
"""A motion is stiff if the run is longer than `MANY` time constants 1/|λ| of its fastest modes, and
than `DAMPED` of their decay: explicit steps must then be shorter than accuracy requires."""
SOME = 3e3
"""Noise is looked for where the run is longer than this many time constants of its fastest mode."""
SOLVED = ("Radau", "BDF")
"""Methods that solve their equations to a fraction of the tolerance."""
NOISY = 10.0
"""Least tolerance of the other methods, in units of the noise of a step."""
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Fast:
    """Properties of the fast modes of a motion.

    stiff  whether explicit steps would be many times shorter than accuracy requires
    quick  whether a mode is fast compared with the run, damped or not
    decay  the greatest decay rate of a mode, 1/s
    noise  (ny,), greatest change of each state in a step by rounding errors of the derivative
    """

    stiff: bool
    quick: bool
    decay: float
    noise: FloatArray


def fast(problem: Problem, states: Iterable[tuple[float, FloatArray]], span: float) -> Fast:
    """The fast modes at some times and states of a run of `span` s.

    States at which the derivative or the Jacobian is not finite are ignored.
    """
    stiff, some, decay, most = False, False, 0.0, np.zeros(len(problem.states))
    for t, y in states:
        modes, noise = _modes_and_noise(problem.derivative, problem.jacobian, t, y, span, SOME)
        quick = np.abs(modes) * span > MANY
        some = some or bool(quick.any())
        stiff = stiff or bool((-modes[quick].real * span > DAMPED).any())
        decay = max(decay, float((-modes.real).max(initial=0.0)))
        most = np.maximum(most, noise)
    return Fast(stiff, some, decay, most)


def growth(problem: Problem, t: float, y: FloatArray) -> float:
    """The greatest rate at which a small deviation from a state grows, 1/s; 0 if none does, or if
    the Jacobian is not finite.
    """
    try:
        matrix = problem.jacobian(t, y)
    except (ArithmeticError, ValueError):
        return 0.0
    if not np.isfinite(matrix).all():
        return 0.0
    return float(np.linalg.eigvals(matrix).real.max(initial=0.0))


def step_noise(
    derivative: Callable[[float, FloatArray], FloatArray],
    jacobian: Callable[[float, FloatArray], FloatArray],
    t: float,
    y: FloatArray,
    span: float,
) -> FloatArray:
    """The greatest change of each state (ny,) in a step from `y` at `t` by rounding errors of the
    derivative; 0 if no mode is fast compared with a run of `span` s.
    """
    return _modes_and_noise(derivative, jacobian, t, y, span, MANY)[1]


def least_tolerance(method: str, rtol: float) -> float:
    """The least absolute tolerance that a method can meet, in units of the noise of a step.

    Radau and BDF solve their equations to a fraction of the tolerance, √rtol, as in SciPy.
    """
    if method.startswith(SOLVED):
        return 1 / max(10 * EPS / rtol, min(0.03, math.sqrt(rtol)))
    return NOISY


def _modes_and_noise(
    derivative: Callable[[float, FloatArray], FloatArray],
    jacobian: Callable[[float, FloatArray], FloatArray],
    t: float,
    y: FloatArray,
    span: float,
    least: float,
) -> tuple[NDArray[np.complex128], FloatArray]:
    """The modes at a state, 1/s, and the noise of a step; none if a value is not finite. The noise
    is 0 unless a run of `span` s has more than `least` time constants of the fastest mode.
    """
    random, nothing = np.random.default_rng(0), np.zeros_like(y)
    none = np.zeros(0, dtype=np.complex128), nothing
    try:
        matrix, here, rounded = jacobian(t, y), derivative(t, y), nothing
        for _ in range(PROBES):
            moved = np.nextafter(y, random.choice([-np.inf, np.inf], size=len(y)))
            rounded = np.maximum(rounded, np.abs(derivative(t, moved) - here) / 2)
    except (ArithmeticError, ValueError):
        return none
    if not (np.isfinite(matrix).all() and np.isfinite(rounded).all()):
        return none
    modes = np.asarray(np.linalg.eigvals(matrix), dtype=np.complex128)
    rate, most = float(np.abs(modes).max(initial=0.0)), nothing
    if rate * span <= least:
        return modes, nothing
    for h in np.array(STEPS) / rate:
        inverse = np.linalg.inv(np.eye(len(y)) - h * ROTATION * matrix)
        most = np.maximum(most, h * np.abs(inverse) @ rounded)
    return modes, most
