"""The derivation step by step, numbered like the handout."""

from collections.abc import Iterator

import sympy as sp

from eomgen.derivation.dots import dotted
from eomgen.derivation.handout.closed import Equations
from eomgen.derivation.handout.elimination import rows_without_forces, symmetric, trees
from eomgen.derivation.handout.kinematics import Kinematics
from eomgen.derivation.reading import words_on_names
from eomgen.derivation.steps import Definition, Equation, Pairs, Step
from eomgen.derivation.symbols import Expr
from eomgen.language.formula import written


def handout_steps(equations: Equations) -> Iterator[Step]:
    """Every step from the state to the closed form, in the derivation's own symbols."""
    yield from _mechanism(equations)
    yield from _equations_of_motion(equations)
    yield from _solution(equations)


NOT_SYMMETRIC = (
    "Not symmetric: its rows are torques about the bodies' own centres. `mass_matrix()` of the "
    "generated module is the symmetric one."
)


def _mechanism(equations: Equations) -> Iterator[Step]:
    """State, free bodies, and the joints as constraints."""
    s, kin, model = equations.symbols, equations.kinematics, equations.model
    held = [k for k, body in enumerate(model.bodies) if body.joint.holds]
    yield Step.of(
        "state",
        "State",
        "Each body has the position x, y of its centre of mass, its momentum P = m v, its "
        "orientation and its angular momentum L = I ω. The joints leave the coordinates free."
        + words_on_names(model),
        [
            (sp.Symbol("Y"), _redundant_state(equations)),
            *zip(s.angle, kin.angle, strict=True),
            *zip(s.omega, kin.omega, strict=True),
        ],
        "(1)",
    )
    yield Step.of(
        "bodies",
        "Momenta and forces",
        "Force is dP/dt, torque is dL/dt. The joint force f_j acts on the parent, -f_j on the "
        "child; both are unknown. The forces of effects, (29) to (35), are among them.",
        [pair for k in range(len(model.bodies)) for pair in _momenta(equations, k)],
        "(2)-(11)",
    )
    yield Step.of(
        "balance",
        "Free bodies",
        f"The same for the accelerations: {_count(3 * len(model.bodies))} scalar equations in "
        f"{_count(3 * len(model.bodies) + 2 * len(held))} unknowns, the accelerations and the "
        "joint forces. What the joints say of the accelerations is missing.",
        list(equations.free_bodies.equations),
        "(12)-(17)",
    )
    arms = [pair for k in held for pair in _arms(kin, k)]
    yield Step.of(
        "joint", "Arms", "From each centre of mass to the joint, in world axes.", arms, "(18), (19)"
    )
    yield Step.of(
        "joint",
        "Constraint",
        "The two bodies share the joint: x_parent + r_parent = x_child + r_child. This gives the "
        "place of the child.",
        [pair for k in held for pair in (*_shared(equations, k), *_placed(equations, k))],
        "(20), (21)",
    )
    yield Step.of(
        "joint",
        "Constraint differentiated twice",
        "The child's acceleration, from the parent's and from the angular velocities and "
        "accelerations.",
        [
            pair
            for k in held
            for pair in zip((s.xdd[k], s.ydd[k]), kin.acceleration[k], strict=True)
        ],
        "(22), (23)",
    )


def _arms(kin: Kinematics, k: int) -> Iterator[Definition]:
    """The components of the arms of a body's joint."""
    name = kin.model.bodies[k].joint.name
    for word, arm in (("parent", kin.arm_parent[k]), ("child", kin.arm_child[k])):
        for axis, component in zip("xy", arm, strict=True):
            yield sp.Symbol(f"r_{name},{word},{axis}"), component


def _count(n: int) -> str:
    words = "zero one two three four five six seven eight nine ten eleven twelve".split()
    return words[n] if n < len(words) else str(n)


def _shared(equations: Equations, k: int) -> Pairs:
    """The place of a joint, by the parent and by the child (20)."""
    s, body = equations.symbols, equations.model.bodies[k]
    arms = {
        word: [sp.Symbol(f"r_{body.joint.name},{word},{axis}") for axis in "xy"]
        for word in ("parent", "child")
    }
    above = (s.x[body.parent], s.y[body.parent]) if body.parent >= 0 else (sp.S.Zero, sp.S.Zero)
    own = (s.x[k], s.y[k])
    return [(above[i] + arms["parent"][i], own[i] + arms["child"][i]) for i in range(2)]


