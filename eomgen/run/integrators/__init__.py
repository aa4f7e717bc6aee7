"""The methods of the integrators in `eomgen.tables.integrators`, by name."""

from collections.abc import Iterator, Mapping
from functools import cache
from pkgutil import resolve_name

from eomgen.base.errors import RunError, nearest
from eomgen.run.failure import EndedRunError, StepFailure
from eomgen.run.integrators.interface import Adaptive, FixedStep
from eomgen.tables import integrators

__all__ = [
    "INTEGRATORS",
    "Adaptive",
    "EndedRunError",
    "FixedStep",
    "StepFailure",
    "find_integrator",
]


class _Methods(Mapping[str, FixedStep | Adaptive]):
    """The methods by name. Each is imported when it is first used: some load much of SciPy."""

    def __getitem__(self, name: str) -> FixedStep | Adaptive:
        spec = integrators.INTEGRATORS[name]
        return _loaded(f"{spec.package}.{spec.method}")

    def __iter__(self) -> Iterator[str]:
        return iter(integrators.INTEGRATORS)

    def __len__(self) -> int:
        return len(integrators.INTEGRATORS)


@cache
def _loaded(place: str) -> FixedStep | Adaptive:
    """The method at "package.module:attribute"."""
    method = resolve_name(place)
    assert isinstance(method, FixedStep | Adaptive)
    return method


INTEGRATORS = _Methods()


def find_integrator(name: str) -> FixedStep | Adaptive:
    """Return the integrator called exactly `name`; raises `RunError` if there is none."""
    if name not in INTEGRATORS:
        raise RunError(
            f"integrator: unknown name '{name}'{nearest(name, INTEGRATORS)}; "
            f"known: {', '.join(INTEGRATORS)}"
        )
    return INTEGRATORS[name]
