"""Joint forces and moments, all six components, by Newton and Euler for each body."""

from collections.abc import Sequence

from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.tree import observables
from eomgen.dynamics.tree.forces import Wrench
from eomgen.dynamics.tree.vectors import (
    Vec,
    add,
    cross,
    in_space,
    product,
    scale,
    sub,
    times,
    torque_in_space,
    transposed,
    zeros,
)
from eomgen.scalars.protocol import Scalar
from eomgen.scene.constraints import LoopJoint
from eomgen.scene.effects.base import Load
from eomgen.scene.joints.base import WORLD


def reactions(
    dynamics: Dynamics, vd: Sequence[Scalar], of_constraints: Sequence[Sequence[Load]] = ()
) -> list[Wrench]:
    """The wrench of each of the model's `force_joints` on its parent, at the joint's point on the
    child, in world axes. `of_constraints` are the loads of each constraint on bodies.

    Leaves first: the joint's wrench on its child is what the child's subtree needs for its
    acceleration, beyond weight and loads. It includes the motor, which acts between the joint's two
    bodies, and its rotor.
    """
    model, linkage, kinematics = dynamics.model, dynamics.linkage, dynamics.kinematics
    scalars = dynamics.scalars
    twists = dynamics.felt[1]
    accelerating = dynamics.accelerating(vd)
    nothing = zeros(scalars)
    sums: list[Wrench] = []  # about each body's joint point, in world axes
    joints: list[Vec] = []
    for k, mount in enumerate(linkage.mounts):
        centre = dynamics.centre(k)
        point = dynamics.point_position(k, mount.joint)
        joints.append(point)
        if mount.frame < 0:
            sums.append(Wrench(nothing, scale(mount.mass, sub(nothing, dynamics.down))))
            arm = sub(centre, point)
            sums[-1] = Wrench(cross(arm, sums[-1].force), sums[-1].force)
            continue
        frame = mount.frame
        world_R_body = observables.orientation(linkage, kinematics, k, scalars)
        w = kinematics.to_world(frame, twists[frame].angular)
        a = accelerating[frame]
        reach = kinematics.of_frame(frame, mount.at)
        there = kinematics.to_world(frame, add(a.linear, times(a.field, reach)))
        alpha = kinematics.to_world(frame, a.angular)
        inertia = product(product(world_R_body, mount.inertia), transposed(world_R_body))
        force = scale(mount.mass, there)
        moment = add(times(inertia, alpha), cross(w, times(inertia, w)))
        sums.append(Wrench(add(moment, cross(sub(centre, point), force)), force))
    held = [x for loads in of_constraints for x in loads if x.body != WORLD]
    for load in (*dynamics.loads[0], *map(dynamics.point_force, held)):
        k = load.body
        arm = sub(dynamics.point_position(k, load.at), joints[k])
        f = sums[k]
        moment = add(load.torque, cross(arm, load.force))
        sums[k] = Wrench(sub(f.moment, moment), sub(f.force, load.force))
    for k in reversed(range(len(sums))):
        parent = model.bodies[k].parent
        if parent >= 0:
            arm = sub(joints[k], joints[parent])
            f, g = sums[parent], sums[k]
            moment = add(f.moment, add(g.moment, cross(arm, g.force)))
            sums[parent] = Wrench(moment, add(f.force, g.force))
    holding = {body.name for body in model.holding}
    of_tree = [
        Wrench(sub(nothing, f.moment), sub(nothing, f.force))
        for body, f in zip(model.bodies, sums, strict=True)
        if body.name in holding
    ]
    pairs = zip(model.constraints, of_constraints, strict=bool(of_constraints))
    return of_tree + [_of_loop(dynamics, c, f) for c, f in pairs if isinstance(c, LoopJoint)]


def _of_loop(dynamics: Dynamics, loop: LoopJoint, loads: Sequence[Load]) -> Wrench:
    """The wrench of a loop joint on its parent, at the joint's point on the child."""
    scalars, joint = dynamics.scalars, loop.joint
    at = tuple(dynamics.value(part) for part in joint.r_child)
    point = in_space(dynamics.position(joint.child, at), scalars)
    whole = Wrench(zeros(scalars), zeros(scalars))
    for load in loads:
        if load.body == joint.parent:
            there = in_space(dynamics.position(load.body, load.at), scalars)
            force, torque = in_space(load.force, scalars), torque_in_space(load.torque, scalars)
            moment = add(torque, cross(sub(there, point), force))
            whole = Wrench(add(whole.moment, moment), add(whole.force, force))
    return whole
