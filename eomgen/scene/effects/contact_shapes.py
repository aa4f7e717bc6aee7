"""Shapes with which bodies touch planes and each other."""

from collections.abc import Iterator, Mapping
from itertools import product
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from eomgen.base.errors import SceneError
from eomgen.language.base import Identifier, Number, Table
from eomgen.language.formula import ZERO
from eomgen.language.quantity import Numbers, Quantity, Vector, quantity, with_components
from eomgen.language.rewriting import difference, sum_of, times
from eomgen.scalars import exact
from eomgen.scene.effects.base import Mechanism
from eomgen.scene.effects.bodies import wrong
from eomgen.scene.effects.elements import Touching
from eomgen.scene.effects.touching import Solid
from eomgen.scene.joints.base import WORLD

CORES = ("end", "half_sizes", "semi_axes", "vertices")
MOST_VERTICES = 1000


class ContactShape(Table):
    """A shape with which a body touches others: a core, rounded by `radius`.

    Without more the core is the point `at`, and the shape a sphere, a circle in the plane. With
    `end` it is the line from `at` to there: a capsule. With `half_sizes` it is a box about `at`,
    with `semi_axes` an ellipsoid, both turned by `orientation_deg`, with `vertices` the convex hull
    of points that are given from `at`. Positions are in body axes.

    A plane is touched by the ends of a capsule, the corners of a box, the vertices of a hull, and
    by the lowest point of an ellipsoid, Σ w (w·n)/sqrt(Σ (w·n)²) with its half-axes w. A flat
    ellipsoid is a disc: the rim of a cylinder is one at each end. Spheres, capsules and boxes touch
    each other where their cores are nearest, a capsule and a box at the ends of the capsule, and
    two boxes at the corners of each, too. One of two needs a `radius`, within which they may
    overlap.
    """

    example: ClassVar[str] = """
[[effects]]
type = "contact"
name = "floor"
law = "spring_damper"
stiffness = 1e4

[effects.shapes.forearm]
body = "hand"
at = [0, 0, 0.1]
end = [0, 0, -0.1]
radius = 0.03
"""

    body: Identifier = Field(description="body it is fixed to, or 'world'")
    at: Vector = quantity(
        "m", "its middle, or one end, from the centre of mass", default=(), validate_default=False
    )
    radius: Quantity = quantity("m", "radius", "nonnegative", default=ZERO, validate_default=False)
    end: Vector | None = quantity(
        "m", "the other end of a capsule, from the centre of mass", default=None
    )
    half_sizes: Vector | None = quantity("m", "half sizes of a box", "positive", default=None)
    semi_axes: Vector | None = quantity("m", "half-axes of an ellipsoid", "positive", default=None)
    vertices: Annotated[tuple[Numbers, ...], Field(max_length=MOST_VERTICES)] = Field(
        default=(), description="points whose hull it is, from `at`, m"
    )
    orientation_deg: Number | tuple[Number, Number, Number] = Field(
        default=0.0,
        description="rotation of a box or an ellipsoid about x, then y, then z; in the plane one "
        "angle",
    )

    @model_validator(mode="after")
    def _one_core(self) -> Self:
        given = [key for key in CORES if getattr(self, key)]
        if len(given) > 1:
            raise wrong(given[1], f"is given in addition to '{given[0]}'; give one of them")
        if "orientation_deg" in self.model_fields_set and not (self.half_sizes or self.semi_axes):
            raise wrong("orientation_deg", "turns half_sizes or semi_axes; leave it out")
        return self

    def checked(self, dimensions: int, location: str) -> Self:
        """Itself, with a component of each vector for each dimension."""
        fields = {key: getattr(self, key) for key in ("at", *CORES[:-1])}
        fields |= {f"vertices[{i}]": point for i, point in enumerate(self.vertices)}
        for key, vector in fields.items():
            with_components(tuple(vector or ()), ZERO, dimensions, f"{location}.{key}")
        if isinstance(self.orientation_deg, tuple) and dimensions == 2:
            raise SceneError(f"{location}.orientation_deg: has 3 components; the plane takes one")
        if dimensions == 3 and not isinstance(self.orientation_deg, tuple) and self.orientation_deg:
            raise SceneError(f"{location}.orientation_deg: is one angle; space takes 3")
        return self

    def from_centre(self, centres: Mapping[str, Vector]) -> Self:
        """Itself, with points of a body that has its own frame from the centre of mass in it."""
        fields = dict[str, Vector]()
        if centre := centres.get(self.body):
            for key in ("at", "end"):
                pairs = zip(getattr(self, key) or (), centre, strict=False)
                fields[key] = tuple(difference(r, c) for r, c in pairs)
        return self.replaced(**{key: point for key, point in fields.items() if point})

    @property
    def edges(self) -> Vector:
        """The half sizes of a box or an ellipsoid."""
        return self.half_sizes or self.semi_axes or ()

    def count(self, dimensions: int) -> int:
        """At how many points it touches a plane."""
        if self.half_sizes:
            return 1 << dimensions
        return max(len(self.vertices), 2 if self.end else 1)

    def solid(self, mechanism: Mechanism) -> Solid:
        """The shape with numbers."""
        n = mechanism.dimensions
        zeros = (mechanism.zero,) * n
        at = tuple(map(mechanism.value, self.at)) or zeros
        arms = [tuple(map(mechanism.number, point)) for point in self.vertices] or [()]
        if self.end:
            pairs = zip(self.end, at, strict=True)
            arms.append(tuple(mechanism.value(end) - start for end, start in pairs))
        turn = exact.orientation(self.orientation_deg)
        edges = []
        for k, size in enumerate(map(mechanism.value, self.edges)):
            edges.append(tuple(mechanism.number(turn[i][k]) * size for i in range(n)))
        radius = mechanism.value(self.radius)
        smooth = self.semi_axes is not None
        return Solid(self.body, at, radius, tuple(arms), tuple(edges), smooth=smooth)

    def places(self, dimensions: int) -> Iterator[Vector]:
        """The points of its core that a picture shows: middle, ends or corners of a box that is
        not turned.
        """
        zero = (ZERO,) * dimensions
        if self.half_sizes and not self.orientation_deg:
            for signs in product((-1.0, 1.0), repeat=dimensions):
                half = tuple(times(*pair) for pair in zip(signs, self.half_sizes, strict=True))
                yield sum_of(self.at or zero, half)
        elif not (self.edges or self.vertices):
            yield self.at or zero
            if self.end:
                yield self.end

    def touching(self, dimensions: int) -> Iterator[Touching]:
        """What a picture of its body shows, if there is no other: none of the world, of hulls, and
        in the plane of ellipses and of boxes that are turned.
        """
        flat = dimensions == 2 and (self.semi_axes or self.orientation_deg)
        if self.body == WORLD or self.vertices or flat:
            return
        turn = self.orientation_deg if isinstance(self.orientation_deg, tuple) else ()
        at = self.at or (ZERO,) * dimensions
        sizes = self.half_sizes, self.end, self.semi_axes
        yield Touching(self.body, at, self.radius, *sizes, turn)


def between_count(first: ContactShape, second: ContactShape, dimensions: int) -> int:
    """At how many points two spheres, capsules or boxes touch: see `nearest.between`."""
    boxes = [shape for shape in (first, second) if shape.half_sizes]
    if len(boxes) == 2:
        return (2 << dimensions) + (dimensions == 3)
    return 3 if boxes and (first.end or second.end) else 1
