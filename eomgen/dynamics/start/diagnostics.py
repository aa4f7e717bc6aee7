"""What fails at a time and state: effects without finite values, a singular mass matrix, overlaps.

Computed in numbers when a run cannot go on, and for warnings at the initial state.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eomgen.dynamics.dynamics import Dynamics, Values
from eomgen.dynamics.start.constraint_equations import INDEPENDENT, ConstraintEquations
from eomgen.model.model import Model
from eomgen.scalars.floats import FloatScalars
from eomgen.scene.effects import Effect
from eomgen.scene.effects.base import JointLoad


def values_at(
    model: Model,
    t: float,
    y: Sequence[float],
    parameters: Mapping[str, float],
    inputs: Mapping[str, float],
) -> Values:
    """The values of a model at time t (s) and state y = [q, v, x] (ny,) of form 'velocity'.

    Parameters that are not given have their defaults, and so do inputs.
    """
    nq, nv = len(model.coordinates), len(model.velocities)
    states = {x.name: value for x, value in zip(model.extra, y[nq + nv :], strict=True)}
    return Values(
        {**model.defaults, **parameters},
        {**{i.name: i.default for i in model.inputs}, **inputs},
        list(y[:nq]),
        list(y[nq : nq + nv]),
        states,
        t,
    )


def effect_sizes(model: Model, values: Values) -> dict[str, float]:
    """For each effect the largest absolute component of its forces (N), torques (N m) and rates of
    states; infinite where one is not finite.
    """
    dynamics = Dynamics(model, values, FloatScalars())
    return {effect.name: _size(effect, dynamics) for effect in model.effects}


@dataclass(frozen=True)
class Overlap:
    """A soft contact or stop that overlaps: its greatest depth, m or rad, and its energy, J."""

    effect: str
    depth: float
    energy: float


def initial_overlaps(model: Model) -> list[Overlap]:
    """The soft contacts and stops of a model that overlap at its initial state.

    Empty if an effect has no finite value there; that is a separate error.
    """
    start = [*model.initial_q, *model.initial_v, *(x.initial for x in model.extra)]
    dynamics = Dynamics(model, values_at(model, 0.0, start, {}, {}), FloatScalars())
    found = []
    try:
        for effect in model.effects:
            depth = float(effect.overlap(dynamics))
            if depth > 0.0:
                found.append(Overlap(effect.name, depth, float(effect.potential_energy(dynamics))))
    except (ArithmeticError, ValueError):
        return []
    return found


def _size(effect: Effect, dynamics: Dynamics) -> float:
    largest = 0.0
    try:
        numbers = [float(rate) for rate in effect.rates(dynamics)]
        for load in effect.loads(dynamics):
            parts = (load.force,) if isinstance(load, JointLoad) else (*load.force, *load.torque)
            numbers += [float(part) for part in parts]
    except (ArithmeticError, ValueError):
        return math.inf
    for number in numbers:
        largest = max(largest, abs(number)) if math.isfinite(number) else math.inf
    return largest


def constraint_trouble(model: Model, values: Values) -> str:
    """What is wrong with the constraints at this position: that one follows from the others, or has
    no value; "" if they are independent.
    """
    if not model.constraints:
        return ""
    moved = model.with_parameters({p.name: values.parameters[p.name] for p in model.parameters})
    matrix = ConstraintEquations.of(moved).jacobian(np.array(values.q))
    if not np.isfinite(matrix).all():
        return "a formula of the constraints has no finite value, as at the end of its domain"
    lengths = np.linalg.norm(matrix, axis=1)
    worst = int(np.argmin(lengths))
    if lengths[worst]:
        left, sizes, _ = np.linalg.svd(matrix / lengths[:, np.newaxis])
        if sizes[-1] > INDEPENDENT:
            return ""
        worst = int(np.abs(left[:, -1]).argmax())  # the combination that is nearest to 0
    name, _ = model.rows[worst]
    return f"constraint {name} follows from the others, as at a dead point or a change point"


def is_singular(model: Model, values: Values) -> bool:
    """Whether the mass matrix is singular: v̇ from rest without effects is not finite then."""
    still = replace(values, v=[0.0] * len(values.v))
    # Drives stay: without them their coordinates would be states.
    bare = replace(model, effects=tuple(e for e in model.effects if e.prescribes()))
    try:
        found = Dynamics(bare, still, FloatScalars()).articulated_forward()
    except (ArithmeticError, ValueError):
        return True
    return not all(math.isfinite(vd) for vd in found)
