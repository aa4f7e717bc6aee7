"""The constraints of a mechanism, and projection of a state onto them: see
`eomgen.engine.projection`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from eomgen.engine.projection import PROJECTED, Residuals, moved_onto
from eomgen.run.compiled import Constrained
from eomgen.run.failure import StepFailure
from eomgen.run.margins import Seen
from eomgen.run.sizes import row_sizes

FloatArray = NDArray[np.float64]

PROJECTS = ("constraint_residuals", "project_position", "project_velocity", "constraint_margins")
"""The functions of a module that a step onto the constraints needs."""


class Violations:
    """The largest residual of each of `nc` rows over a run, m or rad, as they are added.

    before  of the states that were projected: ends of steps, and rows within them
    after   of these after projection
    """

    def __init__(self, count: int) -> None:
        self.before, self.after = np.zeros((2, count))

    def add(self, before: FloatArray, after: FloatArray) -> None:
        """Take account of a projection."""
        np.maximum(self.before, np.abs(before), out=self.before)
        np.maximum(self.after, np.abs(after), out=self.after)


Value = Callable[[float, FloatArray], FloatArray]
"""A function of time and state."""


def without(t: float, y: FloatArray) -> FloatArray:
    """A `Value` that a module lacks."""
    raise AssertionError("the module lacks this function")


@dataclass(frozen=True, eq=False)
class Projection:
    """The constraints of a module.

    names       of its rows
    sizes       size of each residual
    residuals   (t, y) -> (nc,), m or rad
    rates       (t, y) -> (nc,), their rates
    jacobian    (t, y) -> (nc, nv), the derivatives of the rates by the velocities
    position    (t, y) -> (nq,), the coordinates after a step of Newton's method
    velocity    (t, y) -> (nv,), the velocities that meet the constraints
    margins     (t, y) -> (nc,), how far each row is from following from others, at most 1; 0 in a
                singular position
    quaternions indices of the components of each unit quaternion among the coordinates
    violations  to which each projection is added, if given
    seen        the margins of the run, if they are watched
    inertia, kinetic_slopes
                (t, y) -> the mass matrix (nv, nv), and the derivatives (nq,) of the kinetic energy
                by the coordinates; `without` if the module has none
    """

    names: tuple[str, ...]
    sizes: FloatArray
    residuals: Value
    rates: Value
    jacobian: Value
    position: Value
    velocity: Value
    margins: Value
    coordinates: int
    quaternions: Sequence[tuple[int, int, int, int]] = ()
    violations: Violations | None = None
    seen: Seen | None = None
    inertia: Value = without
    kinetic_slopes: Value = without

    def onto(self, t: float, y: FloatArray, unit: Callable[[FloatArray], FloatArray]) -> FloatArray:
        """The state on the constraints; `unit` normalises quaternions.

        Raises `StepFailure` if the constraints cannot be met near the state.
        """
        y, (first, left, after) = y.copy(), np.empty((3, len(self.names)))
        off = Residuals(len(self.names), self.sizes, first, left, after, np.empty_like(y))
        if moved_onto(_Held(self, unit), t, y, off) != PROJECTED:
            worst = int(np.argmax(np.abs(off.left) / self.sizes))
            raise StepFailure(
                f"constraint {self.names[worst]} cannot be met near t = {t:.6g} s",
                "take shorter steps, or a start farther from a singular position",
            )
        if self.violations:
            self.violations.add(off.first, off.left)
        return y

    def scaled_jacobian(self, t: float, y: FloatArray) -> FloatArray:
        """The derivatives (nc, nv) of the rates, in sizes, by the velocities."""
        return self.jacobian(t, y) / self.sizes[:, None]


@dataclass(frozen=True, eq=False)
class _Held:
    """The constraints as the engine is given them."""

    of: Projection
    unit: Callable[[FloatArray], FloatArray]

    def residuals_at(self, t: float, y: FloatArray, out: FloatArray) -> bool:
        out[:] = self.of.residuals(t, y)
        return True

    def move_closer(self, t: float, y: FloatArray, there: FloatArray) -> bool:
        there[: self.of.coordinates] = self.of.position(t, y)
        there[:] = self.unit(there)
        return True

    def hold_velocities(self, t: float, y: FloatArray) -> bool:
        v, nq = self.of.velocity(t, y), self.of.coordinates
        y[nq : nq + len(v)] = v
        return True


@dataclass(frozen=True, eq=False)
class Linkage:
    """Constraints as steps that solve for them are given them; `rates` are those of the states."""

    of: Projection
    rates: Value

    def off_by(self, t: float, y: FloatArray, out: FloatArray) -> bool:
        """The residuals, in sizes."""
        out[:] = self.of.residuals(t, y) / self.of.sizes
        return True

    def drift_at(self, t: float, y: FloatArray, out: FloatArray) -> bool:
        """Their rates."""
        out[:] = self.of.rates(t, y) / self.of.sizes
        return True

    def rows_at(self, t: float, y: FloatArray, out: FloatArray) -> bool:
        """The derivatives of their rates by the velocities."""
        out[:] = self.of.scaled_jacobian(t, y)
        return True

    def rates_at(self, t: float, y: FloatArray, out: FloatArray) -> bool:
        """The rates of the states."""
        out[:] = self.rates(t, y)
        return True

    def inertia_at(self, t: float, y: FloatArray, out: FloatArray) -> bool:
        """The mass matrix."""
        out[:] = self.of.inertia(t, y)
        return True

    def slopes_at(self, t: float, y: FloatArray, out: FloatArray) -> bool:
        """The derivatives of the kinetic energy by the coordinates."""
        out[:] = self.of.kinetic_slopes(t, y)
        return True


def constrained_by(projection: Projection | None) -> Constrained | None:
    """What compiled steps of a run are given of its constraints."""
    if projection is None:
        return None
    largest, seen = projection.violations, projection.seen
    assert largest and seen
    margins = (seen.start, seen.before), (seen.t, seen.here)
    return Constrained(projection.sizes, largest.before, largest.after, margins)


def jacobian_of(module: Any) -> Callable[..., FloatArray]:
    """The derivatives (nc, nv) of a module's constraint rates by the velocities, as a function of
    time, state, parameters and inputs.
    """
    if hasattr(module, "constraint_jacobian"):
        return cast(Callable[..., FloatArray], module.constraint_jacobian)

    def by_columns(t: float, y: FloatArray, p: Any = None, u: Any = None) -> FloatArray:
        nq, nc = len(module.POSITIONS), len(module.CONSTRAINTS)
        nv = len(module.project_velocity(t, y, p, u))
        columns = np.repeat(y[:, np.newaxis], nv + 1, axis=1)
        columns[nq : nq + nv] = np.eye(nv, nv + 1)
        rates = module.constraint_rates(t, columns, p, u).reshape(nc, nv + 1)
        return np.asarray(rates[:, :nv] - rates[:, nv:])

    return by_columns


def projection_of(module: Any, parameters: Any, inputs: Any, size: float) -> Projection | None:
    """The projection of a module of this size, m; None if it has no constraints."""
    names = getattr(module, "CONSTRAINTS", None)
    if not names or not hasattr(module, "project_position"):
        return None

    jacobian = jacobian_of(module)

    def of(name: str) -> Value:
        function = getattr(module, name, None)
        return (lambda t, y: function(t, y, parameters, inputs)) if function else without

    return Projection(
        tuple(names),
        np.array(row_sizes(module.UNITS, "constraint", names, "N", size)),
        residuals=of("constraint_residuals"),
        rates=of("constraint_rates"),
        jacobian=lambda t, y: jacobian(t, y, parameters, inputs),
        position=of("project_position"),
        velocity=of("project_velocity"),
        margins=of("constraint_margins"),
        coordinates=len(module.POSITIONS),
        quaternions=module.QUATERNIONS,
        inertia=of("mass_matrix"),
        kinetic_slopes=of("kinetic_slopes"),
    )
