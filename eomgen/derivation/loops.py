"""The steps of a derivation on constraints: from g = 0 to an equation for each freedom."""

from collections.abc import Iterator, Sequence

import sympy as sp

from eomgen.derivation.constraints import DerivedConstraint, DerivedRow
from eomgen.derivation.dots import dotted
from eomgen.derivation.effects import equations_of
from eomgen.derivation.embedding import Embedding, Polygon, projected, solved_for
from eomgen.derivation.matrices import Matrices
from eomgen.derivation.simplified import by_cramer, simplified, size
from eomgen.derivation.steps import Definition, Equation, Step
from eomgen.derivation.symbols import Expr, real
from eomgen.dynamics.start.walks import safely_dependent
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
MOST_WRITTEN = 80
"""The size of an acceleration up to which it is written without names for its parts."""


# With positions in closed form.


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
    loop = next((loop for loop in model.loops if loop is constraint), None)
    if loop is None:
        words = "g is what the constraint keeps at 0. It determines what follows."
    else:
        words = (
            f"The {loop.joint.type} joint between `{loop.joint.parent}` and `{loop.joint.child}` "
            "closes a "
            "loop: g is the distance of its two ends, kept at 0. The polygon gives what follows."
        )
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
    whole = [e.xreplace(found.same) for e in (tree.M, tree.V, tree.G, tree.F)]
    M, vectors = projected(K, found.kappa, whole[0], dict(zip("VGF", whole[1:], strict=True)))
    k = K.cols
    letters = [
        Equation(sp.Symbol("M_r"), M),
        *(Equation(sp.Symbol(f"{x}_r"), e) for x, e in vectors.items()),
    ]
    if k == 1:
        letters = [Equation(line.left, line.right[0]) for line in letters]
    matrix = [Equation(sp.Symbol("K"), K)] if k > 1 or K.rows > 1 else []
    if any(found.kappa):
        matrix.append(Equation(sp.Symbol("kappa"), found.kappa))
    steps = [Step("equations", "One equation for each freedom", FREE, (*matrix, *letters))]
    names = [model.velocities[j].acceleration for j in found.independent]
    right = vectors["F"] - vectors["V"] - vectors["G"]
    solved = tuple(solved_for(names, M, right))
    shown: Sequence[Definition] = solved
    words = "Solved for the accelerations of the freedoms; those of the other coordinates follow."
    if k == 1 and size(solved[0][1]) > MOST_WRITTEN:
        one = [real(f"{x}_r") for x in "FVGM"]
        kept = [x for x, e in zip(one[:3], (vectors[y][0] for y in "FVG"), strict=True) if e != 0]
        total = sum((x if x.name[0] == "F" else -x for x in kept), sp.S.Zero)
        shown = [(solved[0][0], total / one[3])]
    elif k > 1:
        words += (
            " From the last freedom to the first each is eliminated: d is a pivot, and b what is "
            "left of F_r - V_r - G_r."
        )
    steps.append(Step("solution", "Solved", words, tuple(equations_of(shown))))
    steps += _force_steps(found, tree, constraints)
    reduced = Matrices(
        tuple(real(model.coordinates[i].name) for i in model.state_coordinates),
        tuple(real(model.velocities[j].name) for j in found.independent),
        tuple(real(name) for name in names),
        M,
        vectors["V"],
        vectors["G"],
        vectors["F"],
        (*found.definitions, *solved),
        tree.formulas,
    )
    return steps, reduced


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
    M, K, h = _matrix("M", n, n), _matrix("K", n, k), _matrix("h_0", n, 1)
    kappa, rate = _matrix("kappa", n, 1), _matrix(dotted("u"), k, 1)
    reduced, rest = _matrix("M_r", k, k), _matrix("h_r", k, 1)
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
    whole = _matrix(dotted("v"), n, 1)
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


def bias_of(n: int) -> tuple[Equation, ...]:
    """What h is, where V, G and F are written out."""
    V, G, F = (_matrix(x, n, 1) for x in "VGF")
    return (Equation(_matrix("h_0", n, 1), sp.MatAdd(V, G, sp.MatMul(-1, F))),)


