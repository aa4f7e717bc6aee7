"""Where the camera is: the view that a motion needs, or that its scene asks for."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eomgen.scene.look import Camera, Shape
from eomgen.show.outlines import extent_points

Array = NDArray[np.float64]

ASPECT = 4 / 3
"""Width to height of the picture for which a camera is chosen."""
MARGIN = 1.1
"""The view is so much larger than what it must contain."""
SMALL = 0.36
"""If at some time the bodies fill less than this part of the height and of the width of a view of
the whole motion, the camera follows."""
LONE = 0.02
"""The same for bodies that all move by themselves, as stones that are thrown: their paths are what
is to be seen."""
FEWEST, SOUNDINGS = 60, 300
"""Number of samples at which the bounds of the bodies are found, with many points and with few."""
ALONE = 1.6
"""A view that follows a single body is so much larger than one of a mechanism."""
GAIN = 1.3
"""It follows only if bodies are then larger by this factor."""
FAR = 6.0
"""What bodies hold to is shown if its distance from them is at most this multiple of the size of
the region in which they are."""
WIDEST = 4.0
"""Greatest width to height of what a camera shows."""
MOST_POINTS = 2_000_000
"""About how many points of bodies are looked at."""
MANY = 10_000
"""Number of points of a body of which fewer are looked at."""
LEAST = 1e-6
"""Height of a view of nothing, m."""


@dataclass(frozen=True)
class View:
    """A camera with nothing left open.

    center      what it looks at, world axes, m; of a camera that follows, from the body's centre of
                mass
    height      from the bottom to the top of the picture, m
    width       that the picture must show too, m; 0 for any
    follow      the name of the body that it follows
    background  colour of figures
    themed      whether a page may use the background of its theme instead
    """

    mode: Literal["fit", "follow", "fixed"] = "fixed"
    center: tuple[float, ...] | None = None
    height: float = 4.0
    width: float = 0.0
    follow: str | None = None
    background: str = "#ffffff"
    themed: bool = True
    azimuth_deg: float = -60.0
    elevation_deg: float = 20.0


@dataclass(frozen=True, eq=False)
class Bounds:
    """The least and the greatest position of all bodies in the picture, right and up, m, at each of
    some samples, and the position (n, nb, 2) of each body's centre of mass there.
    """

    low: Array  # (n, 2)
    high: Array  # (n, 2)
    centres: Array  # (n, nb, 2)

    def view(self, body: int | None = None, fixed: Array | None = None) -> tuple[Array, Array]:
        """Centre and size of the least rectangle around all bodies at all times, and the points
        `fixed` (k, 2); relative to the centre of mass of `body`, if given.
        """
        moving = 0.0 if body is None else self.centres[:, body]
        low, high = (self.low - moving).min(axis=0), (self.high - moving).max(axis=0)
        if fixed is not None and len(fixed):
            low, high = np.minimum(low, fixed.min(axis=0)), np.maximum(high, fixed.max(axis=0))
        return (low + high) / 2, high - low

    def least_share(self, size: Array) -> float:
        """The least part of the height or the width of a view of this size that bodies fill."""
        height = max(float(size[1]), float(size[0]) / ASPECT, LEAST) * MARGIN
        spans = self.high - self.low
        return float(np.maximum(spans[:, 0] / (ASPECT * height), spans[:, 1] / height).min())


def bounds_of(
    shapes: Sequence[Sequence[Shape]], poses: Array, eye: Array, rows: Sequence[int] | None = None
) -> Bounds:
    """The bounds of bodies at poses (n, nb, 3) or (n, nb, 3, 4), seen along the axes `eye`.

    `rows` are the samples; by default up to `SOUNDINGS` of them, evenly spread.
    """
    dimensions = poses.ndim - 1
    points_of = [_outermost(extent_points(own, dimensions)) for own in shapes]
    if rows is None:
        most = MOST_POINTS // sum(map(len, points_of))
        count = min(len(poses), SOUNDINGS, max(most, FEWEST))
        rows = np.linspace(0, len(poses) - 1, count).round().astype(int).tolist()
    at = poses[list(rows)]
    if dimensions == 2:
        c, s = np.cos(at[..., 2]), np.sin(at[..., 2])
        # Right and up in the picture, along the axes of each body: (n, nb, 2, dimensions).
        axes = np.stack([c, -s, s, c], axis=-1).reshape(*c.shape, 2, 2)
        centres = at[..., :2]
    else:
        axes, centres = eye[:2] @ at[..., :3], at[..., 3] @ eye[:2].T
    # One body after another: the points of all of them take much memory.
    low, high = np.empty_like(centres), np.empty_like(centres)
    for body, points in enumerate(points_of):
        turned = axes[:, body] @ points.T
        low[:, body] = centres[:, body] + turned.min(axis=2)
        high[:, body] = centres[:, body] + turned.max(axis=2)
    return Bounds(low.min(axis=1), high.max(axis=1), centres)


def _outermost(points: Array) -> Array:
    """Points with the same bounds from all sides: of very many only the corners of their hull."""
    if len(points) > MANY:
        from scipy.spatial import ConvexHull, QhullError  # it takes long to load

        with suppress(QhullError):  # they are in a plane
            return np.asarray(points[ConvexHull(points).vertices])
    return points


def framed(
    camera: Camera,
    bodies: Sequence[str],
    leading: Sequence[int],
    shapes: Sequence[Sequence[Shape]],
    poses: Array,
    eye: Array,
    fixed: Array,
) -> View:
    """The view of a motion by a camera of a scene.

    `leading` are the bodies that a camera may follow: those that translate in the world. `fixed`
    are points (k, d) of the world that the view of a whole motion shows too, m, world axes: what
    springs hold to and the like. With any of them the whole motion is shown unless asked otherwise.
    """
    finite = np.isfinite(poses.reshape(len(poses), -1)).all(axis=1)
    poses = poses[finite]
    dimensions = poses.ndim - 1
    given = View(
        height=camera.height or View.height,
        background=camera.background or View.background,
        themed=camera.background is None,
        azimuth_deg=camera.azimuth_deg,
        elevation_deg=camera.elevation_deg,
        center=camera.center,
    )
    if not len(poses):
        return given
    bounds = bounds_of(shapes, poses, eye)
    fixed = _near(bounds, fixed if dimensions == 2 else (fixed @ eye.T)[:, :2])
    middle, size = bounds.view(fixed=fixed)
    depth = float((poses[..., 3] @ eye[2]).mean()) if dimensions == 3 else 0.0
    followed = None if camera.follow is None else bodies.index(camera.follow)
    mode = camera.mode
    if mode is None and (camera.follow is not None):
        mode = "follow"
    elif mode is None and (camera.center is not None or camera.height is not None):
        mode = "fixed"
    elif mode is None:
        small = LONE if len(leading) == len(bodies) else SMALL
        followed = None if len(fixed) else _worth_following(bounds, size, leading, small)
        mode = "fit" if followed is None else "follow"
    if mode == "follow":
        if followed is None:
            followed = _steadiest(bounds, leading or range(len(bodies)))
        offset, size = bounds.view(followed)
        if len(bodies) == 1:
            size = size * ALONE
        offset = offset if camera.height is None else np.zeros(2)
        center = _world(offset, 0.0, eye, dimensions)
        return _sized(given, camera, mode, center, size, bodies[followed])
    center = camera.center or _world(middle, depth, eye, dimensions)
    if camera.center is not None:
        # The view is centred there, so it reaches as far on the other side.
        seen = np.array(camera.center) if dimensions == 2 else (eye @ camera.center)[:2]
        size = size + 2 * np.abs(middle - seen)
    return _sized(given, camera, mode, center, size, None)


@dataclass(frozen=True, eq=False)
class Framing:
    """The arguments of `framed`. The view is found when it is first asked for: that takes longer
    than many a run.
    """

    camera: Camera
    bodies: Sequence[str]
    leading: Sequence[int]
    shapes: Sequence[Sequence[Shape]]
    poses: Array
    eye: Array
    fixed: Array

    @cached_property
    def view(self) -> View:
        """The view of the motion."""
        given = (self.leading, self.shapes, self.poses, self.eye, self.fixed)
        return framed(self.camera, self.bodies, *given)


def _near(bounds: Bounds, points: Array) -> Array:
    """Those of some points (k, 2) that are not so far away that bodies would be tiny beside them,
    or infinitely far.
    """
    middle, size = bounds.view()
    with np.errstate(invalid="ignore"):
        near = np.abs(points - middle).max(axis=1) <= FAR * size.max()
    return np.asarray(points[near])


def _sized(
    view: View,
    camera: Camera,
    mode: Literal["fit", "follow", "fixed"],
    center: Sequence[float],
    size: Array,
    follow: str | None,
) -> View:
    """The view with its centre, and with the size that it needs unless the scene gives one."""
    center = tuple(map(float, center))
    if camera.height is not None:
        return replace(view, mode=mode, center=center, follow=follow)
    width, height = (max(float(x) * MARGIN, LEAST) for x in size)
    return replace(
        view,
        mode=mode,
        center=center,
        follow=follow,
        height=max(height, width / WIDEST),
        width=width,
    )


def _worth_following(
    bounds: Bounds, size: Array, leading: Sequence[int], small: float
) -> int | None:
    """The body to follow, if the bodies fill less than the part `small` of a view of the whole
    motion, and more of one that follows.
    """
    share = bounds.least_share(size)
    if share >= small or not leading:
        return None
    body = _steadiest(bounds, leading)
    _, followed = bounds.view(body)
    return body if bounds.least_share(followed) > GAIN * share else None


def _steadiest(bounds: Bounds, leading: Sequence[int]) -> int:
    """The body around which all bodies need the smallest view."""

    def height(body: int) -> float:
        _, size = bounds.view(body)
        return max(float(size[1]), float(size[0]) / ASPECT)

    return min(leading, key=height)


def _world(seen: Array, near: float, eye: Array, dimensions: int) -> tuple[float, ...]:
    """The point of the world at a place of the picture (right, up), and `near` to the eye, m."""
    if dimensions == 2:
        return float(seen[0]), float(seen[1])
    x, y, z = (np.array([*seen, near]) @ eye).tolist()
    return x, y, z
