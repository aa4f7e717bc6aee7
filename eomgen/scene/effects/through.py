"""The way of a rope through points, rings and discs, as tables of a scene."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier, Table
from eomgen.language.formula import ZERO, Formula
from eomgen.language.quantity import Quantity, Vector, quantity, with_components
from eomgen.language.rewriting import difference
from eomgen.scene.effects.base import EffectTable
from eomgen.scene.effects.bodies import wrong
from eomgen.scene.effects.spans import Stop

MOST_STOPS = 100
Sense = Literal["clockwise", "counterclockwise"]


class RopePoint(Table):
    """What a rope is held by or runs through: a point or a ring, or with `radius` a disc about it,
    which it goes round in the sense `winds`, seen along the rope from its first end to its last.

    The rope slides through rings and over discs without friction. A disc that `grips` takes it
    along without slip; so does a disc at an end, a drum, on which it is wound.
    """

    example: ClassVar[str] = """
[[constraints]]
type = "rope"
name = "hoist"

[[constraints.through]]
body = "hand"

[[constraints.through]]
body = "world"
at = [0.4, 1.0]
radius = 0.1
winds = "clockwise"

[[constraints.through]]
body = "world"
at = [0.9, -0.5]
"""

    body: Identifier = Field(description="body it is fixed to, or 'world'")
    at: Vector = quantity(
        "m", "the point, from the centre of mass", default=(), validate_default=False
    )
    radius: Quantity | None = quantity("m", "radius of the disc", "positive", default=None)
    winds: Sense | None = Field(default=None, description="sense in which the rope goes round it")
    grips: bool = Field(
        default=False, strict=True, description="whether the disc takes the rope without slip"
    )

    @model_validator(mode="after")
    def _keys_fit(self) -> Self:
        if self.radius is None and self.winds is not None:
            raise wrong("winds", "is that of a disc; give its radius, or leave it out")
        if self.radius is None and self.grips:
            raise wrong("grips", "is that of a disc; give its radius, or leave it out")
        if self.radius is not None and self.winds is None:
            raise wrong("winds", "is missing; say how the rope goes round: clockwise or not")
        return self


class Through(EffectTable):
    """What runs `through` points, rings and discs."""

    anchor_fields: ClassVar[tuple[str, ...]] = ("through",)

    through: Annotated[tuple[RopePoint, ...], Field(min_length=2, max_length=MOST_STOPS)] = Field(
        description="what it is held by and runs through, from end to end"
    )

    def checked(self, dimensions: int, location: str) -> Self:
        """Check points, and that discs are in the plane."""
        through = []
        for i, point in enumerate(self.through):
            at = with_components(point.at, ZERO, dimensions, f"{location}.through[{i}].at")
            if point.radius is not None and dimensions == 3:
                raise SceneError(
                    f"{location}.through[{i}].radius: a rope goes round discs in the plane only; "
                    "in space leave it out: the rope runs through a ring"
                )
            through.append(point.replaced(at=at))
        return self.replaced(through=tuple(through))

    def from_centres(self, centres: Mapping[str, tuple[Formula, ...]]) -> Mapping[str, Any]:
        """Its points from the centres of mass."""
        return {
            "through": tuple(
                point.replaced(
                    at=tuple(
                        difference(r, c) for r, c in zip(point.at, centres[point.body], strict=True)
                    )
                )
                if point.body in centres
                else point
                for point in self.through
            )
        }

    def stops(self) -> tuple[Stop, ...]:
        """Its points."""
        return tuple(
            Stop(p.body, p.at, p.radius, p.winds != "clockwise", p.grips) for p in self.through
        )
