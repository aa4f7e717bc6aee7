"""The axes of joints in their parents' axes, for pictures."""

import numpy as np
from numpy.typing import NDArray

from eomgen.language.formula import Formula
from eomgen.language.rewriting import constant
from eomgen.model.bodies import Body
from eomgen.model.model import Model
from eomgen.scalars.exact import orientation
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import kinds_of, spatial


def slides(joint: Joint, dimensions: int) -> bool:
    """Whether a joint slides along one axis."""
    return kinds_of(joint, dimensions).count("prismatic") == 1


def joint_axis(model: Model, body: Body) -> tuple[Formula, ...] | None:
    """The unit axis of a joint's first primitive, three components in the parent's axes; None where
    there is none, or where it is that of the plane.
    """
    joint = body.joint
    primitives = joint.primitives(model.dimensions)
    if not primitives or kinds_of(joint, model.dimensions).count("prismatic") > 1:
        return None
    first = primitives[0]
    if first.kind == "spherical" or (model.dimensions == 2 and first.kind == "revolute"):
        return None
    axis = np.array(spatial(first.axis)) / np.linalg.norm(first.axis)
    return constant(*(_fixed_rotation(body) @ axis))


def directions_across(
    model: Model, body: Body
) -> tuple[tuple[Formula, ...], tuple[Formula, ...]] | None:
    """Two unit vectors across the axis of a revolute joint, in the parent's axes.

    The first points to the child's centre of mass at coordinate 0, if that is beside the axis; a
    turn by a right angle leads to the second.
    """
    joint = body.joint
    if kinds_of(joint, model.dimensions) != ["revolute"]:
        return None
    arm = np.array(spatial(tuple(-model.value(r) for r in joint.r_child)))
    axis = np.array(spatial(joint.primitives(model.dimensions)[0].axis))
    axis = axis / np.linalg.norm(axis)
    across = arm - (arm @ axis) * axis
    if np.linalg.norm(across) <= 1e-9 * np.linalg.norm(arm):
        one = np.eye(3)[np.argmin(np.abs(axis))]
        across = one - (one @ axis) * axis
    across = across / np.linalg.norm(across)
    first, second = (
        constant(*(_fixed_rotation(body) @ one)[: model.dimensions])
        for one in (across, np.cross(axis, across))
    )
    return first, second


def _fixed_rotation(body: Body) -> NDArray[np.float64]:
    """From the child's axes to the parent's at coordinate 0."""
    rows = orientation(body.joint.orientation_deg)
    return np.array([[float(entry) for entry in row] for row in rows])
