"""Linear and quadratic drag in a fluid, of translation and of rotation."""

from collections.abc import Iterator
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from eomgen.language.formula import ZERO
from eomgen.language.quantity import Quantity, quantity
from eomgen.language.quantity import Vector as VectorField
from eomgen.language.rewriting import constant
from eomgen.scene.effects.base import Load, Mechanism, Scalar, Vector
from eomgen.scene.effects.bodies import OnBodies, local_names, wrong
from eomgen.scene.effects.elements import Layout, Wind
from eomgen.scene.effects.vectors import length, negative, scale, sub

MADE_OF = ("density", "area", "coefficient")


class Drag(OnBodies):
    """Drag f = -(linear + quadratic |w|) w at a point of velocity w = v - wind in the fluid.

    Drag on rotation: torque = -(turning_linear + turning_quadratic |ω|) ω. Instead of `quadratic`,
    density, area and coefficient give ½ ρ A c_d of the drag equation. All vectors are in world
    axes; each body has these coefficients. The drag is differentiable at rest.
    """

    example: ClassVar[str] = """
[[effects]]
type = "drag"
name = "air"
bodies = ["arm", "hand"]
quadratic = 0.02
wind = ["3*sin(t)", 0]
"""
    vector_fields = ("at", "wind")

    type: Literal["drag"]
    linear: Quantity = quantity(
        "N s/m", "linear drag", "nonnegative", default=ZERO, validate_default=False
    )
    quadratic: Quantity = quantity(
        "N s^2/m^2", "quadratic drag", "nonnegative", default=ZERO, validate_default=False
    )
    density: Quantity | None = quantity(
        "kg/m^3", "density of the fluid", "nonnegative", default=None
    )
    area: Quantity | None = quantity("m^2", "reference area", "nonnegative", default=None)
    coefficient: Quantity | None = quantity("", "drag coefficient", "nonnegative", default=None)
    turning_linear: Quantity = quantity(
        "N m s/rad", "linear drag on rotation", "nonnegative", default=ZERO, validate_default=False
    )
    turning_quadratic: Quantity = quantity(
        "N m s^2/rad^2",
        "quadratic drag on rotation",
        "nonnegative",
        default=ZERO,
        validate_default=False,
    )
    wind: VectorField = quantity(
        "m/s",
        "velocity of the fluid",
        sees=("motion", "x", "y", "z"),
        default=(),
        validate_default=False,
    )
    allow_active: bool = Field(
        default=False, strict=True, description="whether coefficients may be negative"
    )

    @model_validator(mode="after")
    def _coefficients_fit(self) -> Self:
        given = [key for key in MADE_OF if getattr(self, key) is not None]
        if given and self.quadratic != ZERO:
            raise wrong("quadratic", f"is given in addition to '{given[0]}'; leave one of them out")
        missing = [key for key in MADE_OF if key not in given]
        if given and missing:
            raise wrong(missing[0], "is missing; give density, area and coefficient together")
        turning = (self.turning_linear, self.turning_quadratic)
        if not given and all(x == ZERO for x in (self.linear, self.quadratic, *turning)):
            keys = "linear, quadratic, turning_linear or turning_quadratic"
            raise wrong("linear", f"there is no drag at all; give {keys}")
        return self

    def loads(self, mechanism: Mechanism) -> Iterator[Load]:
        """Force at the point and torque on each body."""
        linear, quadratic = mechanism.value(self.linear), self._quadratic(mechanism)
        turning = tuple(mechanism.value(x) for x in (self.turning_linear, self.turning_quadratic))
        has_wind = any(part != ZERO for part in self.wind)
        has_force = self.linear != ZERO or quadratic is not None
        has_torque = self.turning_linear != ZERO or self.turning_quadratic != ZERO
        for body, at in self.loaded_points(mechanism):
            force: Vector = (mechanism.zero,) * mechanism.dimensions
            if has_force:
                speed = mechanism.velocity(body, at)
                if has_wind:
                    names = local_names(mechanism, self.wind, body, at)
                    wind = tuple(mechanism.value(part, **names) for part in self.wind)
                    speed = mechanism.called("w", *sub(speed, wind))
                force = _drag(mechanism, linear, quadratic, speed)
            torque: Vector = ()
            if has_torque:
                square = turning[1] if self.turning_quadratic != ZERO else None
                torque = _drag(mechanism, turning[0], square, mechanism.angular_velocity(body))
            yield Load(body, force, at, "applied", torque)

    def elements(self, layout: Layout) -> Iterator[Wind]:
        """The wind, if there is any."""
        if any(part != ZERO for part in self.wind):
            yield Wind(self.name, constant(*[0.0] * layout.dimensions), formula=self.wind)

    def _quadratic(self, mechanism: Mechanism) -> Scalar | None:
        """The quadratic coefficient, N s²/m²; None if there is none."""
        if self.density is not None and self.area is not None and self.coefficient is not None:
            half = mechanism.number(0.5) * mechanism.value(self.density)
            return half * mechanism.value(self.area) * mechanism.value(self.coefficient)
        return mechanism.value(self.quadratic) if self.quadratic != ZERO else None


def _drag(mechanism: Mechanism, linear: Scalar, quadratic: Scalar | None, speed: Vector) -> Vector:
    factor = linear
    if quadratic is not None:
        factor = factor + quadratic * length(mechanism, speed)
    return negative(scale(factor, speed))
