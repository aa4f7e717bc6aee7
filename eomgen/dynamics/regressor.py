"""Inverse dynamics as a linear function of the inertias of bodies: τ = Y(q, v, v̇) π.

π has for each frame that carries bodies the ten numbers of a rigid-body inertia (Featherstone 2008,
2.13): mass, first moment, and inertia about the point where its joint holds the body, in body axes;
in the plane the four of these that matter. Bodies that are welded together are one. Rotors add the
reflected inertia of each motor.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.tree.forces import Wrench, at_parent
from eomgen.dynamics.tree.frames import Mount, Rigid, turned
from eomgen.dynamics.tree.motion import inertial_force
from eomgen.dynamics.tree.vectors import (
    Vec,
    add,
    congruent,
    constant,
    dot,
    plus,
    scale,
    symmetric,
    times,
    unit,
    zeros,
)
from eomgen.model.model import Model
from eomgen.scalars.protocol import Scalar, Scalars
from eomgen.tables.outputs import IN_PLANE, IN_SPACE

MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
"""The entries of an inertia."""
ROTOR = "rotor"


@dataclass(frozen=True)
class InertialParameter:
    """One number of π: of a body, "m", "mx", …, "Ixx", …; or "rotor" of a joint's motor.

    welded  the other bodies that it includes
    """

    of: str
    what: str
    welded: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.of}.{self.what}"


def inertial_parameters(model: Model, dynamics: Dynamics) -> tuple[InertialParameter, ...]:
    """The numbers π of a model, bodies from the root to the leaves. In each first those of which
    others are made: what does not stand alone is added to what comes before it.
    """
    order = (*(f"I{name}" for name in MOMENTS), "mx", "my", "mz", "m")
    known = IN_SPACE if model.dimensions == 3 else IN_PLANE
    found: list[InertialParameter] = []
    for k, frame in enumerate(dynamics.linkage.frames):
        bodies = _on(dynamics, k)
        if bodies:
            name, *welded = (model.bodies[i].name for i in bodies)
            found += [
                InertialParameter(name, what, tuple(welded)) for what in order if what in known
            ]
        if not dynamics.scalars.is_zero(frame.armature):
            found += [InertialParameter(_coordinate(model, i), ROTOR) for i in frame.v]
    return tuple(found)


def regressor(
    dynamics: Dynamics, vd: Sequence[Scalar], parameters: Sequence[InertialParameter]
) -> list[list[Scalar]]:
    """Y (nv, n), column by column: the generalised forces of each parameter at accelerations vd."""
    model, scalars = dynamics.model, dynamics.scalars
    moving = dynamics.accelerating(vd)
    links, nv = dynamics.kinematics.links, dynamics.nv
    mounts = {b.name: m for b, m in zip(model.bodies, dynamics.linkage.mounts, strict=True)}
    columns = []
    for parameter in parameters:
        column = [scalars.number(0.0)] * nv
        if parameter.what == ROTOR:
            i = next(i for i in range(nv) if _coordinate(model, i) == parameter.of)
            column[i] = vd[i]
        elif (k := mounts[parameter.of].frame) >= 0:
            mount = mounts[parameter.of]
            rigid = _single(mount, parameter.what, scalars)
            if dynamics.kinematics.axes == "world":
                rigid = turned(rigid, dynamics.kinematics.world[k])
            link = replace(links[k], rigid=rigid)
            wrench = Wrench(*inertial_force(link, moving[k], scalars))
            while k >= 0:
                for axis, i in links[k].free:
                    column[i] = dot(axis.direction, wrench.moment if axis.angular else wrench.force)
                wrench, k = at_parent(links[k], wrench), links[k].parent
        columns.append(column)
    return columns


def values_at_random(model: Model, numbers: Iterator[float], scalars: Scalars) -> Values:
    """A state of a model, of random numbers; quaternions are the squares of others, divided by
    their lengths, which are of length 1 exactly.
    """
    q = [scalars.number(next(numbers)) for _ in model.coordinates]
    for w, x, y, z in model.quaternions:
        a, b, c, d = q[w], q[x], q[y], q[z]
        rest = b * b + c * c + d * d
        two, length = scalars.number(2.0) * a, a * a + rest
        q[w], q[x], q[y], q[z] = (
            (a * a - rest) / length,
            two * b / length,
            two * c / length,
            two * d / length,
        )
    v = [scalars.number(next(numbers)) for _ in model.velocities]
    given = {name: scalars.number(x) for name, x in model.defaults.items()}
    inputs = {i.name: scalars.number(i.default) for i in model.inputs}
    return Values(given, inputs, q, v, {}, scalars.number(0.0))


def _on(dynamics: Dynamics, frame: int) -> list[int]:
    """The bodies on a frame."""
    return [i for i, mount in enumerate(dynamics.linkage.mounts) if mount.frame == frame]


def _coordinate(model: Model, velocity: int) -> str:
    """The name of the joint that has a velocity."""
    return next(index.body.joint.name for index in model.joint_indices if velocity in index.v)


def _single(mount: Mount, what: str, scalars: Scalars) -> Rigid:
    """The inertia about the frame's origin of which one number is 1, the others 0."""
    zero, one, none = scalars.number(0.0), scalars.number(1.0), zeros(scalars)
    axes = constant(mount.axes, scalars)
    at = add(mount.at, times(axes, mount.joint))
    flat = symmetric([zero] * 6)
    if what == "m":
        return Rigid(one, at, _pair(at, scale(scalars.number(0.5), at), scalars))
    if what[0] == "m":
        first = times(axes, unit("xyz".index(what[1]), scalars))
        return Rigid(zero, first, _pair(at, first, scalars))
    entries = [one if name == what[1:] else zero for name in MOMENTS]
    return Rigid(zero, none, plus(flat, congruent(axes, symmetric(entries))))


def _pair(a: Vec, h: Vec, scalars: Scalars) -> tuple[Vec, Vec, Vec]:
    """2 (a·h) 1 - a hᵀ - h aᵀ, the inertia that a first moment h at a adds."""
    twice = scalars.number(2.0) * dot(a, h)
    entries = [
        (twice if i == j else scalars.number(0.0)) - a[i] * h[j] - h[i] * a[j]
        for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    ]
    return symmetric(entries)
