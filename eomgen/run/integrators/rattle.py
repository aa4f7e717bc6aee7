"""RATTLE, the leapfrog of mechanisms with constraints: see `eomgen.engine.rattle`."""

from typing import cast

import numpy as np

from eomgen.base.errors import RunError
from eomgen.engine import few
from eomgen.engine.explicit import Step
from eomgen.engine.implicit import DIVERGES, SINGULAR, UNSOLVED
from eomgen.engine.rattle import MOST, Linked, rattle
from eomgen.engine.separable import moved_force
from eomgen.engine.structures import with_room
from eomgen.run.failure import StepFailure
from eomgen.run.integrators.interface import Change
from eomgen.run.problem import FloatArray, Problem
from eomgen.run.projection import Linkage, Projection, without

CHECKS = 3
"""Velocities at which forces are checked."""
REMEDY = "take a smaller --dt or an adaptive method (--integrator DOP853)"
WHY = {
    SINGULAR: "the mass matrix, or that of the constraints, is singular",
    DIVERGES: "the iteration of a step diverges",
    UNSOLVED: f"the step did not converge in {MOST} iterations",
}


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
    room, step = linked(problem), Step()

    def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
        made = rattle(linkage_of(problem), t, y, h, room, step)
        if made in WHY:
            raise StepFailure(WHY[made], REMEDY)
        return step.change

    return change


def sizes_of(problem: Problem) -> tuple[int, int]:
    """The number of coordinates, and that of constraints."""
    held = cast(Projection, problem.projection)
    return held.coordinates, len(held.names)


def linkage_of(problem: Problem) -> Linkage:
    """The constraints of a problem that has some, as the engine is given them."""
    return Linkage(cast(Projection, problem.projection), problem.derivative)


def linked(problem: Problem) -> Linked:
    """Room for steps of a problem that has constraints."""
    n, rows = sizes_of(problem)
    factors = {"first": few.factors_of(n), "second": few.factors_of(n)}
    return with_room(Linked, n=n, rows=rows, third=few.factors_of(rows), **factors)


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
    return _forces_of_velocity(problem)


def _forces_of_velocity(problem: Problem) -> str:
    """Why forces are not those at rest, at seeded velocities; "" if they are."""
    y, linkage, room = problem.initial, linkage_of(problem), linked(problem)
    n = room.n
    seeded = np.random.default_rng(1)
    for _ in range(CHECKS):
        moving = np.concatenate((y[:n], seeded.normal(size=n)))
        found = moved_force(linkage, moving, room)
        if found >= 0:
            return f"that on {problem.states[found]} depends on velocities"
    return ""
