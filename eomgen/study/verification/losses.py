"""Errors in extended precision, counted in ulps of the sizes of their terms."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eomgen.model.model import Model
from eomgen.study.precision.extended import NOTHING, Array, extended
from eomgen.study.verification.roundings import ULP
from eomgen.study.verification.ulps import LEAST_SCALE

DIFFERENCED = 1e-18
"""Error of slopes and rates that are differences of differences, relative to their terms."""


@dataclass(frozen=True)
class Loss:
    """The error of a quantity, and its change by one ulp in the data, both in ulps of its terms.
    The error is infinite if the module gave no finite number.
    """

    error: float
    data: float


def loss_of(given: Any, true: Array, changes: Sequence[Array], scale: Array) -> Loss:
    """The error of what is given, and the greatest change by changed data, each of terms of a
    scale.
    """
    if not np.isfinite(given).all():
        return Loss(np.inf, 0.0)
    data = max(ulps(changed - true, scale) for changed in changes)
    return Loss(ulps(extended(given) - true, scale), data)


def ulps(error: Array, scale: Array) -> float:
    """The greatest of differences, each in ulps of its scale, which counts at least a thousandth of
    the greatest scale (see `ulps`). Where all scales are 0, any difference is infinite. nan if any
    difference is nan.
    """
    error, scale = np.broadcast_arrays(
        error, np.maximum(scale, LEAST_SCALE * np.max(scale, initial=0.0))
    )
    parts = [
        float(abs(x) / s / ULP) if s else np.inf
        for x, s in zip(error.flat, scale.flat, strict=True)
        if x
    ]
    return float(np.max(parts, initial=0.0))  # Python's own max could lose a nan


def rest_of(model: Model) -> float:
    """What 60 digits leave of terms that cancel, relative to these; more where rates and β of
    constraints are differences.
    """
    return DIFFERENCED if model.constraints else NOTHING
