"""A model whose fixed directions and angles are changed by one unit in the last place.

0 stays 0, and a multiple of 90 degrees stays one: these are meant exactly.
"""

import math
import random
from dataclasses import replace

from eomgen.model.model import Model
from eomgen.scene.effects import Effect
from eomgen.scene.joints import Joint


def perturbed(model: Model, seed: int = 9) -> Model:
    """The model with each of these numbers changed to a neighbouring double, up or down."""
    rng = random.Random(seed)

    def near(x: float) -> float:
        return math.nextafter(x, rng.choice((-math.inf, math.inf))) if x else x

    def nudged(degrees: float) -> float:
        return near(degrees) if math.fmod(degrees, 90.0) else degrees

    def joint(given: Joint) -> Joint:
        if not given.holds:
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
        found = {key: getattr(given, key) for key in given.direction_fields}
        return given.replaced(**{k: tuple(map(near, d)) for k, d in found.items() if d})

    return replace(
        model,
        bodies=tuple(replace(body, joint=joint(body.joint)) for body in model.bodies),
        effects=tuple(map(effect, model.effects)),
        locked_deg=tuple((name, nudged(degrees)) for name, degrees in model.locked_deg),
    )
