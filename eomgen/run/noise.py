"""What is fast in a motion, and what rounding alone makes of it.

A derivative in doubles is that of a state a few units in the last place away: of a spring of k N/m
on m kg, k ε s/m off. An implicit step of h solves y = h f(y), so that rounding of f moves its end
by (I - h J)^-1 h δf, which is greatest where h is about 1/|λ| of what is fast, and never as much as
h δf. A tolerance below that makes steps shrink to nothing.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eomgen.run.problem import FloatArray, Problem

PROBES = 8
"""States about one, each a unit in the last place away, that the derivative is evaluated at."""
STEPS = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Steps that are looked at, in times of the fastest mode, 1/|λ|."""
TURN = np.exp(0.25j * np.pi)
"""Steps are turned by this in the complex plane, where I - h J is singular neither for growing nor
for swinging modes: steps of a method that keeps its error are never near that."""
MANY, DAMPED = 1e4, 100.0
"""A motion is stiff where its fastest mode has more than `MANY` times its own time in the run, and
dies away `DAMPED` times over: explicit steps must follow it, and accuracy does not ask for that."""
SOLVED = ("Radau", "BDF")
"""Methods that solve their equations to a part of the tolerance."""
NOISY = 10.0
"""Times the noise of a step that a tolerance of the others is at least."""
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Fast:
    """What is fast in a motion.

    stiff  whether explicit steps would be many times shorter than accuracy needs
    noise  (ny,), the most that rounding of the derivative moves each state in a step
    """

    stiff: bool
    noise: FloatArray


def fast(problem: Problem, states: Iterable[tuple[float, FloatArray]], span: float) -> Fast:
    """What is fast at some times and states of a run of `span` s.

    Nothing is at a state where derivative or Jacobian have no finite value.
    """
    stiff, most = False, np.zeros(len(problem.states))
    for t, y in states:
        modes, noise = _looked_at(problem.derivative, problem.jacobian, t, y, span)
        quick = np.abs(modes) * span > MANY
        stiff = stiff or bool((-modes[quick].real * span > DAMPED).any())
        most = np.maximum(most, noise)
    return Fast(stiff, most)


def step_noise(
    derivative: Callable[[float, FloatArray], FloatArray],
    jacobian: Callable[[float, FloatArray], FloatArray],
    t: float,
    y: FloatArray,
    span: float,
) -> FloatArray:
    """The most that rounding of the derivative moves each state (ny,) in a step from `y` at `t`, as
    far as the motion is fast in a run of `span` s; else 0.
    """
    return _looked_at(derivative, jacobian, t, y, span)[1]


def least_tolerance(method: str, rtol: float) -> float:
    """Times the noise of a step: what a method's absolute tolerance is to be at least.

    Radau and BDF solve their equations to a part of the tolerance, √rtol, as SciPy has it.
    """
    if method.startswith(SOLVED):
        return 1 / max(10 * EPS / rtol, min(0.03, math.sqrt(rtol)))
    return NOISY


def _looked_at(
    derivative: Callable[[float, FloatArray], FloatArray],
    jacobian: Callable[[float, FloatArray], FloatArray],
    t: float,
    y: FloatArray,
    span: float,
) -> tuple[NDArray[np.complex128], FloatArray]:
    """The modes at a state, 1/s, and the noise of a step; none where there is no finite value."""
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
    if rate * span <= MANY:
        return modes, nothing
    for h in np.array(STEPS) / rate:
        inverse = np.linalg.inv(np.eye(len(y)) - h * TURN * matrix)
        most = np.maximum(most, h * np.abs(inverse) @ rounded)
    return modes, most
