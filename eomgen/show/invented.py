"""Shapes of bodies to which the scene gives none, from joints, masses and inertias.

Links reach their joints: their ends are the formulas of the joints' points. Widths and the sizes of
solids are numbers, for the scene's values of the parameters.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eomgen.language.formula import Constant
from eomgen.language.rewriting import constant, scaled, sum_of, times, total
from eomgen.model.bodies import Body
from eomgen.model.model import Model
from eomgen.scene.effects import elements
from eomgen.scene.effects.elements import Touching
from eomgen.scene.joints.base import kinds_of, spatial
from eomgen.scene.look import Box, Cylinder, Disc, Ellipsoid, Polygon, Rod, Shape, Sphere
from eomgen.show.body_points import BodyPoints, Vector, gyration, is_drawn, length_of
from eomgen.show.colours import shade
from eomgen.show.joint_axes import slides
from eomgen.show.outlines import hull
from eomgen.show.solid import angles_of, rotation_to
from eomgen.show.symbols import toothed

Array = NDArray[np.float64]

WIDTH = 0.11
"""Width of a link relative to its length."""
WIDEST, NARROWEST = 1.6, 0.6
"""A body is drawn at most so much wider or narrower than a median one, for its mass."""
PLANETS = 3.0
"""The same of particles."""
BOB = 0.3
"""A body whose extent about its centre of mass is smaller than this part of its distance from the
joint is drawn as a bob at the end of a rod."""
LONGEST = 1.6
"""The far end of a link is at most so much farther from its centre of mass than the joint is."""
THICK = 0.5
"""A body in space is a rod if its second extent is at most this part of its first."""
STRAIGHT = 0.15
"""A link is straight if its centre of mass is at most this part of its length beside its axis."""
CARRIAGE = (0.5, 0.36, 0.4)
"""Size of a carriage along its rail and across, relative to the mechanism's size."""
ASPECT = 1.7
"""Length to width of a planar body of which only the moment of inertia is known."""
ALIKE = 1e-6
"""Principal moments count as equal if they differ by less than this part of the largest."""
SPECK = (0.02, 0.06)
"""Least and greatest half extent of a body without joints in a region of size 1."""
PARTICLE = 0.09
"""Radius of a particle relative to the mechanism's size."""


@dataclass(frozen=True)
class Inventor:
    """What all bodies of a model share.

    size    typical length, m
    mass    median mass, kg
    extent  least and greatest half extent of bodies without joints, m
    """

    model: Model
    size: float
    mass: float
    extent: tuple[float, float] = (0.0, math.inf)

    def number(self, body: Body, most: float = WIDEST) -> float:
        """How much larger than a median body it is drawn, for its mass, at most `most`."""
        mass = self.model.value(body.mass)
        if not (mass > 0 and self.mass > 0):
            return NARROWEST
        return min(most, max(WIDEST * NARROWEST / most, float(np.cbrt(mass / self.mass))))


def inventor_of(model: Model, size: float, spread: float) -> Inventor:
    """The inventor of shapes for a model's bodies.

    `spread` is the size of the region in which bodies move, m, if pictures are to show all of it;
    else 0.
    """
    masses = [model.value(body.mass) for body in model.bodies]
    mass = median([m for m in masses if m > 0] or [0.0])
    extent = (SPECK[0] * spread, SPECK[1] * spread) if spread > 0 else (0.0, math.inf)
    return Inventor(model, size, mass, extent)


