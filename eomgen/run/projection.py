"""Projection of a state onto the constraints of a mechanism, after each step.

The step of an integrator leaves the constraints by its error. Newton's method returns the
coordinates to them, and a linear solution the velocities, both to the nearest state in the metric
of the mass matrix (Hairer and Wanner II, VII.2; Eich 1993). The order of the method is kept, and no
error of the constraints adds up.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from eomgen.run.compiled import Constrained, Margins
from eomgen.run.failure import StepFailure

FloatArray = NDArray[np.float64]

MOST = 12
"""Most steps of Newton's method after a step; two suffice where steps are accurate."""
MET = 1e-15
"""A residual relative to the mechanism's size that is rounding, beside the last one."""
SINGULAR, NEAR = 1e-9, 0.05
"""A margin that counts as 0; and one below which the least margin is searched between steps."""
IN_CLOSED_FORM = 1e-7
"""A margin that counts as 0 in closed form, which turns back on the same branch at a dead point."""
BEFORE_END = 0.3
"""A margin from which, in closed form, a step may lead to where the loops cannot be closed."""
SEARCH = 60
"""Evaluations of that search."""
REMEDY = (
    "take another start, lengths that do not line up, or --route aba at a dead point of the "
    "coordinates that were taken as independent"
)
CLOSE = 1e-9
"""The largest residual that is left where Newton's method ends, in sizes."""
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


@dataclass
class Seen:
    """The least margins of a run: `here` at the last time t, and `before` at `start`, the time
    before it; -inf if there is none.
    """

    start: float = 0.0
    t: float = 0.0
    before: float = float("-inf")
    here: float = float("inf")

    def begin(self, t: float, margin: float) -> None:
        """Begin with a state at t that ends no step."""
        self.start = self.t = t
        self.before, self.here = float("-inf"), margin

    def add(self, t: float, margin: float) -> None:
        """Take account of the end of a step."""
        self.start, self.t, self.before, self.here = self.t, t, self.here, margin

    def turns(self, t: float, now: float) -> bool:
        """Whether with a step to t the margins have passed a small minimum, and may be 0 in one of
        the last two steps.
        """
        before, here = self.before, self.here
        if not (here < before and here < now and here < NEAR):
            return False
        return not stays_away(here, (self.start, self.t, t), (before, here, now))


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
        y, nq = y.copy(), self.coordinates
        first = left = self.residuals(t, y)
        off = self._relative(left)
        for _ in range(MOST):
            if off <= MET:
                break
            there = y.copy()
            there[:nq] = self.position(t, y)
            there = unit(there)
            after = self.residuals(t, there)
            if not self._relative(after) < off:  # rounding, or no way towards the constraints
                break
            y, left, off = there, after, self._relative(after)
        if not off <= CLOSE:
            worst = int(np.argmax(np.abs(left) / self.sizes))
            raise StepFailure(
                f"constraint {self.names[worst]} cannot be met near t = {t:.6g} s",
                "take shorter steps, or a start farther from a singular position",
            )
        v = self.velocity(t, y)
        y[nq : nq + len(v)] = v
        if self.violations:
            self.violations.add(first, left)
        return y

    def scaled_jacobian(self, t: float, y: FloatArray) -> FloatArray:
        """The derivatives (nc, nv) of the rates, in sizes, by the velocities."""
        return self.jacobian(t, y) / self.sizes[:, None]

    def _relative(self, residuals: FloatArray) -> float:
        """The largest residual, in sizes."""
        return float(np.abs(residuals / self.sizes).max())


def constrained_by(projection: Projection | None) -> Constrained | None:
    """What compiled steps of a run are given of its constraints."""
    if projection is None:
        return None
    largest, seen = projection.violations, projection.seen
    assert largest and seen
    margins = (seen.start, seen.before), (seen.t, seen.here)
    given = projection.sizes, projection.quaternions
    return Constrained(*given, largest.before, largest.after, margins)


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
        np.array([size if module.UNITS[name] == "N" else 1.0 for name in names]),
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


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """The constraints of a module that keeps them in closed form: nothing is projected.

    names    of the rows
    angles   names of angles that jump by a turn at the end of their range
    margins  (t, y) -> (nc + na,), or (n,), (ny, n) -> (nc + na, n), as of `Projection`; then how
             far each angle is from there, at most 1
    seen     the margins of the run, if they are watched
    """

    names: tuple[str, ...]
    angles: tuple[str, ...]
    margins: Callable[[Any, FloatArray], FloatArray]
    seen: Seen | None = None

    def passed(
        self, t: float, y: FloatArray, ends: FloatArray, states: FloatArray
    ) -> FloatArray | None:
        """The least margins (m + 1,) at t and at the ends (m,) of m steps from there, whose states
        are (m, ny); None if one of these steps may pass a singular position.
        """
        times = np.concatenate(([t], ends))
        found = self.margins(times, np.vstack((y, states)).T).min(axis=0)
        if found.min() >= NEAR:
            return np.asarray(found)
        assert self.seen
        seen = replace(self.seen)
        for end, margin in zip(ends.tolist(), found[1:].tolist(), strict=True):
            if not margin >= IN_CLOSED_FORM or seen.turns(end, margin):
                return None
            seen.add(end, margin)
        return np.asarray(found)


