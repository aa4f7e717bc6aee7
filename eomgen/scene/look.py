"""The appearance of a scene: shapes on bodies, and the camera. No equation depends on it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import AfterValidator, Field

from eomgen.base.errors import SceneError, nearest
from eomgen.language.base import Identifier, Number, Positive, Table
from eomgen.language.conditions import of_quantity, require
from eomgen.language.formula import Constant, Formula, names_in
from eomgen.language.quantity import Quantity, Vector, quantity


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

BARE = "#4477aa"
"""The colour of a body, or of a shape, without one."""

# The number of components depends on the scene's dimensions; `check_look` checks it.
Point = Annotated[tuple[Number, ...], Field(min_length=2, max_length=3)]
Angles = tuple[Number, Number, Number]


def _colour_field() -> Any:
    return Field(default=None, description="colour, #rrggbb; one for each body if absent")


def _center() -> Any:
    return quantity("m", "centre; the body's centre of mass if absent", default=None)


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
    size: Vector = quantity("m", "lengths of its edges", "positive")
    center: Vector | None = _center()
    angle: Number = Field(default=0.0, description="angle of rotation, rad, in the plane")
    orientation_deg: Angles = Field(
        default=(0.0, 0.0, 0.0), description="rotation about x, then y, then z, in space"
    )
    color: Colour | None = _colour_field()


class Disc(Table):
    """A disc of `radius` m about `center`, in body axes; in the plane."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "disc"
radius = 0.05
"""
    type: Literal["disc"]
    radius: Quantity = quantity("m", "radius", "positive")
    center: Vector | None = _center()
    color: Colour | None = _colour_field()


class Polygon(Table):
    """A closed polygon through `points`, m, body axes; in the plane."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "polygon"
points = [[0, 0], [0.3, 0], [0, 0.2]]
"""
    type: Literal["polygon"]
    points: Annotated[tuple[Vector, ...], Field(min_length=3, max_length=1000)] = quantity(
        "m", "corners in order"
    )
    color: Colour | None = _colour_field()


class Rod(Table):
    """A thick line with round ends from one point to another, m, body axes."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "rod"
start = ["-l/2", 0]
end = ["l/2", 0]
width = 0.06
"""
    type: Literal["rod"]
    start: Vector = quantity("m", "one end")
    end: Vector = quantity("m", "the other end")
    width: Quantity = quantity("m", "width", "positive")
    color: Colour | None = _colour_field()


class Sphere(Table):
    """A ball of `radius` m about `center`, in body axes; in space."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "sphere"
radius = 0.05
center = [0, 0, 0.1]
"""
    type: Literal["sphere"]
    radius: Quantity = quantity("m", "radius", "positive")
    center: Vector | None = _center()
    color: Colour | None = _colour_field()


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
    start: Vector = quantity("m", "one end")
    end: Vector = quantity("m", "the other end")
    radius: Quantity = quantity("m", "radius", "positive")
    color: Colour | None = _colour_field()


class Ellipsoid(Table):
    """An ellipsoid with half-axes `radii` m, in body axes, rotated like a box; in space."""

    example: ClassVar[str] = """
[[bodies.shapes]]
type = "ellipsoid"
radii = [0.1, 0.1, 0.3]
"""
    type: Literal["ellipsoid"]
    radii: Vector = quantity("m", "half-axes", "positive")
    center: Vector | None = _center()
    orientation_deg: Angles = Field(default=(0.0, 0.0, 0.0), description="about x, then y, then z")
    color: Colour | None = _colour_field()


Shape: TypeAlias = Annotated[
    Box | Cylinder | Disc | Ellipsoid | Polygon | Rod | Sphere, Field(discriminator="type")
]


INSTEAD = {
    2: {"sphere": "disc", "cylinder": "box", "ellipsoid": "disc"},
    3: {"disc": "sphere", "polygon": "box"},
}
"""Shapes that do not exist in 2 or 3 dimensions, with the one to use instead."""


class Camera(Table):
    """The camera of pictures.

    In `mode = "fit"` the whole motion lies within the picture. With "follow" the picture moves with
    the body `follow`, and with "fixed" it shows `height` m around `center`. Without a mode, it is
    fixed if `center` or `height` is given, and follows if `follow` is; else the whole motion is
    shown, unless the mechanism would be small in it: then the camera follows its heaviest body that
    moves away. `height` is the distance from the bottom to the top of the picture; what the motion
    needs if absent.

    In space the picture is a parallel projection, seen from a direction that is rotated by
    `azimuth_deg` from x towards y and by `elevation_deg` towards z.
    """

    example: ClassVar[str] = """
