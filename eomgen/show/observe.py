"""From a trajectory to a motion: poses, energies and joint gaps, by the generated code."""

import numpy as np
from numpy.typing import NDArray

from eomgen.joints import Revolute
from eomgen.joints.base import WORLD
from eomgen.model import Model
from eomgen.run.module import GeneratedModule
from eomgen.run.trajectory import Trajectory
from eomgen.show.motion import Motion

Floats = NDArray[np.float64]


def observe(model: Model, module: GeneratedModule, trajectory: Trajectory) -> Motion:
    """What a figure or a page shows of a run, at the values of the model's parameters."""
    columns = trajectory.y.T
    p = {parameter.name: parameter.default for parameter in model.parameters}
    with np.errstate(
        all="ignore"
    ):  # a run that was stopped may hold numbers whose squares overflow
        poses = np.moveaxis(module.body_poses(0.0, columns, p), -1, 0)
        kinetic = module.kinetic_energy(0.0, columns, p)
        potential = module.potential_energy(0.0, columns, p)
        drift = joint_drift(model, poses)
    return Motion(
        name=model.name,
        title=model.title,
        t=trajectory.t,
        y=trajectory.y,
        states=trajectory.states,
        units=tuple(module.UNITS[name] for name in trajectory.states),
        positions=module.POSITIONS,
        bodies=module.BODIES,
        shapes=tuple(body.shapes for body in model.bodies),
        joints=module.JOINTS,
        poses=poses,
        kinetic_energy=kinetic,
        potential_energy=potential,
        joint_drift=drift,
        camera=model.camera,
        integrator=trajectory.integrator,
        finished=trajectory.finished,
        message=trajectory.message,
        anchors=tuple(
            (k, model.value(joint.r_child[0]), model.value(joint.r_child[1]))
            for k, joint in _pins(model)
        ),
    )


def joint_drift(model: Model, poses: Floats) -> Floats:
    """Distance of each pin's point on its parent from that on its child, (n, nj), m.

    `poses` (n, nb, 3) as `body_poses` gives them. Measured from the poses alone, whatever the state
    form: a form that keeps each body's place for itself can pull its joints apart.
    """
    names = [body.name for body in model.bodies]
    gaps = []
    for k, joint in _pins(model):
        parent = None if joint.parent == WORLD else poses[:, names.index(joint.parent)]
        on_parent = _point(parent, [model.value(r) for r in joint.r_parent], len(poses))
        on_child = _point(poses[:, k], [model.value(r) for r in joint.r_child], len(poses))
        gaps.append(np.hypot(*(on_parent - on_child)))
    return np.array(gaps).reshape(len(gaps), len(poses)).T


def _pins(model: Model) -> list[tuple[int, Revolute]]:
    return [
        (k, body.joint) for k, body in enumerate(model.bodies) if isinstance(body.joint, Revolute)
    ]


def _point(pose: Floats | None, r: list[float], n: int) -> Floats:
    """World place of a point of a body (2, n); of the world itself where `pose` is None."""
    if pose is None:
        return np.repeat(np.array(r)[:, np.newaxis], n, axis=1)
    x, y, angle = pose.T
    c, s = np.cos(angle), np.sin(angle)
    return np.array([x + c * r[0] - s * r[1], y + s * r[0] + c * r[1]])
