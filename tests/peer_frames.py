"""States of an imported robot in the numeric recursion, for comparison with another program."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars

Array = Any
OFFSETS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Points of a body that show where it is and how it is turned, from its centre of mass, m."""


def stand_in(model: Model) -> Any:
    """What a conversion needs of a generated module, from the recursion. Its states are all
    coordinates and velocities, and then other states, whose rates are not computed.
    """
    joints = [c.name for c in (*model.coordinates, *model.velocities)]
    start = [*model.initial_q, *model.initial_v, *(state.initial for state in model.extra)]
    first, last = len(model.coordinates), len(joints)
    route = "aba" if model.rows else "orthogonal"

    def derivative(t: float, y: Array, p: None, u: Any) -> Array:
        d = dynamics_at(model, y[:first].tolist(), y[first:last].tolist(), u)
        return np.array([*np.full(first, np.nan), *d.forward(route)(None), *y[last:] * np.nan])

    return SimpleNamespace(
        STATES=(*joints, *(state.name for state in model.extra)),
        PARAMETERS=model.defaults,
        initial_state=lambda: np.array(start),
        derivative=derivative,
    )


def dynamics_at(
    model: Model, q: Sequence[float], v: Sequence[float], u: Any = None, x: Any = None
) -> Dynamics:
    """The recursion at coordinates, velocities, inputs and other states of the scene."""
    return Dynamics(model, Values(model.defaults, u or {}, q, v, x or {}), FloatScalars(), "own")


def frames(d: Dynamics, body: str) -> tuple[Array, Array]:
    """Places and velocities of the `OFFSETS` of a body in the world, each (4, 3)."""
    places = [d.position(body, at) for at in OFFSETS]
    return np.array(places), np.array([d.velocity(body, at) for at in OFFSETS])


def expected_frames(turn: Array, centre: Array, speed: Array, spin: Array) -> tuple[Array, Array]:
    """The same by world_R_body, centre of mass, its velocity, and the angular velocity in world
    axes.
    """
    arms = np.array(OFFSETS) @ turn.T
    return centre + arms, speed + np.cross(spin, arms)
