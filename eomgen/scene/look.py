"""The appearance of a scene: shapes on bodies, and the camera. No equation depends on it."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, TypeAlias

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
        raise ValueError("is no colour: write #rrggbb, for example '#3366cc'")
    return text


Colour = Annotated[str, AfterValidator(_colour)]

# How many components a scene wants is known only with its dimensions: `check_look` counts them.
Point = Annotated[tuple[Number, ...], Field(min_length=2, max_length=3)]
Lengths = Annotated[tuple[Positive, ...], Field(min_length=2, max_length=3)]
Turns = tuple[Number, Number, Number]

NOTHING = "the body's centre of mass if absent"


class Box(Table):
    """A rectangle or a cuboid, `size` m along its own axes, in body axes.

    In the plane it is turned by `angle` rad; in space by `orientation_deg` about x, then y, then z
    of the body's axes.
    """

    type: Literal["box"]
    size: Lengths
    center: Point | None = Field(default=None, description=NOTHING)
    angle: Number = Field(default=0.0, description="rad, in the plane")
    orientation_deg: Turns = Field(
        default=(0.0, 0.0, 0.0), description="about x, then y, then z, in space"
    )
    color: Colour = "#4477aa"


class Disc(Table):
    """A disc of `radius` m about `center`, in body axes; in the plane."""

    type: Literal["disc"]
    radius: Positive
    center: Point | None = Field(default=None, description=NOTHING)
    color: Colour = "#4477aa"


class Polygon(Table):
    """A closed polygon through `points`, m, body axes; in the plane."""

    type: Literal["polygon"]
    points: Annotated[tuple[Point, ...], Field(min_length=3, max_length=1000)]
    color: Colour = "#4477aa"


class Rod(Table):
    """A thick line with round ends from one point to another, m, body axes."""

    type: Literal["rod"]
    start: Point
    end: Point
    width: Positive
    color: Colour = "#4477aa"


class Sphere(Table):
    """A ball of `radius` m about `center`, in body axes; in space."""

    type: Literal["sphere"]
    radius: Positive
    center: Point | None = Field(default=None, description=NOTHING)
    color: Colour = "#4477aa"


class Cylinder(Table):
    """A cylinder of `radius` m with flat ends at `start` and `end`, m, body axes; in space."""

    type: Literal["cylinder"]
    start: Point
    end: Point
    radius: Positive
    color: Colour = "#4477aa"


class Ellipsoid(Table):
    """An ellipsoid with half-axes `radii` m, turned like a box, in body axes; in space."""

    type: Literal["ellipsoid"]
    radii: Lengths
    center: Point | None = Field(default=None, description=NOTHING)
    orientation_deg: Turns = Field(default=(0.0, 0.0, 0.0), description="about x, then y, then z")
    color: Colour = "#4477aa"


Shape: TypeAlias = Annotated[
    Box | Cylinder | Disc | Ellipsoid | Polygon | Rod | Sphere, Field(discriminator="type")
]

INSTEAD = {
    2: {"sphere": "disc", "cylinder": "box", "ellipsoid": "disc"},
    3: {"disc": "sphere", "polygon": "box"},
}
"""Shapes that there are not in so many dimensions, and what to use for each."""


class Camera(Table):
    """Where the picture looks: at `center` (m, world axes), or at the body it follows.

    `height` is what the picture shows from bottom to top, m. In space the eye stands far off, in
    the direction that `azimuth_deg` turns from x towards y and `elevation_deg` lifts towards z.
    """

    center: Point | None = Field(default=None, description="the world's origin if absent")
    height: Positive = 4.0
    follow: Identifier | None = None
    background: Colour = "#ffffff"
    azimuth_deg: Number = Field(default=-60.0, description="in space")
    elevation_deg: Annotated[Number, Field(ge=-90, le=90)] = Field(
        default=20.0, description="in space"
    )


def check_look(
    shapes: Sequence[Shape], camera: Camera | None, dimensions: int, location: str
) -> None:
    """Check that `shapes` and `camera` are of the plane (`dimensions` 2) or of space (3).

    `location` is where the scene gives them, for messages: `bodies[0]` for the shapes of a body,
    `camera` for the camera. Raises `SceneError` with place, value and remedy.
    """
    for i, shape in enumerate(shapes):
        _check_shape(shape, dimensions, f"{location}.shapes[{i}]")
    if camera is not None:
        _check_point(camera.center, dimensions, f"{location}.center")
        if dimensions == 2:
            for key in ("azimuth_deg", "elevation_deg"):
                if key in camera.model_fields_set:
                    raise SceneError(
                        f"{location}.{key}: {getattr(camera, key):g}: the camera of the plane does "
                        "not turn; leave it out, or set dimensions = 3"
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
            raise SceneError(f"{location}.{wrong}: turns a box of {there}; in {here} use '{right}'")
    if isinstance(shape, Cylinder) and shape.start == shape.end:
        raise SceneError(f"{location}.end: {list(shape.end)} is the start too; give it a length")


def _points(shape: Shape) -> Iterator[tuple[str, tuple[float, ...] | None]]:
    """What a shape has one component of for each dimension, with its key."""
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
