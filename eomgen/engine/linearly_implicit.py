"""Steps that are implicit in stiff forces, whose equations the mechanism solves itself."""

from typing import Annotated, Protocol

from eomgen.engine.explicit import Step
from eomgen.subset.words import Vector, copy


class ResistedSystem(Protocol):
    """A mechanism that makes its own steps, see `eomgen.dynamics.resisting`."""

    def implicit_step(
        self, t: float, y: Annotated[Vector, "STATES"], h: float
    ) -> Annotated[Vector, "STATES"]:
        """The change of the states (STATES,) in a step of h from y at time t, s."""
        ...


def linearly_implicit(
    system: ResistedSystem, t: float, y: Annotated[Vector, "STATES"], h: float, step: Step
) -> None:
    """Semi-implicit Euler, linearly implicit in stiff forces. Order 1."""
    step.change = system.implicit_step(t, y, h)
    step.place = copy(y)
    step.slope = step.change / h
