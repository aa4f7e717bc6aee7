"""Shapes in space as meshes of faces, for the figure and the page.

All faces have four corners, counter-clockwise seen from outside; a triangle repeats one of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eomgen.language.formula import Formula
from eomgen.scene.look import BARE, Box, Cylinder, Ellipsoid, Rod, Shape, Sphere, number, numbers

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FEWEST, MOST = 8, 32
"""Least and greatest number of sides of round shapes."""

SHARP = np.cos(np.radians(50))
"""An edge is drawn between faces that meet at more than this angle; an octagon's meet at 45°."""

FINEST = 200
"""Greatest number of faces across a picture; each further try makes them larger by `COARSER`."""

COARSER = 1.25
TRIES = 24


@dataclass(frozen=True, eq=False)
class Mesh:
    """A solid's surface in body axes, m.

    `across` gives for each side of each face, from corner k to k + 1, the index of the neighbouring
    face, or -1 if the side is a sharp edge, which is always drawn.
    """

    vertices: Array  # (k, 3)
    faces: Indices  # (f, 4), into vertices
    smooth: bool = False  # no edges, however coarse

    @cached_property
    def thickness(self) -> float:
        """About the least thickness of the solid, m."""
        about = self.vertices - self.vertices.mean(axis=0)
        _, _, own_axes = np.linalg.svd(about, full_matrices=False)
        return float(np.ptp(about @ own_axes.T, axis=0).min())

    @cached_property
    def normals(self) -> Array:
        """Outward normals (f, 3), of unit length."""
        a, b, c, d = np.moveaxis(self.vertices[self.faces], 1, 0)
        return unit(np.cross(c - a, d - b))

    @cached_property
    def across(self) -> Indices:
        """Neighbours of each face's sides (f, 4); the face itself at a triangle's empty side."""
        count = len(self.vertices)
        start, end = self.faces, np.roll(self.faces, -1, axis=1)
        own = np.repeat(np.arange(len(self.faces)), 4)
        keys, opposite = (start * count + end).ravel(), (end * count + start).ravel()
        order = np.argsort(keys, kind="stable")
        found = order[np.minimum(np.searchsorted(keys[order], opposite), len(keys) - 1)]
        neighbour = np.where((keys[found] == opposite) & (keys != opposite), own[found], own)
        bend = np.einsum("fi,fi->f", self.normals[own], self.normals[neighbour])
        edge = (bend < SHARP) & (not self.smooth)
        return np.where(edge, -1, neighbour).reshape(-1, 4)


