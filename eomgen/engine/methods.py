"""The methods of the engine: which of its functions makes a step, by their names."""

from collections.abc import Iterable, Mapping
from typing import Any

from eomgen.engine import explicit, implicit
from eomgen.engine.embedded import DOP853

Root = tuple[str, Mapping[str, Any]]
"""A function of the engine, with the values of its `Known` parameters."""
Roots = Iterable[Root]
EQUAL: Mapping[str, Root] = {
    "euler": ("runge_kutta", {"method": explicit.EULER}),
    "semi_implicit_euler": ("semi_implicit_euler", {}),
    "leapfrog": ("leapfrog", {}),
    "leapfrog_4": ("composed", {"of": explicit.LEAPFROG_4}),
    "leapfrog_6": ("composed", {"of": explicit.LEAPFROG_6}),
    "rk4": ("runge_kutta", {"method": explicit.RUNGE_KUTTA_4}),
    "linearly_implicit": ("linearly_implicit", {}),
    "implicit_midpoint": ("implicit_change", {"method": implicit.IMPLICIT_MIDPOINT}),
    "gauss_4": ("implicit_change", {"method": implicit.GAUSS_4}),
    "gauss_6": ("implicit_change", {"method": implicit.GAUSS_6}),
}
"""What makes a step of given length, by the names of methods."""
METHODS: Mapping[str, Root] = {
    **EQUAL,
    "DOP853": ("explicit_step", {"method": DOP853}),
    "taylor": ("expanded", {}),
    "Rodas5P": ("rodas_step", {}),
}
"""What makes a step, by the names of all methods of the engine."""
