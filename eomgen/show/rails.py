"""The ranges of a picture's rails, from the motion of what slides on them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eomgen.language.formula import Constant, Formula
from eomgen.model.model import Model
from eomgen.show.elements import Element, Support
from eomgen.show.picture import Picture

Array = NDArray[np.float64]

BEYOND = 0.35
"""How much longer than the way of its slider a rail is at each end, relative to the size."""


def with_rails(picture: Picture, model: Model, poses: Array) -> Picture:
    """The picture with rails as long as the ways of sliders at the poses of a run."""
    finite = np.isfinite(poses.reshape(len(poses), -1)).all(axis=1)
    if not finite.any():
        return picture

    def ranged(element: Element) -> Element:
        if not isinstance(element, Support) or element.kind != "rail":
            return element
        way = _way(picture, model, poses[finite], element)
        beyond = BEYOND * picture.size
        low, high = float(way.min()) - beyond, float(way.max()) + beyond
        return replace(element, low=Constant(low), high=Constant(high))

    return replace(picture, elements=tuple(map(ranged, picture.elements)))


def _way(picture: Picture, model: Model, poses: Array, rail: Support) -> Array:
    """Displacement (n,) of a slider's point along its rail, m."""
    joint = picture.joints[rail.joint]
    assert rail.axis is not None

    def values(vector: tuple[Formula, ...]) -> Array:
        return np.array([model.value(part) for part in vector])

    start = world_points(poses, rail.body, values(joint.at_parent))
    along = world_points(poses, rail.body, values(joint.at_parent) + values(rail.axis)) - start
    point = world_points(poses, joint.child, values(joint.at_child))
    return np.asarray(((point - start) * along).sum(axis=-1))


def world_points(poses: Array, body: int, r: Array) -> Array:
    """World positions (n, d) of a point `r` (d,) of a body, in body axes, m; -1 is the world."""
    if body < 0:
        return np.broadcast_to(r, (len(poses), len(r)))
    pose = poses[:, body]
    if poses.ndim == 4:
        return np.asarray(pose[..., :3] @ r + pose[..., 3])
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    turned = np.stack([c * r[0] - s * r[1], s * r[0] + c * r[1]], axis=-1)
    return np.asarray(pose[:, :2] + turned)
