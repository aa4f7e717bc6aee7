"""The integrators by name."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from scipy.integrate import DOP853, RK45, OdeSolver

from eomgen.errors import RunError, nearest
from eomgen.run.integrators import (
    euler,
    gauss_4,
    gauss_6,
    implicit_midpoint,
    leapfrog,
    runge_kutta_4,
    semi_implicit_euler,
)
from eomgen.run.integrators.gragg_bulirsch_stoer import GraggBulirschStoer
from eomgen.run.integrators.implicit_stages import REMEDY, ImplicitMethod
from eomgen.run.integrators.interface import (
    Adaptive,
    Change,
    EndedRunError,
    FixedStep,
    Stability,
    StepFailure,
)
from eomgen.run.integrators.unwarned import BDF, LSODA, Radau

__all__ = [
    "INTEGRATORS",
    "Adaptive",
    "EndedRunError",
    "FixedStep",
    "StepFailure",
    "find_integrator",
]

_SHORTER = "take a smaller --dt, or an implicit or adaptive method (--integrator Radau)"
_LOOSER = "try another --integrator, or a looser --rtol and --atol"


def _any(change: Change, order: int, stability: Stability | None = None) -> FixedStep:
    """A method that serves every problem alike."""
    return FixedStep(lambda _: change, order, _SHORTER, stability=stability)


def _implicit(method: ImplicitMethod) -> FixedStep:
    return FixedStep(lambda _: method.change, method.order, REMEDY, explicit=False)


def _explicit(solver: "Callable[..., OdeSolver[Any]]", *memory: str) -> Adaptive:
    return Adaptive(solver, uses_jacobian=False, one_step=True, remedy=_LOOSER, memory=memory)


INTEGRATORS: Mapping[str, FixedStep | Adaptive] = MappingProxyType(
    {
        "euler": _any(euler.change, euler.ORDER, euler.stability),
        "semi_implicit_euler": _any(semi_implicit_euler.change, semi_implicit_euler.ORDER),
        "leapfrog": FixedStep(leapfrog.prepare, leapfrog.ORDER, _SHORTER),
        "rk4": _any(runge_kutta_4.change, runge_kutta_4.ORDER, runge_kutta_4.TABLEAU.stability),
        "implicit_midpoint": _implicit(implicit_midpoint.METHOD),
        "gauss_4": _implicit(gauss_4.METHOD),
        "gauss_6": _implicit(gauss_6.METHOD),
        "RK45": _explicit(RK45, "h_abs", "f"),
        "DOP853": _explicit(DOP853, "h_abs", "f"),
        "gragg_bulirsch_stoer": Adaptive(
            GraggBulirschStoer,
            uses_jacobian=False,
            one_step=True,
            remedy=_LOOSER,
            memory=("length", "slope", "target", "fresh"),
            sees_end=False,
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
