"""Velocities and accelerations from the root to the leaves, energy and momentum.

The outward sweep of the recursive Newton-Euler algorithm (Featherstone 2008, table 5.1). It uses
classical accelerations of points, not spatial accelerations.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from eomgen.dynamics.tree.kinematics import Link, MotionAxis, TreeKinematics
from eomgen.dynamics.tree.solids import Solid
from eomgen.dynamics.tree.vectors import (
    Mat,
    Vec,
    add,
    cross,
    dot,
    named,
    scale,
    times,
    zeros,
)
from eomgen.scalars.protocol import Scalar, Scalars

Motion = tuple[Vec, Vec]
"""An angular and a linear velocity or acceleration of a frame, at its origin."""


@dataclass(frozen=True)
class Twist:
    """A velocity in a link's axes: angular (rad/s), and linear at the link's origin (m/s)."""

    angular: Vec
    linear: Vec


@dataclass(frozen=True)
class Acceleration:
    """The acceleration of a frame, in its link's axes.

    angular  α, rad/s²
    linear   a, of the frame's origin, m/s²
    field    W = [α]x + [ω]x², with a_p = a + W (p - origin) for every point p fixed in the frame
    spread   W_zz - W_yy, W_xx - W_zz, W_yy - W_xx, from which squares cancel
    mixed    the entries of [ω]x² off the diagonal: ω_y ω_z, ω_x ω_z, ω_x ω_y
    """

    angular: Vec
    linear: Vec
    field: Mat
    spread: Vec
    mixed: Vec


def velocities(
    kinematics: TreeKinematics, v: Sequence[Scalar], scalars: Scalars
) -> tuple[Twist, ...]:
    """The velocity of every frame: v_k = v_parent + S_k v."""
    found: list[Twist] = []
    for link in kinematics.links:
        angular, linear = zeros(scalars), zeros(scalars)
        if link.parent >= 0:
            angular, linear = outward(link, found[link.parent].angular, found[link.parent].linear)
        own_angular, own_linear = own_motion(link, v, scalars)
        angular = named(add(angular, own_angular), f"omega_{link.name}", scalars)
        linear = named(add(linear, own_linear), f"velocity_{link.name}", scalars)
        found.append(Twist(angular, linear))
    return tuple(found)


def outward(link: Link, angular: Vec, linear: Vec) -> Motion:
    """The motion of a frame that is fixed to its parent, which moves like this."""
    return link.rotation.into(angular), link.rotation.into(add(linear, cross(angular, link.arm)))


def with_rate(axis: MotionAxis, rate: Scalar, angular: Vec, linear: Vec) -> Motion:
    """A motion and that along an axis."""
    more = scale(rate, axis.direction)
    return (add(angular, more), linear) if axis.angular else (angular, add(linear, more))


def own_motion(link: Link, rates: Sequence[Scalar], scalars: Scalars) -> Motion:
    """S v of the link's own velocities, or S v̇ of its accelerations: angular, linear."""
    motion = zeros(scalars), zeros(scalars)
    for axis, i in zip(link.axes, link.v, strict=True):
        motion = with_rate(axis, rates[i], *motion)
    return motion


def accelerations(
    kinematics: TreeKinematics,
    twists: Sequence[Twist],
    v: Sequence[Scalar],
    vd: Sequence[Scalar] | None,
    base: Vec,
    scalars: Scalars,
    falling: Collection[int] = (),
) -> tuple[Acceleration, ...]:
    """The acceleration of every frame at v̇ = `vd` (None is 0).

    `base` is the world's acceleration in world axes: uniform gravity g acts like a world that
    accelerates by -g. It is left out for the frames `falling`, which are children of the world.
    """
    found: list[Acceleration] = []
    two = scalars.number(2.0)
    for k, link in enumerate(kinematics.links):
        if link.parent >= 0:
            parent = found[link.parent]
            angular = link.rotation.into(parent.angular)
            linear = link.rotation.into(add(parent.linear, times(parent.field, link.arm)))
            spin = link.rotation.into(twists[link.parent].angular)
        else:
            angular, linear, spin = zeros(scalars), zeros(scalars), zeros(scalars)
            if k not in falling:
                linear = link.rotation.into(base)
        own_angular, own_linear = own_motion(link, v, scalars)
        # The axes of motion turn with the parent; a slide feels twice that (Coriolis).
        angular = add(angular, cross(spin, own_angular))
        linear = add(linear, cross(scale(two, spin), own_linear))
        if vd is not None:
            more_angular, more_linear = own_motion(link, vd, scalars)
            angular, linear = add(angular, more_angular), add(linear, more_linear)
        linear = named(linear, f"bias_{link.name}" if vd is None else f"a_{link.name}", scalars)
        found.append(Acceleration(angular, linear, *_field(twists[k].angular, angular)))
    return tuple(found)


