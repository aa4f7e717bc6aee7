"""The steps of a derivation on polygons: what each determines, and an equation for each freedom."""

from collections.abc import Iterator, Sequence

import sympy as sp

from eomgen.derivation.constraints import DerivedConstraint
from eomgen.derivation.dots import dotted
from eomgen.derivation.effects import equations_of
from eomgen.derivation.embedding import Embedding, Polygon, projected, solved_for
from eomgen.derivation.loops import FORCES, acting_steps, loop_words, matrix
from eomgen.derivation.matrices import Matrices
from eomgen.derivation.simplified import by_cramer, simplified, size
from eomgen.derivation.steps import Definition, Equation, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.model.model import Model

FREE = (
    "The columns of K are the motions that the constraints allow. A constraint force does no work "
    "in them, so Kᵀ takes all of them out of M dv/dt + V + G = F, the equations of the tree. With "
    "dv/dt = K du/dt + κ this leaves M_r du/dt + V_r + G_r = F_r, one equation for each freedom: "
    "M_r = "
    "KᵀM K, V_r = Kᵀ(V + M κ), G_r = KᵀG, F_r = KᵀF."
)
ALGORITHM = (
    "The columns of K are the motions that the constraints allow. A constraint force does no work "
    "in them, so Kᵀ takes all of them out of M dv/dt + h_0 = Jᵀ λ, the equations of the tree. With "
    "dv/dt = K du/dt + κ this leaves M_r du/dt + h_r = 0, one equation for each freedom."
)
MOST_WRITTEN = 80
"""The size of an acceleration up to which it is written without names for its parts."""


def polygon_steps(model: Model, found: Embedding) -> Iterator[Step]:
    """Each constraint, and the coordinates, velocities and accelerations that follow from it."""
    for polygon in found.polygons:
        constraint = next(c for c in model.constraints if c.name == polygon.constraint)
        title = f"Constraint `{polygon.constraint}`"
        lines = [
            Equation(real(f"g_{row.name}"), row.position)
            for row in polygon.rows
            if row.position is not None
        ]
        lines += equations_of(polygon.lengths)
        lines += equations_of(polygon.positions)
        yield Step(
            "constraint", f"{title}: positions", _where(model, constraint, polygon), tuple(lines)
        )
        yield Step("constraint", f"{title}: velocities", *_velocities(polygon))
        yield Step("constraint", f"{title}: accelerations", *_accelerations(polygon))


def _where(model: Model, constraint: object, polygon: Polygon) -> str:
    words = "g is what the constraint keeps at 0. It determines what follows."
    if closes := loop_words(model, constraint):
        words = f"{closes}: g is the distance of its two ends, kept at 0. The polygon gives what "
        words += "follows."
    if polygon.lengths:
        words += (
            " w is the root of a quadratic equation. Its sign is that of the branch on which the "
            "mechanism is assembled, and stays while the mechanism passes no dead point."
        )
    if any(symbol.name.startswith("e_") for symbol, _ in polygon.lengths):
        words += " e is the direction of a bar, from which atan2 takes the angle."
    return words


def _velocities(polygon: Polygon) -> tuple[str, tuple[Equation, ...]]:
    words = (
        "The derivative of g is 0: a linear equation for each row, solved for the dependent "
        "velocities."
    )
    if polygon.ratios:
        words += " K is the ratio of a dependent velocity to an independent one."
    lines = [Equation(real(dotted(f"g_{row.name}")), row.speed) for row in polygon.rows]
    lines = [line for line in lines if size(line.right) > 1]
    pairs = (*polygon.ratios, *polygon.velocities)
    return words, (*lines, *equations_of(pairs))


def _accelerations(polygon: Polygon) -> tuple[str, tuple[Equation, ...]]:
    words = "The same for the second derivative."
    if polygon.drifts:
        words += " κ is the dependent acceleration where the independent ones are 0."
    return words, tuple(equations_of((*polygon.drifts, *polygon.rates)))


