"""The integrators by name."""

from collections.abc import Mapping
from types import MappingProxyType

from scipy.integrate import BDF, DOP853, LSODA, RK45, Radau

from eomgen.errors import RunError, nearest
from eomgen.run.integrators import (
    euler,
    gauss_4,
    gauss_6,
    implicit_midpoint,
    runge_kutta_4,
    semi_implicit_euler,
)
from eomgen.run.integrators.gragg_bulirsch_stoer import GraggBulirschStoer
from eomgen.run.integrators.implicit_stages import REMEDY, ImplicitMethod
from eomgen.run.integrators.interface import Adaptive, FixedStep, StepFailure

__all__ = ["INTEGRATORS", "Adaptive", "FixedStep", "StepFailure", "find_integrator"]

_SHORTER = "take a smaller --dt, or an implicit or adaptive method (--integrator Radau)"
_LOOSER = "try another --integrator, or a looser --rtol and --atol"


def _implicit(method: ImplicitMethod) -> FixedStep:
    return FixedStep(method.change, method.order, REMEDY)


INTEGRATORS: Mapping[str, FixedStep | Adaptive] = MappingProxyType(
    {
        "euler": FixedStep(euler.change, euler.ORDER, _SHORTER),
        "semi_implicit_euler": FixedStep(
            semi_implicit_euler.change, semi_implicit_euler.ORDER, _SHORTER
        ),
        "rk4": FixedStep(runge_kutta_4.change, runge_kutta_4.ORDER, _SHORTER),
        "implicit_midpoint": _implicit(implicit_midpoint.METHOD),
        "gauss_4": _implicit(gauss_4.METHOD),
        "gauss_6": _implicit(gauss_6.METHOD),
        "RK45": Adaptive(RK45, uses_jacobian=False, one_step=True, remedy=_LOOSER),
        "DOP853": Adaptive(DOP853, uses_jacobian=False, one_step=True, remedy=_LOOSER),
        "gragg_bulirsch_stoer": Adaptive(
            GraggBulirschStoer, uses_jacobian=False, one_step=True, remedy=_LOOSER
        ),
        "Radau": Adaptive(Radau, uses_jacobian=True, one_step=True, remedy=_LOOSER),
        "Radau_differences": Adaptive(Radau, uses_jacobian=False, one_step=True, remedy=_LOOSER),
        "BDF": Adaptive(BDF, uses_jacobian=True, one_step=False, remedy=_LOOSER),
        "BDF_differences": Adaptive(BDF, uses_jacobian=False, one_step=False, remedy=_LOOSER),
        "LSODA": Adaptive(LSODA, uses_jacobian=True, one_step=False, remedy=_LOOSER),
    }
)


def find_integrator(name: str) -> FixedStep | Adaptive:
    """Return the integrator called exactly `name`; raises `RunError` if there is none."""
    if name not in INTEGRATORS:
        raise RunError(
            f"integrator: unknown name '{name}'{nearest(name, INTEGRATORS)}; "
            f"known: {', '.join(INTEGRATORS)}"
        )
    return INTEGRATORS[name]
