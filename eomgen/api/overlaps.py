"""Soft contacts and stops that overlap at the initial state of a model."""

from collections.abc import Iterable
from dataclasses import dataclass

from eomgen.dynamics.start.diagnostics import initial_overlaps
from eomgen.model.bodies import dofs_of
from eomgen.model.model import Model


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
        dofs = dofs_of(model.bodies, model.dimensions)
        limited = [dof for joint in effect.limited(dofs) for dof in dofs[joint]]
        kind, unit = ("stop", _unit(limited)) if limited else ("contact", "m")
        found.append(StartOverlap(effect.name, kind, overlap.depth, unit, overlap.energy))
    return found


def _unit(dofs: Iterable[str]) -> str:
    """The unit of the coordinates that a stop limits."""
    prismatic = {dof == "prismatic" for dof in dofs}
    return "rad or m" if len(prismatic) == 2 else "m" if True in prismatic else "rad"
