"""The appearance of a scene: shapes on bodies, and the camera. No equation depends on it."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import AfterValidator, Field

from eomgen.errors import SceneError
from eomgen.language.base import Identifier, Number, Positive, Table


def _colour(text: str) -> str:
    digits = text[1:]
    if not (
        text.startswith("#")
        and len(digits) == 6
        and all(c in "0123456789abcdefABCDEF" for c in digits)
    ):
        raise ValueError("is not a colour: write #rrggbb, for example '#3366cc'")
    return text


Colour = Annotated[str, AfterValidator(_colour)]

# The number of components depends on the scene's dimensions; `check_look` checks it.
Point = Annotated[tuple[Number, ...], Field(min_length=2, max_length=3)]
Lengths = Annotated[tuple[Positive, ...], Field(min_length=2, max_length=3)]
Angles = tuple[Number, Number, Number]


def _metres(about: str, **options: Any) -> Any:
    """A field for a length or a position, m."""
    return Field(description=about, json_schema_extra={"unit": "m"}, **options)


def _colour_field() -> Any:
    return Field(default="#4477aa", description="colour, #rrggbb")


def _center() -> Any:
    return _metres("centre; the body's centre of mass if absent", default=None)


class Box(Table):
    """A rectangle or a cuboid with edges of `size` m, centred at `center` in body axes.

    It is rotated relative to the body: in the plane by `angle` rad, in space by `orientation_deg`
    about the body's x, then y, then z axis.
    """

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "box"
size = [0.4, 0.1]
color = "#33658a"
"""
    type: Literal["box"]
    size: Lengths = _metres("lengths of its edges")
    center: Point | None = _center()
    angle: Number = Field(default=0.0, description="angle of rotation, rad, in the plane")
    orientation_deg: Angles = Field(
        default=(0.0, 0.0, 0.0), description="rotation about x, then y, then z, in space"
    )
    color: Colour = _colour_field()


class Disc(Table):
    """A disc of `radius` m about `center`, in body axes; in the plane."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "disc"
radius = 0.05
"""
    type: Literal["disc"]
    radius: Positive = _metres("radius")
    center: Point | None = _center()
    color: Colour = _colour_field()


class Polygon(Table):
    """A closed polygon through `points`, m, body axes; in the plane."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "polygon"
points = [[0, 0], [0.3, 0], [0, 0.2]]
"""
    type: Literal["polygon"]
    points: Annotated[tuple[Point, ...], Field(min_length=3, max_length=1000)] = _metres(
        "corners in order"
    )
    color: Colour = _colour_field()


class Rod(Table):
    """A thick line with round ends from one point to another, m, body axes."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "rod"
start = [-0.4, 0]
end = [0.4, 0]
width = 0.06
"""
    type: Literal["rod"]
    start: Point = _metres("one end")
    end: Point = _metres("the other end")
    width: Positive = _metres("width")
    color: Colour = _colour_field()


class Sphere(Table):
    """A ball of `radius` m about `center`, in body axes; in space."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "sphere"
radius = 0.05
center = [0, 0, 0.1]
"""
    type: Literal["sphere"]
    radius: Positive = _metres("radius")
    center: Point | None = _center()
    color: Colour = _colour_field()


class Cylinder(Table):
    """A cylinder of `radius` m with flat ends at `start` and `end`, m, body axes; in space."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "cylinder"
start = [0, 0, -0.4]
end = [0, 0, 0.4]
radius = 0.03
"""
    type: Literal["cylinder"]
    start: Point = _metres("one end")
    end: Point = _metres("the other end")
    radius: Positive = _metres("radius")
    color: Colour = _colour_field()


class Ellipsoid(Table):
    """An ellipsoid with half-axes `radii` m, in body axes, rotated like a box; in space."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "ellipsoid"
radii = [0.1, 0.1, 0.3]
"""
    type: Literal["ellipsoid"]
    radii: Lengths = _metres("half-axes")
    center: Point | None = _center()
    orientation_deg: Angles = Field(default=(0.0, 0.0, 0.0), description="about x, then y, then z")
    color: Colour = _colour_field()


Shape: TypeAlias = Annotated[
    Box | Cylinder | Disc | Ellipsoid | Polygon | Rod | Sphere, Field(discriminator="type")
]


