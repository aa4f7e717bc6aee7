"""Initial states on the constraints of a mechanism, at the parameters of a run."""

from collections.abc import Collection, Mapping

import numpy as np

from eomgen.dynamics.start.assembly import closed_start
from eomgen.model.model import Model
from eomgen.run.problem import FloatArray


def on_constraints(
    model: Model,
    parameters: Mapping[str, float] | None,
    y: FloatArray,
    given: Collection[str] = (),
    argument: str = "initial",
) -> tuple[FloatArray, tuple[str, ...]]:
    """The state `y` (ny,) of a model of form 'velocity', moved onto its constraints at these
    parameters, and notices of what the scene gives and could not be kept; states named in `given`
    are kept. Without constraints it is `y` itself.

    Raises `SceneError`, which calls what is given `argument`, if they cannot be met.
    """
    if not model.constraints:
        return y, ()
    nq, nv = len(model.coordinates), len(model.velocities)
    values = y.tolist()
    moved = model.with_parameters(parameters or {})
    q, v, notices = closed_start(moved, values[:nq], values[nq : nq + nv], given, argument)
    return np.array([*q, *v, *values[nq + nv :]]), notices