def _placed(equations: Equations, k: int) -> Pairs:
    """The place of a child (21)."""
    s = equations.symbols
    return list(zip((s.x[k], s.y[k]), equations.kinematics.position[k], strict=True))


def _momenta(equations: Equations, k: int) -> Pairs:
    """Rates of place and momentum of a body, as in (4) to (7): by its momenta, by its forces."""
    s, name = equations.symbols, equations.model.bodies[k].name
    (_, fx), (_, fy), (_, torque) = equations.free_bodies.equations[3 * k : 3 * k + 3]
    px, py, spin = (sp.Symbol(f"{word}_{name}{axis}") for word, axis in
                    (("P", ",x"), ("P", ",y"), ("L", "")))  # fmt: skip
    dpx, dpy, dspin = (sp.Symbol(dotted(x.name)) for x in (px, py, spin))
    pairs = [(s.xd[k], px / s.mass[k]), (s.yd[k], py / s.mass[k]), (dpx, fx), (dpy, fy)]
    if s.inertia[k] != 0:
        pairs.append((s.omega[k], spin / s.inertia[k]))
    return [*pairs, (dspin, torque)]


def _redundant_state(equations: Equations) -> Expr:
    """The redundant state of all bodies (1): x, P, orientation, L."""
    s, row = equations.symbols, []
    for k, body in enumerate(equations.model.bodies):
        momentum = [sp.Symbol(f"P_{body.name},{axis}") for axis in "xy"]
        row += [s.x[k], s.y[k], *momentum, s.angle[k], sp.Symbol(f"L_{body.name}")]
    return sp.Matrix([row])


def _equations_of_motion(equations: Equations) -> Iterator[Step]:
    """The joint forces eliminated, and M, V, G, F."""
    floating = any(tree.floating for tree in trees(equations.model))
    yield from _eliminated(equations)
    sums = ", a floating tree's first rows being the sum of its forces." if floating else "."
    yield Step.of(
        "equations",
        "Elimination",
        "In matrices this is M a + V + G = F in the accelerations a of the coordinates" + sums,
        [_system(equations), (sp.Symbol("a"), sp.Matrix(equations.symbols.a))],
        "(24), (25)",
    )
    collected = equations.collected
    rows = "" if collected.M == collected.M.T else NOT_SYMMETRIC
    yield Step.of("equations", "Mass matrix", rows, [(sp.Symbol("M"), collected.M)], "(26)")
    yield Step.of("equations", "Velocity forces", "", [(sp.Symbol("V"), collected.V)], "(27)")
    yield Step.of("equations", "Gravity forces", "", [(sp.Symbol("G"), collected.G)], "(28)")
    words = "External forces and joint torques, eliminated in the same way."
    efforts = equations.free_bodies.efforts.items()
    yield Step.of(
        "equations", "Applied forces", words, [(sp.Symbol("F"), collected.F), *efforts], "(29)-(36)"
    )


def _eliminated(equations: Equations) -> Iterator[Step]:
    """The elimination line by line: joint forces, then dependent accelerations."""
    model, s, kin = equations.model, equations.symbols, equations.kinematics
    force = "f_j accelerates the bodies on the inner side of its joint"
    if not any(tree.floating for tree in trees(model)):
        force = "-f_j accelerates the bodies on the outer side of its joint"
    if not equations.joint_force:
        return
    yield Step.of("balance", "The joint forces", f"{force}.", list(equations.joint_force))
    left = rows_without_forces(kin, kin.inertial)
    free = equations.free_bodies
    pairs = zip(
        rows_without_forces(kin, free.gravity), rows_without_forces(kin, free.applied), strict=True
    )
    right = [sum(pair) for pair in pairs]
    yield Step.of(
        "balance",
        "Without joint forces",
        "Put into the equations of the other bodies and into the torque equations.",
        list(zip(left, right, strict=True)),
    )
    a, whole = sp.Matrix(s.a), equations.collected
    yield Step.of(
        "balance",
        "Without dependent accelerations",
        "With (22) and (23), collected by the accelerations of the coordinates.",
        list(zip(whole.F, whole.M * a + whole.V + whole.G, strict=True)),
    )


