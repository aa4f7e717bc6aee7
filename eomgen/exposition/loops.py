"""The steps of a derivation on constraints: their equations, multipliers, and elimination."""

from collections.abc import Iterator, Sequence

import sympy as sp

from eomgen.derivation.dots import dotted
from eomgen.derivation.projected.symbols import real
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr
from eomgen.dynamics.closed_positions import safely_dependent
from eomgen.exposition.constraints import DerivedConstraint, DerivedRow
from eomgen.exposition.effects import equations_of
from eomgen.model.model import Model
from eomgen.tables.routes import ROUTES

POSITIONS = (
    "g is what the constraint keeps at 0; x, y, z and p are positions in the world. Its "
    "multiplier λ is the size of its force, and the force acts in the direction in which g grows: "
    "it does the work λ dg."
)
RATES = (
    "The first derivative of g is linear in the velocities. J has an entry for each velocity, the "
    "rate of g while this velocity is 1 and all others are 0; entries that are 0 are left out. β "
    "is what the second derivative is where dv/dt = 0."
)
FORCES = (
    "What the multipliers exert on the bodies or along the coordinates: the forces of which λ dg "
    "is the work. In the steps of the tree they are known forces, as those of effects are."
)
MULTIPLIERS = (
    "F of the steps before contains the forces of the constraints. It is a sum of F_0, which is F "
    "where all λ are 0, and of Jᵀ λ, so the equations of the tree are M dv/dt + V + G = F_0 + Jᵀ "
    "λ, with M symmetric, as `mass_matrix()` of the generated module returns it. As many further "
    "equations say that each g stays 0: J dv/dt + β = 0."
)
INDEPENDENT = (
    "By the constraints the velocities v_d follow from the others, v_i. In the order v_d, v_i of "
    "rows and columns, J consists of J_d and J_i, and the columns of N are the motions that all "
    "constraints allow: J N = 0. So Nᵀ takes λ out of the equations, and what is left has a row "
    "for each degree of freedom. γ is the acceleration of the dependent coordinates where those "
    "of the independent ones are 0. The rows of v_d then give λ. J_d has an inverse unless the "
    "mechanism is in a position where v_d does not follow from v_i, as at a dead point."
)
RANGE = (
    "dv/dt without constraints is a_0. It is corrected by M⁻¹ Jᵀ λ, and λ follows from A, which "
    "has a row for each constraint. A is symmetric, and positive definite unless a constraint "
    "follows from the others, as at a dead point."
)
BY_RECURSION = (
    " M is never formed: the algorithm above, without motion and loads and with a generalised "
    "force f at the joints, gives M⁻¹ f, and so the columns of M⁻¹ Jᵀ."
)
MOST = 48
"""The most entries of J up to which it is written as a matrix."""


def constraint_steps(model: Model, constraints: Sequence[DerivedConstraint]) -> Iterator[Step]:
    """Each constraint, its derivatives, and its forces."""
    for derived in constraints:
        constraint = derived.constraint
        words = _kind(model, derived)
        lines = equations_of(derived.definitions)
        lines += [
            Equation(real(f"g_{row.name}"), row.position)
            for row in derived.rows
            if row.position is not None
        ]
        left_out = [
            name for name, _ in constraint.row_names(model.dimensions) if name in model.dropped
        ]
        if left_out:
            words += f" Left out, because they follow from others: {', '.join(left_out)}."
        yield Step("", f"Constraint `{constraint.name}`", words, tuple(lines))
        lines = equations_of(derived.speeds)
        for row in derived.rows:
            lines.append(Equation(real(dotted(f"g_{row.name}")), row.speed))
        for row in derived.rows:
            for velocity, slope in row.slopes:
                lines.append(Equation(entry(row.name, velocity), slope))
        lines += [Equation(real(f"beta_{row.name}"), row.bend) for row in derived.rows]
        title = f"Constraint `{constraint.name}`, differentiated twice"
        yield Step("", title, RATES, tuple(lines))
        lines = equations_of(derived.force.definitions)
        yield Step("", f"Constraint `{constraint.name}`, its forces", FORCES, tuple(lines))


def _kind(model: Model, derived: DerivedConstraint) -> str:
    constraint = derived.constraint
    loop = next((loop for loop in model.loops if loop is constraint), None)
    if loop is None:
        return f"{derived.force.words}\n\n{POSITIONS}"
    joint = loop.joint
    return (
        f"The {joint.type} joint between `{joint.parent}` and `{joint.child}` closes a loop. "
        f"{POSITIONS}"
    )


def entry(row: str, velocity: str) -> Expr:
    """The name of an entry of J."""
    return real(f"J_{row},{velocity.removesuffix('_dot')}")


