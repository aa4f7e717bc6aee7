"""The view of a space: the eye's axes, light, the floor, and the faces that look at the eye.

The view is orthographic, with the eye infinitely far away: equal lengths look equal everywhere, a
ball is a circle, and the scale bar holds for the whole picture.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eomgen.show.motion import Array, Motion, Plane
from eomgen.show.solid import Indices, Solids, unit

LIGHT = unit(np.array([-0.45, 0.75, 0.65]))
"""Direction to the light, in the eye's axes: it always comes over the eye's left shoulder."""

AMBIENT, GLOSS = 0.56, 0.1
"""The part of a colour left in shadow, and the part of white that full light adds."""

UP = (0.0, 0.0, 1.0)

LINES = 40
"""Greatest number of the floor's grid lines in each direction."""

NEAR_ZERO, NEAR_FLOOR = 0.02, 0.5
"""The floor is at z = 0 if the lowest point is at most so far below or above it, relative to the
height of the picture."""


SOUNDINGS = 300
"""Greatest number of samples at which the lowest point is searched."""


@dataclass(frozen=True)
class Floor:
    """A grid at height `z`, m, with spacing `step`, m, over the ranges `x` and `y`, m."""

    z: float
    step: float
    x: tuple[float, float]
    y: tuple[float, float]

    def lines(self) -> Array:
        """End points (lines, 2, 3) of the grid's lines, m."""
        ends = []
        for axis, (low, high) in enumerate((self.x, self.y)):
            first, last = round(low / self.step), round(high / self.step)
            for value in np.arange(first, last + 1) * self.step:
                pair = np.full((2, 3), self.z)
                pair[:, axis] = value
                pair[:, 1 - axis] = (self.y, self.x)[axis]
                ends.append(pair)
        return np.array(ends)

    def through_origin(self) -> NDArray[np.bool_]:
        """Which of the lines are at x = 0 or y = 0."""
        flat = self.lines()[..., :2]
        return np.asarray((flat == 0.0).all(axis=1).any(axis=1))


@dataclass(frozen=True, eq=False)
class Cast:
    """The faces of all bodies, each in its own body's axes, m."""

    vertices: Array  # (k, 3)
    bodies: Indices  # (k,) whose vertex it is
    faces: Indices  # (f, 4)
    across: Indices  # (f, 4) as in a `Mesh`
    colours: Array  # (f, 3) red, green, blue from 0 to 1
    thickness: Array  # (f,) of the solid a face belongs to, m

    def world_vertices(self, pose: Array) -> Array:
        """World positions (k, 3), m, of the vertices at a pose (nb, 3, 4)."""
        of = pose[self.bodies]
        return np.asarray(np.einsum("kij,kj->ki", of[..., :3], self.vertices) + of[..., 3])


@dataclass(frozen=True, eq=False)
class Sight:
    """Faces and edges that look at the eye, in its axes: right, up, and near, m."""

    faces: Array  # (f, 4, 3) convex and flat, counter-clockwise
    colours: Array  # (f, 3) as the light falls
    edges: Array  # (e, 2, 3)
    edge_colours: Array  # (e, 3) without light
    edge_thickness: Array  # (e,) of the solid that an edge belongs to


def eye_axes(azimuth_deg: float, elevation_deg: float) -> Array:
    """The picture's right and up and the direction to the eye, as rows in world axes.

    The azimuth is from x towards y, the elevation towards z. A world point times the transpose is
    its position in the picture and its nearness, m.
    """
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


def cast_of(solids: Solids) -> Cast:
    """The faces of all bodies in one table."""
    none = np.zeros((0, 4), dtype=np.int64)
    tables = [(np.zeros((0, 3)), none[:, 0], none, none, np.zeros((0, 3)), np.zeros(0))]
    corners = sides = 0
    for body, shapes in enumerate(solids.bodies):
        for index, colour in shapes:
            mesh = solids.meshes[index]
            rgb = np.array([[int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]])
            tables.append(
                (
                    mesh.vertices,
                    np.full(len(mesh.vertices), body),
                    mesh.faces + corners,
                    np.where(mesh.across < 0, -1, mesh.across + sides),
                    rgb.repeat(len(mesh.faces), axis=0),
                    np.full(len(mesh.faces), mesh.thickness),
                )
            )
            corners, sides = corners + len(mesh.vertices), sides + len(mesh.faces)
    return Cast(*map(np.concatenate, zip(*tables, strict=True)))