def from_centre(shape: Shape, com: Sequence[float]) -> Shape:
    """A shape given in a body's frame, from its centre of mass `com`; () if that is the origin."""
    fields: dict[str, object] = {}
    for name in ("center", "start", "end") if com else ():
        if (point := getattr(shape, name, None)) is not None:
            fields[name] = _shifted(point, com)
    if com and isinstance(shape, Polygon):
        fields["points"] = tuple(_shifted(point, com) for point in shape.points)
    return shape.replaced(**fields) if fields else shape


def _shifted(point: Sequence[float], com: Sequence[float]) -> tuple[float, ...]:
    return tuple(x - c for x, c in zip(point, com, strict=True))


INSTEAD = {
    2: {"sphere": "disc", "cylinder": "box", "ellipsoid": "disc"},
    3: {"disc": "sphere", "polygon": "box"},
}
"""Shapes that do not exist in 2 or 3 dimensions, with the one to use instead."""


class Camera(Table):
    """The camera. It looks at `center` (m, world axes), or at the body that it follows.

    `height` is the distance from the bottom to the top of the picture, m. In space the picture is a
    parallel projection, seen from a direction that is rotated by `azimuth_deg` from x towards y and
    by `elevation_deg` towards z.
    """

    example: ClassVar[str] = """
[camera]
height = 3.0
follow = "arm"
"""
    center: Point | None = _metres(
        "point that it looks at; the world's origin if absent", default=None
    )
    height: Positive = _metres("height of the picture", default=4.0)
    follow: Identifier | None = Field(default=None, description="body that it follows")
    background: Colour = Field(default="#ffffff", description="colour of the background")
    azimuth_deg: Number = Field(
        default=-60.0, description="direction of view, from x towards y, in space"
    )
    elevation_deg: Annotated[Number, Field(ge=-90, le=90)] = Field(
        default=20.0, description="direction of view, towards z, in space"
    )


def check_look(
    shapes: Sequence[Shape], camera: Camera | None, dimensions: int, location: str
) -> None:
    """Check that `shapes` and `camera` fit the plane (`dimensions` 2) or space (3).

    `location` is that of the body or the camera in the scene, such as `bodies[0]`. Raises
    `SceneError` with location, value and remedy.
    """
    for i, shape in enumerate(shapes):
        _check_shape(shape, dimensions, f"{location}.shapes[{i}]")
    if camera is not None:
        _check_point(camera.center, dimensions, f"{location}.center")
        if dimensions == 2:
            for key in ("azimuth_deg", "elevation_deg"):
                if key in camera.model_fields_set:
                    raise SceneError(
                        f"{location}.{key}: {getattr(camera, key):g}: the camera cannot be "
                        "rotated in the plane; leave it out, or set dimensions = 3"
                    )


def _check_shape(shape: Shape, dimensions: int, location: str) -> None:
    here, there = ("the plane", "space") if dimensions == 2 else ("space", "the plane")
    instead = INSTEAD[dimensions].get(shape.type)
    if instead:
        raise SceneError(f"{location}.type: '{shape.type}' is a shape of {there}; use '{instead}'")
    for key, point in _points(shape):
        _check_point(point, dimensions, f"{location}.{key}")
    if isinstance(shape, Box):
        right, wrong = ("angle", "orientation_deg")[:: 1 if dimensions == 2 else -1]
        if wrong in shape.model_fields_set:
            raise SceneError(
                f"{location}.{wrong}: rotates a box in {there}; in {here} use '{right}'"
            )
    if isinstance(shape, Cylinder) and shape.start == shape.end:
        raise SceneError(f"{location}.end: {list(shape.end)} is also the start; give it a length")


def _points(shape: Shape) -> Iterator[tuple[str, tuple[float, ...] | None]]:
    """The vectors of a shape that have one component for each dimension, with their keys."""
    match shape:
        case Box():
            yield from (("size", shape.size), ("center", shape.center))
        case Disc() | Sphere():
            yield "center", shape.center
        case Ellipsoid():
            yield from (("radii", shape.radii), ("center", shape.center))
        case Polygon():
            yield from ((f"points[{i}]", point) for i, point in enumerate(shape.points))
        case Rod() | Cylinder():
            yield from (("start", shape.start), ("end", shape.end))


def _check_point(point: tuple[float, ...] | None, dimensions: int, location: str) -> None:
    if point is not None and len(point) != dimensions:
        where = "the plane" if dimensions == 2 else "space"
        raise SceneError(
            f"{location}: {list(point)} has {len(point)} components; in {where} give {dimensions}"
        )
