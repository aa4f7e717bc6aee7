"""A model whose fixed directions and angles are changed by one unit in the last place.

0 stays 0, and a multiple of 90 degrees stays one: these are meant exactly.
"""

import math
import random
from dataclasses import replace

from eomgen.model.model import Model
from eomgen.scene.effects import Effect, Gravity
from eomgen.scene.joints import Free, Joint


def perturbed(model: Model, seed: int = 9) -> Model:
    """The model with each of these numbers changed to a neighbouring double, up or down."""
    rng = random.Random(seed)

    def near(x: float) -> float:
        return math.nextafter(x, rng.choice((-math.inf, math.inf))) if x else x

    def nudged(degrees: float) -> float:
        return near(degrees) if math.fmod(degrees, 90.0) else degrees

    def joint(given: Joint) -> Joint:
        if isinstance(given, Free):
            return given
        angles = given.orientation_deg
        fields: dict[str, object] = {
            "orientation_deg": tuple(map(nudged, angles))
            if isinstance(angles, tuple)
            else nudged(angles)
        }
        if (axis := getattr(given, "axis", None)) is not None:
            fields["axis"] = tuple(map(near, axis))
        if (axes := getattr(given, "axes", None)) is not None:
            fields["axes"] = tuple(tuple(map(near, axis)) for axis in axes)
        return given.replaced(**fields)

    def effect(given: Effect) -> Effect:
        if isinstance(given, Gravity) and given.direction is not None:
            return given.replaced(direction=tuple(map(near, given.direction)))
        return given

    return replace(
        model,
        bodies=tuple(replace(body, joint=joint(body.joint)) for body in model.bodies),
        effects=tuple(map(effect, model.effects)),
        locked_deg=tuple((name, nudged(degrees)) for name, degrees in model.locked_deg),
    )
