"""How many digits a route loses on a model, measured in numbers before code is written."""

import math
import random
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from eomgen.derivation.recursive.dynamics import Dynamics, Values
from eomgen.derivation.recursive.numbers import FloatScalars
from eomgen.effects import Driven, Gravity
from eomgen.model import Model

TRIALS = 3
ALL = -math.log10(sys.float_info.epsilon)
"""The digits of a double."""

Accelerations = Callable[[Values], Sequence[float]]
"""v̇ at values of a model."""


def digits_lost(model: Model, closed: Accelerations | None = None) -> Mapping[str, float]:
    """The decimal digits that `aba`, `ldl` and, if it is given, the closed form lose on v̇, relative
    to its largest component or 1, at the worst of some seeded random states; 0 to `ALL`.

    They are compared with `orthogonal`, which keeps them. Of the effects uniform gravity and drives
    act, or with a closed form all, the scene's own parameters hold, and inputs are 0.
    """
    still = model
    if closed is None:
        kept = tuple(e for e in model.effects if isinstance(e, Gravity | Driven))
        still = replace(model, effects=kept)
    rng = random.Random(6)
    worst: dict[str, float] = {}
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
            found |= {} if closed is None else {"closed": list(closed(values))}
        except (ArithmeticError, ValueError):
            continue
        size = max(1.0, *(abs(x) for x in true)) if true else 1.0
        for route, other in found.items():
            off = max((abs(a - b) for a, b in zip(other, true, strict=True)), default=0.0) / size
            worst[route] = max(worst.get(route, 0.0), off if off == off else 1.0)
    return {route: _digits(worst.get(route, 0.0)) for route in ("aba", "ldl", "closed")}


def _digits(off: float) -> float:
    return min(ALL, max(0.0, math.log10(off) + ALL)) if off > 0.0 else 0.0
