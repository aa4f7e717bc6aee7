"""The base of effects that act on a point of one body, of several bodies, or of all."""

from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from eomgen.language.base import Identifier
from eomgen.language.formula import Formula, names_in
from eomgen.language.quantity import Vector as VectorField
from eomgen.language.quantity import quantity
from eomgen.scene.effects.base import EffectTable, Mechanism, Scalar, Vector


class OnBodies(EffectTable):
    """An effect at the point `at` of `body`, or of each of `bodies`, which may be "all"; or at each
    of the named `points` of the scene.
    """

    body_fields: ClassVar[tuple[str, ...]] = ("body", "bodies")
    point_fields = ("points",)
    vector_fields: ClassVar[tuple[str, ...]] = ("at",)
    points_of: ClassVar[Mapping[str, tuple[str, ...]]] = {"at": ("body", "bodies")}

    naming: ClassVar[tuple[str, ...]] = ("body", "bodies", "points")
    """The keys of which one says where it acts."""

    body: Identifier | None = Field(default=None, description="body it acts on")
    bodies: Literal["all"] | Annotated[tuple[Identifier, ...], Field(min_length=1)] | None = Field(
        default=None, description="bodies it acts on, if several; 'all' are all of the scene"
    )
    points: Annotated[tuple[Identifier, ...], Field(min_length=1)] | None = Field(
        default=None, description="named points it acts on, instead of bodies"
    )
    at: VectorField = quantity(
        "m", "point from the centre of mass", default=(), validate_default=False
    )

    @model_validator(mode="after")
    def _one_or_several(self) -> Self:
        given = [key for key in self.naming if getattr(self, key)]
        if len(given) != 1:
            what = f"is given in addition to '{given[1]}'" if given else "is missing"
            key = given[0] if given else "body"
            raise wrong(key, f"{what}; give one of {', '.join(self.naming)}")
        if given == ["points"] and self.at:
            raise wrong("at", "named points have their own positions; leave it out")
        listed = getattr(self, given[0])
        for i, name in enumerate(listed if isinstance(listed, tuple) else ()):
            if name in listed[:i]:
                raise wrong(f"{given[0]}[{i}]", f"'{name}' is listed twice; leave one out")
        return self

    def acted_on(self, mechanism: Mechanism) -> tuple[str, ...]:
        """Names of the bodies that it acts on."""
        if self.body is not None:
            return (self.body,)
        return self.bodies if isinstance(self.bodies, tuple) else mechanism.bodies

    def loaded_points(self, mechanism: Mechanism) -> Iterator[tuple[str, Vector]]:
        """Each body with its point, from the centre of mass in body axes, m."""
        if self.points is not None:
            yield from (mechanism.point(name) for name in self.points)
            return
        at = tuple(mechanism.value(part) for part in self.at)
        for body in self.acted_on(mechanism):
            yield body, at


def wrong(key: str, message: str) -> PydanticCustomError:
    """A validation error that involves several keys of a table; it is reported at `key`."""
    return PydanticCustomError("keys", "{why}", {"why": message, "key": key})


def local_names(
    mechanism: Mechanism, parts: tuple[Formula, ...], body: str, at: Vector
) -> dict[str, Scalar]:
    """Position x, y, z (m) and velocity vx, vy, vz (m/s) of a point in world axes, if the formulas
    `parts` use them. In the plane z and vz are 0.
    """
    used = {name for part in parts for name in names_in(part)}
    found: dict[str, Scalar] = {}
    for prefix, motion in (("", "position"), ("v", "velocity")):
        names = [f"{prefix}{axis}" for axis in "xyz"]
        if used.intersection(names):
            values = (*getattr(mechanism, motion)(body, at), mechanism.zero)
            found |= dict(zip(names, values, strict=False))
    return found
