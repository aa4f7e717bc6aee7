"""The entries of a module's Jacobian, against differences of v̇ in 60 digits.

Along one direction, small entries hide behind large ones. Here each coordinate, velocity and extra
state is displaced alone, a quaternion along its sphere.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from gmpy2 import mpfr

from eomgen.model.model import Model
from eomgen.run.problem import FloatArray
from eomgen.study.precision.extended import (
    Array,
    doubles,
    extended,
    extended_digits,
    of_unit_length,
)
from eomgen.study.verification.hard_states import State
from eomgen.study.verification.roundings import ULP, Roundings, spread, worst_share
from eomgen.study.verification.truth import Truth
from eomgen.study.whole import Viewed, names_of

STEP = mpfr(2) ** -66
"""Step of central differences, for rates of order 1; their error is its square, about 1e-40."""
SMOOTH = 1e-9
"""Greatest second difference, relative to the first difference, if there is no corner."""

LEFT = 1e-17
"""What differences leave where a slope bends, as that of |v| v at 0, of the greatest entry."""


def worst_slope(
    model: Model, truth: Truth, module: Any, roundings: Roundings, state: State
) -> float | None:
    """The greatest error of an entry of the Jacobian's rows of v̇, in units of what rounding makes
    of it. None where entries are not judged: of modules without a Jacobian, with fewer states than
    the model, or with one that is computed along directions only.
    """
    if isinstance(module, Viewed) or not (hasattr(module, "jacobian") and len(state.y)):
        return None
    if roundings.tangent("jacobian"):
        return None
    at = slice(len(model.coordinates), len(model.coordinates) + len(model.velocities))
    given = module.jacobian(state.t, state.y, None, state.u or None)[at]
    if not np.isfinite(given).all():
        return float("inf")
    here = dict(zip(names_of(model), state.y.tolist(), strict=True))
    runs = roundings.runs("jacobian", state.t, here, state.u)[at]
    worst, rest = 0.0, LEFT * np.max(abs(given), initial=0.0)
    with extended_digits():
        y = of_unit_length(extended(state.y), model.quaternions)
        for direction, true in _slopes(model, truth, state, y):
            along = doubles(direction)
            error = doubles(extended(given) @ direction - true)
            terms = abs(given) @ abs(along)
            spreads: FloatArray = spread(np.tensordot(runs, along, (1, 0)))
            worst = max(worst, worst_share(error, spreads + ULP * terms + rest)[0])
    return worst


def _slopes(model: Model, truth: Truth, state: State, y: Array) -> Iterator[tuple[Array, Array]]:
    """Directions, and the derivatives of v̇ along them, except at corners, which have two."""
    t = mpfr(state.t)
    middle = truth.extended(t, y, state.u, {})
    directions = extended(np.eye(len(y)))
    for indices in map(list, model.quaternions):
        for k in indices:
            directions[k, indices] = directions[k, indices] - y[k] * y[indices]
    for direction in directions:
        ahead, behind = (
            truth.extended(t, y + step * direction, state.u, {}) for step in (STEP, -STEP)
        )
        change = ahead - behind
        bend = np.max(abs(ahead - 2 * middle + behind))
        if bend <= SMOOTH * np.max(abs(change)):
            yield direction, change / (2 * STEP)
