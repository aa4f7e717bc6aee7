"""Shapes of bodies to which the scene gives none, from joints, masses and inertias.

Links reach their joints: their ends are the formulas of the joints' points. Widths and the sizes of
solids are numbers, for the scene's values of the parameters.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from eomgen.language.formula import Constant
from eomgen.model.model import Body, Model
from eomgen.scene.joints import Cylindrical, Free, Prismatic, Revolute
from eomgen.scene.joints.base import spatial
from eomgen.scene.look import Box, Cylinder, Disc, Rod, Shape, Sphere
from eomgen.show.body_points import BodyPoints, Vector, gyration, is_drawn, length_of
from eomgen.show.colours import shade
from eomgen.show.formulas import constant, scaled, sum_of
from eomgen.show.solid import angles_of, rotation_to

Array = NDArray[np.float64]

WIDTH = 0.11
"""Width of a link relative to its length."""
WIDEST, NARROWEST = 1.6, 0.6
"""A body is drawn at most so much wider or narrower than a median one, for its mass."""
BOB = 0.3
"""A body whose extent about its centre of mass is smaller than this part of its distance from the
joint is drawn as a bob at the end of a rod."""
LONGEST = 1.6
"""The far end of a link is at most so much farther from its centre of mass than the joint is."""
STRAIGHT = 0.15
"""A link is straight if its centre of mass is at most this part of its length beside its axis."""
CARRIAGE = (0.42, 0.26, 0.3)
"""Size of a carriage along its rail and across, relative to the mechanism's size."""
ASPECT = 1.7
"""Length to width of a planar body of which only the moment of inertia is known."""
PARTICLE = 0.09
"""Radius of a particle relative to the mechanism's size."""


@dataclass(frozen=True)
class Inventor:
    """What all bodies of a model share.

    size  typical length, m
    mass  median mass, kg
    """

    model: Model
    size: float
    mass: float

    def number(self, body: Body) -> float:
        """How much larger than a median body it is drawn, for its mass."""
        mass = self.model.value(body.mass)
        if not (mass > 0 and self.mass > 0):
            return NARROWEST
        return min(WIDEST, max(NARROWEST, float(np.cbrt(mass / self.mass))))


def inventor_of(model: Model, size: float) -> Inventor:
    """The inventor of shapes for a model's bodies."""
    masses = [model.value(body.mass) for body in model.bodies]
    return Inventor(model, size, median([m for m in masses if m > 0] or [0.0]))


def invented_shapes(
    inventor: Inventor, body: Body, points: BodyPoints, color: str
) -> tuple[Shape, ...]:
    """The shapes of a body: rods to its joints, and a solid where it has an extent of its own."""
    model = inventor.model
    arms = [r for r in points.joints if is_drawn(length_of(model, r))]
    if isinstance(body.joint, Prismatic | Cylindrical):
        shapes = [*_rods(inventor, body, arms, color), *_slider(inventor, body, color)]
    elif not arms:
        shapes = [*_alone(inventor, body, points, color)]
    elif len(arms) == 1 and len(points.joints) == 1:
        shapes = [*_pendulum(inventor, body, arms[0], points.others, color)]
    elif len(arms) == 2 and _is_straight(model, arms):
        shapes = [_rod(inventor, body, arms[0], arms[1], color)]
    else:
        shapes = [*_rods(inventor, body, arms, color), *_hub(inventor, body, arms, color)]
    return (*shapes, *_barrel(inventor, body, arms, color))


def _rod(inventor: Inventor, body: Body, start: Vector, end: Vector, color: str) -> Rod:
    value = inventor.model.value
    length = math.dist([*map(value, start)], [*map(value, end)])
    width = WIDTH * inventor.number(body) * min(inventor.size, 1.5 * length)
    return Rod(type="rod", start=start, end=end, width=Constant(width), color=color)


def _rods(inventor: Inventor, body: Body, arms: Sequence[Vector], color: str) -> Iterator[Rod]:
    """A rod from the centre of mass to each joint, or one through two joints in line with it."""
    if len(arms) == 2 and _is_straight(inventor.model, arms):
        yield _rod(inventor, body, arms[0], arms[1], color)
        return
    zero = constant(*[0.0] * inventor.model.dimensions)
    yield from (_rod(inventor, body, zero, arm, color) for arm in arms)