def _system(equations: Equations) -> tuple[Expr, Expr]:
    """M a + V + G = F, by its letters."""
    n = len(equations.symbols.a)
    M, (a, V, G, F) = sp.MatrixSymbol("M", n, n), (sp.MatrixSymbol(x, n, 1) for x in "aVGF")
    return sp.MatAdd(sp.MatMul(M, a), V, G), F


def _solution(equations: Equations) -> Iterator[Step]:
    """The closed form; its numbers continue the handout's."""
    yield Step.of(
        "solution",
        "Closed form",
        "Solved once, symbolically, for the angular acceleration α of every body. The pivots d "
        "are sums of positive terms, so no division can fail at any pose; c couples one body to "
        "another, b is its load, and M the mass of a whole tree.",
        _solved(equations),
        "(37)",
    )
    words = "Recovered from the accelerations."
    yield Step.of("force", "Joint force", words, list(equations.joint_force), "(38)")


def _solved(equations: Equations) -> list[tuple[Expr, Expr]]:
    """The solution without the generalised forces, which only `forward_dynamics` has."""
    still = dict.fromkeys(equations.symbols.tau, sp.Integer(0))
    return [
        (symbol, expression.xreplace(still))
        for symbol, expression in equations.solution.definitions
    ]


def readable(equations: Equations) -> dict[str, str]:
    """Names of symbols by ones that printers know how to write."""
    s, model = equations.symbols, equations.model
    taken = {*s.parameters, *s.inputs, *(q.name for q in s.q)}
    shown = {symbol.name: written(formula) for formula, symbol in s.formulas.items()}
    words = {
        "x": "x", "xd": dotted("x"), "xdd": dotted("x", 2), "y": "y", "yd": dotted("y"),
        "ydd": dotted("y", 2), "angle": "psi", "omega": "omega", "alpha": "alpha",
    }  # fmt: skip
    for body in model.bodies:
        shown |= {f"{word}__{body.name}": f"{name}_{body.name}" for word, name in words.items()}
        joint = body.joint.name
        shown |= {f"f{axis}__{joint}": f"f_{joint},{axis}" for axis in "xy"}
    short = {"pivot": "d", "coupling": "c", "load": "b", "mass": "M", "weight": "w", "row": "j",
             "effort": "tau"}  # fmt: skip
    for symbol in (*equations.free_bodies.efforts, *dict(equations.solution.definitions)):
        kind, _, rest = symbol.name.partition("__")
        if symbol.name not in shown and kind in short:
            rest = rest.replace("__", ",")
            brief = f"{short[kind]}_{rest}"
            shown[symbol.name] = f"{kind}_{rest}" if brief in taken else brief
    return shown


SYMMETRIC = (
    "There are two ways to write (24). Its rows above are torques about the bodies' own centres "
    "of mass, so M of (26) is not symmetric. A Lagrangian derivation has generalised forces as "
    "rows, and its M is symmetric: ½ vᵀ M v is the kinetic energy. `mass_matrix()` of the "
    "generated module returns that one, and `velocity_force()`, `gravity_force()`, "
    "`applied_force()` the V, G, F that belong to it. The matrix T leads from one to the other: "
    "to the torque of each body it adds the moment of the tree's total force, and then it sums "
    "the rows of all bodies that a joint turns. T has an inverse, so both systems have the same "
    "solution."
)
SYMMETRIC_TITLE = "The symmetric mass matrix, that of kinetic energy"


def symmetry_steps(equations: Equations) -> Iterator[Step]:
    """How the handout's M becomes the symmetric one of the generated module."""
    n, s = len(equations.symbols.a), equations.symmetric
    by = symmetric(equations.kinematics, sp.eye(n))
    if by == sp.eye(n):
        return
    own = (("M", s.M), ("V", s.V), ("G", s.G), ("F", s.F))
    lines = [Equation(sp.MatrixSymbol("T", n, n), by)]
    transform = sp.MatrixSymbol("T", n, n)
    for letter, whole in own:
        columns = n if letter == "M" else 1
        name = sp.MatrixSymbol(f"{letter}_sym", n, columns)
        lines.append(Equation(name, sp.MatMul(transform, sp.MatrixSymbol(letter, n, columns))))
        lines.append(Equation(name, whole))
    yield Step("variant", SYMMETRIC_TITLE, SYMMETRIC, tuple(lines))
