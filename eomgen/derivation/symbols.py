"""The symbols of a derivation, and the trigonometry it needs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from eomgen.language.formula import Formula, Name, calls_function, evaluate, names_in
from eomgen.model.model import Model
from eomgen.scalars.protocol import Scalars

Expr = Any
"""A SymPy expression (SymPy carries no types)."""
Vec = tuple[Expr, Expr]


class SympyScalars(Scalars):
    """SymPy expressions as scalars for formulas; decimals stay exact."""

    def number(self, value: float) -> Expr:
        """The exact rational that the scene's decimal says."""
        return sp.Rational(repr(value))

    def call(self, function: str, *arguments: Expr) -> Expr:
        """A function of formulas. What SymPy would rewrite is opaque, such as exp, with its powers,
        and atan(1).
        """
        if function in ("sin", "cos", "tan", "tanh"):
            return getattr(sp, function)(*arguments)
        return sp.Function(function, real=True)(*arguments)


def _quantity(formula: Formula, parameters: dict[str, Expr], formulas: dict[Formula, Expr]) -> Expr:
    """A quantity over the parameters' symbols.

    A formula with a function in it becomes a separate symbol: the trigonometry here is for sines
    and cosines of poses only, and the mechanics does not depend on what such a formula is.
    """
    if formula in formulas:
        return formulas[formula]
    return evaluate(formula, parameters, SympyScalars())


@dataclass(frozen=True)
class Symbols:
    """Symbols of a model: one list each over coordinates, bodies, or revolute joints.

    `q`, `v`, `a` are coordinates with their first and second derivatives, `tau` generalised forces
    beside those of the effects. Per body `x`, `y`, `angle` are the pose of the centre of mass in
    world axes, `xd`, `yd`, `omega` its velocity, `xdd`, `ydd`, `alpha` its acceleration.
    `formulas` are quantities with functions in them, each one symbol to the derivation.
    `force` holds the joint force of the body's own joint, acting on its parent (0 if free).
    """

    parameters: dict[str, Expr]
    formulas: dict[Formula, Expr]
    inputs: dict[str, Expr]
    mass: tuple[Expr, ...]
    inertia: tuple[Expr, ...]
    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    a: tuple[Expr, ...]
    tau: tuple[Expr, ...]
    x: tuple[Expr, ...]
    y: tuple[Expr, ...]
    angle: tuple[Expr, ...]
    xd: tuple[Expr, ...]
    yd: tuple[Expr, ...]
    omega: tuple[Expr, ...]
    xdd: tuple[Expr, ...]
    ydd: tuple[Expr, ...]
    alpha: tuple[Expr, ...]
    force: tuple[Vec, ...]

    def value(self, formula: Formula) -> Expr:
        """A quantity over the parameters' symbols."""
        return _quantity(formula, self.parameters, self.formulas)


def functions_of_parameters(model: Model) -> Iterator[Formula]:
    """The quantities of a model that call functions and depend on parameters alone."""
    for formula in model.quantities():
        if calls_function(formula) and all(n in model.defaults for n in names_in(formula)):
            yield formula


def make_symbols(model: Model) -> Symbols:
    """Symbols for a model; masses and inertias that are one parameter are positive symbols."""
    positive = {
        quantity.name
        for body in model.bodies
        for quantity in (body.mass, body.moment)
        if isinstance(quantity, Name)
    }
    parameters = {
        p.name: of_scene(p.name, positive=True) if p.name in positive else of_scene(p.name)
        for p in model.parameters
    }

    called = dict.fromkeys(functions_of_parameters(model))
    formulas = {formula: real(f"formula__{i}") for i, formula in enumerate(called, 1)}

    def quantity(formula: Formula) -> Expr:
        return _quantity(formula, parameters, formulas)

    coordinates = [c.name for c in model.coordinates]
    bodies = [body.name for body in model.bodies]

    def each(names: Sequence[str], pattern: str) -> tuple[Expr, ...]:
        return tuple(real(pattern.format(name)) for name in names)

    return Symbols(
        parameters=parameters,
        formulas=formulas,
        inputs={i.name: of_scene(i.name) for i in model.inputs},
        mass=tuple(quantity(body.mass) for body in model.bodies),
        inertia=tuple(quantity(body.moment) for body in model.bodies),
        q=each(coordinates, "{}"),
        v=each(coordinates, "{}_dot"),
        a=each(coordinates, "{}_ddot"),
        tau=each(coordinates, "tau__{}"),
        # Names of scenes contain no two underscores, so these are different from all of them.
        x=each(bodies, "x__{}"),
        y=each(bodies, "y__{}"),
        angle=each(bodies, "angle__{}"),
        xd=each(bodies, "xd__{}"),
        yd=each(bodies, "yd__{}"),
        omega=each(bodies, "omega__{}"),
        xdd=each(bodies, "xdd__{}"),
        ydd=each(bodies, "ydd__{}"),
        alpha=each(bodies, "alpha__{}"),
        force=tuple(
            (real(f"fx__{body.joint.name}"), real(f"fy__{body.joint.name}"))
            for body in model.bodies
        ),
    )