def invented_shapes(
    inventor: Inventor, body: Body, points: BodyPoints, color: str
) -> tuple[Shape, ...]:
    """The shapes of a body: rods to its joints, and a solid where it has an extent of its own."""
    model = inventor.model
    arms = [r for r in points.joints if is_drawn(length_of(model, r))]
    touching = [] if arms else [*_touching(inventor, body, points, color)]
    if touching:
        shapes = touching
    elif slides(body.joint, model.dimensions):
        shapes = [*_rods(inventor, body, arms, color), *_slider(inventor, body, color)]
        reach = CARRIAGE[0] * inventor.size * inventor.number(body) / 2
        shapes += _to_others(inventor, points, reach, color)
    elif not arms:
        shapes = [] if points.discs else [*_alone(inventor, body, points, color)]
    elif len(arms) == 1 and len(points.joints) == 1 and not _is_thick(model, body, arms[0]):
        shapes = [*_pendulum(inventor, body, arms[0], points.others, color)]
    elif len(arms) == 2 and _is_straight(model, arms):
        shapes = [_rod(inventor, body, arms[0], arms[1], color)]
    elif len(arms) > 1 and model.dimensions == 2:
        shapes = [*_plate(inventor, body, arms, color)]
    else:
        shapes = [*_rods(inventor, body, arms, color), *_hub(inventor, body, points, arms, color)]
    discs = (shape for disc in points.discs for shape in _disc(inventor, body, disc, color))
    return (*discs, *shapes, *_barrel(inventor, body, arms, color))


def _disc(inventor: Inventor, body: Body, disc: elements.Disc, color: str) -> Iterator[Shape]:
    """A disc or a gear, with a mark that shows rotation; in space about the axis of the joint."""
    model, dark = inventor.model, shade(color)
    if model.dimensions == 3:
        if kinds_of(body.joint, 3) == ["revolute"]:
            axis = np.array(spatial(body.joint.primitives(3)[0].axis))
            radius = model.value(disc.radius)
            half = 0.1 * radius * axis / np.linalg.norm(axis)
            yield _along(disc.at, half, radius, color)
        return
    if disc.teeth:
        size = model.value(disc.radius)
        outline = [constant(*(size * x for x in p)) for p in toothed(disc.teeth, False, disc.phase)]
        points = tuple(sum_of(disc.at, point) for point in outline[:-1])
        yield Polygon(type="polygon", points=points, color=color)
    else:
        yield Disc(type="disc", radius=disc.radius, center=disc.at, color=color)
    end = (total(disc.at[0], times(0.72, disc.radius)), *disc.at[1:])
    yield Rod(type="rod", start=disc.at, end=end, width=times(0.16, disc.radius), color=dark)


def _touching(inventor: Inventor, body: Body, points: BodyPoints, color: str) -> Iterator[Shape]:
    """The spheres and boxes with which a body touches others, and a mark that shows rotation."""
    model = inventor.model
    dark = shade(color)
    yield from (_solid_in_contact(solid, color) for solid in points.solids)
    for at, corners, rounding in points.boxes:
        size = tuple(times(2.0, total(half, rounding)) for half in corners)
        yield Box(type="box", size=size, center=at, color=color)
    for at, radius in points.spheres if not points.boxes else ():
        if is_drawn(length_of(model, at)):
            continue  # a foot or the like, at the end of a rod
        end = (total(at[0], times(0.72, radius)), *at[1:])
        if model.dimensions == 2:
            yield Disc(type="disc", radius=radius, center=at, color=color)
            width = times(0.16, radius)
            yield Rod(type="rod", start=at, end=end, width=width, color=dark)
        else:
            yield Sphere(type="sphere", radius=radius, center=at, color=color)
            yield Sphere(type="sphere", radius=times(0.4, radius), center=end, color=dark)


def _solid_in_contact(solid: Touching, color: str) -> Shape:
    """A capsule, or a box or an ellipsoid that is turned."""
    at, radius = solid.at, solid.radius
    if solid.end:
        return Rod(type="rod", start=at, end=solid.end, width=times(2.0, radius), color=color)
    sizes = tuple(total(half, radius) for half in solid.corners or solid.semi_axes or ())
    turned: Any = {"orientation_deg": solid.orientation_deg} if solid.orientation_deg else {}
    if solid.semi_axes:
        return Ellipsoid(type="ellipsoid", radii=sizes, center=at, color=color, **turned)
    size = tuple(times(2.0, half) for half in sizes)
    return Box(type="box", size=size, center=at, color=color, **turned)


