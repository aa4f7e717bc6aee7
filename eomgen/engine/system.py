"""What the engine is given: the functions of a mechanism."""

from typing import Annotated, Protocol

from eomgen.subset.words import Matrix, Vector


class System(Protocol):
    """The mechanism whose steps are made; STATES is the number of its states."""

    def derivative(self, t: float, y: Annotated[Vector, "STATES"]) -> Annotated[Vector, "STATES"]:
        """The rates of the states (STATES,) at time t, s."""
        ...


class StiffSystem(Protocol):
    """A mechanism with the Jacobian of its rates."""

    def derivative(self, t: float, y: Annotated[Vector, "STATES"]) -> Annotated[Vector, "STATES"]:
        """The rates of the states (STATES,) at time t, s."""
        ...

    def jacobian(
        self, t: float, y: Annotated[Vector, "STATES"]
    ) -> Annotated[Matrix, "STATES", "STATES"]:
        """The derivatives of the rates by the states (STATES, STATES)."""
        ...
