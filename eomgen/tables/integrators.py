"""The integrators: one table.

The schema takes the names from it, `run.integrators` the methods, the accuracy study the kinds. To
add an integrator, add its entry here and the module of `run.integrators` that the entry names.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from eomgen.base.plugins import added

Kind = Literal["explicit", "implicit", "symplectic"]


@dataclass(frozen=True)
class IntegratorSpec:
    """One integrator.

    about   what it is
    kind    by which tables and figures group it
    method  "module:attribute" in `package`: its `FixedStep` or `Adaptive`
    rattle  whether its steps with constraints are those of RATTLE, on all coordinates
    outputs of the module that its steps call
    package where the module of its method is
    """

    about: str
    kind: Kind
    method: str
    rattle: bool = False
    outputs: tuple[str, ...] = ()
    package: str = "eomgen.run.integrators"


_OWN: Mapping[str, IntegratorSpec] = {
    "euler": IntegratorSpec("explicit Euler, order 1", "explicit", "explicit:EULER_STEPS"),
    "semi_implicit_euler": IntegratorSpec(
        "symplectic Euler, order 1", "symplectic", "explicit:SEMI_IMPLICIT_EULER"
    ),
    "leapfrog": IntegratorSpec(
        "Störmer-Verlet, order 2", "symplectic", "leapfrog:LEAPFROG", rattle=True
    ),
    "leapfrog_4": IntegratorSpec(
        "leapfrog composed to order 4, by Suzuki",
        "symplectic",
        "leapfrog:FOUR",
        rattle=True,
    ),
    "leapfrog_6": IntegratorSpec(
        "leapfrog composed to order 6, by Kahan and Li",
        "symplectic",
        "leapfrog:SIX",
        rattle=True,
    ),
    "rk4": IntegratorSpec("classical Runge-Kutta method, order 4", "explicit", "explicit:RK4"),
    "linearly_implicit": IntegratorSpec(
        "symplectic Euler, linearly implicit in stiff forces, order 1",
        "implicit",
        "linearly_implicit:INTEGRATOR",
        outputs=("implicit_step",),
    ),
    "implicit_midpoint": IntegratorSpec(
        "implicit midpoint rule, order 2", "symplectic", "implicit_stages:MIDPOINT"
    ),
    "gauss_4": IntegratorSpec("Gauss collocation, order 4", "symplectic", "implicit_stages:FOUR"),
    "gauss_6": IntegratorSpec("Gauss collocation, order 6", "symplectic", "implicit_stages:SIX"),
    "RK45": IntegratorSpec("Dormand-Prince 5(4), by SciPy", "explicit", "from_scipy:RK45"),
    "DOP853": IntegratorSpec("Dormand-Prince 8(5,3)", "explicit", "dormand_prince_8:INTEGRATOR"),
    "taylor": IntegratorSpec("Taylor series, order 8 to 24", "explicit", "taylor:INTEGRATOR"),
    "Rodas5P": IntegratorSpec("Rosenbrock method, order 5", "implicit", "rodas_5p:INTEGRATOR"),
    "Radau": IntegratorSpec("Radau IIA, order 5, by SciPy", "implicit", "from_scipy:RADAU"),
    "Radau_differences": IntegratorSpec(
        "Radau with a Jacobian by differences", "implicit", "from_scipy:RADAU_DIFFERENCES"
    ),
    "BDF": IntegratorSpec(
        "backward differentiation, orders 1 to 5, by SciPy", "implicit", "from_scipy:BDF"
    ),
    "BDF_differences": IntegratorSpec(
        "BDF with a Jacobian by differences", "implicit", "from_scipy:BDF_DIFFERENCES"
    ),
    "LSODA": IntegratorSpec(
        "Adams or backward differentiation, chosen by stiffness, by SciPy",
        "implicit",
        "from_scipy:LSODA",
    ),
}
INTEGRATORS: Mapping[str, IntegratorSpec] = {**_OWN, **added("integrators", _OWN)}
"""All integrators, those of other packages last."""
GENERAL = tuple(name for name, spec in INTEGRATORS.items() if not spec.outputs)
"""Those that step by the derivative, so that they take every module."""
