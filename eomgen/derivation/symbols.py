"""The symbols of a derivation."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import sympy as sp

from eomgen.language.formula import Formula, Name, calls_function, evaluate, names_in
from eomgen.model.model import Model
from eomgen.model.orientation import rows_of, turns_of
from eomgen.scalars.exact import Real, direction, opposite, orientation, quarters, radians
from eomgen.scalars.protocol import Scalars
from eomgen.scene.joints.base import WithRotor

Expr = Any
"""A SymPy expression (SymPy carries no types)."""


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


@dataclass(frozen=True)
class Symbols:
    """Symbols of a model.

    `q`, `v`, `a` are coordinates, velocities and their derivatives v̇, `tau` generalised forces
    beside those of the effects. `formulas` are quantities with functions in them, each one symbol
    to the derivation; `numbers` are those of fixed rotations, axes and angles, by their sizes.
    `fixed` holds all symbols that depend on parameters alone.
    """

    parameters: dict[str, Expr]
    formulas: dict[Formula, Expr]
    numbers: dict[Real, Expr]
    inputs: dict[str, Expr]
    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    a: tuple[Expr, ...]
    tau: tuple[Expr, ...]

    @property
    def fixed(self) -> frozenset[Expr]:
        """Symbols that are constant in time."""
        named = (self.parameters, self.formulas, self.numbers)
        return frozenset(symbol for symbols in named for symbol in symbols.values())

    def number(self, value: Real) -> Expr:
        """A number of the scene's geometry: 0, 1 and -1 as integers, which simplify; any other as a
        symbol, so that SymPy does not round it.
        """
        if value in (0, 1, -1):
            return sp.Integer(int(value))
        return self.numbers[value] if value > 0 else -self.numbers[opposite(value)]

    def value(self, formula: Formula) -> Expr:
        """A quantity in the parameters' symbols."""
        if formula in self.formulas:
            return self.formulas[formula]
        return evaluate(formula, self.parameters, SympyScalars())


def functions_of_parameters(model: Model) -> Iterator[Formula]:
    """The quantities of a model that call functions and depend on parameters alone."""
    for formula in model.quantities():
        if calls_function(formula) and all(n in model.defaults for n in names_in(formula)):
            yield formula


def make_symbols(model: Model) -> Symbols:
    """Symbols for a model; masses, moments, rotors that are one parameter are positive symbols."""
    quantities = [q for body in model.bodies for q in (body.mass, *body.inertia_com[:3])]
    quantities += [b.joint.motor_inertia for b in model.bodies if isinstance(b.joint, WithRotor)]
    positive = {quantity.name for quantity in quantities if isinstance(quantity, Name)}
    called = dict.fromkeys(functions_of_parameters(model))
    return Symbols(
        parameters={
            p.name: of_scene(p.name, positive=True) if p.name in positive else of_scene(p.name)
            for p in model.parameters
        },
        formulas={formula: real(f"formula__{i}") for i, formula in enumerate(called, 1)},
        numbers={
            x: sp.Symbol(f"number__{i}", positive=True) for i, x in enumerate(_sizes(model), 1)
        },
        inputs={i.name: of_scene(i.name) for i in model.inputs},
        q=tuple(real(c.name) for c in model.coordinates),
        v=tuple(real(c.name) for c in model.velocities),
        a=tuple(real(c.acceleration) for c in model.velocities),
        tau=tuple(real(f"tau__{c.name}") for c in model.velocities),
    )


def _sizes(model: Model) -> dict[Real, None]:
    """The sizes of all numbers in fixed rotations, axes and angles that are neither 0 nor 1."""
    found: dict[Real, None] = {}
    for body in model.bodies:
        joint, parts = body.joint, list[Real]()
        parts += [x for row in orientation(joint.orientation_deg) for x in row]
        if not isinstance(joint.orientation_deg, tuple):
            parts.append(quarters(radians(joint.orientation_deg))[1])
        if joint.orientation is not None and len(rows := rows_of(joint.orientation)) == 1:
            turns = [turn for _, turn in turns_of(rows[0])] if len(rows[0]) != 4 else []
            parts += [x for m in turns if isinstance(m, tuple) for row in m for x in row]
        for primitive in joint.primitives(model.dimensions):
            if primitive.kind != "spherical":
                parts += direction(primitive.axis)
        sizes = (opposite(x) if x < 0 else x for x in parts)
        found |= dict.fromkeys(x for x in sizes if x not in (0, 1))
    return found


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
