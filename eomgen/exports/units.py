"""Units as products of powers of the base units of the SI, for tools that convert."""

import re
from collections.abc import Mapping

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""The base units of the FMI standard, with the radian."""
_NEWTON = {"kg": 1, "m": 1, "s": -2}
KNOWN: Mapping[str, Mapping[str, int]] = {
    **{name: {name: 1} for name in BASE},
    "N": _NEWTON,
    "J": {**_NEWTON, "m": 2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "C": {"s": 1, "A": 1},
    "1": {},
    "": {},
}
_FACTOR = re.compile(r"([A-Za-z]+|1)(?:\^(-?\d+))?")


def exponents(unit: str) -> Mapping[str, int] | None:
    """The exponents of the base units in a unit such as `kg m^2/s^2`, without those that are 0.

    None if it is not a product of powers with whole exponents of known units without factors.
    """
    found = dict.fromkeys(BASE, 0)
    above, *below = unit.strip().split("/")
    for text, sign in ((above, 1), *((part, -1) for part in below)):
        factors = text.replace("*", " ").split()
        if sign < 0 and len(factors) != 1:
            return None  # how far a division reaches is not known
        for factor in factors:
            match = _FACTOR.fullmatch(factor)
            if match is None or match[1] not in KNOWN:
                return None
            for base, power in KNOWN[match[1]].items():
                found[base] += sign * power * int(match[2] or 1)
    return {base: power for base, power in found.items() if power}


def rate_of(unit: str) -> str:
    """The unit of a time derivative."""
    if not unit or unit == "1":
        return "1/s"
    if unit.endswith("/s"):
        return f"{unit}^2"
    if power := re.fullmatch(r"(.*/s\^)(\d+)", unit):
        return f"{power[1]}{int(power[2]) + 1}"
    return f"{unit}/s"
