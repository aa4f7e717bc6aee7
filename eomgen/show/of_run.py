"""What a picture takes from a run: the ranges of rails, and the side of the ground at a joint."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eomgen.language.formula import Constant, Formula
from eomgen.language.rewriting import constant
from eomgen.model.model import Model
from eomgen.scene.effects.elements import (
    Attraction,
    Element,
    Field,
    Heights,
    Link,
    Round,
    Support,
    Wind,
)
from eomgen.scene.look import number, numbers
from eomgen.show.arrows import field_arrows, ground_lines, region_of, wind_at
from eomgen.show.picture import Picture
from eomgen.tables.poses import places_of, world_points

Array = NDArray[np.float64]

BEYOND, ON_BODY = 0.35, 0.08
"""How much longer than the way of its slider a rail in the world, or on a body, is at each end,
relative to the size."""


def with_run(picture: Picture, model: Model, poses: Array) -> Picture:
    """The picture with rails as long as the ways of sliders at the poses of a run, marks of the
    ground on the other side of what they hold, and arrows of fields where bodies move.
    """
    finite = np.isfinite(poses.reshape(len(poses), -1)).all(axis=1)
    if not finite.any():
        return picture

    region = region_of(places_of(poses[finite]).reshape(-1, model.dimensions))

    def ranged(element: Element) -> Element:
        if isinstance(element, Field):
            return field_arrows(element, model, *region)
        if isinstance(element, Heights):
            return ground_lines(element, *region)
        if isinstance(element, Wind):
            return wind_at(element, model, (region[0] + region[1]) / 2)
        if not isinstance(element, Support):
            return element
        if element.kind == "base":
            return replace(element, axis=_ground(picture, model, poses[finite], element))
        way = _way(picture, model, poses[finite], element)
        beyond = (BEYOND if element.body < 0 else ON_BODY) * picture.size
        low, high = float(way.min()) - beyond, float(way.max()) + beyond
        return replace(element, low=Constant(low), high=Constant(high))

    return replace(picture, elements=tuple(map(ranged, picture.elements)))


def spread(poses: Array) -> float:
    """The size of the region in which centres of mass move, m; 0 if no pose is finite."""
    finite = np.isfinite(poses.reshape(len(poses), -1)).all(axis=1)
    places = places_of(poses)[finite]
    if not len(places):
        return 0.0
    return float(np.ptp(places.reshape(-1, places.shape[-1]), axis=0).max())


def leading_bodies(model: Model) -> tuple[int, ...]:
    """The bodies that translate in the world: a camera may follow them."""
    kinds = [[p.kind for p in body.joint.primitives(model.dimensions)] for body in model.bodies]
    pairs = zip(model.bodies, kinds, strict=True)
    return tuple(k for k, (body, own) in enumerate(pairs) if body.parent < 0 and "prismatic" in own)


def fixed_points(drawn: Picture) -> Array:
    """Points (k, d) of the world, m, at which springs, fields and obstacles are. A pair of opposite
    corners stands for each ball.
    """
    found = []
    for element in drawn.elements:
        match element:
            case Link(start=start, end=end):
                found += [numbers(a.at) for a in (start, end) if a.body < 0]
            case Round(body=-1, at=at, radius=radius):
                middle, reach = np.array(numbers(at)), number(radius)
                found += [tuple(middle - reach), tuple(middle + reach)]
            case Attraction(center=center):
                found.append(numbers(center))
            case Field(center=tuple() as center):
                found.append(numbers(center))
    dimensions = len(drawn.joints[0].at_parent)
    return np.array(found, dtype=float).reshape(-1, dimensions)


def _ground(picture: Picture, model: Model, poses: Array, base: Support) -> tuple[Formula, ...]:
    """The unit vector down, or up if what the joint holds is below it most of the time."""
    dimensions = poses.ndim - 1
    heights = poses[..., 1] if dimensions == 2 else poses[..., 2, 3]
    joint = picture.joints[base.joint]  # of the tree, or one that closes a loop
    own = [k for k, root in enumerate(model.roots) if root == model.roots[joint.child]]
    pin = model.value(joint.at_parent[-1])
    below = float(np.median(heights[:, own].mean(axis=1))) < pin
    return constant(*[0.0] * (dimensions - 1), 1.0 if below else -1.0)


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
