"""The methods of the integrators in `eomgen.integrators`, by name."""

from collections.abc import Mapping
from pkgutil import resolve_name
from types import MappingProxyType

from eomgen import integrators
from eomgen.errors import RunError, nearest
from eomgen.run.integrators.interface import Adaptive, EndedRunError, FixedStep, StepFailure

__all__ = [
    "INTEGRATORS",
    "Adaptive",
    "EndedRunError",
    "FixedStep",
    "StepFailure",
    "find_integrator",
]

INTEGRATORS: Mapping[str, FixedStep | Adaptive] = MappingProxyType(
    {
        name: resolve_name(f"{__name__}.{spec.method}")
        for name, spec in integrators.INTEGRATORS.items()
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
