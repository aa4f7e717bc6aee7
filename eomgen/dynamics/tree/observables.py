"""Positions, velocities, momentum and Jacobians of points of a mechanism, in the world."""

from collections.abc import Sequence

from eomgen.dynamics.tree.composite import composite_bodies, force_to_move
from eomgen.dynamics.tree.frames import Linkage
from eomgen.dynamics.tree.kinematics import TreeKinematics
from eomgen.dynamics.tree.motion import Acceleration, Twist, momentum_of
from eomgen.dynamics.tree.vectors import (
    Mat,
    Vec,
    add,
    constant,
    cross,
    product,
    scale,
    sub,
    times,
    zeros,
)
from eomgen.scalars.protocol import Scalars

Origins = tuple[Vec, ...]
"""The origin of every frame in the world, m."""


def frame_origins(kinematics: TreeKinematics, scalars: Scalars) -> Origins:
    """The origins of all frames in the world, m."""
    origins: list[Vec] = []
    for link in kinematics.links:
        base = origins[link.parent] if link.parent >= 0 else zeros(scalars)
        origins.append(add(base, kinematics.to_world(link.parent, link.arm)))
    return tuple(origins)


def orientation(linkage: Linkage, kinematics: TreeKinematics, body: int, scalars: Scalars) -> Mat:
    """world_R_body."""
    mount = linkage.mounts[body]
    axes = constant(mount.axes, scalars)
    return product(kinematics.world[mount.frame], axes) if mount.frame >= 0 else axes


def arm(linkage: Linkage, kinematics: TreeKinematics, body: int, at: Vec, scalars: Scalars) -> Vec:
    """The vector from the frame's origin to a point of a body, in world axes, m; `at` is the point
    from the centre of mass, in body axes.
    """
    mount = linkage.mounts[body]
    own = add(mount.at, times(constant(mount.axes, scalars), at))
    return times(kinematics.world[mount.frame], own) if mount.frame >= 0 else own


def position(
    linkage: Linkage,
    kinematics: TreeKinematics,
    where: Origins,
    body: int,
    at: Vec,
    scalars: Scalars,
) -> Vec:
    """The world position of a point of a body, m."""
    frame = linkage.mounts[body].frame
    reach = arm(linkage, kinematics, body, at, scalars)
    return add(where[frame], reach) if frame >= 0 else reach


def velocity(
    linkage: Linkage,
    kinematics: TreeKinematics,
    twists: Sequence[Twist],
    body: int,
    at: Vec,
    scalars: Scalars,
) -> tuple[Vec, Vec]:
    """Velocity of a point of a body and the body's angular velocity, world axes."""
    frame = linkage.mounts[body].frame
    if frame < 0:
        return zeros(scalars), zeros(scalars)
    angular = kinematics.to_world(frame, twists[frame].angular)
    linear = kinematics.to_world(frame, twists[frame].linear)
    reach = arm(linkage, kinematics, body, at, scalars)
    return add(linear, cross(angular, reach)), angular


def centre_of_mass(
    linkage: Linkage, kinematics: TreeKinematics, where: Origins, scalars: Scalars
) -> Vec:
    """The centre of mass of all bodies, in the world, m. Bodies welded to the world count too."""
    moment, mass = zeros(scalars), scalars.number(0.0)
    for k, mount in enumerate(linkage.mounts):
        point = position(linkage, kinematics, where, k, zeros(scalars), scalars)
        moment, mass = add(moment, scale(mount.mass, point)), mass + mount.mass
    return (moment[0] / mass, moment[1] / mass, moment[2] / mass)


def momentum(
    kinematics: TreeKinematics, where: Origins, twists: Sequence[Twist], scalars: Scalars
) -> tuple[Vec, Vec]:
    """Momentum (kg m/s) and angular momentum about the world's origin (kg m²/s), world axes."""
    linear, angular = zeros(scalars), zeros(scalars)
    for k, link in enumerate(kinematics.links):
        about, p = momentum_of(link, twists[k])
        p = kinematics.to_world(k, p)
        linear = add(linear, p)
        angular = add(angular, add(kinematics.to_world(k, about), cross(where[k], p)))
    return linear, angular


def frame_jacobian(
    linkage: Linkage,
    kinematics: TreeKinematics,
    where: Origins,
    body: int,
    at: Vec,
    nv: int,
    scalars: Scalars,
) -> list[Twist]:
    """The velocity of a point and the body's angular velocity, in world axes, that one of each free
    velocity gives.
    """
    nothing = zeros(scalars)
    columns = [Twist(nothing, nothing)] * nv
    frame = linkage.mounts[body].frame
    point = position(linkage, kinematics, where, body, at, scalars)
    while frame >= 0:
        link = kinematics.links[frame]
        for axis, i in link.free:
            direction = kinematics.to_world(frame, axis.direction)
            reach = sub(point, where[frame])
            columns[i] = (
                Twist(direction, cross(direction, reach))
                if axis.angular
                else Twist(nothing, direction)
            )
        frame = link.parent
    return columns


def centroidal_momentum(
    kinematics: TreeKinematics, where: Origins, centre: Vec, nv: int, scalars: Scalars
) -> list[tuple[Vec, Vec]]:
    """Momentum and angular momentum about a point `centre`, in world axes, that one of each free
    velocity gives.
    """
    nothing = zeros(scalars)
    columns = [(nothing, nothing)] * nv
    bodies = composite_bodies(kinematics, scalars)
    for k, link in enumerate(kinematics.links):
        for axis, i in link.free:
            motion = (axis.direction, nothing) if axis.angular else (nothing, axis.direction)
            wrench = force_to_move(bodies[k], *motion)
            momentum = kinematics.to_world(k, wrench.force)
            about = kinematics.to_world(k, wrench.moment)
            columns[i] = momentum, add(about, cross(sub(where[k], centre), momentum))
    return columns


def acceleration(
    linkage: Linkage,
    kinematics: TreeKinematics,
    accelerating: Sequence[Acceleration],
    body: int,
    at: Vec,
    scalars: Scalars,
) -> Twist:
    """The acceleration of a point of a body and the body's angular acceleration, in world axes, at
    accelerations of the frames.
    """
    frame = linkage.mounts[body].frame
    if frame < 0:
        return Twist(zeros(scalars), zeros(scalars))
    a = accelerating[frame]
    mount = linkage.mounts[body]
    own = add(mount.at, times(constant(mount.axes, scalars), at))
    linear = add(a.linear, times(a.field, kinematics.of_frame(frame, own)))
    return Twist(kinematics.to_world(frame, a.angular), kinematics.to_world(frame, linear))
