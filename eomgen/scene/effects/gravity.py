"""Uniform gravity, downwards or in a given direction."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, field_validator

from eomgen.language.base import Identifier
from eomgen.language.formula import Apply, Formula, evaluate
from eomgen.language.quantity import Numbers, Quantity, quantity
from eomgen.language.rewriting import constant
from eomgen.scalars.exact import direction
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects.base import EffectTable, Load, Mechanism, Scalar, Vector
from eomgen.scene.effects.elements import Layout, Weight


class Gravity(EffectTable):
    """Weight m g of each body, along -y in the plane (handout (5), (9)), along -z in space.

    `direction` (world axes, not 0, need not have unit length) replaces these axes. Gravity does not
    act on the bodies in `except_bodies`; if there are any, the weights of the other bodies are
    applied forces, in F of M v̇ + V + G = F instead of G.
    """

    told = "Weight m g of each body."
    example: ClassVar[str] = """
[[effects]]
type = "gravity"
g = 9.81
"""
    body_fields = ("except_bodies",)
    vector_fields = ("direction",)
    direction_fields = ("direction",)
    single = True

    type: Literal["gravity"]
    name: Identifier = "gravity"
    g: Quantity = quantity("m/s^2", "gravitational acceleration, downwards")
    direction: Numbers | None = Field(
        default=None, description="direction of the weight, world axes"
    )
    except_bodies: tuple[Identifier, ...] = Field(
        default=(), description="bodies it does not act on"
    )

    @field_validator("direction")
    @classmethod
    def _points_somewhere(cls, direction: Numbers | None) -> Numbers | None:
        if direction is not None and not any(direction):
            raise ValueError("has no direction; give a vector that is not zero")
        return direction

    def notices(self, values: Mapping[str, float]) -> Iterator[str]:
        """Whether g is negative, so that bodies fall upwards."""
        if (g := evaluate(self.g, values, FloatScalars())) < 0.0:
            yield f"g: is {g:g} m/s², so bodies fall upwards; for downwards write {-g:g}"

    def acceleration(self, mechanism: Mechanism) -> Vector:
        """Acceleration of free fall, world axes, m/s²."""
        g = mechanism.value(self.g)
        if self.direction is None:
            return (*(mechanism.zero,) * (mechanism.dimensions - 1), -g)
        return tuple(mechanism.number(part) * g for part in direction(self.direction))

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The weight of each body, at its centre of mass."""
        zeros = (mechanism.zero,) * mechanism.dimensions
        if self.direction is None and not self.except_bodies:
            g = mechanism.value(self.g)
            for body in mechanism.bodies:
                mass = mechanism.value(mechanism.masses[body])
                yield Load(body, (*zeros[1:], -mass * g), zeros, "gravity")
            return
        fall = self.acceleration(mechanism)
        for body in self._falling(mechanism):
            force = tuple(mechanism.value(mechanism.masses[body]) * part for part in fall)
            yield Load(body, force, zeros, "applied" if self.except_bodies else "gravity")

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """Σ m g times height, J; zero at the world's origin."""
        total = mechanism.zero
        if self.direction is None and not self.except_bodies:
            g = mechanism.value(self.g)
            for body in mechanism.bodies:
                total = total + mechanism.value(mechanism.masses[body]) * g * mechanism.height(body)
            return total
        fall, zeros = self.acceleration(mechanism), (total,) * mechanism.dimensions
        for body in self._falling(mechanism):
            for part, x in zip(fall, mechanism.position(body, zeros), strict=True):
                total = total - mechanism.value(mechanism.masses[body]) * part * x
        return total

    @property
    def uniform(self) -> bool:
        """True if it acts on all bodies."""
        return not self.except_bodies

    def switched(self, switch: Formula) -> Self:
        """With g times the switch: uniform gravity is no load of a mechanism."""
        return self.replaced(g=Apply("*", (switch, self.g)))

    def elements(self, layout: Layout) -> Iterator[Weight]:
        """An arrow along it."""
        down = (0.0,) * (layout.dimensions - 1) + (-1.0,)
        yield Weight(self.name, constant(*map(float, direction(self.direction or down))))

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """Always true."""
        return True

    def _falling(self, mechanism: Mechanism) -> list[str]:
        return [body for body in mechanism.bodies if body not in self.except_bodies]
