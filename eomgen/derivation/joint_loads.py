"""Loads at joints, over SymPy expressions: springs, friction, motors, controllers without states.

Such a load is a generalised force on the coordinates of its joint, whatever formula it has. A load
that depends on the motion is one symbol to a derivation, with a definition. It is then computed
once, and no term of it is expanded.
"""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Protocol

import sympy as sp

from eomgen.derivation.symbols import Expr, SympyScalars
from eomgen.language.formula import Formula, evaluate
from eomgen.model.model import JointIndex, Model, dofs_of
from eomgen.scene.effects.base import JointLoad, Vector

TIME = sp.Symbol("t", real=True)
"""The time, in loads."""


class JointSymbols(Protocol):
    """What the symbols of both derivations have."""

    @property
    def parameters(self) -> dict[str, Expr]:
        """Symbols of parameters, by name; `inputs` likewise."""

    @property
    def inputs(self) -> dict[str, Expr]:
        """Symbols of inputs, by name."""

    @property
    def formulas(self) -> dict[Formula, Expr]:
        """Symbols of formulas of parameters that call functions."""

    @property
    def q(self) -> tuple[Expr, ...]:
        """Symbols of coordinates; `v` of velocities."""

    @property
    def v(self) -> tuple[Expr, ...]:
        """Symbols of velocities."""


class LoadScalars(SympyScalars):
    """SymPy expressions as scalars for loads.

    Functions that SymPy would rewrite are opaque, such as exp, with its powers, and atan(1).
    """

    def call(self, function: str, *arguments: Expr) -> Expr:
        """A function of formulas."""
        if function in ("sin", "cos", "tan", "tanh"):
            return getattr(sp, function)(*arguments)
        return sp.Function(function, real=True)(*arguments)


class JointMechanism:
    """A model as plain effects see it, over SymPy expressions: see `model.dependence.is_plain`."""

    def __init__(self, model: Model, symbols: JointSymbols) -> None:
        self._model = model
        self._symbols = symbols
        self._scalars = LoadScalars()
        self.dimensions = model.dimensions
        self.magnitude = model.magnitude
        self.bodies = tuple(body.name for body in model.bodies)

    @cached_property
    def joints(self) -> Mapping[str, tuple[str, ...]]:
        """The joints that move but the free ones, each with the kinds of its primitives."""
        return dofs_of(self._model.bodies, self.dimensions)

    def mass(self, body: str) -> Expr:
        """Mass of a body."""
        return self.value(self._model.bodies[self.bodies.index(body)].mass)

    def coordinate(self, joint: str, index: int = 0) -> Expr:
        """Symbol of a coordinate of a joint."""
        return self._symbols.q[self._indices[joint].q[index]]

    def coordinate_name(self, joint: str, index: int = 0) -> str:
        """Its name."""
        return self._indices[joint].body.positions[index].name

    def rate(self, joint: str, index: int = 0) -> Expr:
        """Symbol of a velocity of a joint."""
        return self._symbols.v[self._indices[joint].v[index]]

    def value(self, formula: Formula, **names: Expr) -> Expr:
        """A quantity over symbols."""
        if formula in self._symbols.formulas:
            return self._symbols.formulas[formula]
        return evaluate(formula, {**self._names, **names}, self._scalars)

    def input(self, name: str) -> Expr:
        """Symbol of an input."""
        return self._symbols.inputs[name]

    def number(self, value: float) -> Expr:
        """A number."""
        return self._scalars.number(value)

    def call(self, function: str, *arguments: Expr) -> Expr:
        """A function of formulas."""
        return self._scalars.call(function, *arguments)

    def called(self, letter: str, *values: Expr) -> Vector:
        """The values themselves."""
        return values

    @cached_property
    def _indices(self) -> dict[str, JointIndex]:
        return {index.body.joint.name: index for index in self._model.joint_indices}

    @cached_property
    def _names(self) -> dict[str, Expr]:
        model, s = self._model, self._symbols
        coordinates = (*model.coordinates, *model.velocities)
        moving = zip((c.name for c in coordinates), (*s.q, *s.v), strict=True)
        return {"t": TIME, **s.inputs, **dict(moving), **s.parameters}


def joint_loads(
    model: Model, symbols: JointSymbols, loads: Iterable[JointLoad]
) -> tuple[dict[int, Expr], dict[Expr, Expr]]:
    """The sums of the loads on each velocity, by its index, and definitions of symbols in them."""
    indices = {index.body.joint.name: index for index in model.joint_indices}
    sums: dict[int, Expr] = {}
    for load in loads:
        i = indices[load.joint].v[load.coordinate]
        sums[i] = sums.get(i, sp.Integer(0)) + load.force
    moving = {*symbols.q, *symbols.v, TIME}
    definitions: dict[Expr, Expr] = {}
    for i, force in sums.items():
        if not moving.isdisjoint(force.free_symbols):
            word = model.velocities[i].name.removesuffix("_dot")
            symbol = sp.Symbol(f"effort__{word}", real=True)
            definitions[symbol], sums[i] = force, symbol
    return sums, definitions