def _pendulum(
    inventor: Inventor, body: Body, pin: Vector, others: Sequence[Vector], color: str
) -> Iterator[Shape]:
    """A body at one joint: a rod through its centre of mass, or a bob at the end of one."""
    model = inventor.model
    at = np.array([*map(model.value, pin)])
    arm = float(np.linalg.norm(at))
    zero = constant(*[0.0] * model.dimensions)
    beyond = [r for r in others if np.dot([*map(model.value, r)], at) < -0.1 * arm * arm]
    if beyond:
        far = max(beyond, key=lambda r: length_of(model, r))
        if _is_straight(model, (pin, far)):
            yield _rod(inventor, body, pin, far, color)
        else:
            yield from (_rod(inventor, body, zero, end, color) for end in (pin, far))
        return
    half = math.sqrt(3.0) * _gyration_across(model, body, at)
    if half >= BOB * arm:
        yield _rod(inventor, body, pin, scaled(-min(half / arm, LONGEST), pin), color)
        return
    rod = _rod(inventor, body, pin, zero, shade(color))
    yield rod.replaced(width=Constant(0.6 * WIDTH * inventor.size * NARROWEST))
    radius = max(half / math.sqrt(1.5), PARTICLE * inventor.number(body) * inventor.size)
    yield _ball(model, min(radius, 0.6 * arm), color)


def _gyration_across(model: Model, body: Body, along: Array) -> float:
    """The radius of gyration about an axis across `along` through the centre of mass, m."""
    mass = model.value(body.mass)
    if mass <= 0:
        return 0.0
    if model.dimensions == 2:
        moment = model.value(body.moment)
    else:
        inertia = _inertia(model, body)
        axis = along / np.linalg.norm(along)
        moment = float(np.trace(inertia) - axis @ inertia @ axis) / 2
    return math.sqrt(max(moment, 0.0) / mass)


def _hub(inventor: Inventor, body: Body, arms: Sequence[Vector], color: str) -> Iterator[Shape]:
    """The middle of a body with several arms, or with one and a joint at its centre of mass."""
    model = inventor.model
    farthest = max(length_of(model, arm) for arm in arms)
    largest = gyration(model, body)
    if largest > 0.2 * farthest and (len(arms) > 2 or len(arms) == 1):
        yield from _solid(inventor, body, color, most=1.2 * farthest)
    else:
        yield _ball(model, 0.9 * WIDTH * inventor.number(body) * inventor.size, color)


def _alone(inventor: Inventor, body: Body, points: BodyPoints, color: str) -> Iterator[Shape]:
    """A body without arms: as large as its inertia says, or a particle."""
    model = inventor.model
    if is_drawn(gyration(model, body)):
        yield from _solid(inventor, body, color)
        zero = constant(*[0.0] * model.dimensions)
        reach = 2 * gyration(model, body)
        far = [r for r in points.others if reach < length_of(model, r) < 20 * reach]
        yield from (_rod(inventor, body, zero, r, shade(color)) for r in far)
    else:
        yield _ball(model, PARTICLE * inventor.number(body) * inventor.size, color)


def _ball(model: Model, radius: float, color: str) -> Shape:
    if model.dimensions == 2:
        return Disc(type="disc", radius=Constant(radius), color=color)
    return Sphere(type="sphere", radius=Constant(radius), color=color)


def _solid(inventor: Inventor, body: Body, color: str, most: float = math.inf) -> Iterator[Shape]:
    """The simplest uniform solid of the body's mass and inertia, with half extents up to `most`."""
    model, mass = inventor.model, inventor.model.value(body.mass)
    if model.dimensions == 3:
        yield from _spatial_solid(model, body, color, most)
        return
    moment = model.value(body.moment)
    if isinstance(body.joint, Revolute):
        radius = min(math.sqrt(2 * moment / mass), most)
        yield _ball(model, radius, color)
        # So that its rotation can be seen.
        spoke = constant(0.72 * radius, 0.0)
        yield Rod(
            type="rod",
            start=constant(0.0, 0.0),
            end=spoke,
            width=Constant(0.16 * radius),
            color=shade(color),
        )
        return
    width = min(math.sqrt(12 * moment / mass / (1 + ASPECT**2)), most / ASPECT)
    yield Box(type="box", size=constant(ASPECT * width, width), color=color)


