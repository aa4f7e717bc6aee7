"""The steps of a derivation on constraints, all coordinates being the state."""

from collections.abc import Iterator, Sequence

import sympy as sp

from eomgen.derivation.constraints import DerivedConstraint, DerivedRow
from eomgen.derivation.dots import dotted
from eomgen.derivation.effects import equations_of
from eomgen.derivation.steps import Equation, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.dynamics.start.walks import safely_dependent
from eomgen.model.model import Model
from eomgen.tables.routes import ROUTES

matrix = sp.MatrixSymbol

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
    "The motion is known, and with it what the constraints must add to the tree: R = M dv/dt + V "
    "+ G - F. This is the force of which λ dg is the work, so Jᵀ λ = R."
)
INDEPENDENT = (
    "By the constraints the velocities v_d follow from the others, v_i. In the order v_d, v_i of "
    "rows and columns, J consists of J_d and J_i, and the columns of K are the motions that all "
    "constraints allow: J K = 0. A constraint force does no work in them, so Kᵀ takes all of them "
    "out of the equations of the tree, M dv/dt + h_0 = Jᵀ λ with h_0 = V + G - F, and what is "
    "left has a "
    "row for each freedom. κ is the acceleration of the dependent coordinates where those of the "
    "independent ones are 0. J_d has an inverse unless the mechanism is in a position where v_d "
    "does not follow from v_i, as at a dead point."
)
RANGE = (
    "The constraints are J dv/dt + β = 0, the equations of the tree M dv/dt + h_0 = Jᵀ λ with "
    "h_0 = V "
    "+ G - F. Without constraints dv/dt would be a_0. The least change that meets the constraints, "
    "in the measure of M, is that by their forces; A has a row for each constraint. A is "
    "symmetric, and positive definite unless a constraint follows from the others, as at a dead "
    "point."
)
MOST = 48
"""The most entries of J up to which it is written as a matrix."""


def constraint_steps(model: Model, constraints: Sequence[DerivedConstraint]) -> Iterator[Step]:
    """Each constraint, and its derivatives."""
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
        yield Step("constraint", f"Constraint `{constraint.name}`", words, tuple(lines))
        lines = equations_of(derived.speeds)
        for row in derived.rows:
            lines.append(Equation(real(dotted(f"g_{row.name}")), row.speed))
        for row in derived.rows:
            for velocity, slope in row.slopes:
                lines.append(Equation(entry(row.name, velocity), slope))
        lines += [Equation(real(f"beta_{row.name}"), row.bend) for row in derived.rows]
        title = f"Constraint `{constraint.name}`, differentiated twice"
        yield Step("constraint", title, RATES, tuple(lines))


def _kind(model: Model, derived: DerivedConstraint) -> str:
    closes = loop_words(model, derived.constraint)
    return f"{closes}. {POSITIONS}" if closes else f"{derived.force.words}\n\n{POSITIONS}"


def loop_words(model: Model, constraint: object) -> str:
    """That a constraint is a joint which closes a loop, if it is one."""
    joint = next((loop.joint for loop in model.loops if loop is constraint), None)
    if joint is None:
        return ""
    return f"The {joint.type} joint between `{joint.parent}` and `{joint.child}` closes a loop"


def entry(row: str, velocity: str) -> Expr:
    """The name of an entry of J."""
    return real(f"J_{row},{velocity.removesuffix('_dot')}")


def elimination_steps(
    model: Model, constraints: Sequence[DerivedConstraint], bias: Sequence[Equation] = ()
) -> Iterator[Step]:
    """v̇ of a mechanism whose state has all coordinates, and then the constraint forces; `bias`
    says what h is.
    """
    rows = [row for derived in constraints for row in derived.rows]
    m, n = len(rows), len(model.velocities)
    names = [c.name for c in model.velocities]
    lines = [
        *bias,
        Equation(matrix("beta", m, 1), sp.Matrix([real(f"beta_{r.name}") for r in rows])),
    ]
    if m * n <= MOST:
        entries = sp.Matrix(m, n, lambda i, j: _entry(rows[i], names[j]))
        lines.append(Equation(matrix("J", m, n), entries))
    rates = [c.acceleration for c in model.velocities]
    if by_independent_velocities(model):
        lines += _independent(model, names)
        dependent = [j for _, j in model.pivots]
        rates = [rates[j] for j in (*dependent, *(j for j in range(n) if j not in dependent))]
        lines.append(_one_by_one(rates))
        yield Step("equations", "One equation for each freedom", INDEPENDENT, tuple(lines))
    else:
        lines += [*_range_space(m, n), _one_by_one(rates)]
        yield Step("equations", "The accelerations that meet the constraints", RANGE, tuple(lines))
    known = Equation(matrix("lambda", m, 1), sp.Matrix([row.multiplier for row in rows]))
    yield Step("force", "The forces of the constraints", FORCES, (known, _multipliers(model, m, n)))
    yield from acting_steps(constraints)


