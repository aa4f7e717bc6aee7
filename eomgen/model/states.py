"""The entries of a state vector."""

from dataclasses import dataclass

from eomgen.model.model import Model


@dataclass(frozen=True)
class State:
    """One entry of the state vector; `position` is true for positions and angles, false for rates
    and extra states.
    """

    name: str
    unit: str
    about: str
    position: bool


def velocity_states(model: Model) -> tuple[State, ...]:
    """The states of the form [q, v, x]: coordinates, velocities, extra states of effects; without
    coordinates and velocities that follow from others in closed form.
    """
    positions = (model.coordinates[i] for i in model.state_coordinates)
    velocities = (model.velocities[j] for j in model.state_velocities)
    mechanical = (
        State(c.name, c.unit, c.about, position)
        for group, position in ((positions, True), (velocities, False))
        for c in group
    )
    return (*mechanical, *(State(x.name, x.unit, x.about, False) for x in model.extra))


def initial_state(model: Model) -> tuple[float, ...]:
    """The initial state of the form [q, v, x], in the order of `velocity_states`."""
    return (
        *(model.initial_q[i] for i in model.state_coordinates),
        *(model.initial_v[j] for j in model.state_velocities),
        *(x.initial for x in model.extra),
    )
