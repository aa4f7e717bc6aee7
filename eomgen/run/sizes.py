"""Sizes of a mechanism and its states, to which tolerances are relative.

All sizes scale with the units of a scene: if units change by powers of two, runs are identical; by
powers of ten, identical but for rounding.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from eomgen.run.problem import FloatArray

FAR = 64 * np.finfo(float).eps / 1e-9
"""Least size, relative to the greatest distance: 1e-9 of the size then exceeds rounding errors."""


def mechanism_size(
    units: Mapping[str, str], parameters: Mapping[str, float], start: Mapping[str, float]
) -> float:
    """The size of a mechanism, m: its greatest length, without the distances of the ground and of
    the initial state from the origin; 1 if it has none.

    units       units of parameters and states, by name
    parameters  values of parameters, by name
    start       the initial state, by name
    """
    own = _lengths((name, value) for name, value in parameters.items() if units.get(name) == "m")
    initial = _lengths((name, value) for name, value in start.items() if units.get(name) == "m")
    near = max((value for name, value in own if not name.endswith("_offset")), default=0.0)
    far = max((value for _, value in own + initial), default=0.0)
    return _or_one(max(near, FAR * far) if near else far)


def state_sizes(
    states: Sequence[str], units: Mapping[str, str], y: FloatArray, slope: FloatArray, size: float
) -> tuple[float, ...]:
    """The size of each state, (ny,), in its unit: for lengths the size of the mechanism, m; for
    angles 1; for velocities these times the rate of the motion; for other states, such as those of
    controllers, the greatest initial value of the same unit.

    y, slope  (ny,), the initial state and its derivative
    """
    lengths = {"m": size, "m/s": size, "rad": 1.0, "rad/s": 1.0, "": 1.0}
    moves = [i for i, state in enumerate(states) if units.get(state) in ("m/s", "rad/s")]
    rate = 0.0
    for i in moves:
        own = lengths[units[states[i]]]
        rate = max(rate, abs(float(y[i])) / own, math.sqrt(abs(float(slope[i])) / own))
    rate = _or_one(rate)
    others: dict[str, float] = {}
    for i, state in enumerate(states):
        unit = units.get(state, "")
        if unit not in lengths:
            now = max(abs(float(y[i])), abs(float(slope[i])) / rate)
            others[unit] = max(others.get(unit, 0.0), now)
    found = []
    for state in states:
        unit = units.get(state, "")
        known = lengths[unit] if unit in lengths else _or_one(others[unit])
        found.append(known * (rate if unit in ("m/s", "rad/s") else 1.0))
    return tuple(found)


def _or_one(value: float) -> float:
    """A positive value; 1 for one that is 0 or not finite."""
    return value if value > 0 and math.isfinite(value) else 1.0


def _lengths(pairs: Iterable[tuple[str, float]]) -> list[tuple[str, float]]:
    return [(name, abs(value)) for name, value in pairs if math.isfinite(value)]
