"""The geometry of contact: points, spheres and corners on a plane, spheres on each other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from eomgen.scene.effects.base import Load, Mechanism, Scalar, Vector
from eomgen.scene.effects.vectors import add, cross, dot, nearest_square, negative, scale, sub
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class Side:
    """The contact point P on one of two bodies: the body's point `at` plus a lever.

    `at` from the centre of mass in body axes; the lever is `arm` + `reach` n, m, world axes.
    () and None are none of either.
    """

    body: str
    at: Vector
    arm: Vector = ()
    reach: Scalar | None = None


@dataclass(frozen=True)
class Touch:
    """Two things that may touch, at a state; where they touch, P is the same point of both.

    `normal` n, world axes, has unit length and drives the first away from the second; `gap` is
    their distance, m, negative where they overlap. The second side is left out if the world's.
    `meeting` is 0, m, but for centres within ε = `NEAREST` of each other: (ε² - d²)/(2 ε).
    """

    normal: Vector
    gap: Scalar
    sides: tuple[Side, ...]
    meeting: Scalar | None = None


@dataclass(frozen=True)
class Plane:
    """Of the points x with n·x = offset, from the point `at` of a body or of the world.

    `normal` n is in the body's axes, as `at` is.
    """

    body: str
    at: Vector
    normal: Vector
    offset: Scalar


@dataclass(frozen=True)
class Ball:
    """A sphere, in the plane a circle, about the point `at` of a body or of the world."""

    body: str
    at: Vector
    radius: Scalar


def on_plane(
    mechanism: Mechanism, plane: Plane, ball: Ball, corners: Vector | None = None
) -> Iterator[Touch]:
    """A ball on a plane; or one about each corner of a box, of these half sizes, about its `at`.

    Corners count the signs of x, y, z up, x first: (-, -, -), (+, -, -), (-, +, -), …
    """
    normal = mechanism.outward(plane.body, plane.normal)
    centre = mechanism.position(ball.body, ball.at)
    if plane.body != WORLD:
        centre = sub(centre, mechanism.position(plane.body, plane.at))
    height = dot(normal, centre) - (plane.offset + ball.radius)
    arms: list[Vector] = [()]
    lifts = [mechanism.number(0.0)]
    if corners is not None:
        edges = [_edge(mechanism, ball.body, size, i) for i, size in enumerate(corners)]
        sums = _signed_sums([(*edge, dot(normal, edge)) for edge in edges])
        arms, lifts = [x[:-1] for x in sums], [x[-1] for x in sums]
    for arm, lift in zip(arms, lifts, strict=True):
        sides = [Side(ball.body, ball.at, arm, -ball.radius)]
        if plane.body != WORLD:
            from_plane = add(centre, arm) if arm else centre
            sides.append(Side(plane.body, plane.at, from_plane, -ball.radius))
        yield Touch(normal, height + lift, tuple(sides))


def on_ball(mechanism: Mechanism, first: Ball, second: Ball) -> Touch:
    """Two balls, of which at least one has a radius.

    P divides the way between the centres as the radii do: one point of both, however deep they
    overlap, so that they change no angular momentum. Centres within ε = `NEAREST` of each other
    have no sure normal: there n is d/ε, d the way from the second to the first, and 0 at last.
    """
    d = sub(mechanism.position(first.body, first.at), mechanism.position(second.body, second.at))
    square = dot(d, d)
    larger = mechanism.call("max", square, nearest_square(mechanism))
    length = mechanism.call("sqrt", larger)
    both = first.radius + second.radius
    sides = [Side(first.body, first.at, (), -(length * (first.radius / both)))]
    if second.body != WORLD:
        sides.append(Side(second.body, second.at, (), length * (second.radius / both)))
    normal = tuple(x / length for x in d)
    return Touch(normal, length - both, tuple(sides), (larger - square) / (length + length))


def parting(mechanism: Mechanism, touch: Touch) -> Scalar:
    """The rate of the gap, m/s."""
    return dot(touch.normal, _between([_speed(mechanism, side, side.arm) for side in touch.sides]))


def sliding(mechanism: Mechanism, touch: Touch) -> tuple[Scalar, Vector]:
    """The rate of the gap, and the slip velocity of the first on the second, world axes, m/s."""
    levers = (_lever(touch, side) for side in touch.sides)
    speeds = [_speed(mechanism, s, lever) for s, lever in zip(touch.sides, levers, strict=True)]
    u = _between(speeds)
    apart = dot(touch.normal, u)
    return apart, sub(u, scale(apart, touch.normal))


def point_loads(touch: Touch, force: Vector) -> tuple[Load, ...]:
    """A force at P on the first side, N, world axes, and its opposite on the second."""
    return _on_both(touch, force, [_lever(touch, side) for side in touch.sides])


def pressing(touch: Touch, force: Scalar) -> tuple[Load, ...]:
    """The same for a force along the normal, whose lever along the normal has no moment."""
    return _on_both(touch, scale(force, touch.normal), [side.arm for side in touch.sides])


def tangents(mechanism: Mechanism, touch: Touch) -> tuple[Vector, ...]:
    """Unit tangents, normal to each other, in world axes: one in the plane, two in space.

    n, t1, t2 are right-handed, by Duff et al., "Building an orthonormal basis, revisited",
    J. Computer Graphics Techniques 6 (2017) 1-8.
    """
    if len(touch.normal) == 2:
        x, y = touch.normal
        return ((-y, x),)
    x, y, z = touch.normal
    one = mechanism.number(1.0)
    sign = mechanism.call("select", -z, -one, one)
    a = -(one / (sign + z))
    b = x * y * a
    return (one + sign * x * x * a, sign * b, -(sign * x)), (b, sign + y * y * a, -y)


def merged(loads: Sequence[Load]) -> Iterator[Load]:
    """The loads, with those on the same point of a body added."""
    found: dict[tuple[str, Vector], Load] = {}
    for load in loads:
        key = load.body, load.at
        if (other := found.get(key)) is not None:
            torque = load.torque or other.torque
            if load.torque and other.torque:
                torque = add(other.torque, load.torque)
            load = Load(load.body, add(other.force, load.force), load.at, load.kind, torque)
        found[key] = load
    yield from found.values()


def _on_both(touch: Touch, force: Vector, levers: Sequence[Vector]) -> tuple[Load, ...]:
    loads = []
    for side, lever in zip(touch.sides, levers, strict=True):
        torque = cross(lever, force) if lever else ()
        loads.append(Load(side.body, force, side.at, "applied", torque))
        force = negative(force)
    return tuple(loads)


def _lever(touch: Touch, side: Side) -> Vector:
    """The vector from the side's own point to P, world axes, m."""
    if side.reach is None:
        return side.arm
    reach = scale(side.reach, touch.normal)
    return add(side.arm, reach) if side.arm else reach


def _speed(mechanism: Mechanism, side: Side, lever: Vector) -> Vector:
    """World velocity of the body's point plus a lever, m/s."""
    speed = mechanism.velocity(side.body, side.at)
    if not lever:
        return speed
    w = mechanism.angular_velocity(side.body)
    if len(lever) == 2:
        x, y = lever
        return (speed[0] - w[0] * y, speed[1] + w[0] * x)
    return add(speed, cross(w, lever))


def _between(speeds: Sequence[Vector]) -> Vector:
    """The first velocity, relative to the second if there is one."""
    return sub(*speeds) if len(speeds) == 2 else speeds[0]


def _edge(mechanism: Mechanism, body: str, size: Scalar, axis: int) -> Vector:
    """Half an edge of a box along an axis of its body, world axes."""
    zero = mechanism.number(0.0)
    parts = [size if i == axis else zero for i in range(mechanism.dimensions)]
    return mechanism.outward(body, tuple(parts))


def _signed_sums(parts: Sequence[Vector]) -> list[Vector]:
    """±a ±b …, every choice of signs, those of the first changing fastest."""
    first, *others = parts
    sums = [negative(first), first]
    for other in others:
        sums = [sub(x, other) for x in sums] + [add(x, other) for x in sums]
    return sums
