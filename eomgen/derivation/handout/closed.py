"""The `closed` route: the handout's derivation from joint constraint to closed form, by SymPy."""

from dataclasses import dataclass, replace

import sympy as sp

from eomgen.base.errors import SceneError
from eomgen.derivation.handout.elimination import (
    body_rows,
    collect,
    joint_forces,
    symmetric,
    trees,
)
from eomgen.derivation.handout.free_bodies import FreeBodies, draw_free_bodies
from eomgen.derivation.handout.kinematics import Kinematics, differentiate_joints
from eomgen.derivation.handout.solution import Solution, solve
from eomgen.derivation.handout.symbols import BodySymbols, body_symbols
from eomgen.derivation.rewriting import by_variables, tidy
from eomgen.derivation.steps import Definition
from eomgen.derivation.supported import off_centre, why_not_pins
from eomgen.derivation.symbols import Expr
from eomgen.derivation.terms import Terms
from eomgen.language.formula import is_zero
from eomgen.model.model import Model


@dataclass(frozen=True)
class Equations:
    """A model's equations of motion, by the handout's derivation.

    `collected` is (24) in the handout's rows; `symmetric` the same equations in generalised forces,
    with M = Mᵀ; `solution` the closed form; `joint_force` the recovered force f_j of every joint,
    as definitions over the accelerations.
    """

    kinematics: Kinematics
    free_bodies: FreeBodies
    collected: Terms
    symmetric: Terms
    solution: Solution
    joint_force: tuple[Definition, ...]

    @property
    def model(self) -> Model:
        """The model."""
        return self.kinematics.model

    @property
    def symbols(self) -> BodySymbols:
        """Its symbols."""
        return self.kinematics.symbols


def derive(model: Model) -> Equations:
    """Derive, eliminate and solve; see the modules of this package for each step. Raises
    `SceneError` for a model without a closed form.
    """
    return solved(collected_equations(model))


def solved(equations: Equations) -> Equations:
    """The same with their solution."""
    kin = equations.kinematics
    right_side = body_rows(kin, equations.collected.right)
    right_side += _generalised_forces(kin.model, kin.symbols)
    return replace(equations, solution=solve(kin, right_side))


def collected_equations(model: Model) -> Equations:
    """The equations without a solution.

    Raises `SceneError` for a model without a closed form.
    """
    if why_not := why_not_pins(model):
        raise SceneError(f"route: 'closed' does not derive this scene: {why_not}")
    kin = differentiate_joints(model, body_symbols(model))
    free_bodies = draw_free_bodies(kin)
    collected = collect(kin, free_bodies)
    generalised = collected.each(lambda matrix: symmetric(kin, matrix))
    forces = _recovered_forces(kin, free_bodies)
    return Equations(kin, free_bodies, collected, generalised, Solution((), (), ()), forces)


def _generalised_forces(model: Model, symbols: BodySymbols) -> Expr:
    """Forces τ on the coordinates as rows of the bodies: τ turns the child, -τ the parent."""
    rows = list(symbols.tau)
    for body, last in zip(model.bodies, model.angle_index, strict=True):
        if body.parent >= 0:
            rows[model.angle_index[body.parent]] -= symbols.tau[last]
    return sp.Matrix(rows)


def _recovered_forces(kin: Kinematics, free_bodies: FreeBodies) -> tuple[Definition, ...]:
    model, residuals = kin.model, []
    for k, ((x, y), _) in enumerate(kin.inertial):
        (wx, wy), (fx, fy) = free_bodies.gravity[k][0], free_bodies.applied[k][0]
        residuals.append((x - wx - fx, y - wy - fy))
    found = joint_forces(model, residuals)
    return tuple(
        (symbol, expression)
        for tree in trees(model)
        for k in tree.bodies
        if model.bodies[k].joint.holds
        for symbol, expression in zip(kin.symbols.force[k], found[k], strict=True)
    )


def conditions(equations: Equations) -> tuple[tuple[str, Expr, bool], ...]:
    """The conditions on a user's parameters under which the closed form holds: quantities that must
    be positive, each with its name and whether it may be 0.
    """
    model, symbols = equations.model, equations.symbols
    found: list[tuple[str, Expr, bool]] = []
    for k, body in enumerate(model.bodies):
        found.append((f"mass of {body.name}", symbols.mass[k], False))
        if not is_zero(body.moment):
            # If the joint is not at the centre of mass, m r² alone makes the mass matrix regular.
            may_vanish = model.form == "velocity" and off_centre(body.joint)
            found.append((f"inertia_com of {body.name}", symbols.inertia[k], may_vanish))
    return tuple(found)


def written_out_forces(equations: Equations) -> tuple[Definition, ...]:
    """The joint forces over the bodies' angular motion only.

    In m ẍ + m g the weight that ẍ contains cancels in numbers, which loses digits of a small force
    on a heavy body. Written out and collected it cancels symbolically.
    """
    model, symbols, kin = equations.model, equations.symbols, equations.kinematics
    found = dict(equations.solution.definitions)
    sums = dict(equations.solution.masses)
    definitions = []
    for symbol, expression in equations.joint_force:
        for k in reversed(range(len(model.bodies))):
            ddx, ddy = symbols.xdd[k], symbols.ydd[k]
            if not model.bodies[k].joint.holds:
                inner = (found[ddx], found[ddy])
            else:
                inner = tuple(e.xreplace(kin.inward) for e in kin.acceleration[k])
            expression = expression.xreplace({ddx: inner[0], ddy: inner[1]})
        definitions.append((symbol, by_variables(tidy(expression), symbols.fixed, sums)))
    return tuple(definitions)