def solution_steps(
    model: Model, constraints: Sequence[DerivedConstraint], *, recursive: bool
) -> Iterator[Step]:
    """The equations with multipliers, and how these are eliminated."""
    if not constraints:
        return
    rows = [row for derived in constraints for row in derived.rows]
    m, n = len(rows), len(model.velocities)
    names = [c.name for c in model.velocities]
    matrix = sp.Matrix(m, n, lambda i, j: _entry(rows[i], names[j]))
    lines = [Equation(_matrix("lambda", m, 1), sp.Matrix([row.multiplier for row in rows]))]
    lines.append(Equation(_matrix("beta", m, 1), sp.Matrix([real(f"beta_{r.name}") for r in rows])))
    if m * n <= MOST:
        lines.append(Equation(_matrix("J", m, n), matrix))
    M, J, force = _matrix("M", n, n), _matrix("J", m, n), _matrix("F_0", n, 1)
    left = sp.MatAdd(
        sp.MatMul(M, _matrix(dotted("v"), n, 1)), _matrix("V", n, 1), _matrix("G", n, 1)
    )
    right = sp.MatAdd(force, sp.MatMul(J.T, _matrix("lambda", m, 1)))
    lines.append(Equation(left, right))
    bend = sp.MatAdd(sp.MatMul(J, _matrix(dotted("v"), n, 1)), _matrix("beta", m, 1))
    lines.append(Equation(bend, sp.ZeroMatrix(m, 1)))
    yield Step("", "The equations with multipliers", MULTIPLIERS, tuple(lines))
    if by_independent_velocities(model):
        title = "Elimination by independent velocities"
        yield Step("", title, INDEPENDENT, tuple(_independent(model, names)))
    else:
        words = RANGE + (BY_RECURSION if recursive else "")
        yield Step("", "Elimination of the multipliers", words, tuple(_range_space(m, n)))


def by_independent_velocities(model: Model) -> bool:
    """Whether the elimination that is shown is that by independent velocities; loop by loop it is
    that of the route `embedded`.
    """
    if model.route == "auto":
        return safely_dependent(model)
    return ROUTES[model.route].loops


def _entry(row: DerivedRow, velocity: str) -> Expr:
    return entry(row.name, velocity) if velocity in dict(row.slopes) else sp.S.Zero


def _matrix(name: str, rows: int, columns: int) -> Expr:
    return sp.MatrixSymbol(name, rows, columns)


def _independent(model: Model, names: Sequence[str]) -> Iterator[Equation]:
    dependent = [column for _, column in model.pivots]
    independent = [j for j in range(len(names)) if j not in dependent]
    m, k = len(dependent), len(independent)
    n = m + k
    for letter, columns in (("v_d", dependent), ("v_i", independent)):
        yield Equation(sp.Symbol(letter), sp.Matrix([[real(names[j]) for j in columns]]))
    first, second = _matrix("J_d", m, m), _matrix("J_i", m, k)
    beta, M, N = _matrix("beta", m, 1), _matrix("M", n, n), _matrix("N", n, k)
    gamma, rest = _matrix("gamma", n, 1), _matrix("F_0", n, 1)
    V, G, rate = _matrix("V", n, 1), _matrix("G", n, 1), _matrix(dotted("v_i"), k, 1)
    inverse = sp.Inverse(first)
    turned = sp.MatMul(-1, inverse, second)
    yield Equation(N, sp.BlockMatrix([[turned], [sp.Identity(k)]]))
    bent = sp.MatMul(-1, inverse, beta)
    yield Equation(gamma, sp.BlockMatrix([[bent], [sp.ZeroMatrix(k, 1)]]))
    force = sp.MatAdd(rest, sp.MatMul(-1, V), sp.MatMul(-1, G), sp.MatMul(-1, M, gamma))
    yield Equation(rate, sp.MatMul(sp.Inverse(sp.MatMul(N.T, M, N)), N.T, force))
    whole = _matrix(dotted("v"), n, 1)
    yield Equation(whole, sp.MatAdd(sp.MatMul(N, rate), gamma))
    needed = sp.MatAdd(sp.MatMul(M, whole), V, G, sp.MatMul(-1, rest))
    pick = sp.BlockMatrix([[sp.Identity(m), sp.ZeroMatrix(m, k)]])
    yield Equation(_matrix("lambda", m, 1), sp.MatMul(sp.Inverse(first.T), pick, needed))


def _range_space(m: int, n: int) -> Iterator[Equation]:
    M, J, inverse = _matrix("M", n, n), _matrix("J", m, n), sp.Inverse(_matrix("M", n, n))
    free, square, found = _matrix("a_0", n, 1), _matrix("A", m, m), _matrix("lambda", m, 1)
    V, G, force = (_matrix(name, n, 1) for name in ("V", "G", "F_0"))
    yield Equation(free, sp.MatMul(inverse, sp.MatAdd(force, sp.MatMul(-1, V), sp.MatMul(-1, G))))
    yield Equation(square, sp.MatMul(J, sp.Inverse(M), J.T))
    open_by = sp.MatAdd(sp.MatMul(J, free), _matrix("beta", m, 1))
    yield Equation(found, sp.MatMul(-1, sp.Inverse(square), open_by))
    yield Equation(_matrix(dotted("v"), n, 1), sp.MatAdd(free, sp.MatMul(inverse, J.T, found)))
