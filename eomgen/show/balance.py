"""Where energy goes: whether it should stay what it is, and works by the type of effects."""

from collections.abc import Mapping, Sequence

import numpy as np

from eomgen.language.formula import Formula
from eomgen.model.model import Model
from eomgen.scene.effects import Effect
from eomgen.scene.effects.attraction import PointGravity
from eomgen.scene.effects.contact import BodyContact
from eomgen.scene.effects.external_force import ExternalForce
from eomgen.scene.effects.external_torque import ExternalTorque
from eomgen.scene.effects.field import ForceField
from eomgen.scene.effects.gravity import Gravity
from eomgen.scene.effects.joint_spring import JointSpring
from eomgen.scene.effects.joint_stop import JointStop
from eomgen.scene.effects.motor import Motor
from eomgen.scene.effects.spring import Spring
from eomgen.show.motion import Array

MOST_WORKS = 6
"""Works that are told apart one by one; of more, those of a type are summed."""


def works_by_type(
    model: Model, names: Sequence[str], works: Array
) -> tuple[tuple[str, ...], Array]:
    """Names of effects and their works (n, m), J; of more than `MOST_WORKS` by type, (n, k).

    The sum of twelve effects is called `pd (12)`; what is alone of its type keeps its name.
    """
    if len(names) <= MOST_WORKS:
        return tuple(names), works
    types = {effect.name: effect.type for effect in model.effects}
    slots: dict[str, list[int]] = {}
    for slot, name in enumerate(names):
        slots.setdefault(types[name], []).append(slot)
    called = tuple(f"{t} ({len(k)})" if len(k) > 1 else names[k[0]] for t, k in slots.items())
    return called, np.stack([works[:, k].sum(axis=1) for k in slots.values()], axis=1)


def keeps_energy(model: Model, inputs: Mapping[str, float]) -> bool:
    """Whether exact motion keeps the sum of kinetic and potential energy.

    It does where, at the values of the parameters, each effect has a potential energy for all that
    it does, or does no work at all; `inputs` that are not named are 0. What is not known to keep it
    counts as if it did not, rigid contacts among it.
    """
    return not model.leave_out and all(_keeps(effect, model, inputs) for effect in model.effects)


def _keeps(effect: Effect, model: Model, inputs: Mapping[str, float]) -> bool:
    def none(*formulas: Formula) -> bool:
        return all(model.value(formula) == 0 for formula in formulas)

    match effect:
        case Gravity() | PointGravity():
            return True
        case Spring() | JointSpring():
            return effect.law is None and none(effect.damping)
        case JointStop():
            return effect.restitution is None and none(effect.damping)
        case BodyContact():
            lost = (effect.damping, effect.dissipation, effect.friction)
            return effect.law != "impact" and none(*lost)
        case ForceField():
            return effect.kind in ("attract", "repel", "avoid")
        case Motor() | ExternalForce() | ExternalTorque():
            wanted = effect.inputs(model.dimensions)
            return bool(wanted) and not any(inputs.get(given.name) for given in wanted)
    return False
