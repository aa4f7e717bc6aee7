"""Gravity towards a fixed point, such as a planet or a star."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Literal

from pydantic import Field

from eomgen.language.base import Identifier
from eomgen.language.quantity import Quantity, quantity
from eomgen.language.quantity import Vector as VectorField
from eomgen.scene.effects.base import EffectTable, Load, Mechanism, Scalar, Vector
from eomgen.scene.effects.elements import Attraction, Layout
from eomgen.scene.effects.vectors import dot, negative, scale, sub


class PointGravity(EffectTable):
    """Newton's attraction f = -μ m r/|r|³ of each body by a mass M that is fixed in the world.

    r is the vector from the point `at` to the body's centre of mass, where the force acts; μ = G M.
    There is no gravity gradient torque. The force is infinite at the point itself.
    """

    example: ClassVar[str] = """
[[effects]]
type = "point_gravity"
name = "sun"
mu = 10.0
at = [5, 0]
"""
    body_fields = ("except_bodies",)
    vector_fields = ("at",)

    type: Literal["point_gravity"]
    name: Identifier
    mu: Quantity = quantity("m^3/s^2", "μ = G M of the attracting mass", "nonnegative")
    at: VectorField = quantity(
        "m", "position of the attracting mass, world axes", default=(), validate_default=False
    )
    except_bodies: tuple[Identifier, ...] = Field(
        default=(), description="bodies it does not act on"
    )

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """The attraction of each body, at its centre of mass."""
        zeros, mu = (mechanism.zero,) * mechanism.dimensions, mechanism.value(self.mu)
        for body in self._attracted(mechanism):
            arm, squared = self._from_point(mechanism, body)
            cubed = squared * mechanism.call("sqrt", squared)
            pull = mu * mechanism.value(mechanism.masses[body]) / cubed
            yield Load(body, negative(scale(pull, arm)), zeros, "applied")

    def potential_energy(self, mechanism: Mechanism) -> Scalar:
        """-Σ μ m/|r|, J; zero at infinity."""
        total, mu = mechanism.zero, mechanism.value(self.mu)
        for body in self._attracted(mechanism):
            _, squared = self._from_point(mechanism, body)
            mass = mechanism.value(mechanism.masses[body])
            total = total - mu * mass / mechanism.call("sqrt", squared)
        return total

    def elements(self, layout: Layout) -> Iterator[Attraction]:
        """Its point, and the bodies that it attracts."""
        left_out = ("world", *self.except_bodies)
        pulled = tuple(k for name, k in layout.bodies.items() if name not in left_out)
        yield Attraction(self.name, self.at, pulled)

    def keeps_energy(
        self, values: Mapping[str, float], inputs: Mapping[str, float], dimensions: int
    ) -> bool:
        """Always true."""
        return True

    def _attracted(self, mechanism: Mechanism) -> list[str]:
        return [body for body in mechanism.bodies if body not in self.except_bodies]

    def _from_point(self, mechanism: Mechanism, body: str) -> tuple[Vector, Scalar]:
        """The vector r, m, and r·r."""
        zeros = (mechanism.zero,) * mechanism.dimensions
        centre = tuple(mechanism.value(part) for part in self.at)
        arm = sub(mechanism.position(body, zeros), centre)
        arm = mechanism.called("r", *arm)
        return arm, dot(arm, arm)