def acting_steps(constraints: Sequence[DerivedConstraint]) -> Iterator[Step]:
    """What the multipliers exert on the bodies or along the coordinates."""
    for derived in constraints:
        lines = tuple(equations_of(derived.force.definitions))
        words = "What λ exerts on the bodies or along the coordinates."
        if lines:
            yield Step("force", f"Constraint `{derived.constraint.name}`: its forces", words, lines)


# With all coordinates as the state.


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


def elimination_steps(
    model: Model, constraints: Sequence[DerivedConstraint], bias: Sequence[Equation] = ()
) -> Iterator[Step]:
    """v̇ of a mechanism whose state has all coordinates, and then the constraint forces; `bias` "
    "says
    what h is.
    """
    rows = [row for derived in constraints for row in derived.rows]
    m, n = len(rows), len(model.velocities)
    names = [c.name for c in model.velocities]
    lines = [
        *bias,
        Equation(_matrix("beta", m, 1), sp.Matrix([real(f"beta_{r.name}") for r in rows])),
    ]
    if m * n <= MOST:
        matrix = sp.Matrix(m, n, lambda i, j: _entry(rows[i], names[j]))
        lines.append(Equation(_matrix("J", m, n), matrix))
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
    known = Equation(_matrix("lambda", m, 1), sp.Matrix([row.multiplier for row in rows]))
    yield Step("force", "The forces of the constraints", FORCES, (known, _multipliers(model, m, n)))
    yield from acting_steps(constraints)


def _one_by_one(rates: Sequence[str]) -> Equation:
    """The entries of v̇."""
    return Equation(sp.Matrix([real(name) for name in rates]), _matrix(dotted("v"), len(rates), 1))


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
    beta, M, K = _matrix("beta", m, 1), _matrix("M", n, n), _matrix("K", n, k)
    kappa, h, rate = _matrix("kappa", n, 1), _matrix("h_0", n, 1), _matrix(dotted("v_i"), k, 1)
    inverse = sp.Inverse(first)
    turned = sp.MatMul(-1, inverse, second)
    yield Equation(K, sp.BlockMatrix([[turned], [sp.Identity(k)]]))
    bent = sp.MatMul(-1, inverse, beta)
    yield Equation(kappa, sp.BlockMatrix([[bent], [sp.ZeroMatrix(k, 1)]]))
    force = sp.MatAdd(h, sp.MatMul(M, kappa))
    yield Equation(rate, sp.MatMul(-1, sp.Inverse(sp.MatMul(K.T, M, K)), K.T, force))
    yield Equation(_matrix(dotted("v"), n, 1), sp.MatAdd(sp.MatMul(K, rate), kappa))


def _range_space(m: int, n: int) -> Iterator[Equation]:
    M, J, inverse = _matrix("M", n, n), _matrix("J", m, n), sp.Inverse(_matrix("M", n, n))
    free, square = _matrix("a_0", n, 1), _matrix("A", m, m)
    yield Equation(free, sp.MatMul(-1, inverse, _matrix("h_0", n, 1)))
    yield Equation(square, sp.MatMul(J, sp.Inverse(M), J.T))
    open_by = sp.MatAdd(sp.MatMul(J, free), _matrix("beta", m, 1))
    change = sp.MatMul(-1, inverse, J.T, sp.Inverse(square), open_by)
    yield Equation(_matrix(dotted("v"), n, 1), sp.MatAdd(free, change))


def _multipliers(model: Model, m: int, n: int) -> Equation:
    """λ, by the rows of v_d or by all."""
    left = _matrix("lambda", m, 1)
    if by_independent_velocities(model):
        M, h = _matrix("M", n, n), _matrix("h_0", n, 1)
        needed = sp.MatAdd(sp.MatMul(M, _matrix(dotted("v"), n, 1)), h)
        pick = sp.BlockMatrix([[sp.Identity(m), sp.ZeroMatrix(m, n - m)]])
        return Equation(left, sp.MatMul(sp.Inverse(_matrix("J_d", m, m).T), pick, needed))
    open_by = sp.MatAdd(sp.MatMul(_matrix("J", m, n), _matrix("a_0", n, 1)), _matrix("beta", m, 1))
    return Equation(left, sp.MatMul(-1, sp.Inverse(_matrix("A", m, m)), open_by))
