"""Whether energy is conserved, and the works of effects summed by type."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eomgen.model.model import Model
from eomgen.show.motion import Array, Motion

MOST_WORKS = 6
"""Greatest number of works that are shown one by one; more are summed by type."""


def works_by_type(
    model: Model, names: Sequence[str], works: Array
) -> tuple[tuple[str, ...], Array]:
    """Names of effects and their works (n, m), J; if there are more than `MOST_WORKS`, the sums of
    each type (n, k).

    The sum of twelve effects is named `pd (12)`. The only effect of a type keeps its
    name.
    """
    if len(names) <= MOST_WORKS:
        return tuple(names), works
    types = {effect.name: effect.type for effect in model.effects}
    slots: dict[str, list[int]] = {}
    for slot, name in enumerate(names):
        slots.setdefault(types[name], []).append(slot)
    called = tuple(f"{t} ({len(k)})" if len(k) > 1 else names[k[0]] for t, k in slots.items())
    return called, np.stack([works[:, k].sum(axis=1) for k in slots.values()], axis=1)


@dataclass(frozen=True)
class Imbalance:
    """The energy error of a run.

    lost       its greatest absolute value, J
    size       the greatest kinetic energy, J
    conserved  whether exact motion conserves energy; if not, the error is the change of kinetic
               energy that the works of effects do not explain
    """

    lost: float
    size: float
    conserved: bool


def imbalance(motion: Motion) -> Imbalance | None:
    """The energy error of a motion; None if energy is not conserved and works are not known."""
    kinetic = motion.kinetic_energy
    size = float(np.max(kinetic))
    if motion.keeps_energy:
        total = kinetic + motion.potential_energy
        return Imbalance(float(np.max(np.abs(total - total[0]))), size, True)
    if motion.works is None:
        return None
    left = kinetic - kinetic[0] - motion.works.sum(axis=1)
    return Imbalance(float(np.max(np.abs(left))), size, False)


def keeps_energy(model: Model, inputs: Mapping[str, float]) -> bool:
    """Whether exact motion conserves the sum of kinetic and potential energy, at the values of the
    parameters. Inputs that are not in `inputs` are 0. See `EffectTable.keeps_energy`.
    """
    return not model.leave_out and all(
        effect.keeps_energy(model.defaults, inputs, model.dimensions) for effect in model.effects
    )
