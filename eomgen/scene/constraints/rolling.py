"""Rolling without slip: wheels, spheres and ellipsoids on planes, spheres on spheres.

The lowest point of a convex body over a plane follows from its support function h (Kane and
Levinson, "Realistic mathematical modeling of the rattleback", 1982, for the ellipsoid). With the
plane's normal n in body axes, h(n) is how far the body reaches against n from its centre, and the
contact point is -∇h(n) from the centre. ∇h changes at right angles to n, so the rate of the gap is
the normal velocity of the material point in contact.
"""

import math
from collections.abc import Iterator
from functools import reduce
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from eomgen.base.errors import SceneError
from eomgen.language.conditions import Condition
from eomgen.language.formula import ZERO, Apply
from eomgen.language.quantity import Numbers, Quantity, Vector, quantity
from eomgen.language.rewriting import constant, times, total
from eomgen.scene.constraints.base import Linkage, Row
from eomgen.scene.constraints.between import OnOther, across, checked_direction, unit
from eomgen.scene.effects.base import Scalar
from eomgen.scene.effects.base import Vector as Components
from eomgen.scene.effects.bodies import wrong
from eomgen.scene.effects.elements import WORLD_INDEX, Layout, Plane, Round
from eomgen.scene.effects.touching import Touch, normal_loads, point_loads, tangents
from eomgen.scene.effects.vectors import add, dot, negative, scale, sub


