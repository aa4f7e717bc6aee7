"""RATTLE: the leapfrog of mechanisms with constraints. Order 2, symplectic, symmetric.

For a Hamiltonian system with a mass matrix that depends on positions (Hairer, Lubich, Wanner,
Geometric Numerical Integration, VII.1.4; H. C. Andersen, J. Comput. Phys. 52 (1983) 24-34, for
particles). With p = M v and the gradients of the kinetic energy T by q at fixed v,

    p' = p + h/2 (∂T/∂q(q, a) + F(q)) + J(q)ᵀ λ,    M(q) a = M(r) b = p'
    r = q + h/2 (a + b),    g(r) = 0
    s = p' + h/2 (∂T/∂q(r, b) + F(r)) + J(r)ᵀ μ,    M(r) w = s,    J(r) w = 0

leads from q and v to r and w. F are the forces, up to those along Jᵀ, which λ and μ make up for:
M v̇ at rest.
"""

from typing import cast

import numpy as np

from eomgen.errors import RunError
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.elimination import Factors, factored, product
from eomgen.run.integrators.interface import Change
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import Projection, without

MOST = 60
"""Most iterations of a step; they converge linearly, by about h times the fastest rate."""
ROUNDOFF = 4 * float(np.finfo(np.float64).eps)
NOISE = 1e-12
"""A change below this fraction of the coordinates is rounding if it is not smaller than that of two
iterations before. From one to the next it may grow while the iteration converges."""
CHECKS, STEP, SAME = 3, 1e-5, 1e-6
"""States at which forces are checked, the step of differences, and what counts as equal."""
REMEDY = "take a smaller --dt or an adaptive method (--integrator DOP853)"


def prepare(problem: Problem) -> Change:
    """Return `change(problem, t, y, h) -> y(t + h) - y(t)`, (ny,), for this problem.

    Raises `RunError` if it has states that RATTLE does not take.
    """
    why = _refused(problem)
    if why:
        raise RunError(
            f"integrator: leapfrog takes mechanisms with constraints whose forces depend on "
            f"positions alone, and {why}; take --integrator implicit_midpoint or gauss_4"
        )
    return change


def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
    """A step. Raises `StepFailure` if the iteration does not converge."""
    held = cast(Projection, problem.projection)
    nq, half = held.coordinates, h / 2
    q, v = y[:nq], y[nq:]

    def force(mass: FloatArray, at: FloatArray) -> FloatArray:
        still = np.concatenate((at, np.zeros(nq)))
        return product(mass, problem.derivative(t, still)[nq:])

    def slopes(at: FloatArray, speed: FloatArray) -> FloatArray:
        return held.kinetic_slopes(t, np.concatenate((at, speed)))

    here, columns = held.inertia(t, y), held.scaled_jacobian(t, y).T
    mass = _factored(here)
    ways = _solved(mass, columns)
    begun = product(here, v) + half * force(here, q)
    a = b = v
    multipliers, step, before = np.zeros(columns.shape[1]), h * v, [np.inf, np.inf]
    for _ in range(MOST):
        there = np.concatenate((q + step, b))
        middle = begun + half * slopes(q, a) + product(columns, multipliers)
        after, last_mass = held.scaled_jacobian(t, there), held.inertia(t, there)
        a, b = mass.solve(middle), _factored(last_mass).solve(middle)
        new = half * (a + b)
        off = held.residuals(t, np.concatenate((q + new, b))) / held.sizes
        more = _factored(h * product(after, ways)).solve(off)
        multipliers = multipliers - more
        moved = max(_largest(new - step), _largest(h * product(ways, more)))
        step, size = new, _largest(new)
        stalls = before[-2] <= moved <= NOISE * (_largest(q) + size)
        if moved <= ROUNDOFF * size or stalls:
            break
        before.append(moved)
    else:
        raise StepFailure(f"the step did not converge in {MOST} iterations", REMEDY)
    r = q + step
    there = np.concatenate((r, b))
    last_mass = held.inertia(t, there)
    last = middle + half * (force(last_mass, r) + slopes(r, b))
    mass = _factored(last_mass)
    w, ways = mass.solve(last), _solved(mass, after.T)
    w = w - product(ways, _factored(product(after, ways)).solve(product(after, w)))
    return np.concatenate((step, w - v))


def _factored(matrix: FloatArray) -> Factors:
    factors = factored(-matrix, 0.0, 0)
    if factors is None:
        raise StepFailure("the mass matrix, or that of the constraints, is singular", REMEDY)
    return factors


def _solved(factors: Factors, columns: FloatArray) -> FloatArray:
    """The solutions for right sides (n, k)."""
    return np.array([factors.solve(column) for column in columns.T]).T


def _largest(values: FloatArray) -> float:
    return float(np.abs(values).max())


def _refused(problem: Problem) -> str:
    """Why RATTLE cannot make the steps; "" if it can."""
    held = cast(Projection, problem.projection)
    if problem.quaternions:
        return "this one has orientations by quaternions"
    if len(problem.states) != 2 * held.coordinates:
        return "this one has controller states"
    if problem.contacts is not None:
        return "those of rigid contacts that are held depend on velocities"
    if problem.timed:
        return "this one depends on time"
    if held.inertia is without or held.kinetic_slopes is without:
        return "the module lacks mass_matrix and kinetic_slopes, which simulate asks for"
    return _forces_of_velocity(problem, held)


def _forces_of_velocity(problem: Problem, held: Projection) -> str:
    """Why forces are not those at rest: at seeded velocities that keep the constraints,
    M v̇ + Ṁ v - ∂T/∂q, up to what acts along Jᵀ, is compared with that at rest. "" if they are.
    """
    y, nq, seeded = problem.initial, held.coordinates, np.random.default_rng(1)
    jacobian = held.jacobian(0.0, y)
    mass, still = held.inertia(0.0, y), np.concatenate((y[:nq], np.zeros(nq)))
    at_rest = mass @ problem.derivative(0.0, still)[nq:]
    for _ in range(CHECKS):
        v = seeded.normal(size=nq)
        v -= np.linalg.lstsq(jacobian, jacobian @ v, rcond=1e-9)[0]
        moving = np.concatenate((y[:nq], v))
        ends = (held.inertia(0.0, moving + e * np.concatenate((v, 0 * v))) for e in (STEP, -STEP))
        ahead, behind = (m @ v for m in ends)
        change = mass @ problem.derivative(0.0, moving)[nq:] + (ahead - behind) / (2 * STEP)
        other = change - held.kinetic_slopes(0.0, moving) - at_rest
        left = other - jacobian.T @ np.linalg.lstsq(jacobian.T, other, rcond=1e-9)[0]
        size = float(np.abs(change).max() + np.abs(at_rest).max())
        worst = int(np.abs(left).argmax())
        if abs(left[worst]) > SAME * size:
            return f"that on {problem.states[worst]} depends on velocities"
    return ""
