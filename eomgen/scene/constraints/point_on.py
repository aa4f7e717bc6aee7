"""A point that stays on a line, a plane, or a curve or surface given by formulas."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from eomgen.base.errors import SceneError
from eomgen.language.formula import names_in
from eomgen.language.quantity import Numbers, Quantity, quantity
from eomgen.scene.constraints.base import Linkage, Row
from eomgen.scene.constraints.between import OnOther, across, checked_direction, unit
from eomgen.scene.effects.base import Vector
from eomgen.scene.effects.bodies import wrong
from eomgen.scene.effects.touching import normal_loads
from eomgen.scene.effects.vectors import add, dot, scale

KINDS = ("line", "normal", "equations")


class PointOn(OnOther):
    """The point `at` of `body` stays, without friction, on

    - `line`: the line through `other_at` in this direction;
    - `normal`: the plane through `other_at` with this normal;
    - `equations`: where these formulas are 0. They are formulas of the point's position x, y, z
      from `other_at`, of `t` and of parameters. In the plane one formula is a curve; in space one
      is a surface and two are a curve.

    All are fixed to `other`, in its axes. The residual of a formula f is f/|grad f|, so its
    multiplier is the force on the point along the gradient, N. Where the gradient is 0, as at the
    apex of a cone, the constraint is singular.
    """

    told = "A point stays on a line, a curve or a surface, without friction."
    example: ClassVar[str] = """
[[constraints]]
type = "point_on"
name = "ring"
body = "hand"
equations = ["(x - 0.5)**2 + (y + 1.2)**2 - 0.7**2"]
"""
    type: Literal["point_on"]
    line: Numbers = Field(default=(), validate_default=False, description="direction of the line")
    normal: Numbers = Field(
        default=(), validate_default=False, description="direction of the plane's normal"
    )
    equations: Annotated[tuple[Quantity, ...], Field(min_length=1, max_length=2)] = quantity(
        "", "is kept at 0", sees=("x", "y", "z", "t"), default=(), validate_default=False
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        given = [kind for kind in KINDS if getattr(self, kind)]
        if len(given) != 1:
            what = f"is given in addition to '{given[0]}'" if given else "is missing"
            key = given[1] if given else KINDS[0]
            raise wrong(key, f"{what}; give one of {', '.join(KINDS)}")
        return self

    def checked(self, dimensions: int, location: str) -> Self:
        """Check directions, the number of equations, and that they depend on the position."""
        if self.equations:
            self._check_equations(dimensions, location)
            return self
        key = "line" if self.line else "normal"
        if key == "normal" and dimensions == 2:
            raise SceneError(f"{location}.normal: the plane has no planes in it; give a line")
        direction = checked_direction(getattr(self, key), dimensions, f"{location}.{key}")
        return self.replaced(**{key: direction})

    def _check_equations(self, dimensions: int, location: str) -> None:
        if len(self.equations) >= dimensions:
            raise SceneError(
                f"{location}.equations: 2 equations hold the point in the plane; give one"
            )
        axes = "xyz"[:dimensions]
        for i, equation in enumerate(self.equations):
            used, where = set(names_in(equation)), f"{location}.equations[{i}]"
            if dimensions == 2 and "z" in used:
                raise SceneError(f"{where}: has z, which is 0 in the plane; use x and y")
            if not used.intersection(axes):
                raise SceneError(f"{where}: depends on none of {', '.join(axes)}; name a curve")

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """One row of the constraint's name, or two that are numbered."""
        count = len(self.equations) or (dimensions - 1 if self.line else 1)
        if count == 1:
            return [(self.name, "N")]
        return [(f"{self.name}_{i + 1}", "N") for i in range(count)]

    def rows(self, mechanism: Linkage) -> Iterator[Row]:
        """The distances from the line or plane; f/|grad f| of each equation."""
        one, d = mechanism.number(1.0), self.apart(mechanism)
        if self.equations:
            yield from self._formula_rows(mechanism, d)
            return
        if self.line:
            directions = across(mechanism, self.other, self.line)
        else:
            directions = [unit(mechanism, self.other, self.normal)]
        for e in directions:
            gap = dot(e, d)
            yield Row(gap, normal_loads(self.touch(mechanism, e, gap), one))

    def _formula_rows(self, mechanism: Linkage, d: Vector) -> Iterator[Row]:
        one, count = mechanism.number(1.0), mechanism.dimensions
        axes = [
            mechanism.outward(
                self.other, tuple(mechanism.number(float(i == k)) for k in range(count))
            )
            for i in range(count)
        ]
        names = {name: dot(d, axis) for name, axis in zip("xyz", axes, strict=False)}
        for equation in self.equations:
            value, slopes, by_time = mechanism.gradient(equation, names)
            size = mechanism.call("sqrt", dot(slopes, slopes))
            along = scale(slopes[0], axes[0])
            for slope, axis in zip(slopes[1:], axes[1:], strict=True):
                along = add(along, scale(slope, axis))
            e = tuple(part / size for part in along)
            gap = value / size
            loads = normal_loads(self.touch(mechanism, e, gap), one)
            yield Row(gap, loads, by_time / size)
