"""What the motion of a run comes of: a scene, parameters and inputs."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from eomgen.model.model import Model

UNITS = "units of parameters"
START = "initial state"
"""The part of a scene that a motion under way no longer depends on, but sizes do."""


@dataclass(frozen=True)
class Origin:
    """What makes a motion, once it is under way, what it is.

    scene               digests of the parts of a scene, by what they are called; looks, names of
                        files and settings of the solver are none
    parameters, inputs  values, by name
    """

    scene: Mapping[str, str]
    parameters: Mapping[str, float]
    inputs: Mapping[str, float]


def origin_of(model: Model, parameters: Mapping[str, float], inputs: Mapping[str, float]) -> Origin:
    """Where the motion of a model comes from, with values in place of some of its own."""
    parts: dict[str, object] = {
        "dimensions": model.dimensions,
        "form": model.form,
        "locked coordinates": model.locked,
        "effects left out": model.leave_out,
        UNITS: tuple((p.name, p.unit) for p in model.parameters),
        START: (model.initial_q, model.initial_v, model.states),
    }
    for body in model.bodies:
        parts[f"body '{body.name}'"] = body
    for point in model.points:
        parts[f"point '{point.name}'"] = point
    for effect in model.effects:
        parts[f"effect '{effect.name}'"] = effect
    return Origin(
        {name: hashlib.sha256(repr(part).encode()).hexdigest() for name, part in parts.items()},
        {**model.defaults, **parameters},
        {**dict.fromkeys([i.name for i in model.inputs], 0.0), **inputs},
    )