def mesh(shape: Shape, grain: float) -> Mesh:
    """The surface of a shape in space, with faces about `grain` m long if possible."""
    match shape:
        case Box():
            return _box(shape)
        case Sphere() | Ellipsoid():
            if isinstance(shape, Sphere):
                radii: tuple[float, ...] = (number(shape.radius),) * 3
            else:
                radii = numbers(shape.radii)
            ball = _revolved(_arc(_sides(max(radii), grain) // 2), _sides(max(radii), grain))
            turned = ball @ np.diag(radii)
            if isinstance(shape, Ellipsoid):
                turned = turned @ rotation(shape.orientation_deg).T
            return _joined([turned + _center(shape.center)], smooth=True)
        case Cylinder():
            radius = number(shape.radius)
            profile = [(0.0, 0.0), (radius, 0.0), (radius, 1.0), (0.0, 1.0)]
            return _around(shape, profile, radius, grain)
        case Rod():
            return _rod(shape, grain)
    raise AssertionError(f"{shape.type} is not a shape of space")


@dataclass(frozen=True)
class Solids:
    """All shapes of all bodies; equal shapes share one mesh."""

    meshes: tuple[Mesh, ...]
    bodies: tuple[tuple[tuple[int, str], ...], ...]
    """For each body the index of each of its shapes' meshes, and the shape's colour."""


def solids(shapes: Sequence[Sequence[Shape]], height: float, budget: int) -> Solids:
    """Meshes as fine as a picture `height` m high can show, but coarser if they have many faces.

    `budget` is the total number of faces aimed at; very many shapes exceed it.
    """
    by_shape: dict[Shape, list[Shape]] = {}
    for group in shapes:
        for shape in group:
            by_shape.setdefault(shape.replaced(color=None), []).append(shape)
    grain = height / FINEST
    coarsest, least = _meshes(by_shape, np.inf)
    for _ in range(TRIES):
        meshes, faces = (coarsest, least) if least > budget else _meshes(by_shape, grain)
        if faces <= max(budget, least):
            break
        grain *= COARSER
    index = {key: k for k, key in enumerate(by_shape)}
    of_bodies = (tuple((index[s.replaced(color=None)], s.color or BARE) for s in g) for g in shapes)
    return Solids(tuple(meshes) if by_shape else (), tuple(of_bodies))


def _meshes(by_shape: Mapping[Shape, Sequence[Shape]], grain: float) -> tuple[list[Mesh], int]:
    """A mesh for each shape, and the number of faces of all that are equal to these."""
    meshes = [mesh(shape, grain) for shape in by_shape]
    groups = zip(meshes, by_shape.values(), strict=True)
    return meshes, sum(len(mesh.faces) * len(group) for mesh, group in groups)


def rotation(turns_deg: Sequence[float]) -> Array:
    """R = Rz Ry Rx for rotations by three angles, degrees, about the fixed x, then y, then z."""
    cx, cy, cz = np.cos(np.radians(turns_deg))
    sx, sy, sz = np.sin(np.radians(turns_deg))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x, dtype=float)


def angles_of(matrix: Array) -> tuple[float, float, float]:
    """The angles, degrees, of which `rotation` makes this rotation matrix."""
    (a, b, _), (d, e, _), (g, h, i) = matrix
    if np.hypot(h, i) < 1e-9:  # the angles about x and z turn about one axis
        angles = (0.0, np.copysign(np.pi / 2, -g), np.arctan2(-b, e))
    else:
        angles = (np.arctan2(h, i), np.arctan2(-g, np.hypot(h, i)), np.arctan2(d, a))
    x, y, z = (float(x) for x in np.degrees(angles))
    return x, y, z


def rotation_to(axis: Array) -> Array:
    """A rotation matrix whose first column is the unit vector `axis` and whose second is level."""
    aside = np.array([-axis[1], axis[0], 0.0]) if np.hypot(*axis[:2]) > 1e-9 else np.eye(3)[1]
    aside = unit(aside)
    return np.column_stack([axis, aside, np.cross(axis, aside)])


def unit(vectors: Array) -> Array:
    """Vectors along the last axis with length 1; zero stays zero."""
    # Divided by the largest component first, because squares of tiny numbers underflow.
    largest = np.abs(vectors).max(axis=-1, keepdims=True)
    scaled = vectors / np.where(largest > 0, largest, 1.0)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    return np.asarray(scaled / np.where(length > 0, length, 1.0))


def _center(center: tuple[Formula, ...] | None) -> Array:
    return np.zeros(3) if center is None else np.array(numbers(center))


def _sides(radius: float, grain: float) -> int:
    """Number of sides of a circle, a multiple of four."""
    return 4 * int(np.clip(np.ceil(2 * np.pi * radius / grain / 4), FEWEST // 4, MOST // 4))


def _box(box: Box) -> Mesh:
    half = np.array(numbers(box.size)) / 2
    sheets = []
    for axis in range(3):
        # The next two axes in cyclic order make a right-handed system with this one.
        first, second = (axis + 1) % 3, (axis + 2) % 3
        sheet = np.zeros((2, 2, 3))
        sheet[..., first] = half[first] * np.array([[-1], [1]])
        sheet[..., second] = half[second] * np.array([[-1, 1]])
        sheet[..., axis] = half[axis]
        sheets += [sheet, -sheet.swapaxes(0, 1)]
    turned = rotation(box.orientation_deg)
    return _joined([sheet @ turned.T + _center(box.center) for sheet in sheets])


def _rod(rod: Rod, grain: float) -> Mesh:
    """A cylinder between two hemispheres."""
    length = float(np.linalg.norm(np.subtract(numbers(rod.end), numbers(rod.start))))
    radius = number(rod.width) / 2
    ball = _arc(_sides(radius, grain) // 2) * radius
    half = len(ball) // 2
    below, above = ball[: half + 1], ball[half + (length == 0.0) :] + np.array([0.0, length])
    profile = np.concatenate([below, above]) / [1.0, length or 1.0]
    return _around(rod, profile, radius, grain)


def _arc(parts: int) -> Array:
    """Half a circle of radius 1 from (0, -1) to (0, 1), as rows of radius and height."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, parts + 1)
    arc = np.column_stack([np.cos(angles), np.sin(angles)])
    arc[[0, -1], 0] = 0.0
    return arc


def _revolved(profile: Array, sides: int) -> Array:
    """A profile of radii and heights, upwards, rotated about z: points (sides + 1, rows, 3)."""
    angles = np.linspace(0.0, 2 * np.pi, sides + 1)[:, np.newaxis]
    radius, height = profile.T
    ones = np.ones_like(angles)
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), height * ones], axis=-1)


def _around(shape: Cylinder | Rod, profile: ArrayLike, radius: float, grain: float) -> Mesh:
    """A profile of radii (m) and heights (parts of the length), rotated about the shape's axis."""
    along = np.subtract(numbers(shape.end), numbers(shape.start))
    axis = unit(along) if along.any() else np.array([0.0, 0.0, 1.0])
    scale = float(np.linalg.norm(along)) or 1.0
    aside = unit(np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
    frame = np.array([aside, np.cross(axis, aside), axis * scale])
    surface = _revolved(np.array(profile), _sides(radius, grain)) @ frame
    surface = surface + numbers(shape.start)
    return _joined([surface], smooth=isinstance(shape, Rod))


def _joined(sheets: Sequence[Array], *, smooth: bool = False) -> Mesh:
    """One mesh from sheets (a, b, 3) of points whose borders meet, with counter-clockwise faces.

    A sheet's normal is the cross product of the directions of its first and second index.
    """
    points, faces = [], []
    first = 0
    for sheet in sheets:
        rows, columns = sheet.shape[:2]
        index = first + np.arange(rows * columns).reshape(rows, columns)
        corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
        faces.append(np.stack(corners, axis=-1).reshape(-1, 4))
        points.append(sheet.reshape(-1, 3))
        first += rows * columns
    every = np.concatenate(points)
    size = float(np.abs(every - every[0]).max()) or 1.0
    _, kept, place = np.unique(
        np.round((every - every[0]) / size, 9), axis=0, return_index=True, return_inverse=True
    )
    return Mesh(every[kept], place.reshape(-1)[np.concatenate(faces)], smooth)
