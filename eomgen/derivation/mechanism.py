"""The mechanism as effects see it when their formulas are to be read.

Positions and velocities of points, and what effects name by `called`, become symbols. Their
definitions are noted in the order in which they are made.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import sympy as sp

from eomgen.derivation.dots import dotted
from eomgen.derivation.steps import Definition
from eomgen.derivation.symbolic_scalars import SymbolicScalars
from eomgen.derivation.symbols import Expr, names_of_scene, of_scene, real
from eomgen.language.formula import Formula
from eomgen.model.model import Model
from eomgen.model.named import NamedModel
from eomgen.scalars.protocol import Scalars
from eomgen.scene.effects.base import Vector
from eomgen.scene.joints.base import WORLD

AXES = "xyz"


@dataclass
class Notes:
    """The definitions made so far, by effect; the only mutable object here.

    counts  how often a letter names something of the effect
    totals  the same in an earlier run, None in the first: what is named once needs no number
    """

    suffix: str = ""
    counts: Counter[str] = field(default_factory=Counter)
    totals: Counter[str] | None = None
    definitions: list[Definition] = field(default_factory=list)
    known: dict[object, tuple[Expr, ...]] = field(default_factory=dict)
    bodies: dict[str, None] = field(default_factory=dict)

    def subscript(self, word: str) -> str:
        """The subscript of the next thing of this name."""
        self.counts[word] += 1
        several = self.totals is None or self.totals[word] > 1
        number = f",{self.counts[word]}" if several else ""
        return f"{self.suffix}{number}"


class SymbolicMechanism(NamedModel):
    """A model over symbols, as effects see it that use joints and inputs alone: see
    `scene.effects.base.Mechanism`.

    names     symbols by the names of the scene
    formulas  formulas that are symbols themselves
    heights   of the bodies, if effects use them
    """

    def __init__(
        self,
        model: Model,
        names: Mapping[str, Expr],
        scalars: Scalars,
        formulas: Mapping[Formula, Expr] = MappingProxyType({}),
        heights: Iterable[Expr] = (),
    ) -> None:
        super().__init__(model, scalars)
        self.names = dict(names)
        self._formulas, self._heights = formulas, tuple(heights)

    def height(self, body: str) -> Expr:
        """World y or z of a body's centre of mass."""
        return self._heights[self.bodies.index(body)]

    def value(self, formula: Formula, **names: Expr) -> Expr:
        """A quantity over the names of the scene."""
        if formula in self._formulas:
            return self._formulas[formula]
        return super().value(formula, **names)


