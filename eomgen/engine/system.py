"""What the engine is given: the functions of a mechanism."""

from typing import Annotated, Protocol

from eomgen.subset.words import Vector


class System(Protocol):
    """The mechanism whose steps are made; STATES is the number of its states."""

    def derivative(self, t: float, y: Annotated[Vector, "STATES"]) -> Annotated[Vector, "STATES"]:
        """The rates of the states (STATES,) at time t, s."""
        ...
