"""The fixed rotation of a joint, from angles, a quaternion or a matrix of numbers or formulas."""

import math
from collections.abc import Iterator, Sequence

from eomgen.base.errors import SceneError, nearest
from eomgen.language.angles import degrees_of
from eomgen.language.base import LARGEST
from eomgen.language.conditions import Condition, require, value_of
from eomgen.language.formula import Apply, Constant, Formula, meant, names_in
from eomgen.model.names import Scope
from eomgen.scalars.exact import Matrix, radians, rotation_about
from eomgen.scene.joints import Joint

NO_ROTATION = 1e-6
"""Deviation of a matrix from a rotation, in its entries, that is accepted as rounding."""
COMPUTED = 1e-12
"""The same of a matrix of formulas, whose entries are used as they are."""


def oriented(
    joint: Joint, location: str, dimensions: int, scope: Scope
) -> tuple[Joint, tuple[Condition, ...]]:
    """A joint whose `orientation` has become `orientation_deg`, if it is of numbers: these are part
    of the structure of the equations. One that depends on parameters stays, with `Constant` for
    what does not; and conditions on their values.

    Raises `SceneError` for an unknown name, or for what is not a rotation.
    """
    if joint.orientation is None:
        return joint, ()
    at = f"{location}.orientation"
    if "orientation_deg" in joint.model_fields_set:
        raise SceneError(f"{at}: orientation_deg is also given; give only one of them")
    rows = rows_of(joint.orientation)
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
    if not any(_depends(part) for row in rows for part in row):
        return joint.replaced(orientation=None, orientation_deg=degrees), ()
    own = [
        [part if _depends(part) else Constant(x) for part, x in zip(*pair, strict=True)]
        for pair in zip(rows, values, strict=True)
    ]
    conditions = tuple(_conditions(at, own))
    require(conditions, scope.values)
    kept = tuple(map(tuple, own)) if len(own) > 1 else tuple(own[0])
    return joint.replaced(orientation=kept if dimensions == 3 else own[0][0]), conditions


def rows_of(given: Formula | tuple[Formula | tuple[Formula, ...], ...]) -> list[list[Formula]]:
    """One row of angles or of a quaternion, or the three rows of a matrix."""
    if not isinstance(given, tuple):
        return [[given]]
    if all(isinstance(row, tuple) for row in given):
        return [list(row) for row in given if isinstance(row, tuple)]
    return [[part for part in given if not isinstance(part, tuple)]]


def turns_of(angles: Sequence[Formula]) -> list[tuple[int, Formula | Matrix]]:
    """The factors of Rz Ry Rx of three angles, or Rz of one: an axis each, with a formula of the
    angle, or the rotation itself where the angle is a number.
    """
    axes = (2, 1, 0) if len(angles) == 3 else (2,)
    return [
        (k, rotation_about(k, radians(degrees_of(a.value))) if isinstance(a, Constant) else a)
        for k, a in zip(axes, reversed(angles), strict=True)
    ]


def _value(formula: Formula, at: str, scope: Scope) -> float:
    for name in names_in(formula):
        if name not in scope.values:
            hint = meant(formula, scope.values) or nearest(name, scope.values)
            hint = hint or "; give it a value in [parameters]"
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


def _depends(formula: Formula) -> bool:
    return next(names_in(formula), None) is not None


def _conditions(at: str, rows: Sequence[Sequence[Formula]]) -> Iterator[Condition]:
    """Conditions that formulas give a rotation."""
    if len(rows) == 3:
        words = (
            "is no rotation: its rows are not of length 1, perpendicular and right-handed, by "
            "{:.2g}; use sin and cos of an angle, or a quaternion of any length"
        )
        off = _deviation(rows)
        yield Condition(at, off, words, (off,), high=COMPUTED)
    elif len(rows[0]) == 4:
        words = "the quaternion has no length; give 1, 0, 0, 0 for no turn"
        square = _total(*(Apply("*", (part, part)) for part in rows[0]))
        yield Condition(at, square, words, (), strict=True)
    else:
        for angle in rows[0]:
            words = f"the angle {{:g}} is larger than {LARGEST:g}; change its parameters"
            yield Condition(at, angle, words, (angle,), low=-LARGEST, high=LARGEST)


def _deviation(rows: Sequence[Sequence[Formula]]) -> Formula:
    """The largest entry of R Rᵀ - 1 and of x × y - z, for the rows x, y, z of R."""

    def minus(a: Formula, b: Formula) -> Formula:
        return Apply("-", (a, b))

    def times(a: Formula, b: Formula) -> Formula:
        return Apply("*", (a, b))

    parts: list[Formula] = []
    for i, one in enumerate(rows):
        for j, other in enumerate(rows[: i + 1]):
            length = _total(*(times(a, b) for a, b in zip(one, other, strict=True)))
            parts.append(minus(length, Constant(float(i == j))))
    x, y, z = rows
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        parts.append(minus(minus(times(x[j], y[k]), times(x[k], y[j])), z[i]))
    most: Formula = Constant(0.0)
    for part in parts:
        most = Apply("max", (most, Apply("abs", (part,))))
    return most


def _total(first: Formula, *rest: Formula) -> Formula:
    for term in rest:
        first = Apply("+", (first, term))
    return first
