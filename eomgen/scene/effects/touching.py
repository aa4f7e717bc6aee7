"""Contact geometry: points, spheres and corners on a plane or on heights, spheres on spheres."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

from eomgen.language.derivatives import derivative
from eomgen.language.formula import Formula
from eomgen.scene.effects.base import Load, Mechanism, Scalar, Vector
from eomgen.scene.effects.vectors import add, cross, dot, nearest_square, negative, scale, sub
from eomgen.scene.joints.base import WORLD


@dataclass(frozen=True)
class Side:
    """The contact point P as a point of one of the two bodies: its point `at` plus a lever.

    `at` is from the centre of mass in body axes, m. The lever is `arm` + `reach` n in world axes,
    m, with the normal n; () and None stand for 0.
    """

    body: str
    at: Vector
    arm: Vector = ()
    reach: Scalar | None = None


@dataclass(frozen=True)
class Touch:
    """A possible contact at a state. If the gap is 0, P is the same point on both sides.

    normal       unit vector n, world axes, from the second body to the first
    gap          distance, m; negative if they overlap
    sides        the first body and, unless it is the world, the second
    energy_term  times the elastic force it is added to the potential energy, m; None for 0. It is
                 not 0 only if centres are within ε = `NEAREST` of each other: (ε² - d²)/(2 ε)
    share        times friction; None for 1. It is not 1 only there: (d/ε)²
    slope        rate of the gap where the first body's point moves along n with 1 m/s; None for 1
    """

    normal: Vector
    gap: Scalar
    sides: tuple[Side, ...]
    energy_term: Scalar | None = None
    share: Scalar | None = None
    slope: Scalar | None = None


@dataclass(frozen=True)
class Plane:
    """The points x with n·x = offset, where x is from the point `at` of a body or of the world.

    `normal` n and `at` are in the body's axes.
    """

    body: str
    at: Vector
    normal: Vector
    offset: Scalar


@dataclass(frozen=True)
class Heights:
    """The height of the ground, a formula of x, and y in space, with its first and second
    derivatives by them.
    """

    height: Formula
    slopes: tuple[Formula, ...]
    bends: tuple[tuple[Formula, ...], ...]

    @classmethod
    def of(cls, height: Formula, dimensions: int) -> Self:
        """The height in the plane or in space."""
        names = "xy"[: dimensions - 1]
        slopes = tuple(derivative(height, name) for name in names)
        bends = tuple(tuple(derivative(part, name) for part in slopes) for name in names)
        return cls(height, slopes, bends)


@dataclass(frozen=True)
class Solid:
    """What touches: a core on a body or in the world, rounded by `radius`, m.

    Vectors are in body axes, m; `at` is from the centre of mass. The core is the points
    at `arms` from there, of which () is `at` itself; with `edges` the box of these half edges,
    whose corners are their signed sums, or, if it is `smooth`, the ellipsoid of these half-axes.
    """

    body: str
    at: Vector
    radius: Scalar
    arms: tuple[Vector, ...] = ((),)
    edges: tuple[Vector, ...] = ()
    smooth: bool = False


def on_plane(mechanism: Mechanism, plane: Plane, solid: Solid) -> Iterator[Touch]:
    """The contacts of a solid with a plane: at the points or corners of its core, or at the lowest
    point of an ellipsoid.

    The signs of the corners' x, y, z are in the order (-, -, -), (+, -, -), (-, +, -), …
    """
    normal = mechanism.outward(plane.body, plane.normal)
    centre = mechanism.position(solid.body, solid.at)
    if plane.body != WORLD:
        centre = sub(centre, mechanism.position(plane.body, plane.at))
    normal = mechanism.called("n", *normal)
    height = dot(normal, centre) - (plane.offset + solid.radius)
    for arm, lift in _lowest(mechanism, solid, normal):
        sides = [Side(solid.body, solid.at, arm, -solid.radius)]
        if plane.body != WORLD:
            from_plane = add(centre, arm) if arm else centre
            sides.append(Side(plane.body, plane.at, from_plane, -solid.radius))
        (gap,) = mechanism.called("g", height + lift)
        yield Touch(normal, gap, tuple(sides))


def _lowest(mechanism: Mechanism, solid: Solid, normal: Vector) -> Iterator[tuple[Vector, Scalar]]:
    """The points of a core that a plane touches first: arms from `at` in world axes, m, () for
    none, with their heights above it along the normal n.

    The support function of an ellipsoid with half-axes w is h = sqrt(Σ (w·n)²), and its lowest
    point -∂h/∂n, so the speed of the gap is that of the body's point there.
    """
    edges = [mechanism.outward(solid.body, edge) for edge in solid.edges]
    if solid.smooth:
        parts = [dot(normal, edge) for edge in edges]
        reach = mechanism.call("sqrt", dot(tuple(parts), tuple(parts)))
        arm = scale(parts[0], edges[0])
        for part, edge in zip(parts[1:], edges[1:], strict=True):
            arm = add(arm, scale(part, edge))
        yield tuple(-(x / reach) for x in arm), -reach
    elif edges:
        sums = signed_sums([(*edge, dot(normal, edge)) for edge in edges])
        yield from ((x[:-1], x[-1]) for x in sums)
    for own in solid.arms if not edges else ():
        arm = mechanism.outward(solid.body, own) if own else ()
        yield arm, dot(normal, arm) if arm else mechanism.zero


def points_of(mechanism: Mechanism, solid: Solid) -> list[Vector]:
    """The points or corners of a core from `at`, world axes, m."""
    if solid.edges:
        return signed_sums([mechanism.outward(solid.body, edge) for edge in solid.edges])
    return [mechanism.outward(solid.body, arm) if arm else () for arm in solid.arms]


def on_heights(mechanism: Mechanism, heights: Heights, solid: Solid) -> Iterator[Touch]:
    """The contacts of the points or corners of a core, rounded, with the ground below a height h.

    The gap of a point, (z - h)/w less the radius with w² = 1 + |∇h|², is its distance to first
    order, exact for planes and points that touch. The force acts along the gradient of the gap, so
    it has a potential on any ground.
    """
    up = mechanism.dimensions - 1
    one = mechanism.number(1.0)
    for arm in points_of(mechanism, solid):
        place = mechanism.position(solid.body, solid.at)
        place = add(place, arm) if arm else place
        names = dict(zip("xyz"[:up], place, strict=False))
        slopes = [mechanism.value(part, **names) for part in heights.slopes]
        square = one + dot(tuple(slopes), tuple(slopes))
        width = mechanism.call("sqrt", square)
        above = (place[up] - mechanism.value(heights.height, **names)) / width
        gradient = list[Scalar]()
        for slope, bends in zip(slopes, heights.bends, strict=True):
            bent = [mechanism.value(part, **names) for part in bends]
            gradient.append(-(slope / width) - above * dot(tuple(slopes), tuple(bent)) / square)
        gradient.append(one / width)
        slope = mechanism.call("sqrt", dot(tuple(gradient), tuple(gradient)))
        normal = mechanism.called("n", *(part / slope for part in gradient))
        (gap,) = mechanism.called("g", above - solid.radius)
        side = Side(solid.body, solid.at, arm, -solid.radius)
        yield Touch(normal, gap, (side,), slope=slope)


def on_ball(
    mechanism: Mechanism,
    first: Solid,
    second: Solid,
    arms: tuple[Vector, Vector] = ((), ()),
    apart: Vector = (),
) -> Touch:
    """The contact of two solids at points of their cores, at least one with a radius > 0.

    The points are at `arms` from where each is `at`, world axes, m; without these they are there,
    as the centres of balls. `apart` is the vector from the second point to the first, if it is
    known with less rounding. P divides the line between them in the ratio of the radii. It is one
    point of both bodies at any depth, so the forces conserve angular momentum. If the points are
    within ε = `NEAREST` of each other, n is d/ε with the vector d from the second to the first, so
    it falls to 0.
    """
    if first.body == WORLD:
        first, second, arms, apart = second, first, arms[::-1], negative(apart)
    ends = []
    for solid, arm in zip((first, second), arms, strict=True):
        place = mechanism.position(solid.body, solid.at)
        ends.append(add(place, arm) if arm else place)
    d = mechanism.called("d", *(apart or sub(*ends)))
    square = dot(d, d)
    larger = mechanism.call("max", square, nearest_square(mechanism))
    (length,) = mechanism.called("l", mechanism.call("sqrt", larger))
    both = first.radius + second.radius
    reaches = -(length * (first.radius / both)), length * (second.radius / both)
    sides = tuple(
        Side(solid.body, solid.at, arm, reach)
        for solid, arm, reach in zip((first, second), arms, reaches, strict=True)
        if solid.body != WORLD
    )
    normal = mechanism.called("n", *(x / length for x in d))
    (gap,) = mechanism.called("g", length - both)
    term = (larger - square) / (length + length)
    return Touch(normal, gap, sides, term, square / larger)


def gap_rate_of(mechanism: Mechanism, touch: Touch) -> Scalar:
    """The rate of the gap, m/s."""
    u = _relative([_speed(mechanism, side, side.arm) for side in touch.sides])
    return mechanism.called("gdot", _sloped(touch, dot(touch.normal, u)))[0]


def gap_rate_and_slip(mechanism: Mechanism, touch: Touch) -> tuple[Scalar, Vector]:
    """The rate of the gap, and the slip velocity of the first body on the second, m/s."""
    levers = (_lever(touch, side) for side in touch.sides)
    speeds = [_speed(mechanism, s, lever) for s, lever in zip(touch.sides, levers, strict=True)]
    u = mechanism.called("c", *_relative(speeds))
    speed = dot(touch.normal, u)
    (gap_rate,) = mechanism.called("gdot", _sloped(touch, speed))
    closing = gap_rate if touch.slope is None else speed
    return gap_rate, mechanism.called("u", *sub(u, scale(closing, touch.normal)))


def pressed(touch: Touch, force: Scalar) -> Scalar:
    """The normal force, N, of a force along the gap."""
    return _sloped(touch, force)


def _sloped(touch: Touch, value: Scalar) -> Scalar:
    return value if touch.slope is None else touch.slope * value


def point_loads(touch: Touch, force: Vector) -> tuple[Load, ...]:
    """The loads of a force (N, world axes) at P on the first body, and of its reaction."""
    return _on_both(touch, force, [_lever(touch, side) for side in touch.sides])


def normal_loads(touch: Touch, force: Scalar) -> tuple[Load, ...]:
    """As `point_loads` for a force along the gap. The lever's part along n has no moment."""
    force = pressed(touch, force)
    return _on_both(touch, scale(force, touch.normal), [side.arm for side in touch.sides])


