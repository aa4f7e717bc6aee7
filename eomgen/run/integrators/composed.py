"""Leapfrog composed to orders 4 and 6: explicit for what leapfrog takes, symplectic, symmetric.

A step is made of leapfrog steps of γ_i h, of which some lead back (Hairer, Lubich, Wanner,
Geometric Numerical Integration, V.3.2): Suzuki, Phys. Lett. A 146 (1990) 319-323, five to order 4;
Kahan and Li, Math. Comput. 66 (1997) 1089-1099, nine to order 6. With constraints the steps are
those of `rattle`, and a composition of such is symplectic too (Reich, SIAM J. Numer. Anal. 33
(1996) 475-491).
"""

import numpy as np

from eomgen.run.integrators import leapfrog
from eomgen.run.integrators.interface import Change, FixedStep
from eomgen.run.problem import FloatArray, Problem

_SUZUKI = 1 / (4 - 4 ** (1 / 3))
FOUR = (_SUZUKI, _SUZUKI, 1 - 4 * _SUZUKI, _SUZUKI, _SUZUKI)
_KAHAN_LI = (0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981,
             0.08221359629355080023)  # fmt: skip
SIX = (*_KAHAN_LI, 1 - 2 * sum(_KAHAN_LI), *reversed(_KAHAN_LI))
"""The γ_i."""


PARTS = {"leapfrog_4": FOUR, "leapfrog_6": SIX}
"""Those of each method."""


def composed(name: str, order: int) -> FixedStep:
    """A method of `PARTS`, whose steps are leapfrog steps of these parts."""
    parts = PARTS[name]

    def prepare(problem: Problem) -> Change:
        """As for `leapfrog`."""
        one = leapfrog.prepare(problem)

        def change(problem: Problem, t: float, y: FloatArray, h: float) -> FloatArray:
            total = np.zeros_like(y)
            for part in parts:
                total = total + one(problem, t, y + total, part * h)
                t += part * h
            return total

        return change

    return FixedStep(prepare, order=order, compiled=name, solves=True)


LEAPFROG_4 = composed("leapfrog_4", 4)
LEAPFROG_6 = composed("leapfrog_6", 6)