def _is_thick(model: Model, body: Body, arm: Vector) -> bool:
    """Whether the inertia of a body in space is that of a cuboid that is no rod."""
    mass = model.value(body.mass)
    if model.dimensions == 2 or mass <= 0:
        return False
    a, b, c = np.maximum(np.linalg.eigvalsh(_inertia(model, body)), 0.0)
    longest, second = math.sqrt(max(b + c - a, 0.0)), math.sqrt(max(a + c - b, 0.0))
    axis = np.array([*map(model.value, arm)]) / length_of(model, arm)
    along = math.sqrt(max(a + b + c - 2 * float(axis @ _inertia(model, body) @ axis), 0.0))
    reach = math.sqrt(6 / mass) * longest / 2
    is_rod = second <= THICK * longest and along > 0.7 * longest
    return not is_rod and reach > BOB * length_of(model, arm)


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


def _plate(inventor: Inventor, body: Body, arms: Sequence[Vector], color: str) -> Iterator[Shape]:
    """A planar body with its joints and its centre of mass at the corners or within."""
    value = inventor.model.value
    points = [constant(0.0, 0.0), *arms]
    places = np.array([[*map(value, point)] for point in points])
    corners = [points[k] for k in hull(places)]
    pairs = zip(corners, [*corners[1:], corners[0]], strict=True)
    yield from (_rod(inventor, body, a, b, color) for a, b in pairs)
    if len(corners) > 2:
        yield Polygon(type="polygon", points=tuple(corners), color=color)


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


def _hub(
    inventor: Inventor, body: Body, points: BodyPoints, arms: Sequence[Vector], color: str
) -> Iterator[Shape]:
    """The middle of a body with several arms, or with one and a joint at its centre of mass."""
    model = inventor.model
    farthest = max(length_of(model, arm) for arm in arms)
    largest = gyration(model, body)
    if points.carries:
        yield _ball(model, 0.9 * WIDTH * inventor.number(body) * inventor.size, color)
    elif is_drawn(largest) and (len(arms) > 2 or _is_thick(model, body, arms[0])):
        yield from _solid(inventor, body, color, 0.0, farthest)
    elif largest > 0.2 * farthest and len(arms) == 1:
        yield from _solid(inventor, body, color, 0.0, 0.3 * farthest)
    else:
        yield _ball(model, 0.9 * WIDTH * inventor.number(body) * inventor.size, color)


def _alone(inventor: Inventor, body: Body, points: BodyPoints, color: str) -> Iterator[Shape]:
    """A body without arms: as large as its inertia says, or a particle."""
    model = inventor.model
    if model.dimensions == 3 and points.carries:  # a ring of a gimbal, which must hide nothing
        yield _ball(model, 0.9 * WIDTH * inventor.number(body) * inventor.size, color)
    elif is_drawn(gyration(model, body)):
        yield from _solid(inventor, body, color, *inventor.extent)
        yield from _to_others(inventor, points, 2 * gyration(model, body), color)
    else:
        radius = PARTICLE * inventor.number(body, PLANETS) * inventor.size
        yield _ball(model, min(max(radius, inventor.extent[0]), inventor.extent[1]), color)


def _to_others(inventor: Inventor, points: BodyPoints, reach: float, color: str) -> Iterator[Shape]:
    """Rods from the centre of mass to what effects hold, where a body does not reach so far."""
    model = inventor.model
    zero = constant(*[0.0] * model.dimensions)
    for r in points.others:
        if reach < length_of(model, r) < 20 * reach:
            width = Constant(WIDTH * NARROWEST * min(inventor.size, length_of(model, r)))
            yield Rod(type="rod", start=zero, end=r, width=width, color=shade(color))


def _ball(model: Model, radius: float, color: str) -> Shape:
    if model.dimensions == 2:
        return Disc(type="disc", radius=Constant(radius), color=color)
    return Sphere(type="sphere", radius=Constant(radius), color=color)


