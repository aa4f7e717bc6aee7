"""What a scene says of directions, orientations and inertias, made sound or refused."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from eomgen.errors import SceneError
from eomgen.language.conditions import ROUNDING
from eomgen.language.formula import ZERO, Formula
from eomgen.language.quantity import with_components
from eomgen.model.model import Model
from eomgen.scalars.exact import sine_between
from eomgen.scene.joints import Free, Joint
from eomgen.scene.joints.base import Geared
from eomgen.scene.schema import BodyTable

PARALLEL = 1e-15
"""Sine of the angle below which two axes are as good as parallel: their last digits say which."""


def straightened_joint(joint: Joint, place: str, dimensions: int, notices: list[str]) -> Joint:
    """A joint with vectors of the right length and axes that have a direction.

    Adds a notice for every axis that is not of length 1. Raises `SceneError` for a joint that there
    is not in this space, an axis of no length, parallel axes, limits upside down.
    """
    if dimensions not in joint.spaces:
        raise SceneError(
            f"{place}.type: a '{joint.type}' joint is one of space; give dimensions = 3"
        )
    if isinstance(joint, Free):
        return joint
    fields: dict[str, object] = {
        name: with_components(getattr(joint, name), ZERO, dimensions, f"{place}.{name}")
        for name in ("r_parent", "r_child")
    }
    turned = isinstance(joint.orientation_deg, tuple)
    if turned and dimensions == 2:
        raise SceneError(f"{place}.orientation_deg: has 3 components; the plane takes one angle")
    if not turned and dimensions == 3 and joint.orientation_deg != 0.0:
        raise SceneError(f"{place}.orientation_deg: is one angle; space takes 3, about x, y and z")
    axis = getattr(joint, "axis", None)
    if axis is not None:
        if joint.type == "revolute" and dimensions == 2:
            raise SceneError(f"{place}.axis: in the plane a pin turns about z; leave it out")
        fields["axis"] = _direction(axis, f"{place}.axis", dimensions, notices)
    axes = getattr(joint, "axes", None)
    if axes is not None:
        first, second = (
            _direction(a, f"{place}.axes[{i}]", dimensions, notices) for i, a in enumerate(axes)
        )
        if sine_between(first, second) < PARALLEL:
            raise SceneError(f"{place}.axes: are parallel; give two that cross, or a revolute")
        fields["axes"] = (first, second)
    if isinstance(joint, Geared):
        if joint.limits is not None and joint.limits[0] >= joint.limits[1]:
            low, high = joint.limits
            raise SceneError(f"{place}.limits: {low:g} is not below {high:g}; give [low, high]")
        if joint.gear_ratio is not None and joint.motor_inertia == ZERO:
            raise SceneError(f"{place}.gear_ratio: does nothing without a motor_inertia; give one")
        if joint.gear_ratio == ZERO:
            raise SceneError(f"{place}.gear_ratio: is 0, so that no rotor turns; give another")
    return joint.replaced(**fields)


def _direction(
    axis: tuple[float, ...], place: str, dimensions: int, notices: list[str]
) -> tuple[float, ...]:
    """The axis itself: rounded to length 1 it would no longer be what the scene says."""
    axis = with_components(axis, 0.0, dimensions, place)
    if not any(axis):
        raise SceneError(f"{place}: has no length; give a direction, for example {_example(axis)}")
    if abs(math.hypot(*axis) - 1.0) > ROUNDING:
        notices.append(
            f"{place}: has length {math.hypot(*axis):g}; taken as a direction of length 1"
        )
    return axis


def _example(axis: Sequence[float]) -> str:
    return str([1.0, *([0.0] * (len(axis) - 1))])


def entries_of_inertia(body: BodyTable, place: str, dimensions: int) -> tuple[Formula, ...]:
    """The entries of a body's inertia: one in the plane, six in space.

    Raises `SceneError`, naming the body, if there are not as many as there should be.
    """
    given = body.inertia_com
    where = f"{place}.inertia_com: body '{body.name}'"
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


def unit_quaternions(model: Model, given: Collection[object]) -> Model:
    """The model with quaternions of length 1 at the start: 1, 0, 0, 0 where none is given.

    `given` is the scene's own `initial.q`: a list of everything, or a table by name.

    Adds a notice for each that was scaled. Raises `SceneError` for one of no length that was given.
    """
    q = list(model.initial_q)
    names = [c.name for c in model.coordinates]
    notices = list(model.notices)
    for indices in model.quaternions:
        parts = [q[i] for i in indices]
        length = math.hypot(*parts)
        if length == 0.0:
            if not isinstance(given, Mapping) or any(names[i] in given for i in indices):
                raise SceneError(
                    f"initial.q: the quaternion from {names[indices[0]]} on has no length; "
                    "give 1, 0, 0, 0 for no turn"
                )
            parts, length = [1.0, 0.0, 0.0, 0.0], 1.0
        elif abs(length - 1.0) > ROUNDING:
            notices.append(
                f"initial.q: the quaternion from {names[indices[0]]} on has length {length:g}; "
                "scaled to 1"
            )
        for i, part in zip(indices, parts, strict=True):
            q[i] = part / length
    return replace(model, initial_q=tuple(q), notices=tuple(notices))
