"""Jacobians by differences, where no exact one is known."""

from typing import Annotated

from eomgen.engine.system import System
from eomgen.subset.words import Matrix, Vector, copy

CUBE_ROOT = (2.0**-52) ** (1 / 3)


def differences(
    system: System,
    sizes: Annotated[Vector, "STATES"],
    t: float,
    y: Annotated[Vector, "STATES"],
    found: Annotated[Matrix, "STATES", "STATES"],
) -> None:
    """The derivatives of the rates by the states, whose sizes are given, by central differences."""
    place = copy(y)
    for j in range(len(y)):
        step = CUBE_ROOT * max(sizes[j], abs(y[j]))
        place[j] = y[j] + step
        ahead = system.derivative(t, place)
        place[j] = y[j] - step
        behind = system.derivative(t, place)
        found[:, j] = (ahead - behind) / (2.0 * step)
        place[j] = y[j]