def _spatial_solid(model: Model, body: Body, color: str, most: float) -> Iterator[Shape]:
    """A ball, a cylinder or a cuboid, as the principal moments have one value, two or three."""
    mass = model.value(body.mass)
    moments, axes = np.linalg.eigh(_inertia(model, body))
    axes = axes * np.where(np.linalg.det(axes) < 0, -1.0, 1.0)
    a, b, c = (float(max(x, 0.0)) for x in moments)
    largest = c or 1.0
    if c - a < 1e-6 * largest:
        radius = min(math.sqrt(2.5 * a / mass), most)
        yield _ball(model, radius, color)
        yield Sphere(
            type="sphere",
            center=constant(0.0, -0.9 * radius, 0.0),
            radius=Constant(0.2 * radius),
            color=shade(color),
        )
        return
    for own, other, k in ((a, (b + c) / 2, 0), (c, (a + b) / 2, 2)):
        two = c - b if k == 0 else b - a
        if two < 1e-6 * largest:
            radius = min(math.sqrt(2 * own / mass), most)
            length = math.sqrt(max(12 * (other - own / 2) / mass, 0.0))
            half = axes[:, k] * min(max(length, 0.1 * radius) / 2, most)
            radius = max(radius, 0.04 * length)
            yield Cylinder(
                type="cylinder",
                start=constant(*-half),
                end=constant(*half),
                radius=Constant(radius),
                color=color,
            )
            if k == 2:  # flat, as a wheel
                spot = 0.7 * radius * axes[:, 0]
                yield Rod(
                    type="rod",
                    start=constant(*(spot - 1.02 * half)),
                    end=constant(*(spot + 1.02 * half)),
                    width=Constant(0.3 * radius),
                    color=shade(color),
                )
            return
    sums = np.array([b + c - a, a + c - b, a + b - c])
    size = np.sqrt(np.maximum(6 * sums / mass, 0.0))
    size = np.minimum(np.maximum(size, 0.05 * size.max()), 2 * most)
    yield Box(type="box", size=constant(*size), orientation_deg=angles_of(axes), color=color)


def _inertia(model: Model, body: Body) -> Array:
    xx, yy, zz, xy, xz, yz = map(model.value, body.inertia_com)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _slider(inventor: Inventor, body: Body, color: str) -> Iterator[Shape]:
    """A carriage at a prismatic joint, or a sleeve at a cylindrical one, along its axis."""
    joint, model = body.joint, inventor.model
    assert not isinstance(joint, Free)
    primitive = joint.primitives(model.dimensions)[0]
    axis = np.array(primitive.axis) / np.linalg.norm(primitive.axis)
    scale = inventor.size * inventor.number(body)
    length, width, depth = (scale * part for part in CARRIAGE)
    center = joint.r_child
    if model.dimensions == 2:
        yield Box(
            type="box",
            size=constant(length, width),
            center=center,
            angle=math.atan2(axis[1], axis[0]),
            color=color,
        )
    elif isinstance(joint, Prismatic):
        yield Box(
            type="box",
            size=constant(length, depth, width),
            center=center,
            orientation_deg=angles_of(rotation_to(axis)),
            color=color,
        )
    else:
        yield _along(center, axis * length / 2, width / 2, color)


def _barrel(inventor: Inventor, body: Body, arms: Sequence[Vector], color: str) -> Iterator[Shape]:
    """A short cylinder along the axis of a revolute joint in space."""
    joint, model = body.joint, inventor.model
    if model.dimensions == 3 and isinstance(joint, Revolute) and arms:
        axis = np.array(spatial(joint.primitives(3)[0].axis))
        width = WIDTH * inventor.size * inventor.number(body)
        half = 0.75 * width * axis / np.linalg.norm(axis)
        yield _along(joint.r_child, half, 0.6 * width, shade(color))


def _along(center: Vector, half: Array, radius: float, color: str) -> Cylinder:
    """A cylinder about `center` whose ends are at ±`half` from it."""
    return Cylinder(
        type="cylinder",
        start=sum_of(center, constant(*-half)),
        end=sum_of(center, constant(*half)),
        radius=Constant(radius),
        color=color,
    )


def _is_straight(model: Model, arms: Sequence[Vector]) -> bool:
    """Whether the centre of mass is near the line between two points, and between them."""
    a, b = (np.array([*map(model.value, arm)]) for arm in arms)
    along = b - a
    length = float(np.linalg.norm(along))
    if not length:
        return False
    part = float(-a @ along) / length**2
    beside = float(np.linalg.norm(a + part * along))
    return -0.05 <= part <= 1.05 and beside <= STRAIGHT * length
