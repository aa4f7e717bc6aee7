"""Checks and normal forms of joint geometry and of inertias."""

import math
from collections.abc import Iterator, Sequence

from eomgen.base.errors import SceneError
from eomgen.language.conditions import ROUNDING
from eomgen.language.formula import ZERO, Formula
from eomgen.language.quantity import with_components
from eomgen.scalars.exact import sine_between
from eomgen.scene.joints import Joint
from eomgen.scene.joints.base import Geared
from eomgen.scene.schema import BodyTable

PARALLEL = 1e-15
"""Two axes count as parallel if the sine of the angle between them is less: it is then determined
by rounding errors.
"""


def normalised_joint(joint: Joint, location: str, dimensions: int) -> Joint:
    """A joint with vectors that have one component for each dimension.

    Raises `SceneError` for a spatial joint in the plane, a vector or an orientation with the wrong
    number of components, an axis of length zero, parallel axes, limits in the wrong order, or a
    gear ratio that is zero or has no effect.
    """
    if dimensions not in joint.spaces:
        raise SceneError(
            f"{location}.type: a '{joint.type}' joint exists only in space; give dimensions = 3"
        )
    if not joint.holds:
        return joint
    fields: dict[str, object] = {
        name: with_components(getattr(joint, name), ZERO, dimensions, f"{location}.{name}")
        for name in ("r_parent", "r_child")
    }
    three_angles = isinstance(joint.orientation_deg, tuple)
    if three_angles and dimensions == 2:
        raise SceneError(f"{location}.orientation_deg: has 3 components; the plane takes one angle")
    if not three_angles and dimensions == 3 and joint.orientation_deg != 0.0:
        raise SceneError(
            f"{location}.orientation_deg: is one angle; space takes 3, about x, y and z"
        )
    names, count = getattr(joint, "coordinates", None), len(joint.primitives(dimensions))
    if names is not None and len(names) != count:
        raise SceneError(f"{location}.coordinates: has {len(names)} names; give {count}")
    axis = getattr(joint, "axis", None)
    if axis is not None:
        if joint.type == "revolute" and dimensions == 2:
            raise SceneError(f"{location}.axis: in the plane a pin turns about z; leave it out")
        fields["axis"] = _direction(axis, f"{location}.axis", dimensions)
    axes = getattr(joint, "axes", None)
    if axes is not None:
        first, second = (
            _direction(a, f"{location}.axes[{i}]", dimensions) for i, a in enumerate(axes)
        )
        if sine_between(first, second) < PARALLEL:
            raise SceneError(
                f"{location}.axes: are parallel; give two that cross, or a revolute joint"
            )
        fields["axes"] = (first, second)
    if isinstance(joint, Geared):
        if joint.limits is not None and joint.limits[0] >= joint.limits[1]:
            low, high = joint.limits
            raise SceneError(f"{location}.limits: {low:g} is not below {high:g}; give [low, high]")
        if joint.gear_ratio is not None and joint.motor_inertia == ZERO:
            raise SceneError(
                f"{location}.gear_ratio: does nothing without a motor_inertia; give one"
            )
        if joint.gear_ratio == ZERO:
            raise SceneError(
                f"{location}.gear_ratio: is 0, so the rotor would not turn; give another"
            )
    return joint.replaced(**fields)


def _direction(axis: tuple[float, ...], location: str, dimensions: int) -> tuple[float, ...]:
    """An axis with its components checked. It is not normalised, which would round it."""
    axis = with_components(axis, 0.0, dimensions, location)
    if not any(axis):
        raise SceneError(
            f"{location}: has no length; give a direction, for example {_example(axis)}"
        )
    return axis


def axis_notices(joint: Joint, location: str) -> Iterator[str]:
    """A notice for each axis of a joint whose length is not 1."""
    single = getattr(joint, "axis", None)
    axes = {} if single is None else {"axis": single}
    axes |= {f"axes[{i}]": axis for i, axis in enumerate(getattr(joint, "axes", None) or ())}
    for key, axis in axes.items():
        length = math.hypot(*axis)
        if abs(length - 1.0) > ROUNDING:
            yield f"{location}.{key}: has length {length:g}; taken as a direction of length 1"


def _example(axis: Sequence[float]) -> str:
    return str([1.0, *([0.0] * (len(axis) - 1))])


def entries_of_inertia(body: BodyTable, location: str, dimensions: int) -> tuple[Formula, ...]:
    """The inertia of a body about its centre of mass: one moment in the plane, in space xx, yy, zz,
    xy, xz, yz.

    Raises `SceneError`, naming the body, for a wrong number of entries.
    """
    given = body.inertia_com
    where = f"{location}.inertia_com: body '{body.name}'"
    if dimensions == 2:
        if isinstance(given, tuple):
            raise SceneError(f"{where} has {len(given)} entries; the plane takes one number")
        return (given,)
    if isinstance(given, tuple):
        if len(given) not in (3, 6):
            raise SceneError(
                f"{where} has {len(given)} entries; give [xx, yy, zz], or those and xy, xz, yz"
            )
        return (*given, *([ZERO] * (6 - len(given))))
    if given != ZERO:
        raise SceneError(f"{where} has one number; space takes [xx, yy, zz], or 0 for a particle")
    return (ZERO,) * 6
