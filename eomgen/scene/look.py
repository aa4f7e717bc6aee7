"""The looks of a scene: shapes on bodies, and the camera. Nothing here enters an equation."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

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
Point = tuple[Number, Number]


class Box(Table):
    """A rectangle, `size` = [width, height] in m, turned by `angle` rad in body axes."""

    type: Literal["box"]
    size: tuple[Positive, Positive]
    center: Point = (0.0, 0.0)
    angle: Number = 0.0
    color: Colour = "#4477aa"


class Disc(Table):
    """A disc of `radius` m about `center`, in body axes."""

    type: Literal["disc"]
    radius: Positive
    center: Point = (0.0, 0.0)
    color: Colour = "#4477aa"


class Polygon(Table):
    """A closed polygon through `points`, m, body axes."""

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


Shape = Annotated[Box | Disc | Polygon | Rod, Field(discriminator="type")]


class Camera(Table):
    """Where the picture looks: at `center` (m, world axes), or at the body it follows.

    `height` is what the picture shows from bottom to top, m.
    """

    center: Point = (0.0, 0.0)
    height: Positive = 4.0
    follow: Identifier | None = None
    background: Colour = "#ffffff"