def _field(w: Vec, a: Vec) -> tuple[Mat, Vec, Vec]:
    """`field`, `spread` and `mixed` of an `Acceleration`, from ω and α."""
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    field = (
        (-(yy + zz), xy - a[2], xz + a[1]),
        (xy + a[2], -(xx + zz), yz - a[0]),
        (xz - a[1], yz + a[0], -(xx + yy)),
    )
    return field, (zz - yy, xx - zz, yy - xx), (yz, xz, xy)


def inertial_force(link: Link, a: Acceleration, scalars: Scalars) -> tuple[Vec, Vec]:
    """Newton and Euler: the moment about the origin and the force for a link's acceleration.

    f = m a + W h with the first moment h; n = h x a + Σ m r x (W r), see `moment_about_centre`.
    """
    m, h, inertia = link.rigid.mass, link.rigid.first_moment, link.rigid.inertia
    force = add(scale(m, a.linear), times(a.field, h))
    moment = add(cross(h, a.linear), moment_about_centre(inertia, a, scalars))
    return moment, force


def moment_about_centre(inertia: Mat, a: Acceleration, scalars: Scalars) -> Vec:
    """Σ m r x (W r) = J α + ω x J ω from the inertia matrix.

    With E = Σ m r rᵀ = ½ tr(J) 1 - J it is n_x = (W E)_zy - (W E)_yz, and so on cyclically, where
    W_zz - W_yy, … are `spread`. The diagonal of E contributes J_xx α_x + (J_zz - J_yy) ω_y ω_z.
    That is computed from J, since a small moment of inertia would be lost in the rounding of E.
    """
    w, (ax, ay, az), (wyz, wxz, wxy) = a.field, a.angular, a.mixed
    xx, yy, zz = inertia[0][0], inertia[1][1], inertia[2][2]
    exy, exz, eyz = -inertia[0][1], -inertia[0][2], -inertia[1][2]
    x = w[2][0] * exy - w[1][0] * exz + a.spread[0] * eyz + xx * ax + (zz - yy) * wyz
    y = w[0][1] * eyz - w[2][1] * exy + a.spread[1] * exz + yy * ay + (xx - zz) * wxz
    z = w[1][2] * exz - w[0][2] * eyz + a.spread[2] * exy + zz * az + (yy - xx) * wxy
    return (x, y, z)


def kinetic_energy(
    kinematics: TreeKinematics,
    carried: Sequence[Solid | None],
    twists: Sequence[Twist],
    v: Sequence[Scalar],
    scalars: Scalars,
) -> Scalar:
    """Σ ½ m |v|² + ½ ω · I ω about the centres of mass of the frames' bodies, plus ½ A q̇² of the
    motors' rotors, J. About other points there are terms of both signs, which may cancel.
    """
    twice = scalars.number(0.0)
    for k, (link, solid, motion) in enumerate(zip(kinematics.links, carried, twists, strict=True)):
        if solid is not None:
            u = add(motion.linear, cross(motion.angular, kinematics.of_frame(k, solid.centre)))
            w = kinematics.in_frame(k, motion.angular)
            twice = twice + solid.mass * dot(u, u) + dot(w, times(solid.inertia, w))
        for i in link.v:
            twice = twice + link.armature * (v[i] * v[i])
    return scalars.number(0.5) * twice


def momentum_of(link: Link, motion: Twist) -> tuple[Vec, Vec]:
    """Angular momentum about the link's origin (kg m²/s) and momentum (kg m/s), link's axes."""
    rigid = link.rigid
    momentum = add(scale(rigid.mass, motion.linear), cross(motion.angular, rigid.first_moment))
    return add(
        times(rigid.inertia, motion.angular), cross(rigid.first_moment, motion.linear)
    ), momentum
