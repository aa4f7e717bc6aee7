"""What constraints between a point of a body and another body share: their fields and loads."""

from collections.abc import Mapping
from typing import ClassVar, Self

from pydantic import Field, model_validator

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier
from eomgen.language.quantity import Vector as VectorField
from eomgen.language.quantity import quantity, with_components
from eomgen.scalars import exact
from eomgen.scene.constraints.base import ConstraintTable, Linkage
from eomgen.scene.effects.base import Scalar, Vector
from eomgen.scene.effects.bodies import wrong
from eomgen.scene.effects.touching import Side, Touch
from eomgen.scene.effects.vectors import add, sub
from eomgen.scene.joints.base import WORLD, spatial


class OnOther(ConstraintTable):
    """A constraint on the point `at` of `body` that is fixed to `other`, the world by default."""

    body_fields: ClassVar[tuple[str, ...]] = ("body",)
    anchor_fields: ClassVar[tuple[str, ...]] = ("other",)
    vector_fields: ClassVar[tuple[str, ...]] = ("at", "other_at")
    points_of: ClassVar[Mapping[str, tuple[str, ...]]] = {"at": ("body",), "other_at": ("other",)}

    body: Identifier = Field(description="body that is constrained")
    at: VectorField = quantity(
        "m", "its point, from the centre of mass", default=(), validate_default=False
    )
    other: Identifier = Field(default=WORLD, description="body that holds it, or 'world'")
    other_at: VectorField = quantity(
        "m", "point of the other body, from its centre of mass", default=(), validate_default=False
    )

    @model_validator(mode="after")
    def _two_bodies(self) -> Self:
        if self.body == self.other:
            raise wrong("other", "is also body, which holds its own points; name another body")
        return self

    def points(self, mechanism: Linkage) -> tuple[Vector, Vector]:
        """`at` and `other_at`, each from the centre of mass in body axes, m."""
        at, other_at = (tuple(map(mechanism.value, x)) for x in (self.at, self.other_at))
        return at, other_at

    def apart(self, mechanism: Linkage) -> Vector:
        """The vector from `other_at` to `at`, world axes, m."""
        at, other_at = self.points(mechanism)
        return sub(mechanism.position(self.body, at), mechanism.position(self.other, other_at))

    def touch(self, mechanism: Linkage, normal: Vector, gap: Scalar, lever: Vector = ()) -> Touch:
        """A contact of the two bodies at the point `at` plus a lever, world axes, m."""
        at, other_at = self.points(mechanism)
        sides = [Side(self.body, at, lever)]
        if self.other != WORLD:
            apart = self.apart(mechanism)
            sides.append(Side(self.other, other_at, add(apart, lever) if lever else apart))
        return Touch(normal, gap, tuple(sides))


def checked_direction(
    vector: tuple[float, ...], dimensions: int, location: str
) -> tuple[float, ...]:
    """A direction with its components checked, not normalised."""
    vector = with_components(vector, 0.0, dimensions, location)
    if not any(vector):
        raise SceneError(f"{location}: has no direction; give one that is not zero")
    return vector


def unit(mechanism: Linkage, body: str, vector: tuple[float, ...]) -> Vector:
    """The unit vector along a vector in body axes, in world axes."""
    return mechanism.outward(body, tuple(map(mechanism.number, exact.direction(vector))))


def across(mechanism: Linkage, body: str, vector: tuple[float, ...]) -> list[Vector]:
    """Unit vectors across a vector in body axes, in world axes: one in the plane, two in space."""
    n = mechanism.dimensions
    return [
        mechanism.outward(body, tuple(map(mechanism.number, part[:n])))
        for part in exact.perpendiculars(spatial(vector))
        if n == 3 or part[2] == 0
    ]
