"""The fixed rotation of a joint, from angles, a quaternion or a matrix, as angles in degrees."""

import math
from collections.abc import Iterator, Sequence

from eomgen.errors import SceneError, nearest
from eomgen.language.angles import degrees_of
from eomgen.language.base import LARGEST
from eomgen.language.conditions import Condition, value_of
from eomgen.language.formula import Apply, Constant, Formula, names_in
from eomgen.model.names import Scope
from eomgen.scene.joints import Free, Joint

NO_ROTATION = 1e-6
"""Deviation of a matrix from a rotation, in its entries, that is accepted as rounding."""
KEPT = 1e-12
"""Change of an entry that is none."""


def oriented(
    joint: Joint, location: str, dimensions: int, scope: Scope
) -> tuple[Joint, tuple[Condition, ...]]:
    """A joint whose `orientation` has become `orientation_deg`, and conditions that parameters in
    it keep their values: fixed rotations are part of the structure of the equations.

    Raises `SceneError` for an unknown name, or for what is not a rotation.
    """
    if isinstance(joint, Free) or joint.orientation is None:
        return joint, ()
    at = f"{location}.orientation"
    if "orientation_deg" in joint.model_fields_set:
        raise SceneError(f"{at}: orientation_deg is also given; give only one of them")
    rows = _rows(joint.orientation)
    values = [[_value(part, at, scope) for part in row] for row in rows]
    if dimensions == 2:
        if len(rows) > 1 or len(rows[0]) > 1:
            raise SceneError(f"{at}: the plane takes one angle")
        degrees: float | tuple[float, ...] = degrees_of(values[0][0])
    elif len(rows) == 3:
        degrees = _of_matrix(values, at)
    elif len(rows[0]) == 4:
        degrees = _of_quaternion(values[0], at)
    elif len(rows[0]) == 3:
        degrees = tuple(degrees_of(angle) for angle in values[0])
    else:
        raise SceneError(
            f"{at}: is one angle; space takes 3, about x, y and z, a quaternion w, x, y, z, or a "
            "matrix of three rows"
        )
    joint = joint.replaced(orientation=None, orientation_deg=degrees)
    return joint, tuple(_kept(at, rows, values))


def _rows(given: Formula | tuple[Formula | tuple[Formula, ...], ...]) -> list[list[Formula]]:
    """One row of angles or of a quaternion, or the three rows of a matrix."""
    if not isinstance(given, tuple):
        return [[given]]
    if all(isinstance(row, tuple) for row in given):
        return [list(row) for row in given if isinstance(row, tuple)]
    return [[part for part in given if not isinstance(part, tuple)]]


def _value(formula: Formula, at: str, scope: Scope) -> float:
    for name in names_in(formula):
        if name not in scope.values:
            hint = nearest(name, scope.values) or "; give it a value in [parameters]"
            raise SceneError(f"{at}: unknown parameter '{name}'{hint}")
    value = value_of(formula, scope.values)
    if not abs(value) <= LARGEST:
        raise SceneError(f"{at}: its value is not a finite number; change it or its parameters")
    return value


def _of_matrix(rows: Sequence[Sequence[float]], at: str) -> tuple[float, ...]:
    """Angles about x, y and z of a rotation Rz Ry Rx."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    products = [
        sum(x * y for x, y in zip(one, other, strict=True)) - (one is other)
        for one in rows
        for other in rows
    ]
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    off = max(map(abs, [*products, determinant - 1]))
    if not off <= NO_ROTATION:
        raise SceneError(
            f"{at}: is not a rotation: its rows must be perpendicular, right-handed and of length "
            f"1, and are off by {off:.2g}; give more digits, or a quaternion"
        )
    if math.hypot(h, i) < NO_ROTATION:  # the angles about x and z turn about one axis
        return (0.0, math.copysign(90.0, -g), degrees_of(math.atan2(-b, e)))
    angles = (math.atan2(h, i), math.atan2(-g, math.hypot(h, i)), math.atan2(d, a))
    return tuple(map(degrees_of, angles))


def _of_quaternion(parts: Sequence[float], at: str) -> tuple[float, ...]:
    """Angles about x, y and z of a quaternion w, x, y, z of any length."""
    length = math.hypot(*parts)
    if not length:
        raise SceneError(f"{at}: the quaternion has no length; give 1, 0, 0, 0 for no rotation")
    w, x, y, z = (part / length for part in parts)
    alone = [i for i, part in enumerate((x, y, z)) if part]
    if len(alone) <= 1:  # about one axis, without rounding of products
        turn = 2 * math.atan2((x, y, z)[alone[0]], w) if alone else 0.0
        if alone != [1]:
            return tuple(degrees_of(turn) if alone == [i] else 0.0 for i in range(3))
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return _of_matrix(rows, at)


def _kept(
    at: str, rows: Sequence[Sequence[Formula]], values: Sequence[Sequence[float]]
) -> Iterator[Condition]:
    """Conditions that entries which depend on parameters keep their values."""
    words = "a fixed rotation depends on it; change the scene and generate again"
    for row, numbers in zip(rows, values, strict=True):
        for formula, value in zip(row, numbers, strict=True):
            if next(names_in(formula), None) is not None:
                change = Apply("-", (formula, Constant(value)))
                allowed = KEPT * max(1.0, abs(value))
                yield Condition(at, change, words, (), low=-allowed, high=allowed)