def _one_by_one(rates: Sequence[str]) -> Equation:
    """The entries of v̇."""
    return Equation(sp.Matrix([real(name) for name in rates]), matrix(dotted("v"), len(rates), 1))


def by_independent_velocities(model: Model) -> bool:
    """Whether the elimination that is shown is that by independent velocities; loop by loop it is
    that of the route `embedded`.
    """
    if model.route == "auto":
        return safely_dependent(model)
    return ROUTES[model.route].loops


def _entry(row: DerivedRow, velocity: str) -> Expr:
    return entry(row.name, velocity) if velocity in dict(row.slopes) else sp.S.Zero


def _independent(model: Model, names: Sequence[str]) -> Iterator[Equation]:
    dependent = [column for _, column in model.pivots]
    independent = [j for j in range(len(names)) if j not in dependent]
    m, k = len(dependent), len(independent)
    n = m + k
    for letter, columns in (("v_d", dependent), ("v_i", independent)):
        yield Equation(sp.Symbol(letter), sp.Matrix([[real(names[j]) for j in columns]]))
    first, second = matrix("J_d", m, m), matrix("J_i", m, k)
    beta, M, K = matrix("beta", m, 1), matrix("M", n, n), matrix("K", n, k)
    kappa, h, rate = (
        matrix("kappa", n, 1),
        matrix("h_0", n, 1),
        matrix(dotted("v_i"), k, 1),
    )
    inverse = sp.Inverse(first)
    turned = sp.MatMul(-1, inverse, second)
    yield Equation(K, sp.BlockMatrix([[turned], [sp.Identity(k)]]))
    bent = sp.MatMul(-1, inverse, beta)
    yield Equation(kappa, sp.BlockMatrix([[bent], [sp.ZeroMatrix(k, 1)]]))
    force = sp.MatAdd(h, sp.MatMul(M, kappa))
    yield Equation(rate, sp.MatMul(-1, sp.Inverse(sp.MatMul(K.T, M, K)), K.T, force))
    yield Equation(matrix(dotted("v"), n, 1), sp.MatAdd(sp.MatMul(K, rate), kappa))


def _range_space(m: int, n: int) -> Iterator[Equation]:
    M, J, inverse = (
        matrix("M", n, n),
        matrix("J", m, n),
        sp.Inverse(matrix("M", n, n)),
    )
    free, square = matrix("a_0", n, 1), matrix("A", m, m)
    yield Equation(free, sp.MatMul(-1, inverse, matrix("h_0", n, 1)))
    yield Equation(square, sp.MatMul(J, sp.Inverse(M), J.T))
    open_by = sp.MatAdd(sp.MatMul(J, free), matrix("beta", m, 1))
    change = sp.MatMul(-1, inverse, J.T, sp.Inverse(square), open_by)
    yield Equation(matrix(dotted("v"), n, 1), sp.MatAdd(free, change))


def _multipliers(model: Model, m: int, n: int) -> Equation:
    """λ, by the rows of v_d or by all."""
    left = matrix("lambda", m, 1)
    if by_independent_velocities(model):
        M, h = matrix("M", n, n), matrix("h_0", n, 1)
        needed = sp.MatAdd(sp.MatMul(M, matrix(dotted("v"), n, 1)), h)
        pick = sp.BlockMatrix([[sp.Identity(m), sp.ZeroMatrix(m, n - m)]])
        return Equation(left, sp.MatMul(sp.Inverse(matrix("J_d", m, m).T), pick, needed))
    open_by = sp.MatAdd(sp.MatMul(matrix("J", m, n), matrix("a_0", n, 1)), matrix("beta", m, 1))
    return Equation(left, sp.MatMul(-1, sp.Inverse(matrix("A", m, m)), open_by))


def bias_of(n: int) -> tuple[Equation, ...]:
    """What h is, where V, G and F are written out."""
    V, G, F = (matrix(x, n, 1) for x in "VGF")
    return (Equation(matrix("h_0", n, 1), sp.MatAdd(V, G, sp.MatMul(-1, F))),)


def acting_steps(constraints: Sequence[DerivedConstraint]) -> Iterator[Step]:
    """What the multipliers exert on the bodies or along the coordinates."""
    for derived in constraints:
        lines = tuple(equations_of(derived.force.definitions))
        words = "What λ exerts on the bodies or along the coordinates."
        if lines:
            yield Step("force", f"Constraint `{derived.constraint.name}`: its forces", words, lines)
