"""Soft contacts and stops that overlap at the initial state of a model."""

from dataclasses import dataclass

from eomgen.dynamics.diagnostics import initial_overlaps
from eomgen.model.model import Model, dofs_of
from eomgen.scene.effects import JointStop


@dataclass(frozen=True)
class StartOverlap:
    """A soft contact or stop that overlaps at the start.

    kind    "contact" or "stop"
    depth   the greatest, in `unit`: "m", "rad" or, for a stop of both kinds of joint, "rad or m"
    energy  stored in it, J; it may throw the bodies apart
    """

    effect: str
    kind: str
    depth: float
    unit: str
    energy: float


def overlaps_at_start(model: Model) -> list[StartOverlap]:
    """The soft contacts and stops that overlap at the initial state of a model."""
    effects = {effect.name: effect for effect in model.effects}
    found = []
    for overlap in initial_overlaps(model):
        effect = effects[overlap.effect]
        if isinstance(effect, JointStop):
            kind, unit = "stop", _unit(model, effect)
        else:
            kind, unit = "contact", "m"
        found.append(StartOverlap(effect.name, kind, overlap.depth, unit, overlap.energy))
    return found


def _unit(model: Model, stop: JointStop) -> str:
    """The unit of the coordinates that a stop limits."""
    dofs = dofs_of(model.bodies, model.dimensions)
    prismatic = {dof == "prismatic" for joint in stop.acted_on(dofs) for dof in dofs[joint]}
    return "rad or m" if len(prismatic) == 2 else "m" if True in prismatic else "rad"
