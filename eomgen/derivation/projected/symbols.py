"""The symbols of a derivation, the definitions it makes, and derivatives by time."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import sympy as sp

from eomgen.derivation.projected.simplify import gathered
from eomgen.derivation.symbols import (
    Expr,
    SympyScalars,
    functions_of_parameters,
    of_scene,
    real,
)
from eomgen.language.formula import Formula, Name, evaluate
from eomgen.model.model import Model
from eomgen.model.orientation import rows_of, turns_of
from eomgen.scalars.exact import Real, direction, opposite, orientation, quarters, radians
from eomgen.scene.joints.base import WithRotor


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


def triple(word: str, name: str) -> Expr:
    """Three symbols of a vector."""
    return sp.Matrix([real(f"{word}__{name}__{axis}") for axis in "xyz"])


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


@dataclass
class Ledger:
    """The definitions of a derivation, in order: its only mutable object.

    fixed    symbols that depend on parameters alone
    inline   largest number of operations of an expression that is not given a name
    longest  largest number of operations of an expression that is simplified
    rates    time derivatives of symbols; a symbol without an entry is constant
    """

    fixed: frozenset[Expr]
    inline: int
    longest: int
    definitions: dict[Expr, Expr] = field(default_factory=dict)
    rates: dict[Expr, Expr] = field(default_factory=dict)

    def define(self, symbol: Expr, expression: Expr) -> Expr:
        """A definition, whatever its length."""
        self.definitions[symbol] = expression
        return symbol

    def named(self, name: str, expression: Expr, *, positive: bool = False) -> Expr:
        """A symbol for an expression that is long; a short one itself."""
        if expression.is_Atom or sp.count_ops(expression) <= self.inline:
            return expression
        if positive:
            return self.define(sp.Symbol(name, positive=True), expression)
        return self.define(real(name), expression)

    def short(self, expression: Expr, sums: Mapping[Expr, Expr] | None = None) -> Expr:
        """An expression, or each component of a vector, simplified by `gathered` unless long."""
        if isinstance(expression, sp.MatrixBase):
            return expression.applyfunc(self.short)
        if expression.is_Atom or sp.count_ops(expression) > self.longest:
            return expression
        return gathered(expression, self.fixed, sums)

    def vector(self, word: str, name: str, expressions: Expr) -> Expr:
        """The same for the components of a vector."""
        pairs = zip("xyz", expressions, strict=True)
        return sp.Matrix([self.named(f"{word}__{name}__{axis}", e) for axis, e in pairs])
