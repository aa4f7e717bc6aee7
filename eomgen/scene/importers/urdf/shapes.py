"""Visual geometry of links as shapes of pictures."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from eomgen.scene.importers.attributes import number, required, vector
from eomgen.scene.importers.meshes import Array, MeshError, corners_of, find_file
from eomgen.scene.importers.rotations import image, rotation, squared
from eomgen.scene.importers.vectors import Vector
from eomgen.scene.importers.xml_elements import Element

THINNEST = 1e-3
"""Least edge of the box of a mesh, m: a flat one has none."""


@dataclass
class Meshes:
    """The meshes of a robot: each file is read once. `drawn` are those that became boxes, `missing`
    those that did not, with the reason.
    """

    folders: Sequence[Path]
    found: dict[str, Array] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)
    drawn: int = 0

    def corners(self, name: str) -> Array | None:
        """The corners (k, 3) of a mesh, None without a file that can be read."""
        if name not in self.found and name not in self.missing:
            try:
                self.found[name] = corners_of(find_file(name, self.folders))
            except MeshError as error:
                self.missing[name] = str(error)
        return self.found.get(name)


def shapes_of(
    link: Element, what: str, colours: Mapping[str, str], meshes: Meshes
) -> list[dict[str, Any]]:
    """The shapes of a link's visual elements; without any that can be read, of its collision
    elements.

    Raises `SceneError` for sizes that are no positive numbers.
    """
    for tag in ("visual", "collision"):
        found = [
            table | ({"color": colour} if (colour := _colour(element, colours)) else {})
            for element in link.all(tag)
            for table in _shapes(element, what, meshes)
        ]
        if found:
            return found
    return []


def colours_of(robot: Element) -> dict[str, str]:
    """The colours of named materials, as #rrggbb."""
    found = dict[str, str]()
    for element in robot.walk():
        if element.tag == "material" and (colour := _own_colour(element)):
            found.setdefault(element.attributes.get("name", ""), colour)
    return found


def _colour(visual: Element, colours: Mapping[str, str]) -> str:
    material = visual.first("material")
    if material is None:
        return ""
    return _own_colour(material) or colours.get(material.attributes.get("name", ""), "")


def _own_colour(material: Element) -> str:
    """The colour of a material, "" without one, or if it is not three or four numbers."""
    color = material.first("color")
    try:
        parts = [float(word) for word in (color.attributes["rgba"] if color else "").split()[:3]]
        red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in parts)
    except (KeyError, ValueError, OverflowError):
        return ""
    return f"#{red:02x}{green:02x}{blue:02x}"


def _shapes(element: Element, what: str, meshes: Meshes) -> Iterator[dict[str, Any]]:
    geometry, origin = element.first("geometry"), element.first("origin")
    at, angles = vector(origin, "xyz", what), vector(origin, "rpy", what)
    for shape in geometry.children if geometry else ():
        match shape.tag:
            case "box":
                size = lengths_of(shape, what)
                yield _box(size, at, angles)
            case "sphere":
                radius = length_of(shape, "radius", what)
                yield {"type": "sphere", "radius": radius, "center": list(at)}
            case "cylinder" | "capsule":
                yield _cylinder(shape, what, at, angles)
            case "mesh":
                yield from _mesh(shape, what, at, angles, meshes)


def _box(size: Vector, center: Vector, angles: Vector) -> dict[str, Any]:
    table: dict[str, Any] = {"type": "box", "size": list(size), "center": list(center)}
    if any(angles):
        table["orientation_deg"] = [math.degrees(squared(angle)) for angle in angles]
    return table


def _cylinder(shape: Element, what: str, at: Vector, angles: Vector) -> dict[str, Any]:
    radius, half = length_of(shape, "radius", what), length_of(shape, "length", what) / 2
    arm = image(rotation(angles), (0.0, 0.0, half))
    return {
        "type": "cylinder",
        "start": [x - d for x, d in zip(at, arm, strict=True)],
        "end": [x + d for x, d in zip(at, arm, strict=True)],
        "radius": radius,
    }


def _mesh(
    shape: Element, what: str, at: Vector, angles: Vector, meshes: Meshes
) -> Iterator[dict[str, Any]]:
    """The box around a mesh."""
    name = required(shape, "filename", what)
    scale = vector(shape, "scale", what, (1.0, 1.0, 1.0))
    corners = meshes.corners(name)
    if corners is None:
        return
    bounds = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    pairs = list(zip(*bounds, scale, strict=True))
    middle = image(rotation(angles), [s * (low + high) / 2 for low, high, s in pairs])
    x, y, z = (max(abs(s) * (high - low), THINNEST) for low, high, s in pairs)
    meshes.drawn += 1
    yield _box((x, y, z), (at[0] + middle[0], at[1] + middle[1], at[2] + middle[2]), angles)


def lengths_of(shape: Element, what: str) -> Vector:
    """The edges of a box, m."""
    required(shape, "size", what)
    size = vector(shape, "size", what)
    if min(size) <= 0:
        raise shape.error(f"{what}: <box> size has a length that is not positive; give three > 0")
    return size


def length_of(shape: Element, key: str, what: str) -> float:
    """A length of a shape, m."""
    length = number(shape, key, what)
    if length <= 0:
        raise shape.error(
            f"{what}: <{shape.tag}> {key} {length:g} is not positive; give a number > 0"
        )
    return length
