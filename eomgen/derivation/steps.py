"""The derivation told step by step, numbered like the handout."""

from collections.abc import Iterable
from dataclasses import dataclass

import sympy as sp

from eomgen.derivation.closed import Equations
from eomgen.derivation.elimination import trees
from eomgen.derivation.symbols import Expr
from eomgen.joints import Free


@dataclass(frozen=True)
class Equation:
    """One line `left = right`; a matrix equation where `right` is a matrix."""

    left: Expr
    right: Expr


@dataclass(frozen=True)
class Step:
    """A step: the handout's equation numbers, a title, what is done and the equations it gives."""

    number: str
    title: str
    words: str
    equations: tuple[Equation, ...]


def tell(equations: Equations) -> tuple[Step, ...]:
    """Every step from the state to the closed form, in symbols meant for reading."""
    shown = _readable(equations)

    def lines(pairs: Iterable[tuple[Expr, Expr]]) -> tuple[Equation, ...]:
        readable = (Equation(left.xreplace(shown), right.xreplace(shown)) for left, right in pairs)
        return tuple(line for line in readable if line.left != line.right)

    s, kin, model = equations.symbols, equations.kinematics, equations.model
    bodies = range(len(model.bodies))
    held = [k for k in bodies if not isinstance(model.bodies[k].joint, Free)]
    pins = [(k, model.bodies[k].joint.name) for k in held]
    collected = equations.collected
    floating = any(tree.floating for tree in trees(model))
    side = (
        "The joint force f_j accelerates the bodies on the inner side of its joint"
        if floating
        else "The joint force -f_j accelerates the bodies on the outer side of its joint"
    )
    return (
        Step(
            "(1)",
            "State",
            "Each body has the position x, y of its centre of mass, its momentum P = m v, its "
            "orientation and its angular momentum L = I ω. The joints leave the coordinates free.",
            lines([
                *((s.angle[k], kin.angle[k]) for k in bodies),
                *((s.omega[k], kin.omega[k]) for k in bodies),
            ]),
        ),
        Step(
            "(2)-(17)",
            "Free bodies",
            "Force is dP/dt, torque is dL/dt. The joint force f_j acts on the parent, -f_j on the "
            "child; both are unknown.",
            lines(equations.free_bodies.equations),
        ),
        Step(
            "(18), (19)",
            "Arms",
            "From each centre of mass to the joint, in world axes.",
            lines(
                pair
                for k, name in pins
                for word, arm in (("parent", kin.arm_parent[k]), ("child", kin.arm_child[k]))
                for pair in zip(
                    (_symbol(f"rx_{name},{word}"), _symbol(f"ry_{name},{word}")), arm, strict=True
                )
            ),
        ),
        Step(
            "(20), (21)",
            "Constraint",
            "The two bodies share the joint: x_child = x_parent + r_parent - r_child.",
            lines(
                pair
                for k in held
                for pair in zip((s.x[k], s.y[k]), kin.position[k], strict=True)
            ),
        ),
        Step(
            "(22), (23)",
            "Constraint differentiated twice",
            "The child's acceleration by the parent's and by the angular velocities and "
            "accelerations.",
            lines(
                pair
                for k in held
                for pair in zip((s.xdd[k], s.ydd[k]), kin.acceleration[k], strict=True)
            ),
        ),
        Step(
            "(24), (25)",
            "Elimination",
            f"{side}. Put into the torque equations, with the dependent "
            "accelerations replaced by (22) and (23), this leaves M a + V + G = F in the "
            "accelerations a of the coordinates"
            + (", a floating tree's first rows being the sum of its forces." if floating else "."),
            lines([(_symbol("a"), sp.Matrix(s.a))]),
        ),
        Step("(26)", "Mass matrix", "Not symmetric: its rows are torques about the bodies' own centres.",
             lines([(_symbol("M"), collected.M)])),
        Step("(27)", "Velocity forces", "", lines([(_symbol("V"), collected.V)])),
        Step("(28)", "Gravity forces", "", lines([(_symbol("G"), collected.G)])),
        Step("(29)-(36)", "Applied forces", "External forces and joint torques, eliminated alike.",
             lines([(_symbol("F"), collected.F)])),
        Step(
            "(37)",
            "Closed form",
            "Solved once, symbolically, for the angular acceleration α of every body. The pivots d "
            "are sums of positive terms, so no division can fail at any pose; c couples a body to "
            "another, b is its load, and M the mass of a whole tree.",
            lines(_solved(equations)),
        ),
        Step(
            "(38)",
            "Joint force",
            "Recovered from the accelerations.",
            lines(equations.joint_force),
        ),
    )  # fmt: skip


def _solved(equations: Equations) -> list[tuple[Expr, Expr]]:
    """The solution without the generalised forces, which only `forward_dynamics` has."""
    still = dict.fromkeys(equations.symbols.tau, sp.Integer(0))
    return [
        (symbol, expression.xreplace(still))
        for symbol, expression in equations.solution.definitions
    ]


def _symbol(name: str) -> Expr:
    return sp.Symbol(name)


def _readable(equations: Equations) -> dict[Expr, Expr]:
    """Symbols by ones whose names SymPy's printers know how to write: `thetaddot` is θ̈."""
    s, model = equations.symbols, equations.model
    names = [body.name for body in model.bodies]
    shown: dict[Expr, Expr] = {}
    for q, v, a in zip(s.q, s.v, s.a, strict=True):
        shown[v], shown[a] = _dotted(q.name, "dot"), _dotted(q.name, "ddot")
    words = (
        ("x", s.x), ("y", s.y), ("psi", s.angle), ("xdot", s.xd), ("ydot", s.yd),
        ("omega", s.omega), ("xddot", s.xdd), ("yddot", s.ydd), ("alpha", s.alpha),
    )  # fmt: skip
    for word, symbols in words:
        for name, symbol in zip(names, symbols, strict=True):
            shown.setdefault(symbol, _symbol(f"{word}_{name}"))
    for body, (fx, fy) in zip(model.bodies, s.force, strict=True):
        shown[fx] = _symbol(f"f_{body.joint.name},x")
        shown[fy] = _symbol(f"f_{body.joint.name},y")
    short = {"pivot": "d", "coupling": "c", "load": "b", "mass": "M", "weight": "w", "row": "j"}
    for body in model.bodies:
        for field, letter in (("mass", "m"), ("inertia_com", "I")):
            named = s.parameters.get(f"{body.name}_{field}")
            if named is not None:
                shown[named] = _symbol(f"{letter}_{body.name}")
    for symbol, _ in equations.solution.definitions:
        kind, _, rest = symbol.name.partition("__")
        if symbol not in shown and kind in short:
            shown[symbol] = _symbol(f"{short[kind]}_{rest}")
    return shown


def _dotted(name: str, dots: str) -> Expr:
    base, underscore, rest = name.partition("_")
    return _symbol(f"{base}{dots}{underscore}{rest}")