class Rolling(OnOther):
    """A body rolls without slip and without leaving the surface: its point in contact has the
    velocity of the surface there. The centre of its shape is the point `at`. It is

    - a sphere of `radius`; in the plane a wheel;
    - in space with `axis` a disc of this outer `radius`, whose edge is sharp or rounded with the
      radius `rim`;
    - an ellipsoid with `semi_axes` along the body's axes; in the plane an ellipse.

    The surface is the plane through `other_at` with the normal `normal`, by default up; or, for a
    sphere, the sphere of `other_radius` around `other_at`, in the plane a circle, on whose outside
    it rolls, or `inside`. It is fixed to `other`.

    The row `<name>_normal` keeps the distance at 0; its multiplier is the normal force, N. If that
    becomes negative, the surface holds the body: it does not lift off. The rows `<name>_along`, in
    space `<name>_along_1` and `<name>_along_2`, restrict velocities only; their multipliers are the
    components of the friction that rolling needs. A disc that lies flat is singular.
    """

    told = "A body rolls without slip: its point in contact has the velocity of the surface there."
    example: ClassVar[str] = """
[[constraints]]
type = "rolling"
name = "wheel"
body = "hand"
radius = 0.2
other_at = [0, -1.4]
"""
    type: Literal["rolling"]
    radius: Quantity | None = quantity("m", "outer radius", "positive", default=None)
    axis: Numbers = Field(
        default=(), validate_default=False, description="axis of the disc, in body axes"
    )
    rim: Quantity = quantity(
        "m",
        "radius with which the edge of the disc is rounded",
        "nonnegative",
        default=ZERO,
        validate_default=False,
    )
    semi_axes: Vector | None = quantity("m", "half axes of the ellipsoid", "positive", default=None)
    normal: Numbers = Field(
        default=(),
        validate_default=False,
        description="direction of the outward normal of the plane, in the axes of other",
    )
    other_radius: Quantity | None = quantity(
        "m", "radius of the sphere it rolls on", "positive", default=None
    )
    inside: bool = Field(
        default=False, strict=True, description="whether it rolls inside that sphere"
    )

    @model_validator(mode="after")
    def _keys_fit(self) -> Self:
        given = self.model_fields_set
        if (self.radius is None) == (self.semi_axes is None):
            raise wrong("radius", "give radius or semi_axes, one of them")
        if self.radius is None and self.axis:
            raise wrong("axis", "is that of a disc, which has a radius; leave it out")
        if "rim" in given and not self.axis:
            raise wrong("rim", "rounds the edge of a disc; give its axis, or leave it out")
        if self.other_radius is None and self.inside:
            raise wrong("inside", "is that of a sphere; give its other_radius")
        if self.other_radius is not None:
            if self.normal:
                raise wrong("normal", "is that of a plane; give it or other_radius")
            if self.axis or self.semi_axes is not None:
                key = "axis" if self.axis else "semi_axes"
                raise wrong(key, "on a sphere a sphere rolls, with a radius alone; leave it out")
        return self

    def checked(self, dimensions: int, location: str) -> Self:
        """Check directions and the number of half axes; set the default normal."""
        if self.axis and dimensions == 2:
            raise SceneError(f"{location}.axis: in the plane a wheel turns about z; leave it out")
        if self.semi_axes is not None and len(self.semi_axes) != dimensions:
            raise SceneError(
                f"{location}.semi_axes: has {len(self.semi_axes)} components; give {dimensions}"
            )
        fields = {}
        if self.axis:
            fields["axis"] = checked_direction(self.axis, dimensions, f"{location}.axis")
        if self.other_radius is None:
            up = (0.0,) * (dimensions - 1) + (1.0,)
            fields["normal"] = checked_direction(
                self.normal or up, dimensions, f"{location}.normal"
            )
        return self.replaced(**fields)

    def conditions(self, location: str) -> Iterator[Condition]:
        """A rim is smaller than its disc; a sphere inside another is smaller than that."""
        if self.axis and self.rim != ZERO:
            assert self.radius is not None
            rest = Apply("-", (self.radius, self.rim))
            words = "{:g} is not less than the radius, {:g}; give a smaller rim"
            shown = (self.rim, self.radius)
            yield Condition(f"{location}.rim", rest, words, shown, strict=True)
        if self.inside:
            assert self.radius is not None and self.other_radius is not None
            rest = Apply("-", (self.other_radius, self.radius))
            words = "{:g} is not less than other_radius, {:g}, inside which it rolls"
            shown = (self.radius, self.other_radius)
            yield Condition(f"{location}.radius", rest, words, shown, strict=True)

    def elements(self, layout: Layout) -> Iterator[Plane | Round]:
        """What is fixed in the world, the plane or the sphere, and a wheel or ball that rolls."""
        other, body = layout.bodies[self.other], layout.bodies[self.body]
        if other == WORLD_INDEX and self.other_radius is None:
            length = math.hypot(*self.normal)
            normal = [n / length for n in self.normal]
            parts = (times(n, x) for n, x in zip(normal, self.other_at, strict=True))
            yield Plane(self.name, other, constant(*normal), reduce(total, parts))
        elif other == WORLD_INDEX and self.other_radius is not None and not self.inside:
            yield Round("ball", self.name, other, self.other_at, self.other_radius)
        if self.radius is not None and not self.axis:
            kind: Literal["wheel", "ball"] = "wheel" if layout.dimensions == 2 else "ball"
            yield Round(kind, self.name, body, self.at, self.radius)

    def row_names(self, dimensions: int) -> list[tuple[str, str]]:
        """The normal row, then one row in the plane, two in space."""
        words = ["along"] if dimensions == 2 else ["along_1", "along_2"]
        return [(f"{self.name}_{word}", "N") for word in ("normal", *words)]

    def velocity_rows(self, dimensions: int) -> list[str]:
        """The rows in the plane."""
        return [name for name, _ in self.row_names(dimensions)[1:]]

    def rows(self, mechanism: Linkage) -> Iterator[Row]:
        """The gap, and the slip velocity along each tangent."""
        if self.other_radius is None:
            touch = self._on_plane(mechanism)
            along = across(mechanism, self.other, self.normal)
        else:
            touch = self._on_sphere(mechanism, mechanism.value(self.other_radius))
            along = list(tangents(mechanism, touch))
        loads = normal_loads(touch, mechanism.number(1.0))
        yield Row(touch.gap, loads, margin=self._steepness(mechanism))
        for tangent in along:
            yield Row(None, point_loads(touch, tangent))

    def _on_plane(self, mechanism: Linkage) -> Touch:
        n = unit(mechanism, self.other, self.normal)
        reach, lever = self._support(mechanism, n)
        gap = dot(n, self.apart(mechanism)) - reach
        return self.touch(mechanism, n, gap, lever)

    def _on_sphere(self, mechanism: Linkage, other_radius: Scalar) -> Touch:
        assert self.radius is not None
        radius, d = mechanism.value(self.radius), self.apart(mechanism)
        far = mechanism.call("sqrt", dot(d, d))
        n = tuple(x / far for x in d)
        if self.inside:
            n, gap = negative(n), (other_radius - radius) - far
        else:
            gap = far - (other_radius + radius)
        return self.touch(mechanism, n, gap, negative(scale(radius, n)))

    def _support(self, mechanism: Linkage, n: Components) -> tuple[Scalar, Components]:
        """h for the normal n, m, and the lever -∇h from the centre to the contact point; both in
        world axes.
        """
        if self.semi_axes is not None:
            return self._support_of_ellipsoid(mechanism, n)
        assert self.radius is not None
        radius = mechanism.value(self.radius)
        if not self.axis:
            return radius, negative(scale(radius, n))
        rim, steep = mechanism.value(self.rim), self._steep(mechanism, n)
        size = mechanism.call("sqrt", dot(steep, steep))
        inner = radius - rim
        lever = add(scale(inner / size, steep), scale(rim, n))
        return inner * size + rim, negative(lever)

    def _steep(self, mechanism: Linkage, n: Components) -> Components:
        """The normal n without its part along the axis of a disc."""
        a = unit(mechanism, self.body, self.axis)
        return sub(n, scale(dot(n, a), a))

    def _steepness(self, mechanism: Linkage) -> Scalar | None:
        """sin² of a disc's tilt: 0 where it lies flat and has no lowest point."""
        if not self.axis:
            return None
        steep = self._steep(mechanism, unit(mechanism, self.other, self.normal))
        return dot(steep, steep)

    def _support_of_ellipsoid(self, mechanism: Linkage, n: Components) -> tuple[Scalar, Components]:
        """h² = Σ (a_i n·e_i)²; ∇h = Σ a_i² (n·e_i) e_i / h."""
        assert self.semi_axes is not None
        count, parts = mechanism.dimensions, []
        for i, half in enumerate(map(mechanism.value, self.semi_axes)):
            e = mechanism.outward(
                self.body, tuple(mechanism.number(float(i == k)) for k in range(count))
            )
            parts.append((half * dot(n, e), half, e))
        square = parts[0][0] * parts[0][0]
        for along, _, _ in parts[1:]:
            square = square + along * along
        h = mechanism.call("sqrt", square)
        lever = scale(parts[0][0] * parts[0][1] / h, parts[0][2])
        for along, half, e in parts[1:]:
            lever = add(lever, scale(along * half / h, e))
        return h, negative(lever)