def freedom_steps(
    found: Embedding, tree: Matrices, constraints: Sequence[DerivedConstraint]
) -> tuple[list[Step], Matrices]:
    """The equations of the freedoms and their solution, the constraint forces; and the former as
    matrices, without the definitions of effects.
    """
    model, K = found.model, found.K
    reduced = projected(K, found.kappa, tree.each(lambda e: e.xreplace(found.same)))
    k, names = K.cols, zip("MVGF", reduced.whole, strict=True)
    letters = [Equation(sp.Symbol(f"{x}_r"), e[0] if k == 1 else e) for x, e in names]
    motions = [Equation(sp.Symbol("K"), K)] if k > 1 or K.rows > 1 else []
    if any(found.kappa):
        motions.append(Equation(sp.Symbol("kappa"), found.kappa))
    steps = [Step("equations", "One equation for each freedom", FREE, (*motions, *letters))]
    rates = tuple(real(model.velocities[j].acceleration) for j in found.independent)
    solved = tuple(solved_for([x.name for x in rates], reduced))
    shown: Sequence[Definition] = solved
    words = "Solved for the accelerations of the freedoms; those of the other coordinates follow."
    if k == 1 and size(solved[0][1]) > MOST_WRITTEN:
        signs = (("F", 1), ("V", -1), ("G", -1))
        kept = (sign * real(f"{x}_r") for x, sign in signs if getattr(reduced, x)[0] != 0)
        shown = [(solved[0][0], sum(kept, sp.S.Zero) / real("M_r"))]
    elif k > 1:
        words += (
            " From the last freedom to the first each is eliminated: d is a pivot, and b what is "
            "left of F_r - V_r - G_r."
        )
    steps.append(Step("solution", "Solved", words, tuple(equations_of(shown))))
    steps += _force_steps(found, tree, constraints)
    matrices = Matrices(
        *reduced.whole,
        tuple(real(model.coordinates[i].name) for i in model.state_coordinates),
        tuple(real(model.velocities[j].name) for j in found.independent),
        rates,
        (*found.definitions, *solved),
        tree.formulas,
    )
    return steps, matrices


def _force_steps(
    found: Embedding, tree: Matrices, constraints: Sequence[DerivedConstraint]
) -> Iterator[Step]:
    """λ of each constraint, and its forces: the motion is known."""
    model = found.model
    rates = sp.Matrix([real(c.acceleration) for c in model.velocities])
    missing = tree.M * rates + tree.V + tree.G - tree.F
    names = [c.name for c in model.velocities]
    lines = [
        Equation(missing_symbol(symbol.name), simplified(missing[names.index(symbol.name)]))
        for polygon in found.polygons
        for symbol, _ in polygon.velocities
    ]
    yield Step(
        "force", "The forces of the constraints", FORCES, (*lines, *_multiplier_lines(found))
    )
    yield from acting_steps(constraints)


def missing_symbol(velocity: str) -> Expr:
    """What the constraints must add to the force along a velocity."""
    return real(f"R_{velocity.removesuffix('_dot')}")


def _multiplier_lines(found: Embedding) -> list[Equation]:
    """λ of each polygon, from the last to the first: each is pulled by those behind it."""
    lines: list[Equation] = []
    names = [c.name for c in found.model.velocities]
    pulled: dict[int, Expr] = {}
    for polygon in reversed(found.polygons):
        own = [names.index(symbol.name) for symbol, _ in polygon.velocities]
        left = [missing_symbol(names[j]) - pulled.get(j, sp.S.Zero) for j in own]
        block = sp.Matrix(
            [[dict(row.slopes).get(names[j], sp.S.Zero) for row in polygon.rows] for j in own]
        )
        tops, whole = by_cramer(block, left)
        for row, top in zip(polygon.rows, tops, strict=True):
            lines.append(Equation(row.multiplier, simplified(top / whole)))
            for name, slope in row.slopes:
                j = names.index(name)
                pulled[j] = pulled.get(j, sp.S.Zero) + slope * row.multiplier
    return lines


def freedom_algorithm(found: Embedding, constraints: Sequence[DerivedConstraint]) -> Iterator[Step]:
    """The same where M and h come from an algorithm: as matrices."""
    n, k = found.K.shape
    model = found.model
    M, K, h = matrix("M", n, n), matrix("K", n, k), matrix("h_0", n, 1)
    kappa, rate = matrix("kappa", n, 1), matrix(dotted("u"), k, 1)
    reduced, rest = matrix("M_r", k, k), matrix("h_r", k, 1)
    lines = [
        Equation(K, sp.ImmutableMatrix(found.K)),
        Equation(kappa, sp.ImmutableMatrix(found.kappa)),
        Equation(reduced, sp.MatMul(K.T, M, K)),
        Equation(rest, sp.MatMul(K.T, sp.MatAdd(h, sp.MatMul(M, kappa)))),
        Equation(rate, sp.MatMul(-1, sp.Inverse(reduced), rest)),
    ]
    yield Step("equations", "One equation for each freedom", ALGORITHM, tuple(lines))
    own = sp.Matrix([real(model.velocities[j].acceleration) for j in found.independent])
    all_of_them = sp.Matrix([real(c.acceleration) for c in model.velocities])
    whole = matrix(dotted("v"), n, 1)
    lines = [Equation(own, rate), *equations_of(found.rates)]
    yield Step(
        "solution", "Solved", "The accelerations of the freedoms, and of the others.", tuple(lines)
    )
    forces = sp.Matrix([missing_symbol(c.name) for c in model.velocities])
    lines = [
        Equation(whole, sp.ImmutableMatrix(all_of_them)),
        Equation(forces, sp.MatAdd(sp.MatMul(M, whole), h)),
        *_multiplier_lines(found),
    ]
    yield Step("force", "The forces of the constraints", FORCES, tuple(lines))
    yield from acting_steps(constraints)