def real(name: str) -> Expr:
    """A real symbol."""
    return sp.Symbol(name, real=True)


OF_SCENE = "!"
"""Ends the names of symbols of a scene's parameters and inputs, so that the derivation's own never
clash with them. SymPy sorts terms by names, and it sorts before what else these consist of.
"""


def of_scene(name: str, **assumptions: bool) -> Expr:
    """The symbol of a parameter or an input of a scene; of an input that stands for a symbol of the
    derivation, whose name begins with the mark, this symbol.
    """
    if name.startswith(OF_SCENE):
        return real(name.removeprefix(OF_SCENE))
    return sp.Symbol(name + OF_SCENE, **(assumptions or {"real": True}))


def names_of_scene(model: Model) -> list[str]:
    """The names of parameters and inputs."""
    return [*(p.name for p in model.parameters), *(i.name for i in model.inputs)]


def rotate(vector: Vec, angle: Expr) -> Vec:
    """A vector of body axes in world axes."""
    c, s = sp.cos(angle), sp.sin(angle)
    return (vector[0] * c - vector[1] * s, vector[0] * s + vector[1] * c)


def cross(r: Vec, f: Vec) -> Expr:
    """z component of r × f."""
    return r[0] * f[1] - r[1] * f[0]


def add(u: Vec, v: Vec) -> Vec:
    """Sum of two vectors."""
    return (u[0] + v[0], u[1] + v[1])


def scale(k: Expr, v: Vec) -> Vec:
    """A vector times a scalar."""
    return (k * v[0], k * v[1])


def tidy(expression: Expr) -> Expr:
    """Expand, and write products of sines and cosines as functions of sums of angles.

    In this normal form terms that are equal by a trigonometric identity are the same term, so that
    they cancel without a search for simplifications.
    """
    expanded = sp.expand(expression)
    return sp.Add(*(_linear(term) for term in sp.Add.make_args(expanded)))


def _linear(term: Expr) -> Expr:
    """A product with at most one sine or cosine left in each of its terms."""
    plain, waves = [], []
    for factor in sp.Mul.make_args(term):
        base, power = factor.as_base_exp()
        if isinstance(base, sp.sin | sp.cos) and power.is_Integer and power > 0:
            waves += [base] * int(power)
        else:
            plain.append(factor)
    if len(waves) < 2:
        return term
    sums = waves[0]
    for wave in waves[1:]:
        sums = sp.Add(*(_product(part, wave) for part in sp.Add.make_args(sums)))
    return sp.expand(sp.Mul(*plain) * sums)


def _product(part: Expr, wave: Expr) -> Expr:
    """k · wave₁ · wave₂ by the sum and difference of their angles."""
    k, first = part.as_coeff_Mul()
    if not isinstance(first, sp.sin | sp.cos):
        return part * wave
    a, b = first.args[0], wave.args[0]
    match first, wave:
        case sp.sin(), sp.sin():
            pair = sp.cos(a - b) - sp.cos(a + b)
        case sp.cos(), sp.cos():
            pair = sp.cos(a - b) + sp.cos(a + b)
        case sp.sin(), sp.cos():
            pair = sp.sin(a + b) + sp.sin(a - b)
        case _:
            pair = sp.sin(a + b) - sp.sin(a - b)
    return k / 2 * pair


def over_bodies(model: Model, symbols: Symbols) -> dict[Expr, Expr]:
    """Coordinates, velocities and accelerations by those of the bodies: φ = ψ_B - ψ_A.

    Substituted into an expression (`xreplace`), sums along the tree such as θ + φ become one symbol
    of a body, which keeps expressions short.
    """
    result: dict[Expr, Expr] = {}
    for coordinates, x, y, angle in _orders(symbols):
        for k, (body, last) in enumerate(zip(model.bodies, model.angle_index, strict=True)):
            base = angle[body.parent] if body.parent >= 0 else sp.Integer(0)
            result[coordinates[last]] = angle[k] - base
            if len(body.positions) > 1:
                result[coordinates[last - 2]], result[coordinates[last - 1]] = x[k], y[k]
    return result


def over_coordinates(model: Model, symbols: Symbols) -> dict[Expr, Expr]:
    """The inverse: the bodies' angles and angular rates as sums of coordinates."""
    result: dict[Expr, Expr] = {}
    for coordinates, x, y, angle in _orders(symbols):
        for k, (body, last) in enumerate(zip(model.bodies, model.angle_index, strict=True)):
            base = result[angle[body.parent]] if body.parent >= 0 else sp.Integer(0)
            result[angle[k]] = base + coordinates[last]
            if len(body.positions) > 1:
                result[x[k]], result[y[k]] = coordinates[last - 2], coordinates[last - 1]
    return result


def _orders(symbols: Symbols) -> tuple[tuple[tuple[Expr, ...], ...], ...]:
    """Coordinates with the bodies' x, y and angle: pose, first and second derivative."""
    return (
        (symbols.q, symbols.x, symbols.y, symbols.angle),
        (symbols.v, symbols.xd, symbols.yd, symbols.omega),
        (symbols.a, symbols.xdd, symbols.ydd, symbols.alpha),
    )
