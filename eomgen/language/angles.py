"""Angles with units in a scene: "90 deg", "1.57 rad"."""

import math
import re
from collections.abc import Mapping
from typing import Any

_ANGLE = re.compile(
    r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(deg|rad|°)\s*", re.ASCII
)
_DIGITS = 10
"""Decimal places of degrees beyond which they are taken for rounding errors of a conversion."""


def number_with_unit(text: Any) -> tuple[float, bool] | None:
    """The number of an angle and whether it is in degrees; None for anything else."""
    found = _ANGLE.fullmatch(text) if isinstance(text, str) and len(text) < 100 else None
    return (float(found[1]), found[2] != "rad") if found else None


def radians_of(value: Any) -> Any:
    """An angle with a unit in radians; anything else as it is."""
    found = number_with_unit(value)
    if found is None:
        return value
    number, degrees = found
    return math.radians(number) if degrees else number


def by_unit(table: Any) -> Any:
    """A table by coordinate with each angle in degrees under the key `<name>_deg`, and those in
    radians as numbers; anything else as it is.
    """
    if not isinstance(table, Mapping):
        return table
    found = {}
    for name, value in table.items():
        key = str(name).replace("-", "_")  # as in identifiers
        angle = number_with_unit(value)
        if angle is None or (angle[1] and f"{key}_deg" in table):
            found[key] = value
        else:
            found[f"{key}_deg" if angle[1] else key] = angle[0]
    return found


def degrees_of(radians: float) -> float:
    """An angle in degrees: the one with few decimals that is these radians, if there is one."""
    degrees = math.degrees(radians)
    short = round(degrees, _DIGITS)
    return (short if math.radians(short) == radians else degrees) + 0.0  # -0.0 becomes 0.0
