"""Loads as generalised forces, and their power: the two sides of virtual work."""

from collections.abc import Iterable

from eomgen.dynamics.tree import forces as fc
from eomgen.dynamics.tree.kinematics import TreeKinematics
from eomgen.dynamics.tree.mechanism_state import MechanismState
from eomgen.dynamics.tree.observables import arm
from eomgen.dynamics.tree.vectors import Vec, add, cross, in_space, torque_in_space, zeros
from eomgen.scalars.protocol import Scalar
from eomgen.scene.effects.base import JointLoad, Load, Vector
from eomgen.scene.joints.base import WORLD

AnyLoad = Load | JointLoad


def scaled(loads: Iterable[AnyLoad], k: Scalar) -> list[AnyLoad]:
    """The loads times k."""
    found: list[AnyLoad] = []
    for load in loads:
        if isinstance(load, JointLoad):
            found.append(JointLoad(load.joint, k * load.force, load.coordinate))
        else:
            force, torque = (tuple(k * part for part in x) for x in (load.force, load.torque))
            found.append(Load(load.body, force, load.at, load.kind, torque))
    return found


def generalised(d: MechanismState, loads: Iterable[AnyLoad]) -> list[Scalar]:
    """Jᵀ f of loads: the forces on the velocities, driven ones too, that do the same work."""
    loads = list(loads)
    wrenches = _wrenches(d, [load for load in loads if isinstance(load, Load)])
    parts = fc.generalised(d.kinematics, fc.carried(d.kinematics, wrenches), d.moved)
    for load in loads:
        if isinstance(load, JointLoad):
            i = d.joint_indices[load.joint].v[load.coordinate]
            if i < d.moved:
                parts[i] = parts[i] + load.force
    return parts


def _wrenches(d: MechanismState, loads: Iterable[Load]) -> list[fc.Wrench]:
    """Loads as a wrench on each frame: summed in world axes, then rotated once for each frame."""
    nothing = zeros(d.scalars)
    points: dict[tuple[str, Vector], tuple[Vec, Vec]] = {}
    for load in loads:
        force, torque = points.get((load.body, load.at), (nothing, nothing))
        more = torque_in_space(load.torque, d.scalars)
        points[load.body, load.at] = add(force, in_space(load.force, d.scalars)), add(torque, more)
    sums: dict[int, fc.Wrench] = {}
    for (body, at), (force, torque) in points.items():
        frame = -1 if body == WORLD else d.linkage.mounts[d.index[body]].frame
        if frame >= 0:
            wrench = _in_world(d, body, at, force, torque)
            sums[frame] = fc.total(sums[frame], wrench) if frame in sums else wrench
    wrenches = [fc.Wrench(nothing, nothing)] * len(d.kinematics.links)
    for frame, f in sums.items():
        rotated = (d.kinematics.from_world(frame, part) for part in (f.moment, f.force))
        wrenches[frame] = fc.Wrench(*rotated)
    return wrenches


def _in_world(d: MechanismState, body: str, at: Vector, force: Vec, torque: Vec) -> fc.Wrench:
    """A force and a torque on a body as a wrench about its frame's origin, in world axes."""
    own = in_space(at, d.scalars)
    reach = arm(d.linkage, d.kinematics, d.index[body], own, d.scalars)
    return fc.Wrench(add(torque, cross(reach, force)), force)


def wrench_of(
    d: MechanismState, load: Load, kinematics: TreeKinematics | None = None
) -> tuple[int, fc.Wrench]:
    """The frame of a load's body, -1 for the world, and its wrench there, in the link's axes, by
    default those of the recursions.
    """
    links = kinematics or d.kinematics
    frame = -1 if load.body == WORLD else d.linkage.mounts[d.index[load.body]].frame
    if frame < 0:
        return -1, fc.no_wrench(d.scalars)
    force, torque = in_space(load.force, d.scalars), torque_in_space(load.torque, d.scalars)
    f = _in_world(d, load.body, load.at, force, torque)
    return frame, fc.Wrench(*(links.from_world(frame, part) for part in (f.moment, f.force)))


def power_of(d: MechanismState, loads: Iterable[AnyLoad]) -> Scalar:
    """The power of loads, W; for unit loads it is their speed, m/s or rad/s."""
    power = d.scalars.number(0.0)
    for load in loads:
        if isinstance(load, JointLoad):
            power = power + load.force * d.rate(load.joint, load.coordinate)
            continue
        for force, speed in zip(load.force, d.velocity(load.body, load.at), strict=True):
            power = power + force * speed
        for torque, rate in zip(load.torque, d.angular_velocity(load.body), strict=False):
            power = power + torque * rate
    return power