def look(cast: Cast, pose: Array, axes: Array) -> Sight:
    """The faces and edges of the bodies at a pose that look at the eye, hidden or not."""
    corners = (cast.world_vertices(pose) @ axes.T)[cast.faces]  # (f, 4, 3)
    normals = unit(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]))
    front = normals[:, 2] > 0
    # An edge is drawn at sharp bends and along the silhouette.
    drawn = front[:, np.newaxis] & ((cast.across < 0) | ~front[cast.across])
    face, side = np.nonzero(drawn)
    return Sight(
        faces=corners[front],
        colours=lit(cast.colours[front], normals[front] @ LIGHT),
        edges=np.stack([corners[face, side], corners[face, (side + 1) % 4]], axis=1),
        edge_colours=cast.colours[face],
        edge_thickness=cast.thickness[face],
    )


def lit(colours: Array, toward_light: Array) -> Array:
    """Colours (f, 3) under the light, from the cosine of its angle to each normal."""
    light = np.maximum(toward_light, 0.0)[:, np.newaxis]
    return np.asarray(np.minimum(colours * (AMBIENT + (1 - AMBIENT) * light) + GLOSS * light**4, 1))


def floor_under(motion: Motion, cast: Cast) -> Floor:
    """The floor below a motion: a level contact plane near it, else z = 0 if that is near, else the
    height of its lowest point.

    It is within the first picture, even if a body falls without end.
    """
    low, high = _bounds(motion, cast)
    height = motion.camera.height
    looks = motion.center[2]
    if motion.camera.follow is not None:
        looks = motion.places[0, motion.bodies.index(motion.camera.follow), 2]
    z = float(low[2])
    if -NEAR_ZERO * height <= z <= NEAR_FLOOR * height:
        z = 0.0
    z = max(z, float(looks) - height / 2)
    if abs(z) <= NEAR_ZERO * height:
        z = 0.0
    levels = [plane.offset for plane in _near(motion) if plane.normal == UP]
    z = max(levels, default=z)
    step = round_length(height / 8)
    widest = float(max(high[:2] - low[:2]))
    if widest > LINES * step:
        step = round_length(2 * widest / LINES)
    # A narrow strip would show no depth.
    spare = np.maximum(0.6 * widest - (high - low)[:2], 0.0) / 2
    x_low, y_low = np.floor((low[:2] - spare) / step - 0.2) * step
    x_high, y_high = np.ceil((high[:2] + spare) / step + 0.2) * step
    return Floor(z, step, (float(x_low), float(x_high)), (float(y_low), float(y_high)))


def patches(motion: Motion, floor: Floor) -> Array:
    """Squares (k, 4, 3), m, as wide as the floor, on the other planes that the motion comes near.

    Each is centred at the foot of the motion's middle, with two sides level.
    """
    places = motion.places.reshape(-1, 3)
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    half = max(floor.x[1] - floor.x[0], floor.y[1] - floor.y[0]) / 2
    found = []
    for plane in _near(motion):
        if plane != Plane(UP, floor.z):
            normal = np.array(plane.normal)
            level = unit(np.cross(UP, normal)) if normal[:2].any() else np.array([1.0, 0.0, 0.0])
            foot = middle - (normal @ middle - plane.offset) * normal
            one, other = half * level, half * np.cross(normal, level)
            found.append(
                [foot - one - other, foot + one - other, foot + one + other, foot - one + other]
            )
    return np.array(found).reshape(-1, 4, 3)


def _near(motion: Motion) -> list[Plane]:
    """The planes closer to a centre of mass, at some time, than the picture is high."""
    places = motion.places.reshape(-1, 3)
    return [
        plane
        for plane in motion.planes
        if np.abs(places @ plane.normal - plane.offset).min() <= motion.camera.height
    ]


def _bounds(motion: Motion, cast: Cast) -> tuple[Array, Array]:
    """The least and the greatest x, y, z that any body reaches, m."""
    rows = np.linspace(0, len(motion.t) - 1, min(len(motion.t), SOUNDINGS)).round().astype(int)
    poses = motion.poses[rows]
    places = poses[..., 3].reshape(-1, 3)
    low, high = places.min(axis=0), places.max(axis=0)
    for body in range(len(motion.bodies)):
        own = cast.vertices[cast.bodies == body]
        if len(own):
            for axis in range(3):
                reach = poses[:, body, axis, :3] @ own.T + poses[:, body, axis, 3:]
                low[axis] = min(low[axis], reach.min())
                high[axis] = max(high[axis], reach.max())
    return low, high


def round_length(length: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that does not exceed `length`."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= length * 1.0000001))
