"""Joint forces and moments, all six components, by Newton and Euler for each body."""

from collections.abc import Sequence

from eomgen.dynamics import observables
from eomgen.dynamics.dynamics import Dynamics
from eomgen.dynamics.forces import Wrench
from eomgen.dynamics.vectors import (
    Vec,
    add,
    cross,
    product,
    scale,
    sub,
    times,
    transposed,
    zeros,
)
from eomgen.scalars.protocol import Scalar


def reactions(dynamics: Dynamics, vd: Sequence[Scalar]) -> list[Wrench]:
    """The wrench of each joint on its parent, at the joint's point on the child, in world axes.

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
    for load in dynamics.loads[0]:
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
    return [
        Wrench(sub(nothing, f.moment), sub(nothing, f.force))
        for body, f in zip(model.bodies, sums, strict=True)
        if body.name in holding
    ]