def tangents(mechanism: Mechanism, touch: Touch) -> tuple[Vector, ...]:
    """Orthonormal tangents in world axes: one in the plane, two in space.

    n, t1, t2 are right-handed: Duff et al., "Building an orthonormal basis, revisited",
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
    """The loads, with the sum of those at the same point of a body."""
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
    """The vector from the point `at` of a side to P, world axes, m."""
    if side.reach is None:
        return side.arm
    reach = scale(side.reach, touch.normal)
    return add(side.arm, reach) if side.arm else reach


def _speed(mechanism: Mechanism, side: Side, lever: Vector) -> Vector:
    """World velocity of the point `at` plus a lever, fixed to the body, m/s."""
    speed = mechanism.velocity(side.body, side.at)
    if not lever:
        return speed
    w = mechanism.angular_velocity(side.body)
    if len(lever) == 2:
        x, y = lever
        return (speed[0] - w[0] * y, speed[1] + w[0] * x)
    return add(speed, cross(w, lever))


def _relative(speeds: Sequence[Vector]) -> Vector:
    """The velocity of the first side relative to the second, if there is one."""
    return sub(*speeds) if len(speeds) == 2 else speeds[0]


def signed_sums(parts: Sequence[Vector]) -> list[Vector]:
    """All sums ±a ±b …; the sign of the first changes fastest."""
    first, *others = parts
    sums = [negative(first), first]
    for other in others:
        sums = [sub(x, other) for x in sums] + [add(x, other) for x in sums]
    return sums
