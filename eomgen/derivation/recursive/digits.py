"""How many digits a route loses on a model, measured in numbers before code is written."""

import math
import random
import sys
from collections.abc import Mapping
from dataclasses import replace

from eomgen.derivation.recursive.dynamics import Dynamics, Values
from eomgen.derivation.recursive.numbers import FloatScalars
from eomgen.effects import Driven, Gravity
from eomgen.model import Model

TRIALS = 3
ALL = -math.log10(sys.float_info.epsilon)
"""The digits of a double."""


def digits_lost(model: Model) -> Mapping[str, float]:
    """The decimal digits that `aba` and `ldl` lose on v̇, relative to its largest component or 1, at
    the worst of some seeded random states; 0 to `ALL`.

    They are compared with `orthogonal`, which keeps them. Of the effects uniform gravity and drives
    act, the scene's own parameters hold, and inputs are 0.
    """
    still = replace(
        model, effects=tuple(e for e in model.effects if isinstance(e, Gravity | Driven))
    )
    rng = random.Random(6)
    worst = {"aba": 0.0, "ldl": 0.0}
    for _ in range(TRIALS):
        q = [rng.uniform(-1.5, 1.5) for _ in model.coordinates]
        v = [rng.uniform(-1.5, 1.5) for _ in model.velocities]
        inputs = {i.name: 0.0 for i in model.inputs}
        states = {x.name: x.initial for x in model.states}
        values = Values(model.defaults, inputs, q, v, states)
        try:
            d = Dynamics(still, values, FloatScalars(), "own")
            true = d.orthogonal_forward()
            found = {"aba": d.articulated_forward(), "ldl": d.factored_forward()}
        except (ArithmeticError, ValueError):
            continue
        size = max(1.0, *(abs(x) for x in true)) if true else 1.0
        for route, other in found.items():
            off = max((abs(a - b) for a, b in zip(other, true, strict=True)), default=0.0) / size
            worst[route] = max(worst[route], off if off == off else 1.0)
    return {
        route: min(ALL, max(0.0, math.log10(off or 1e-300) + ALL)) for route, off in worst.items()
    }