def closed_form_of(module: Any, parameters: Any, inputs: Any) -> ClosedForm | None:
    """The constraints of a module that keeps them in closed form; None if it does not."""
    if not getattr(module, "FOLLOWING", None):
        return None
    return ClosedForm(
        tuple(module.CONSTRAINTS),
        tuple(getattr(module, "RANGED", ())),
        lambda t, y: module.constraint_margins(t, y, parameters, inputs),
    )


class SingularPositionError(StepFailure):
    """The mechanism is singular at a time."""

    def __init__(self, projection: Projection | ClosedForm, t: float, margins: FloatArray) -> None:
        least = int(np.argmin(margins))
        if least >= len(projection.names):
            angle = projection.angles[least - len(projection.names)]  # type: ignore[union-attr]
            super().__init__(
                f"at t = {t:.6g} s {angle}, which follows from the state in closed form, leaves "
                "the turn in which it is counted",
                "give loops = 'projected' in the scene, or these parameters",
            )
            return
        name = projection.names[least]
        super().__init__(
            f"the mechanism is singular at t = {t:.6g} s: constraint {name} follows from the "
            "others there, as at a dead point or a change point, or has no direction, as where a "
            "disc lies flat",
            REMEDY,
        )

    def __reduce__(self) -> tuple[type, tuple[str, ...]]:
        return StepFailure, (self.reason, self.remedy)


class Part(Protocol):
    """A step, as far as it is watched."""

    @property
    def t(self) -> float:
        """Its end."""

    @property
    def y(self) -> FloatArray:
        """The state there."""

    @property
    def within(self) -> Callable[[float], FloatArray]:
        """The state at a time within it."""

    @property
    def margins(self) -> Margins | None:
        """Of several steps that have been watched, those of the last one."""


Steps = TypeVar("Steps", bound=Part)


def watched(
    projection: Projection | ClosedForm, advances: Iterator[Steps], t: float, y: FloatArray
) -> Iterator[Steps]:
    """The steps of a run from (t, y), which ends where the mechanism is singular.

    The margins are evaluated after each step. Where their least has a small minimum it is searched
    within the steps around it, so that no singular position is passed over. Raises `StepFailure`
    there.
    """
    seen = projection.seen or Seen()
    seen.begin(t, _least(projection, t, y))
    last: Steps | None = None
    try:
        for advance in advances:
            if isinstance(projection, ClosedForm) and not np.isfinite(advance.y).all():
                raise StepFailure("the loops cannot be closed", REMEDY)
            if advance.margins:
                seen.begin(advance.margins.start, advance.margins.before)
                seen.add(advance.t, advance.margins.here)
                last = advance
                yield advance
                continue
            here = _checked(projection, advance.t, advance.y)
            if advance.t > seen.t:
                if last is not None and seen.turns(advance.t, here):
                    _search(projection, seen.start, last, advance)
                seen.add(advance.t, here)
                last = advance
            else:  # a strike
                seen.begin(advance.t, here)
                last = None
            yield advance
    except SingularPositionError:
        raise
    except StepFailure as failure:
        if seen.here < (BEFORE_END if isinstance(projection, ClosedForm) else NEAR):
            reason = f"the mechanism is nearly singular there, and the step fails: {failure.reason}"
            raise StepFailure(reason, REMEDY) from None
        raise


def _search(projection: Projection | ClosedForm, start: float, last: Part, advance: Part) -> None:
    """Look for a singular position in two steps, of which the first begins at `start`, by golden
    section. It ends where none can be.
    """

    def margin(t: float) -> float:
        return _least(projection, t, (last if t < last.t else advance).within(t))

    a, b = start, advance.t
    at_a, at_b = margin(a), margin(b)
    ratio = (5**0.5 - 1) / 2
    c, d = b - ratio * (b - a), a + ratio * (b - a)
    at_c, at_d = margin(c), margin(d)
    for _ in range(SEARCH):
        least, times = min(at_c, at_d), (a, c, d, b)
        if least < _limit(projection) or stays_away(least, times, (at_a, at_c, at_d, at_b)):
            break
        if at_c < at_d:
            b, at_b, d, at_d = d, at_d, c, at_c
            c = b - ratio * (b - a)
            at_c = margin(c)
        else:
            a, at_a, c, at_c = c, at_c, d, at_d
            d = a + ratio * (b - a)
            at_d = margin(d)
    best = c if at_c < at_d else d
    _checked(projection, best, (last if best < last.t else advance).within(best))


def stays_away(least: float, times: Sequence[float], margins: Sequence[float]) -> bool:
    """Whether a margin with these values at ascending times, the least of them `least`, cannot come
    to 0 between them: it would have to change more than twice as fast as it does from one to the
    next. Where it comes to 0, it does so with a slope, on both sides.
    """
    steepest = 0.0
    for i in range(1, len(times)):
        if not times[i - 1] < times[i]:
            return False
        steepest = max(steepest, abs(margins[i] - margins[i - 1]) / (times[i] - times[i - 1]))
    return least > 2 * steepest * (times[-1] - times[0])


def _checked(projection: Projection | ClosedForm, t: float, y: FloatArray) -> float:
    """The least margin. Raises `SingularPositionError` if it counts as 0."""
    margins = projection.margins(t, y)
    least = float(margins.min())
    if least < _limit(projection):
        raise SingularPositionError(projection, t, margins)
    return least


def _least(projection: Projection | ClosedForm, t: float, y: FloatArray) -> float:
    return float(projection.margins(t, y).min())


def _limit(projection: Projection | ClosedForm) -> float:
    return IN_CLOSED_FORM if isinstance(projection, ClosedForm) else SINGULAR
