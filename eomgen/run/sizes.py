"""Sizes of a mechanism and its states, to which tolerances are relative.

All sizes scale with the units of a scene: if units change by powers of two, runs are identical; by
powers of ten, identical but for rounding.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Numbers = Mapping[str, float | FloatArray]
"""Numbers by name, or arrays (n,) of them for n mechanisms at once."""
FAR = 64 * np.finfo(float).eps / 1e-9
"""Least size, relative to the greatest distance: 1e-9 of the size then exceeds rounding errors."""


def mechanism_size(units: Mapping[str, str], parameters: Numbers, start: Numbers) -> FloatArray:
    """The size of a mechanism, m: its greatest length, without the distances of the ground and of
    the initial state from the origin; 1 if it has none. Of n mechanisms: (n,).

    units       units of parameters and states, by name
    parameters  values of parameters, by name
    start       the initial state, by name
    """
    near = far = np.zeros(())
    for name, value in parameters.items():
        if units.get(name) == "m":
            length = _finite(np.abs(value))
            near = near if name.endswith("_offset") else np.maximum(near, length)
            far = np.maximum(far, length)
    for name, value in start.items():
        if units.get(name) == "m":
            far = np.maximum(far, _finite(np.abs(value)))
    return _or_one(np.where(near > 0, np.maximum(near, FAR * far), far))


def row_sizes(
    units: Mapping[str, str], kind: str, names: Iterable[str], unit: str, size: float
) -> list[float]:
    """The size of each contact or constraint: that of the mechanism, m, if it has this unit,
    else 1. Where another variable has its name, `units` have it under its kind and its name.
    """
    own = (units.get(f"{kind} {name}", units[name]) for name in names)
    return [size if each == unit else 1.0 for each in own]


def state_sizes(
    states: Sequence[str],
    units: Mapping[str, str],
    y: FloatArray,
    slope: FloatArray,
    size: FloatArray | float,
) -> FloatArray:
    """The size of each state, (ny,), in its unit: for lengths the size of the mechanism, m; for
    angles 1; for velocities these times the rate of the motion; for other states, such as those of
    controllers, the greatest initial value of the same unit. Of n mechanisms: (ny, n).

    y, slope  (ny,) or (ny, n), the initial state and its derivative
    """
    one = np.ones(())
    lengths = {"m": size, "m/s": size, "rad": one, "rad/s": one, "": one}
    own = [units.get(state, "") for state in states]
    rate = np.zeros(())
    for i, unit in enumerate(own):
        if unit in ("m/s", "rad/s"):
            here = np.fmax(np.abs(y[i]) / lengths[unit], np.sqrt(np.abs(slope[i]) / lengths[unit]))
            rate = np.fmax(rate, here)
    rate = _or_one(rate)
    others: dict[str, FloatArray] = {}
    for i, unit in enumerate(own):
        if unit not in lengths:
            now = np.fmax(np.abs(y[i]), np.abs(slope[i]) / rate)
            others[unit] = np.fmax(others.get(unit, np.zeros(())), now)
    found = [
        np.broadcast_to(
            (lengths[unit] if unit in lengths else _or_one(others[unit]))
            * (rate if unit in ("m/s", "rad/s") else one),
            y.shape[1:],
        )
        for unit in own
    ]
    return np.array(found).reshape(y.shape)


def _or_one(values: FloatArray) -> FloatArray:
    """Positive values; 1 for those that are 0 or not finite."""
    return np.where((values > 0) & np.isfinite(values), values, 1.0)


def _finite(values: FloatArray) -> FloatArray:
    """Values, 0 for those that are not finite."""
    return np.where(np.isfinite(values), values, 0.0)