def _solid(
    inventor: Inventor, body: Body, color: str, least: float, most: float
) -> Iterator[Shape]:
    """The simplest uniform solid of the body's mass and inertia, made smaller or larger if its
    longest half extent is not from `least` to `most`, m.
    """
    model, mass = inventor.model, inventor.model.value(body.mass)
    if model.dimensions == 3:
        yield from _spatial_solid(model, body, color, least, most)
        return
    moment = model.value(body.moment)
    if kinds_of(body.joint, 2) == ["revolute"]:
        radius = _within(math.sqrt(2 * moment / mass), least, most)
        yield _ball(model, radius, color)
        # So that its rotation can be seen.
        start, end = constant(0.0, 0.0), constant(0.72 * radius, 0.0)
        thick = Constant(0.16 * radius)
        yield Rod(type="rod", start=start, end=end, width=thick, color=shade(color))
        return
    width = math.sqrt(12 * moment / mass / (1 + ASPECT**2))
    width = 2 * _within(ASPECT * width / 2, least, most) / ASPECT
    yield Box(type="box", size=constant(ASPECT * width, width), color=color)


def _within(length: float, least: float, most: float) -> float:
    return min(max(length, least), most)


def _spatial_solid(
    model: Model, body: Body, color: str, least: float, most: float
) -> Iterator[Shape]:
    """A ball, a cylinder or a cuboid, as the principal moments have one value, two or three."""
    mass = model.value(body.mass)
    moments, axes = np.linalg.eigh(_inertia(model, body))
    axes = axes * np.where(np.linalg.det(axes) < 0, -1.0, 1.0)
    a, b, c = np.maximum(moments, 0.0).tolist()
    sums = np.array([b + c - a, a + c - b, a + b - c])
    size = np.sqrt(np.maximum(6 * sums / mass, 0.0))
    size = np.maximum(size, 0.05 * size.max())
    scale = _within(size.max() / 2, least, most) / (size.max() / 2)
    alike = ALIKE * c
    if c - a < alike:
        yield from _marked_ball(math.sqrt(2.5 * a / mass) * scale, color)
    elif c - b < alike or b - a < alike:
        k = 0 if c - b < alike else 2
        own, other = (a, c) if k == 0 else (c, a)
        radius = math.sqrt(2 * own / mass)
        length = math.sqrt(max(12 * (other - own / 2) / mass, 0.0))
        radius, length = max(radius, 0.04 * length), max(length, 0.1 * radius)
        half = axes[:, k] * length / 2 * scale
        yield _along(constant(0.0, 0.0, 0.0), half, radius * scale, color)
        if k == 2:  # flat, as a wheel
            spot = 0.7 * radius * scale * axes[:, 0]
            yield _along(constant(*spot), 1.02 * half, 0.15 * radius * scale, shade(color))
    else:
        turn = angles_of(axes)
        yield Box(type="box", size=constant(*size * scale), orientation_deg=turn, color=color)


def _marked_ball(radius: float, color: str) -> Iterator[Sphere]:
    """A ball with a spot that shows its rotation."""
    yield Sphere(type="sphere", radius=Constant(radius), color=color)
    spot, size = constant(0.0, -0.9 * radius, 0.0), Constant(0.2 * radius)
    yield Sphere(type="sphere", center=spot, radius=size, color=shade(color))


def _inertia(model: Model, body: Body) -> Array:
    xx, yy, zz, xy, xz, yz = map(model.value, body.inertia_com)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _slider(inventor: Inventor, body: Body, color: str) -> Iterator[Shape]:
    """A carriage at a prismatic joint, or a sleeve at a cylindrical one, along its axis."""
    joint, model = body.joint, inventor.model
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
    elif len(joint.primitives(3)) == 1:
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
    if model.dimensions == 3 and kinds_of(joint, 3) == ["revolute"] and arms:
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
