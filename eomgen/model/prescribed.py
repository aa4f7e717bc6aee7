"""Checks of prescribed coordinates, which are driven by a formula or locked."""

import math
from collections.abc import Sequence

from eomgen.base.errors import SceneError, listed, nearest
from eomgen.language.formula import Formula, names_in
from eomgen.language.rates import with_rates
from eomgen.model.bodies import Body
from eomgen.model.names import Scope
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects import Effect
from eomgen.scene.joints.base import Coordinate


def values_by_name(
    given: dict[str, float], coordinates: Sequence[Coordinate], location: str
) -> dict[str, float]:
    """The values of a table by coordinate name; keys that end in `_deg` are converted to radians.

    Raises `SceneError`, naming the `location`, for an unknown name, or one that is given twice.
    """
    names = [c.name for c in coordinates]
    degrees = {f"{c.name}_deg": c.name for c in coordinates if c.unit in ("rad", "rad/s")}
    values: dict[str, float] = {}
    for key, value in given.items():
        if key in names:
            values[key] = float(value)
        elif key in degrees:
            if degrees[key] in given:
                raise SceneError(
                    f"{location}.{key}: {degrees[key]} is also given; give only one of them"
                )
            values[degrees[key]] = math.radians(value)
        else:
            hint = nearest(key, (*names, *degrees)) or f"; known: {listed(names)}"
            raise SceneError(f"{location}.{key}: no coordinate has this name{hint}")
    return values


def locked_values(
    given: dict[str, float], bodies: Sequence[Body], effects: Sequence[Effect]
) -> dict[str, float]:
    """The locked coordinates with their values, from a table by name.

    Raises `SceneError` for one that is unknown, is part of a quaternion, or is driven.
    """
    values = values_by_name(given, [c for body in bodies for c in body.positions], "locked")
    driven = {drive[0]: e.name for e in effects if (drive := e.prescribes())}
    for body in bodies:
        for i, c in enumerate(body.positions):
            if c.name in values and i >= body.plain:
                raise SceneError(
                    f"locked.{c.name}: is part of a quaternion, which cannot be locked in part; "
                    f"give joint '{body.joint.name}' type = 'weld'"
                )
            if c.name in values and body.joint.name in driven:
                raise SceneError(
                    f"locked: '{c.name}' is driven by '{driven[body.joint.name]}', too; "
                    "give only one of them"
                )
    return values


def check_drive(
    drive: tuple[str, Formula],
    location: str,
    bodies: Sequence[Body],
    before: Sequence[Effect],
    scope: Scope,
) -> None:
    """Raise `SceneError` unless a drive is the only one of its coordinate, its formula uses time
    and parameters alone, and its value, rate and acceleration are finite at t = 0.

    `before` are the effects that the scene lists before it.
    """
    joint, coordinate = drive
    for other in before:
        if (another := other.prescribes()) and another[0] == joint:
            raise SceneError(
                f"{location}.joint: '{joint}' is driven by '{other.name}', too; give only one of "
                "them"
            )
    own = next(b.positions[0].name for b in bodies if b.joint.name == joint)
    for name in names_in(coordinate):
        if name in (own, f"{own}_dot"):
            raise SceneError(
                f"{location}.coordinate: '{name}' is the motion that the formula prescribes, "
                "which is circular; use t and parameters"
            )
        if name in scope.moving and name not in scope.values and name != "t":
            raise SceneError(
                f"{location}.coordinate: '{name}' is part of the solution, which a prescribed "
                "motion cannot depend on; use t and parameters"
            )
        if name not in scope.values and name != "t":
            return  # an unknown name, which `bind` reports
    try:
        start = with_rates(coordinate, scope.values, 0.0, FloatScalars())
    except (ArithmeticError, ValueError):
        start = (math.nan, math.nan, math.nan)
    if not all(map(math.isfinite, start)):
        raise SceneError(
            f"{location}.coordinate: it, its rate or its acceleration is not finite at t = 0; "
            "change the formula"
        )