class NamingMechanism(SymbolicMechanism):
    """A model over symbols that a person reads, with names for what effects use."""

    def __init__(self, model: Model, notes: Notes) -> None:
        names = ["t", *(x.name for x in model.extra)]
        names += [c.name for body in model.bodies for c in (*body.positions, *body.velocities)]
        symbols = {name: real(name) for name in names}
        symbols |= {name: of_scene(name) for name in names_of_scene(model)}
        super().__init__(model, symbols, SymbolicScalars())
        self.notes = notes
        self._points: dict[tuple[str, Vector], str] = {}

    def height(self, body: str) -> Expr:
        """World y or z of a body's centre of mass."""
        return self.position(body, (sp.S.Zero,) * self.dimensions)[-1]

    def point(self, name: str) -> tuple[str, Vector]:
        """A named point: its body, and where on it."""
        body, at = super().point(name)
        self._points[body, at] = name
        return body, at

    def position(self, body: str, at: Vector) -> Vector:
        """World position of a point of a body: symbols, defined by the body's pose."""
        if body == WORLD:
            return at
        self.notes.bodies[body] = None
        if not any(at):
            return position_symbols(body, self.dimensions)
        if (found := self.notes.known.get(("at", body, at))) is None:
            name = self._points.get((body, at)) or self.notes.subscript("p")
            arm = turned(rotation_symbols(body, self.dimensions), at)
            centre = position_symbols(body, self.dimensions)
            values = tuple(x + a for x, a in zip(centre, arm, strict=True))
            found = self._defined("p", name, values)
            self.notes.known["at", body, at] = found
        return found

    def velocity(self, body: str, at: Vector) -> Vector:
        """World velocity of a point of a body: symbols, defined by the body's motion."""
        if body == WORLD:
            return (sp.S.Zero,) * self.dimensions
        self.notes.bodies[body] = None
        if not any(at):
            return velocity_symbols(body, self.dimensions)
        if (found := self.notes.known.get(("moving", body, at))) is None:
            place = self.position(body, at)
            word = place[0].name.removeprefix("p_").rpartition(",")[0]
            centre = position_symbols(body, self.dimensions)
            arm = tuple(p - x for p, x in zip(place, centre, strict=True))
            own = velocity_symbols(body, self.dimensions)
            more = crossed(omega_symbols(body, self.dimensions), arm)
            values = tuple(v + w for v, w in zip(own, more, strict=True))
            found = self._defined(dotted("p"), word, values)
            self.notes.known["moving", body, at] = found
        return found

    def angular_velocity(self, body: str) -> Vector:
        """Angular velocity of a body, world axes."""
        size = 1 if self.dimensions == 2 else 3
        if body == WORLD:
            return (sp.S.Zero,) * size
        self.notes.bodies[body] = None
        return omega_symbols(body, self.dimensions)

    def outward(self, body: str, vector: Vector) -> Vector:
        """A vector of body axes in world axes."""
        if body == WORLD:
            return vector
        self.notes.bodies[body] = None
        return turned(rotation_symbols(body, self.dimensions), vector)

    def call(self, function: str, *arguments: Expr) -> Expr:
        """A function of formulas; the value of a case distinction gets a name."""
        value = super().call(function, *arguments)
        if isinstance(value, sp.Piecewise):
            return self.called("b", value)[0]
        return value

    def called(self, letter: str, *values: Expr) -> Vector:
        """Values by symbols of their own; what is a symbol already stays."""
        if all(x.is_Atom or (-x).is_Atom for x in values):
            return tuple(values)
        if letter.endswith("dot"):
            letter = dotted(letter.removesuffix("dot"))
        key = (letter, values)
        if (found := self.notes.known.get(key)) is None:
            found = self._defined(letter, self.notes.subscript(letter), values)
            self.notes.known[key] = found
        return found

    def _defined(self, word: str, name: str, values: tuple[Expr, ...]) -> tuple[Expr, ...]:
        if len(values) == 1:
            symbols: tuple[Expr, ...] = (real(f"{word}_{name}"),)
        else:
            axes = zip(AXES, values, strict=False)
            symbols = tuple(real(f"{word}_{name},{axis}") for axis, _ in axes)
        self.notes.definitions += zip(symbols, values, strict=True)
        return symbols


class SamplingMechanism(NamingMechanism):
    """The same at a sample, whose readings have symbols of their own."""

    def value(self, formula: Formula, **names: Expr) -> Expr:
        """A quantity over the names of the scene and readings."""
        return super().value(formula, **{name: sampled(name) for name in names})

    def rounded(self, value: Expr, quantum: Expr) -> Expr:
        """The nearest multiple of a quantum."""
        return quantum * sp.Function("round", real=True)(value / quantum)


def sampled(name: str) -> Expr:
    """What a sample gives a state."""
    base, underscore, rest = name.partition("_")
    return real(f"{base}^+{underscore}{rest}")


def position_symbols(body: str, dimensions: int) -> tuple[Expr, ...]:
    """Symbols of the place of a body's centre of mass in the world."""
    return tuple(real(f"{axis}_{body}") for axis in AXES[:dimensions])


def velocity_symbols(body: str, dimensions: int) -> tuple[Expr, ...]:
    """Symbols of its velocity in the world."""
    return tuple(real(dotted(f"{axis}_{body}")) for axis in AXES[:dimensions])


def omega_symbols(body: str, dimensions: int) -> tuple[Expr, ...]:
    """Symbols of a body's angular velocity: one in the plane; in space three, in world axes."""
    if dimensions == 2:
        return (real(f"omega_{body}"),)
    return tuple(real(f"Omega_{body},{axis}") for axis in AXES)


def rotation_symbols(body: str, dimensions: int) -> Expr:
    """The rotation from a body's axes to the world's: by its angle in the plane, or its entries."""
    if dimensions == 2:
        angle = real(f"psi_{body}")
        return sp.Matrix([[sp.cos(angle), -sp.sin(angle)], [sp.sin(angle), sp.cos(angle)]])
    return sp.Matrix(3, 3, lambda i, j: real(f"W_{body},{AXES[i]}{AXES[j]}"))


def turned(rotation: Expr, vector: Sequence[Expr]) -> tuple[Expr, ...]:
    """A rotation times a vector."""
    return tuple(rotation * sp.Matrix(vector))


def crossed(omega: Sequence[Expr], arm: Sequence[Expr]) -> tuple[Expr, ...]:
    """ω × r, in the plane with ω about z."""
    if len(omega) == 1:
        return (-omega[0] * arm[1], omega[0] * arm[0])
    return tuple(sp.Matrix(omega).cross(sp.Matrix(arm)))
