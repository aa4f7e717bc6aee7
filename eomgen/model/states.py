"""What the numbers of a state vector are."""

from dataclasses import dataclass

from eomgen.model.model import Model


@dataclass(frozen=True)
class State:
    """One number of the state vector; `position` separates positions and angles from their
    rates.
    """

    name: str
    unit: str
    about: str
    position: bool


def velocity_states(model: Model) -> tuple[State, ...]:
    """The form [q, v, x]: coordinates, velocities, and what effects bring along."""
    moving = (
        State(c.name, c.unit, c.about, position)
        for group, position in ((model.coordinates, True), (model.velocities, False))
        for c in group
    )
    return (*moving, *(State(x.name, x.unit, x.about, False) for x in model.states))
