"""Why a run cannot start or go on, as far as the model tells."""

from collections.abc import Mapping, Sequence

import numpy as np

from eomgen.dynamics.finite import effect_sizes, is_singular, values_at
from eomgen.dynamics.regular import resistances, why_unresisted
from eomgen.model.model import Model
from eomgen.run.problem import Explain, Floats

GROWN = 1e9
"""How many times its size at the start an effect has grown where it is worth saying."""
GONE = 1e-9
"""Part of the inertia that a velocity feels elsewhere that is as good as none."""
REMEDY = "soften it, keep its formula finite there, or keep away"


def explain_by(
    model: Model | None, parameters: Mapping[str, float], inputs: Mapping[str, float]
) -> Explain:
    """What `Problem.explain` is for a model, of form 'velocity'; it says nothing for others."""
    if model is None or model.form != "velocity":
        return _nothing
    known = model

    def explain(t: float, y: Floats, initial: Floats) -> str:
        if not np.isfinite(y).all():
            return ""
        values = values_at(known, t, y.tolist(), parameters, inputs)
        sizes = effect_sizes(known, values)
        endless = [name for name, size in sizes.items() if size == float("inf")]
        if endless:
            return f"{_effects(endless)} no finite value; {REMEDY}"
        if not (known.driven or known.locked):
            felt = resistances(known.with_parameters(parameters), np.array([values.q]))
            for i in sorted(felt):
                if felt[i][0] < GONE:
                    return why_unresisted(known, i)
        if is_singular(known, values):
            return "the mass matrix is singular; change lengths, masses or inertias, or keep away"
        first = effect_sizes(known, values_at(known, 0.0, initial.tolist(), parameters, inputs))
        grown = [name for name, size in sizes.items() if size > GROWN * max(first[name], 1e-9)]
        if grown:
            worst = max(grown, key=lambda name: sizes[name])
            growth = f"from {first[worst]:.3g} to {sizes[worst]:.3g}"
            return f"effect '{worst}' has grown {growth}; {REMEDY}"
        return ""

    return explain


def _effects(names: Sequence[str]) -> str:
    listed = ", ".join(f"'{name}'" for name in names)
    return f"effects {listed} have" if len(names) > 1 else f"effect {listed} has"


def _nothing(t: float, y: Floats, initial: Floats) -> str:
    return ""