[camera]
mode = "follow"
follow = "arm"
height = 3.0
"""
    mode: Literal["fit", "follow", "fixed"] | None = Field(
        default=None, description="what it shows, chosen if absent"
    )
    center: Point | None = Field(
        default=None,
        description="point that it looks at, if fixed; the middle of the motion if absent",
        json_schema_extra={"unit": "m"},
    )
    height: Positive | None = Field(
        default=None,
        description="height of the picture; as the motion needs if absent",
        json_schema_extra={"unit": "m"},
    )
    follow: Identifier | None = Field(default=None, description="body that it follows")
    background: Colour | None = Field(
        default=None, description="colour of the background; white, or the page's theme, if absent"
    )
    azimuth_deg: Number = Field(
        default=-60.0, description="direction of view, from x towards y, in space"
    )
    elevation_deg: Annotated[Number, Field(ge=-90, le=90)] = Field(
        default=20.0, description="direction of view, towards z, in space"
    )


def check_look(
    shapes: Sequence[Shape],
    camera: Camera | None,
    dimensions: int,
    location: str,
    known: Mapping[str, float] | None = None,
) -> None:
    """Check that `shapes` and `camera` fit the plane (`dimensions` 2) or space (3).

    `location` is that of the body or the camera in the scene, such as `bodies[0]`; `known` are the
    values of the parameters that formulas of shapes may use. Raises `SceneError` with location,
    value and remedy.
    """
    for i, shape in enumerate(shapes):
        _check_shape(shape, dimensions, f"{location}.shapes[{i}]", known or {})
    if camera is not None:
        _check_camera(camera, dimensions, location)


def _check_camera(camera: Camera, dimensions: int, location: str) -> None:
    _check_components(camera.center, dimensions, f"{location}.center")
    given = camera.model_fields_set
    if dimensions == 2:
        for key in ("azimuth_deg", "elevation_deg"):
            if key in given:
                raise SceneError(
                    f"{location}.{key}: {getattr(camera, key):g}: the camera cannot be "
                    "rotated in the plane; leave it out, or set dimensions = 3"
                )
    if camera.mode == "fit":
        for key in ("center", "height", "follow"):
            if getattr(camera, key) is not None:
                raise SceneError(
                    f"{location}.{key}: mode 'fit' finds the place of the camera itself; leave "
                    "this key or the mode out"
                )
    if camera.mode == "fixed" and camera.follow is not None:
        raise SceneError(
            f"{location}.follow: a fixed camera follows nothing; leave this key or the mode out"
        )


def _check_shape(shape: Shape, dimensions: int, location: str, known: Mapping[str, float]) -> None:
    here, there = ("the plane", "space") if dimensions == 2 else ("space", "the plane")
    instead = INSTEAD[dimensions].get(shape.type)
    if instead:
        raise SceneError(f"{location}.type: '{shape.type}' is a shape of {there}; use '{instead}'")
    for key, vector in _vectors(shape):
        _check_components(vector, dimensions, f"{location}.{key}")
    for key, bound, formula in _quantities(shape):
        _check_names(formula, f"{location}.{key}", known)
        require(of_quantity(f"{location}.{key}", formula, bound, "m"), known)
    if isinstance(shape, Box):
        right, wrong = ("angle", "orientation_deg")[:: 1 if dimensions == 2 else -1]
        if wrong in shape.model_fields_set:
            raise SceneError(
                f"{location}.{wrong}: rotates a box in {there}; in {here} use '{right}'"
            )
    if isinstance(shape, Cylinder) and shape.start == shape.end:
        end = [part.value if isinstance(part, Constant) else "…" for part in shape.end]
        raise SceneError(f"{location}.end: {end} is also the start; give it a length")


def _check_names(formula: Formula, location: str, known: Mapping[str, float]) -> None:
    for name in names_in(formula):
        if name not in known:
            hint = nearest(name, known) or "; shapes may use the scene's [parameters]"
            raise SceneError(f"{location}: unknown parameter '{name}'{hint}")


def _quantities(shape: Shape) -> Iterator[tuple[str, str, Formula]]:
    """The quantities of a shape, each with its key and bound."""
    for key, info in type(shape).model_fields.items():
        extra = info.json_schema_extra
        if isinstance(extra, dict) and "bound" in extra:
            yield from _parts(key, str(extra["bound"]), getattr(shape, key))


def _parts(key: str, bound: str, value: Any) -> Iterator[tuple[str, str, Formula]]:
    if isinstance(value, tuple):
        for i, part in enumerate(value):
            yield from _parts(f"{key}[{i}]", bound, part)
    elif value is not None:
        yield key, bound, value


def _vectors(shape: Shape) -> Iterator[tuple[str, tuple[Formula, ...] | None]]:
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


def _check_components(vector: tuple[Any, ...] | None, dimensions: int, location: str) -> None:
    if vector is not None and len(vector) != dimensions:
        where = "the plane" if dimensions == 2 else "space"
        shown = [part.value if isinstance(part, Constant) else part for part in vector]
        shown = ["…" if isinstance(part, Formula) else part for part in shown]
        raise SceneError(
            f"{location}: {shown} has {len(vector)} components; in {where} give {dimensions}"
        )


def is_drawable(shape: Shape) -> bool:
    """Whether the numbers of a shape, which other parameters than the scene's may give, are finite
    and its lengths positive.
    """
    return all(
        math.isfinite(number(part)) and (bound != "positive" or number(part) > 0)
        for _, bound, part in _quantities(shape)
    )


def number(formula: Formula) -> float:
    """The value of a quantity without names, such as those of `valued` shapes."""
    assert isinstance(formula, Constant), "not evaluated"
    return formula.value


def numbers(vector: Sequence[Formula]) -> tuple[float, ...]:
    """The values of a vector of quantities without names."""
    return tuple(map(number, vector))
